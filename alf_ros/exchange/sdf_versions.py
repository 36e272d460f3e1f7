"""The root of an SDF of any version that is read, written as the newest one has it.

Versions 1.4 to 1.6 say three things in other places: 1.4 has the axes of joints in the frame of
the model, 1.4 and 1.5 have gravity in <physics>, and until 1.6 a <pose> has `frame` for
`relative_to`. Source: the *.convert files of sdformat.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from alf_ros.errors import InputError
from alf_ros.exchange import xml_file

AXES = ('axis', 'axis2')
OF_MODEL = 'use_parent_model_frame'  # of an axis: whether it is in the frame of the model
_OLDEST, NEWEST = 4, 12  # minor versions that are read
# from these minor versions on: axes in the frames of their joints, gravity of the world, and
# `relative_to` in place of `frame`
_AXES_OF_JOINTS, _GRAVITY_OF_WORLD, _RELATIVE_TO = 5, 6, 7


def root_of(
    path: Path, arguments: Mapping[str, str] | None = None
) -> tuple[ElementTree.Element, str]:
    """The root of a file, and its version if it is not one that is expected.

    arguments: of a xacro. Raises InputError.
    """
    root = xml_file.root_of(path, arguments)
    given = root.get('version')
    minor = minor_of(f'1.{NEWEST}' if given is None else given)
    if minor is None:
        message, expected = 'not a version of SDF that is read', '1.4 to 1.12'
        raise InputError(
            message,
            **xml_file.place_of(root, str(path)),
            key='sdf version',
            value=given,
            expected=expected,
        )
    if minor < _AXES_OF_JOINTS:
        _mark_axes(root)
    if minor < _GRAVITY_OF_WORLD:
        for world in root.iter('world'):
            _move_gravity(world)
    if minor < _RELATIVE_TO:
        for pose in root.iter('pose'):
            if 'frame' in pose.attrib:
                pose.set('relative_to', pose.attrib.pop('frame'))
    expected_one = given is not None and _OLDEST <= minor <= NEWEST
    return root, '' if expected_one else f'{path.name} has {given or "none"}'


def minor_of(version: str) -> int | None:
    """The 9 of 1.9; None for a text that is no such version."""
    words = version.strip().split('.')
    known = len(words) == 2 and all(word.isdigit() for word in words) and words[0] == '1'
    return int(words[1]) if known else None


def _mark_axes(root: ElementTree.Element) -> None:
    for joint in root.iter('joint'):
        for tag in AXES:
            axis = joint.find(tag)
            axis = ElementTree.SubElement(joint, tag) if axis is None else axis
            if axis.find(OF_MODEL) is None:
                ElementTree.SubElement(axis, OF_MODEL).text = '1'


def _move_gravity(world: ElementTree.Element) -> None:
    gravity = world.find('physics/gravity')
    if gravity is not None and world.find('gravity') is None:
        world.append(gravity)
