"""Joints of a URDF that it, or a side file, makes balls, universal joints, or fixed.

URDF has neither balls nor universal joints, but Drake and Bullet read some: `ball`, `spherical`,
and `universal`, about x of the parent and y of the child.

A universal joint and a ball become a row of `continuous` joints about axes of the joint's frame,
through links without mass: `name_X`, `name_Y`, `name_Z`. The reader makes one ball of three.

Drake reads three dampings of a planar joint, along x and y of its plane and about its axis. Such a
joint becomes a row of two slides and a hinge, each with its damping.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import xml_file

_AXES = {'X': '1 0 0', 'Y': '0 1 0', 'Z': '0 0 1'}
_ROWS = {f'UJOINT_{a}{b}': a + b for a in _AXES for b in _AXES if a != b} | {'SPHERICAL': 'XYZ'}
CHANGES = (*_ROWS, 'FIXED')
_STATED = {'ball': 'SPHERICAL', 'spherical': 'SPHERICAL', 'universal': 'UJOINT_XY'}
_OF_DRAKE = ('{http://drake.mit.edu}joint', '{undeclared:drake}joint')  # `<drake:joint>`
PLANAR = 'PLANAR'  # a planar joint with a damping of each of its three freedoms
_OPPOSITE = 1e-9  # of 1 + z of an axis: it is -z, to which many shortest turns lead


def rename(root: ElementTree.Element) -> None:
    """Make `<drake:joint>` of the types above, and planar ones, a `<joint>`: Drake asks for it."""
    for each in root:
        if each.tag in _OF_DRAKE and each.get('type') in (*_STATED, 'planar'):
            each.tag = 'joint'


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


def slides(types: Mapping[str, str]) -> set[str]:
    """The slides of the rows of planar joints, which have no limits."""
    return {f'{name}_{axis}' for name, kind in types.items() if kind == PLANAR for axis in 'XY'}


def changed(root: ElementTree.Element, types: Mapping[str, str], file: str) -> ElementTree.Element:
    """A URDF with these joints of another type. Raises InputError for a joint that it lacks."""
    present = {element.get('name', '') for element in root.findall('joint')}
    for name in types:
        if name not in present:
            message = 'the file beside it names a joint that it lacks'
            raise InputError(message, file=file, key='joint_name', value=name, choices=present)
    whole = ElementTree.Element(root.tag, root.attrib)
    for element in root:
        kind = types.get(element.get('name', '')) if element.tag == 'joint' else None
        whole.extend([element] if kind is None else _replaced(element, kind))
    return whole


def _replaced(joint: ElementTree.Element, kind: str) -> Iterator[ElementTree.Element]:
    name = joint.get('name', '')
    if kind == 'FIXED':
        fixed = copy.deepcopy(joint)
        fixed.set('type', 'fixed')
        yield fixed
        return
    ends = [each.get('link', '') for side in ('parent', 'child') for each in joint.findall(side)]
    row = 'XYZ' if kind == PLANAR else _ROWS[kind]
    damping = dampings(joint) if kind == PLANAR else []
    axes = _in_plane(joint) if kind == PLANAR else _AXES
    links = [ends[0], *(f'{name}_{axis}_link' for axis in row[:-1]), ends[-1]]
    for n, axis in enumerate(row):
        if n:
            yield ElementTree.Element('link', {'name': links[n]})
        moves = 'prismatic' if kind == PLANAR and axis != 'Z' else 'continuous'
        one = xml_file.beside(joint, {'name': f'{name}_{axis}', 'type': moves})
        one.extend(joint.findall('origin') if n == 0 else [])
        ElementTree.SubElement(one, 'parent', {'link': links[n]})
        ElementTree.SubElement(one, 'child', {'link': links[n + 1]})
        ElementTree.SubElement(one, 'axis', {'xyz': axes[axis]})
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


def balls(types: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """The joints of the row that each ball was made of, by the name of the ball."""
    return {
        name: tuple(f'{name}_{axis}' for axis in _ROWS[kind])
        for name, kind in types.items()
        if kind == 'SPHERICAL'
    }
