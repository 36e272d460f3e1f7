"""The `<visual>` and `<collision>` elements of an SDF."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from alf_ros.exchange import sdf_surfaces
from alf_ros.exchange.decimal_numbers import decimal
from alf_ros.exchange.robot import GROUND, Collider, FixedPlane, FramePose, Robot
from alf_ros.exchange.sdf_frames import pose_of
from alf_ros.exchange.sdf_resources import mesh_uri
from alf_ros.exchange.visuals import ROUND, mesh_file, moved, numbers, shape, show
from alf_ros.mechanism import VisualShape

COLLISION = 'collision'
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
    surface, found = sdf_surfaces.read(element, robot.error, name), None
    try:
        pose = frame @ pose_of(element.find('pose'), lambda *_, **__: ValueError(name), name)
        plane = element.find('geometry/plane')
        if plane is not None and part == GROUND:
            normal = pose.turn @ numbers(plane.findtext('normal'), 3, (0.0, 0.0, 1.0))
            size = float(np.linalg.norm(normal))
            if size > 0.0:
                for kind in surface.left_out:
                    robot.leave(kind, name)
                if surface.across is not None:
                    robot.leave('friction in two directions', name)
                least = min(mu for mu in (surface.friction, surface.across) if mu is not None)
                robot.planes.append((FixedPlane(pose.origin, normal / size), least))
            return
        found = moved(_shape(element, folder), pose)
    except ValueError:
        pass
    given = surface.friction, surface.across, surface.left_out
    robot.colliders.append(Collider(name.replace(' ', '_'), part, found, *given))


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
