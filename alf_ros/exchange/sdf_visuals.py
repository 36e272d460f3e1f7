"""The `<visual>` and `<collision>` elements of an SDF."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from alf_ros.exchange.decimal_numbers import decimal
from alf_ros.exchange.robot import GROUND, Collider, FixedPlane, FramePose, Robot
from alf_ros.exchange.sdf_frames import pose_of
from alf_ros.exchange.sdf_resources import mesh_uri
from alf_ros.exchange.sdf_values import Refuse, says
from alf_ros.exchange.visuals import ROUND, mesh_file, moved, numbers, shape, show
from alf_ros.mechanism import VisualShape

COLLISION = 'collision'
_EVERY = ('65535', '0xffff', '0xFFFF')  # the mask of what meets all others, the default
READ = ('visual', COLLISION)


def add(
    robot: Robot, visual: ElementTree.Element, folder: Path, part: str, frame: FramePose
) -> None:
    """Give a part the shape of a visual or of a collision, which is relative to `frame`."""
    name = f'{part} {visual.get("name", "")}'.strip()
    if visual.tag == COLLISION:
        _collide(robot, visual, folder, part, name, frame)
        return
    try:
        found = _shape(visual, folder)
        pose = pose_of(visual.find('pose'), lambda *_, **__: ValueError(name), name)
        show(robot, part, found, frame @ pose)
    except ValueError:
        robot.leave('shapes', name)


def _collide(
    robot: Robot,
    element: ElementTree.Element,
    folder: Path,
    part: str,
    name: str,
    frame: FramePose,
) -> None:
    """A plane is one of the ground; what no shape here has is still there."""
    friction, across, found = None, None, None
    contact = element.find('surface/contact')
    if part != GROUND and contact is not None and _is_filtered(contact, robot.error, name):
        robot.leave('filters of contact', name)
    try:
        friction, across = coefficients(
            *(element.findtext(f'surface/friction/ode/{key}') for key in ('mu', 'mu2'))
        )
        pose = frame @ pose_of(element.find('pose'), lambda *_, **__: ValueError(name), name)
        plane = element.find('geometry/plane')
        if plane is not None and part == GROUND:
            normal = pose.turn @ numbers(plane.findtext('normal'), 3, (0.0, 0.0, 1.0))
            size = float(np.linalg.norm(normal))
            if size > 0.0:
                if across is not None:
                    robot.leave('friction in two directions', name)
                least = min(mu for mu in (friction, across) if mu is not None)
                robot.planes.append((FixedPlane(pose.origin, normal / size), least))
            return
        found = moved(_shape(element, folder), pose)
    except ValueError:
        pass
    robot.colliders.append(Collider(name.replace(' ', '_'), part, found, friction, across))


def _is_filtered(contact: ElementTree.Element, refuse: Refuse, name: str) -> bool:
    """Whether something of a collision passes through it. Raises the error."""
    mask = (contact.findtext('collide_bitmask') or '').strip()
    without = says(contact, 'collide_without_contact', refuse, name)
    return without or mask not in ('', *_EVERY)


def coefficients(mu: str | None, mu2: str | None) -> tuple[float, float | None]:
    """Of friction along a direction and across it, 1 where one is absent: None for the second if
    both are alike. Raises ValueError."""
    along, across = (numbers(text, 1, [1.0])[0] for text in (mu, mu2))
    return along, None if across == along else across


def _shape(visual: ElementTree.Element, folder: Path) -> VisualShape:
    """Raises ValueError."""
    color = visual.findtext('material/diffuse') or visual.findtext('material/ambient')
    rgba = None if color is None else [*map(decimal, color.split()), 1.0][:4]
    for each in visual.iterfind('geometry/*'):
        if each.tag == 'mesh':
            if each.find('submesh') is not None:
                raise ValueError('a part of a mesh')
            file = mesh_file(mesh_uri((each.findtext('uri') or '').strip(), folder), folder)
            return shape('mesh', numbers(each.findtext('scale'), 3, (1.0, 1.0, 1.0)), rgba, file)
        if each.tag == 'box':
            return shape('box', numbers(each.findtext('size'), 3), rgba)
        if each.tag in ROUND:
            size = [numbers(each.findtext(key), 1)[0] for key in ROUND[each.tag]]
            return shape(each.tag, size, rgba)
    raise ValueError('no geometry')
