"""The `<visual>` elements of a URDF, read and written, and its `<collision>` elements.

URDF has no capsule: one is written as a cylinder and two spheres. Some files have `<capsule>`; it
is read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.exchange import sdf_surfaces, urdf_gazebo, xml_file
from alf_ros.exchange.robot import GROUND, Collider, FramePose, Robot
from alf_ros.exchange.visuals import ROUND, mesh_file, moved, numbers, shape, show
from alf_ros.mechanism import VisualShape

_NONE = (0.0, 0.0, 0.0)
Colors = dict[str, list[float]]


def add(
    robot: Robot,
    xml: ElementTree.Element,
    folder: Path,
    poses: Mapping[str, FramePose],
    part_of: Mapping[str, str],
) -> None:
    """Give the parts of a robot the shapes of their links; `folder` holds the file."""
    colors: Colors = {}
    for material in xml.findall('material'):
        _color(material, colors)
    frictions = urdf_gazebo.frictions(xml)
    for link in xml.findall('link'):
        name = link.get('name', '')
        for n, visual in enumerate(link.findall('visual')):
            try:
                found = _shape(visual, colors, folder)
                show(robot, part_of[name], found, poses[name])
            except (KeyError, ValueError):
                robot.leave('shapes', f'visual {n} of {name}')
        for n, collision in enumerate(link.findall('collision') if name in part_of else ()):
            collider = _collider(collision, folder, name, n, part_of, poses)
            robot.colliders.append(_with_friction(robot, collider, name, frictions.get(name)))
    _leave_obstacles(robot, xml, part_of)


def _leave_obstacles(robot: Robot, xml: ElementTree.Element, part_of: Mapping[str, str]) -> None:
    """Note the shapes of fixed links, which stop nothing that moves, except those that carry
    something moving, such as the base of a robot."""
    if all(each.part == GROUND for each in robot.colliders):
        return
    above = {
        child.get('link', ''): parent.get('link', '')
        for joint in xml.findall('joint')
        if (child := joint.find('child')) is not None
        and (parent := joint.find('parent')) is not None
    }
    bases: set[str] = set()
    for name, part in part_of.items():
        base = above.get(name) if part != GROUND else None
        while base is not None and base not in bases:
            bases.add(base)
            base = above.get(base)
    for link in xml.findall('link'):
        name = link.get('name', '')
        if part_of.get(name) != GROUND or name in bases:
            continue
        for collision in link.findall('collision'):
            kinds = [each.tag for each in collision.iterfind('geometry/*')]
            robot.leave('contact with fixed shapes', ' '.join([*kinds[:1], name]))


def _collider(
    element: ElementTree.Element,
    folder: Path,
    link: str,
    n: int,
    part_of: Mapping[str, str],
    poses: Mapping[str, FramePose],
) -> Collider:
    name = element.get('name', '') or (link if n == 0 else f'{link}_{n}')
    try:
        return Collider(name, part_of[link], moved(_shape(element, {}, folder), poses[link]))
    except ValueError:
        return Collider(name, part_of[link], None, element=_unusable(element))


def _unusable(element: ElementTree.Element) -> str:
    """The part of a collision that cannot be used."""
    origin, geometry = element.find('origin'), element.find('geometry/*')
    try:
        _frame(origin)
    except ValueError:
        return xml_file.told(element if origin is None else origin)
    return xml_file.told(element if geometry is None else geometry)


def _with_friction(
    robot: Robot, collider: Collider, link: str, given: Mapping[str, ElementTree.Element] | None
) -> Collider:
    """With the coefficients that the extension of Gazebo gives the link. Raises InputError."""
    if given is None:
        return collider
    both = given.get('mu1'), given.get('mu2')
    along, across = sdf_surfaces.coefficients(*both, robot.error, link)
    noted = tuple(f'{tag} of {link}' for tag in given)
    return replace(collider, friction=along, across=across, noted=noted)


def _color(material: ElementTree.Element | None, colors: Colors) -> list[float] | None:
    """The colour of a material, by its name if it says none itself."""
    if material is None:
        return None
    name, color = material.get('name', ''), material.find('color')
    if color is not None:
        try:
            colors[name] = numbers(color.get('rgba'), 4)
        except ValueError:
            return None
    return colors.get(name)


def _shape(visual: ElementTree.Element, colors: Colors, folder: Path) -> VisualShape:
    """Raises ValueError."""
    color = _color(visual.find('material'), colors)
    frame = _frame(visual.find('origin'))
    for each in visual.iterfind('geometry/*'):
        if each.tag == 'mesh':
            file = mesh_file(each.get('filename', ''), folder)
            scale = numbers(each.get('scale'), 3, (1.0, 1.0, 1.0))
            return moved(shape('mesh', scale, color, file), frame)
        if each.tag == 'box':
            return moved(shape('box', numbers(each.get('size'), 3), color), frame)
        if each.tag in ROUND:
            size = [numbers(each.get(key), 1)[0] for key in ROUND[each.tag]]
            return moved(shape(each.tag, size, color), frame)
    raise ValueError('no geometry')


def _frame(origin: ElementTree.Element | None) -> FramePose:
    """Raises ValueError."""
    at = {} if origin is None else origin.attrib
    turn = Rotation.from_euler('xyz', numbers(at.get('rpy'), 3, _NONE)).as_matrix()
    return FramePose(np.array(numbers(at.get('xyz'), 3, _NONE)), turn)


def _text(values: Iterable[float]) -> str:
    return ' '.join(repr(float(value) + 0.0) for value in values)


def elements(shapes: Iterable[VisualShape]) -> Iterator[ElementTree.Element]:
    """The elements of shapes, in the frame of their link."""
    for each in (part for whole in shapes for part in whole.without_capsule):
        visual = ElementTree.Element('visual')
        ElementTree.SubElement(visual, 'origin', xyz=_text(each.at), rpy=_text(each.rpy))
        geometry = ElementTree.SubElement(visual, 'geometry')
        if each.kind == 'mesh':
            mesh = ElementTree.SubElement(geometry, 'mesh', filename=each.uri)
            if each.size != (1.0, 1.0, 1.0):
                mesh.set('scale', _text(each.size))
        elif each.kind == 'box':
            ElementTree.SubElement(geometry, 'box', size=_text(each.size))
        else:
            keys = zip(ROUND[each.kind], each.size, strict=True)
            ElementTree.SubElement(geometry, each.kind, {key: repr(x) for key, x in keys})
        if each.color is not None:
            rgba = _text(each.color)  # one name for one colour: viewers share materials by name
            material = ElementTree.SubElement(visual, 'material', name=f'rgba {rgba}')
            ElementTree.SubElement(material, 'color', rgba=rgba)
        yield visual
