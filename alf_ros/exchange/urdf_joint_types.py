"""Joints of a URDF that it, or a side file, makes balls, universal joints, or fixed.

URDF has neither balls nor universal joints, but Drake and Bullet read some: `ball`, `spherical`,
and `universal`, about x of the parent and y of the child.

A universal joint and a ball become a row of `continuous` joints about axes of the joint's frame,
through links without mass: `name_X`, `name_Y`, `name_Z`. The reader makes one ball of three.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree

from alf_ros.errors import InputError

_AXES = {'X': '1 0 0', 'Y': '0 1 0', 'Z': '0 0 1'}
_ROWS = {f'UJOINT_{a}{b}': a + b for a in _AXES for b in _AXES if a != b} | {'SPHERICAL': 'XYZ'}
CHANGES = (*_ROWS, 'FIXED')
_STATED = {'ball': 'SPHERICAL', 'spherical': 'SPHERICAL', 'universal': 'UJOINT_XY'}


def stated(root: ElementTree.Element) -> dict[str, str]:
    """The joints of a URDF that it gives such a type itself, by name."""
    found = {each.get('name', ''): each.get('type', '') for each in root.findall('joint')}
    return {name: _STATED[kind] for name, kind in found.items() if kind in _STATED}


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
    row = _ROWS[kind]
    links = [ends[0], *(f'{name}_{axis}_link' for axis in row[:-1]), ends[-1]]
    for n, axis in enumerate(row):
        if n:
            yield ElementTree.Element('link', {'name': links[n]})
        one = ElementTree.Element('joint', {'name': f'{name}_{axis}', 'type': 'continuous'})
        one.extend(joint.findall('origin') if n == 0 else [])
        ElementTree.SubElement(one, 'parent', {'link': links[n]})
        ElementTree.SubElement(one, 'child', {'link': links[n + 1]})
        ElementTree.SubElement(one, 'axis', {'xyz': _AXES[axis]})
        yield one


def balls(types: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """The joints of the row that each ball was made of, by the name of the ball."""
    return {
        name: tuple(f'{name}_{axis}' for axis in _ROWS[kind])
        for name, kind in types.items()
        if kind == 'SPHERICAL'
    }
