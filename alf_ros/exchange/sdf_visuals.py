"""The `<visual>` and `<collision>` elements of an SDF."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from alf_ros.exchange import sdf_surfaces, sdf_values, xml_file
from alf_ros.exchange.robot import GROUND, Collider, FixedPlane, FramePose, Robot
from alf_ros.exchange.sdf_frames import pose_of
from alf_ros.exchange.sdf_resources import mesh_uri
from alf_ros.exchange.sdf_surfaces import CollisionSurface
from alf_ros.exchange.visuals import ROUND, mesh_file, moved, numbers, shape, show
from alf_ros.mechanism import VisualShape
from alf_ros.scene.text.decimal_numbers import decimal

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
    surface = sdf_surfaces.read(element, robot.error, name)
    plane = element.find('geometry/plane')
    if plane is not None and part == GROUND:
        pose = frame @ pose_of(element.find('pose'), robot.error, name)
        _ground(robot, plane, surface, name, pose)
        return
    found, told, unusable = None, element.find('pose'), partial(_error, name)
    try:
        pose = frame @ pose_of(told, unusable, name)
        told = element.find('geometry/*')
        found = moved(_shape(element, folder), pose)
    except ValueError:
        pass
    text = '' if found is not None else xml_file.told(element if told is None else told)
    given = surface.friction, surface.across, surface.left_out, text
    robot.colliders.append(Collider(name.replace(' ', '_'), part, found, *given))


def _error(name: str, *_: Any, **__: Any) -> ValueError:
    return ValueError(name)


def _ground(
    robot: Robot, plane: ElementTree.Element, surface: CollisionSurface, name: str, pose: FramePose
) -> None:
    """Raises InputError for a plane without a direction."""
    given = plane.find('normal')
    up = np.array([0.0, 0.0, 1.0])
    if given is not None and (text := (given.text or '').strip()):
        up = sdf_values.numbers(text, 3, robot.error, name, given)
    normal = pose.turn @ up
    size = float(np.linalg.norm(normal))
    if not size > 0.0:
        raise robot.error(name, 'the normal of a plane has no direction', given)
    for kind in surface.left_out:
        robot.leave(kind, name)
    if surface.across is not None:
        robot.leave('friction in two directions', name)
    least = min(mu for mu in (surface.friction, surface.across) if mu is not None)
    robot.planes.append((FixedPlane(pose.origin, normal / size), least))


def _shape(visual: ElementTree.Element, folder: Path) -> VisualShape:
    """Raises ValueError."""
    color = visual.findtext('material/diffuse') or visual.findtext('material/ambient')
    rgba = None if color is None else [*map(decimal, color.split()), 1.0][:4]
    if rgba is not None and len(rgba) < 4:
        raise ValueError(color)
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
