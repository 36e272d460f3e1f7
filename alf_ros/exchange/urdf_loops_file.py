"""The side file of a URDF that closes its loops, and says where its joints are as drawn.

    positions: {shoulder: pi/2}
    loops:
      wrist: {type: revolute, between: [coupler, rocker], at: [0.3, 0, 0], axis: [0, 0, 1]}
      elbow: {type: spherical, between: [frame_of_coupler, frame_of_rocker]}

Positions are in rad or m, zero where absent. Places and directions are in the frame of the first
of the two links, which may be `ground`. On the second link they are where these positions have
them. Without `at` the loop has two ends: the origins of both links coincide, of a `weld` also
their axes, of a `revolute` also `axis` in both of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from alf_ros.exchange import two_ended_loops, urdf_motions
from alf_ros.exchange.robot import AXES, STILL, FramePose
from alf_ros.exchange.two_ended_loops import LoopEnd, TwoEndedLoop, rotation_to
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.mechanism import GROUND
from alf_ros.scene.mechanism_file.joints import unit
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry

_KEYS = ('type', 'between', 'at')
_TWO_ENDS = ('spherical', 'weld', 'revolute')  # types that loops without `at` may have
_SECTIONS = ('positions', 'loops')


def positions(path: Path, joints: Mapping[str, str]) -> dict[str, float]:
    """The positions in a side file, rad or m; joints: of the URDF, with their types. Raises
    InputError."""
    section = yaml_document.read(path).mapping(_SECTIONS).get('positions')
    found = {} if section is None else section.mapping()
    for name, entry in found.items():
        if name not in joints:
            raise entry.error('no such joint', value=name, choices=joints)
        if joints[name] not in urdf_motions.SINGLE:
            raise entry.error('not a joint with one coordinate', value=name)
    return {name: entry.number({}) for name, entry in found.items()}


def loops(path: Path, reader: UrdfReader) -> list[TwoEndedLoop]:
    """The loops of a side file. Raises InputError."""
    section = yaml_document.read(path).mapping(_SECTIONS).get('loops')
    types = {name: joint.type for name, joint in reader.joints.items()}
    poses = reader.poses_at(reader.drawn(positions(path, types)))
    return [
        _two_ended(name, entry, reader)
        if _has_two_ends(entry)
        else _drawn(name, entry, reader, poses)
        for name, entry in ({} if section is None else section.mapping()).items()
    ]


def _has_two_ends(entry: Entry) -> bool:
    fields = entry.mapping()
    return 'at' not in fields and 'type' in fields and fields['type'].text() in _TWO_ENDS


def _two_ended(name: str, entry: Entry, reader: UrdfReader) -> TwoEndedLoop:
    kind = entry.mapping()['type'].text()
    keys = ('type', 'between', *(('axis',) if kind == 'revolute' else ()))
    fields = entry.mapping(keys, keys)
    turn = rotation_to(unit(fields['axis'], 3, {})) if 'axis' in fields else np.eye(3)
    frame = FramePose(np.zeros(3), turn)
    known = tuple(dict.fromkeys((*reader.links, GROUND, 'world')))
    first, second = (LoopEnd(side.text(known), frame) for side in fields['between'].sequence(2))
    return TwoEndedLoop(name, kind, (first, second))


def _drawn(
    name: str, entry: Entry, reader: UrdfReader, poses: dict[str, FramePose]
) -> TwoEndedLoop:
    """A loop `at` a place of the first link, drawn with the links at these poses."""
    if 'type' not in entry.mapping():
        entry.mapping((*_KEYS, 'axis', 'axes'), _KEYS)
    kind = entry.mapping()['type'].text(AXES)
    keys = (*_KEYS, *((), ('axis',), ('axes',))[AXES[kind]])
    fields = entry.mapping(keys, keys)
    links = [side.text((*reader.links, GROUND)) for side in fields['between'].sequence(2)]
    pose = poses.get(links[0], STILL)
    axes = fields['axes'].sequence(2) if 'axes' in fields else ()
    axes = (fields['axis'],) if 'axis' in fields else axes
    along = [pose.turn @ unit(axis, 3, {}) for axis in axes]
    place = pose.place(np.array(fields['at'].vector(3, {})))
    return two_ended_loops.drawn(name, kind, links, place, along, poses, entry.file or '')
