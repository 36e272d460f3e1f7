"""Joints of a URDF that it, or a side file, makes balls, universal joints, or fixed.

URDF has neither balls nor universal joints, but Drake and Bullet read some: `ball`, `spherical`,
and `universal`, about x of the parent and y of the child. Drake also reads `screw`.

A universal joint and a ball become a row of `continuous` joints about axes of the joint's frame,
through links without mass: `name_X`, `name_Y`, `name_Z`, or the next free names. The reader makes
one ball of three. The damping of a universal joint acts on both of its angles, as in Drake.

A screw becomes a `continuous` joint of its name and a prismatic one, `name_slide` or the next free
name, that mimics it. The reader makes one screw of both.

Drake reads three dampings of a planar joint, along x and y of its plane and about its axis. Such a
joint becomes a row of two slides and a hinge, each with its damping.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import xml_file
from alf_ros.exchange.robot import free_name
from alf_ros.scene.text.decimal_numbers import decimal
from alf_ros.scene.text.yaml_document import LARGEST

_AXES = {'X': '1 0 0', 'Y': '0 1 0', 'Z': '0 0 1'}
BALL = 'SPHERICAL'
_ROWS = {f'UJOINT_{a}{b}': a + b for a in _AXES for b in _AXES if a != b} | {BALL: 'XYZ'}
CHANGES = (*_ROWS, 'FIXED')
SCREW = 'SCREW'
_STATED = {'ball': BALL, 'spherical': BALL, 'universal': 'UJOINT_XY', 'screw': SCREW}
_OF_DRAKE = ('{http://drake.mit.edu}joint', '{undeclared:drake}joint')  # `<drake:joint>`
_PITCH = 'screw_thread_pitch'  # m per turn
PLANAR = 'PLANAR'  # a planar joint with a damping of each of its three freedoms
_OPPOSITE = 1e-9  # of 1 + z of an axis: it is -z, to which many shortest turns lead


@dataclass(frozen=True)
class Thread:
    """A screw: its pitch, m per turn, and the name of the joint that slides."""

    pitch: float
    slide: str


@dataclass(frozen=True)
class RowPart:
    """A joint of a row: its name, its axis in the frame of the joint that the row stands for (a
    key of `_AXES`), and its type in URDF."""

    name: str
    axis: str
    type: str


def rename(root: ElementTree.Element) -> None:
    """Make `<drake:joint>` of the types above, and planar ones, a `<joint>`: Drake asks for it."""
    for each in root:
        if each.tag in _OF_DRAKE and each.get('type') in (*_STATED, 'planar'):
            each.tag = 'joint'


def named(root: ElementTree.Element) -> dict[str, str]:
    """The type of each joint, by name; a screw is `continuous`, for it has one coordinate, and the
    others of the types above are their rows."""
    rename(root)
    found = {each.get('name', ''): each.get('type', '') for each in root.findall('joint')}
    kinds = stated(root)
    for name in kinds:
        del found[name]
    for row in rows(root, kinds).values():
        found |= {part.name: part.type for part in row}
    return found | {name: 'continuous' for name, kind in kinds.items() if kind == SCREW}


def rows(root: ElementTree.Element, types: Mapping[str, str]) -> dict[str, tuple[RowPart, ...]]:
    """The row that stands for each joint of one of these types, by name; of screws there is none,
    see `threads`. No part has the name of another joint."""
    taken = {each.get('name', '') for each in root.findall('joint')}
    found = {}
    for name, kind in types.items():
        row = []
        for axis in 'XYZ' if kind == PLANAR else _ROWS.get(kind, ''):
            slides = kind == PLANAR and axis != 'Z'
            own = free_name(f'{name}_{axis}', taken)
            taken.add(own)
            row.append(RowPart(own, axis, 'prismatic' if slides else 'continuous'))
        if row:
            found[name] = tuple(row)
    return found


def renamed(rows: Mapping[str, tuple[RowPart, ...]]) -> Iterator[str]:
    """Lines of the report about parts of rows whose names were taken."""
    for name, row in rows.items():
        for part in row:
            if part.name != (usual := f'{name}_{part.axis}'):
                yield f'{usual} of {name} is {part.name}'


def stated(root: ElementTree.Element) -> dict[str, str]:
    """The joints of a URDF that it gives such a type itself, by name."""
    found = {each.get('name', ''): each.get('type', '') for each in root.findall('joint')}
    damped = (each for each in root.findall('joint') if len(dampings(each)) == 3)
    planar = {each.get('name', ''): PLANAR for each in damped if each.get('type') == 'planar'}
    return {name: _STATED[kind] for name, kind in found.items() if kind in _STATED} | planar


def dampings(joint: ElementTree.Element) -> list[str]:
    """The words of the damping of a joint, of which URDF has one."""
    dynamics = joint.find('dynamics')
    return [] if dynamics is None else dynamics.get('damping', '').split()


def slides(rows: Mapping[str, tuple[RowPart, ...]], threads: Mapping[str, Thread]) -> set[str]:
    """The slides of the rows of planar joints and screws, which have no limits."""
    planar = {part.name for row in rows.values() for part in row if part.type == 'prismatic'}
    return planar | {each.slide for each in threads.values()}


def threads(root: ElementTree.Element, types: Mapping[str, str], file: str) -> dict[str, Thread]:
    """The screws, by name. Raises InputError."""
    taken = {each.get('name', '') for each in root.findall('joint')}
    found = {}
    for joint in root.findall('joint'):
        name = joint.get('name', '')
        if types.get(name) == SCREW:
            slide = free_name(f'{name}_slide', taken)
            taken.add(slide)
            found[name] = Thread(_pitch(joint, file), slide)
    return found


def _pitch(joint: ElementTree.Element, file: str) -> float:
    given = [each for each in joint if _is_pitch(each)]
    text = given[0].get('value') if given else None
    place = xml_file.place_of(given[0] if given else joint, file)
    key, expected = joint.get('name', ''), f'<drake:{_PITCH} value="0.01"/>, m per turn'
    if text is None:
        raise InputError('a screw without its pitch', **place, key=key, expected=expected)
    try:
        pitch = decimal(text.strip())
    except ValueError:
        pitch = math.nan
    if not abs(pitch) <= LARGEST:
        message = 'the pitch is not a usable number'
        raise InputError(message, **place, key=key, value=text, expected=expected)
    return pitch


def _is_pitch(element: ElementTree.Element) -> bool:
    return isinstance(element.tag, str) and element.tag.rpartition('}')[2] == _PITCH


def changed(
    root: ElementTree.Element,
    types: Mapping[str, str],
    rows: Mapping[str, tuple[RowPart, ...]],
    threads: Mapping[str, Thread],
    file: str,
) -> ElementTree.Element:
    """A URDF with these joints of another type. threads: of the screws. Raises InputError for a
    joint that it lacks."""
    present = {element.get('name', '') for element in root.findall('joint')}
    for name in types:
        if name not in present:
            message = 'the file beside it names a joint that it lacks'
            raise InputError(message, file=file, key='joint_name', value=name, choices=present)
    whole = ElementTree.Element(root.tag, root.attrib)
    links = {element.get('name', '') for element in root.findall('link')}
    for element in root:
        name = element.get('name', '')
        kind = types.get(name) if element.tag == 'joint' else None
        if kind == SCREW:
            whole.extend(_thread(element, threads[name], links))
        elif kind in (None, 'FIXED'):
            whole.append(element if kind is None else _fixed(element))
        else:
            whole.extend(_replaced(element, rows[name], links))
    return whole


def _new_link(wanted: str, links: set[str]) -> str:
    """A free name of a link, which is added to `links`."""
    name = free_name(wanted, links)
    links.add(name)
    return name


def _thread(
    joint: ElementTree.Element, thread: Thread, links: set[str]
) -> Iterator[ElementTree.Element]:
    name = joint.get('name', '')
    between = _new_link(f'{name}_slide_link', links)
    axis = joint.findall('axis')
    turns = xml_file.beside(joint, joint.attrib | {'type': 'continuous'})
    turns.extend(each for each in joint if each.tag != 'child' and not _is_pitch(each))
    ElementTree.SubElement(turns, 'child', {'link': between})
    slides = xml_file.beside(joint, {'name': thread.slide, 'type': 'prismatic'})
    ElementTree.SubElement(slides, 'parent', {'link': between})
    slides.extend([*joint.findall('child'), *axis])
    follows = {'joint': name, 'multiplier': repr(thread.pitch / (2.0 * math.pi))}
    ElementTree.SubElement(slides, 'mimic', follows)
    yield from (turns, ElementTree.Element('link', {'name': between}), slides)


def _fixed(joint: ElementTree.Element) -> ElementTree.Element:
    fixed = copy.deepcopy(joint)
    fixed.set('type', 'fixed')
    return fixed


def _replaced(
    joint: ElementTree.Element, row: tuple[RowPart, ...], links: set[str]
) -> Iterator[ElementTree.Element]:
    ends = [each.get('link', '') for side in ('parent', 'child') for each in joint.findall(side)]
    planar = row[0].type == 'prismatic'
    damping = dampings(joint) if planar else []
    if joint.get('type') == 'universal' and [part.axis for part in row] == ['X', 'Y']:
        damping = dampings(joint)[:1] * len(row)
    axes = _in_plane(joint) if planar else _AXES
    between = [_new_link(f'{part.name}_link', links) for part in row[:-1]]
    sides = [ends[0], *between, ends[-1]]
    for n, part in enumerate(row):
        if n:
            yield ElementTree.Element('link', {'name': sides[n]})
        one = xml_file.beside(joint, {'name': part.name, 'type': part.type})
        one.extend(joint.findall('origin') if n == 0 else [])
        ElementTree.SubElement(one, 'parent', {'link': sides[n]})
        ElementTree.SubElement(one, 'child', {'link': sides[n + 1]})
        ElementTree.SubElement(one, 'axis', {'xyz': axes[part.axis]})
        if damping:
            ElementTree.SubElement(one, 'dynamics', {'damping': damping[n]})
        yield one


def _in_plane(joint: ElementTree.Element) -> dict[str, str]:
    """The directions of a planar joint, in Drake z turned the shortest way to the axis, and x and
    y with it. Of a zero axis all are zero, which the reader refuses."""
    given = joint.find('axis')
    words = '1 0 0' if given is None else given.get('xyz', '')
    axis: Floats = np.array(words.split(), dtype=float)
    size = float(np.linalg.norm(axis))
    if not size > 0.0:
        return dict.fromkeys(_AXES, words)
    x, y, z = axis / size
    if 1.0 + z < _OPPOSITE:
        turned = np.diag([1.0, -1.0, -1.0])
    else:
        cross = -x * y / (1.0 + z)
        turned = np.array(
            [(1.0 - x * x / (1.0 + z), cross, -x), (cross, 1.0 - y * y / (1.0 + z), -y), (x, y, z)]
        )
    return {
        name: ' '.join(repr(float(each)) for each in row)
        for name, row in zip(_AXES, turned, strict=True)
    }
