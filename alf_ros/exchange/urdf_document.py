"""A URDF as its file has it: the XML, and its reading by urdf_parser_py.

Joints of types that URDF does not have are joints that it has then (`urdf_joint_types`).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from alf_ros.errors import InputError
from alf_ros.exchange import urdf_gazebo_links, urdf_joint_types, urdf_numbers, xml_file
from alf_ros.exchange.urdf_joint_types import RowPart, Thread
from alf_ros.scene.text.decimal_numbers import decimal

WORLD = 'world'  # the root link of this name is the ground
_DAMPED = (urdf_joint_types.PLANAR, 'UJOINT_XY')  # joints of Drake with their damping
_NONE_HERE = 'limits, damping, friction, springs, armature'  # in the report
_WITHOUT_AXIS = ('fixed', 'floating')  # types of which no reader reads the <axis>


@dataclass(frozen=True)
class UrdfDocument:
    """xml; robot: of urdf_parser_py; kinds: the types of joints that URDF does not have, by name;
    rows: what stands for them, by name; threads: of screws, by name; damping (N m s/rad): of
    balls, by name; absent: kind and name of what it leaves out."""

    xml: ElementTree.Element
    robot: Any
    kinds: Mapping[str, str]
    rows: Mapping[str, tuple[RowPart, ...]]
    threads: Mapping[str, Thread]
    damping: Mapping[str, float]
    absent: tuple[tuple[str, str], ...]


def read(
    path: Path, arguments: Mapping[str, str] | None, types: Mapping[str, str]
) -> UrdfDocument:
    """Read a URDF or xacro; `types`: of joints, by a file beside it. Raises InputError."""
    from urdf_parser_py import urdf
    from urdf_parser_py.xml_reflection import core

    xml = xml_file.root_of(path, arguments)
    if xml.tag != 'robot':
        raise InputError('not a URDF', file=str(path), value=xml.tag, expected='<robot>')
    added = urdf_gazebo_links.added(xml, partial(xml_file.refusal, str(path)))
    absent = [('mass: default of SDF', name) for name in added]
    urdf_joint_types.rename(xml)
    kinds = urdf_joint_types.stated(xml)
    for joint in xml.findall('joint'):
        name = joint.get('name', '')
        kind = kinds.get(name)
        if types.get(name, 'FIXED') != 'FIXED' and _rubs(joint, ('friction', 'damping')):
            absent.append((_NONE_HERE, name))
        if kind is not None:
            urdf_numbers.checked(joint, path)  # with the line
        if kind is not None and _loses(joint, kind):
            absent.append((_NONE_HERE, name))
        if kind == urdf_joint_types.SCREW and _is_limited(joint):
            absent.append(('limits of screws', name))
    balls = [each for each in xml.findall('joint') if each.get('type') == 'ball']
    damping = {each.get('name', ''): _damping(each) for each in balls}
    kinds |= types
    threads = urdf_joint_types.threads(xml, kinds, str(path))
    rows = urdf_joint_types.rows(xml, kinds)
    absent += [('names, changed', each) for each in urdf_joint_types.renamed(rows)]
    xml = urdf_joint_types.changed(xml, kinds, rows, threads, str(path)) if kinds else xml
    if _lacks_world(xml):
        ElementTree.SubElement(xml, 'link', {'name': WORLD})
        absent.append(('link of the world: there is none', WORLD))
    plain = ElementTree.Element('robot', {'name': path.stem} | xml.attrib)
    for element in xml:  # what else there is may be as it likes
        if element.tag in ('link', 'joint'):
            dropped = ['visual', 'collision']
            dropped += ['axis'] if element.get('type') in _WITHOUT_AXIS else []
            kept = [each for each in element if each.tag not in dropped]
            ElementTree.SubElement(plain, element.tag, element.attrib).extend(kept)
    for part in plain:
        absent += urdf_numbers.completed(part)
        urdf_numbers.checked(part, path)
    told, core.on_error = core.on_error, lambda message: None  # unknown elements are listed here
    try:
        robot = urdf.URDF.from_xml_string(ElementTree.tostring(plain))
    except core.ParseError as error:
        where, _, what = re.sub('^ParseError in ', '', str(error)).partition(':')
        place = xml_file.place_of(_found(xml, where), str(path))
        raise InputError(f'{what.strip()} in {where}', **place) from None
    except (TypeError, ValueError, KeyError, AttributeError, AssertionError) as error:  # unchecked
        raise InputError(f'urdf_parser_py cannot read it: {error}', file=str(path)) from None
    finally:
        core.on_error = told
    if not robot.links:
        raise InputError('a robot without links', file=str(path))
    return UrdfDocument(xml, robot, kinds, rows, threads, damping, tuple(absent))


def _loses(joint: ElementTree.Element, kind: str) -> bool:
    """Whether a row that stands for a joint lacks something that acts on the joint."""
    if kind == urdf_joint_types.SCREW:
        return False
    damped = kind in _DAMPED or joint.get('type') == 'ball'
    acting = ('friction',) if damped else ('friction', 'damping')
    return _rubs(joint, acting) or joint.find('limit') is not None


def _damping(ball: ElementTree.Element) -> float:
    """N m s/rad, of the rotation of a ball of Drake, as Drake has it."""
    words = urdf_joint_types.dampings(ball)
    return decimal(words[0]) if words else 0.0


def _rubs(joint: ElementTree.Element, acting: Collection[str]) -> bool:
    """Whether a joint has such a loss."""
    given = (each.get(name) for each in joint.findall('dynamics') for name in acting)
    return any(decimal(text) for text in given if text is not None)


def _is_limited(joint: ElementTree.Element) -> bool:
    limits = joint.findall('limit')
    return any({'lower', 'upper'}.intersection(each.keys()) for each in limits)


def _lacks_world(xml: ElementTree.Element) -> bool:
    """Whether a joint hangs from a link `world` that the file does not have, as Drake has it."""
    parents = (parent for joint in xml.findall('joint') for parent in joint.findall('parent'))
    named = any(each.get('link') == WORLD for each in parents)
    return named and all(each.get('name') != WORLD for each in xml.findall('link'))


def _found(xml: ElementTree.Element, where: str) -> ElementTree.Element | None:
    """The element at a path of urdf_parser_py, `/robot[@name='r']/link[@name='a']/inertial`."""
    inside = re.sub(r"^/robot(\[@name='.*?'\])?", '.', where)
    try:
        return xml.find(inside)
    except (SyntaxError, KeyError):  # a name with a quotation mark
        return None
