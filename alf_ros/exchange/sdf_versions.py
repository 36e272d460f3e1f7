"""The root of an SDF of any version that is read, written as the newest one has it.

Versions 1.4 to 1.6 say three things in other places: 1.4 has the axes of joints in the frame of
the model, 1.4 and 1.5 have gravity in <physics>, and until 1.6 a <pose> has `frame` for
`relative_to`. Until 1.6 joints have no frames either, so a joint may have the name of a link.
Sources: the *.convert files of sdformat, and its Model.cc for names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree

from alf_ros.errors import InputError
from alf_ros.exchange import xml_file
from alf_ros.exchange.robot import free_name

AXES = ('axis', 'axis2')
OF_MODEL = 'use_parent_model_frame'  # of an axis: whether it is in the frame of the model
_OLDEST, NEWEST = 4, 12  # minor versions that are read
# from these minor versions on: axes in the frames of their joints, gravity of the world,
# `relative_to` in place of `frame`, and joints with frames
_AXES_OF_JOINTS, _GRAVITY_OF_WORLD, _RELATIVE_TO, _FRAMES_OF_JOINTS = 5, 6, 7, 7
OLD_ROOT = 'gazebo'  # of versions before 1.3, which have other elements below it too
_WORLD = 'world'  # a name that frames have as well


def root_of(
    path: Path, arguments: Mapping[str, str] | None = None
) -> tuple[ElementTree.Element, list[tuple[str, str]]]:
    """The root of a file, and kind and name of what the report says about its version.

    arguments: of a xacro. Raises InputError.
    """
    root = xml_file.root_of(path, arguments)
    given = root.get('version')
    if root.tag == OLD_ROOT:
        message, expected = f'SDF before 1.3, whose root is <{OLD_ROOT}>', '1.4 to 1.12'
        raise InputError(
            message,
            **xml_file.place_of(root, str(path)),
            key='sdf version',
            value=given,
            expected=expected,
        )
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
    told = []
    if minor < _FRAMES_OF_JOINTS:
        told += [('names, changed', each) for each in _renamed(root)]
    if given is None or not _OLDEST <= minor <= NEWEST:
        told.append(('version of SDF', f'{path.name} has {given or "none"}'))
    return root, told


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


def _renamed(root: ElementTree.Element) -> Iterator[str]:
    """Give joints with the name of a link, or of the world, another one, as libsdformat does.
    Yields the old and the new name of each."""
    for model in root.iter('model'):
        frames = {_WORLD, *(link.get('name', '') for link in model.findall('link'))} - {''}
        joints = {joint.get('name', '') for joint in model.findall('joint')}
        for joint in model.findall('joint'):
            name = joint.get('name', '')
            if name in frames:
                own = free_name(f'{name}_joint', frames | joints)
                joint.set('name', own)
                joints.add(own)
                yield f'joint {name} is {own}'
