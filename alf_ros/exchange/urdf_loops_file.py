"""The side file of a URDF that closes its loops, and says where its joints are as drawn.

    positions: {shoulder: pi/2}
    loops:
      wrist: {type: revolute, between: [coupler, rocker], at: [0.3, 0, 0], axis: [0, 0, 1]}
      elbow: {type: spherical, between: [frame_of_coupler, frame_of_rocker]}

Positions are in rad or m, zero where absent. Places and directions are in the frame of the first
of the two links, which may be `ground`. Without `at` the loop has two ends: the origins of both
links coincide, of a `weld` also their axes, of a `revolute` also `axis` in both of them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from alf_ros.exchange.robot import AXES, Connection, FramePose
from alf_ros.exchange.two_ended_loops import CLOSES, LoopEnd, TwoEndedLoop, rotation_to
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.mechanism import GROUND
from alf_ros.scene.mechanism_file.joints import unit
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry

_KEYS = ('type', 'between', 'at')


_SECTIONS = ('positions', 'loops')


def positions(path: Path) -> dict[str, float]:
    """The positions in a side file. Raises InputError."""
    section = yaml_document.read(path).mapping(_SECTIONS).get('positions')
    found = {} if section is None else section.mapping()
    return {name: entry.number({}) for name, entry in found.items()}


def close(path: Path, reader: UrdfReader) -> None:
    """Add the loops of a side file to the robot of a URDF. Raises InputError."""
    section = yaml_document.read(path).mapping(_SECTIONS).get('loops')
    for name, entry in ({} if section is None else section.mapping()).items():
        if not _two_ends(entry):
            reader.robot.connect(_connection(name, entry, reader))


def two_ended(path: Path) -> list[TwoEndedLoop]:
    """The loops of a side file that name a frame on either side. Raises InputError."""
    section = yaml_document.read(path).mapping(_SECTIONS).get('loops')
    found = []
    for name, entry in ({} if section is None else section.mapping()).items():
        if _two_ends(entry):
            kind = entry.mapping()['type'].text()
            keys = ('type', 'between', *(('axis',) if kind == 'revolute' else ()))
            fields = entry.mapping(keys, keys)
            turn = rotation_to(unit(fields['axis'], 3, {})) if 'axis' in fields else np.eye(3)
            frame = FramePose(np.zeros(3), turn)
            first, second = (LoopEnd(side.text(), frame) for side in fields['between'].sequence(2))
            found.append(TwoEndedLoop(name, kind, (first, second)))
    return found


def _two_ends(entry: Entry) -> bool:
    fields = entry.mapping()
    return 'at' not in fields and 'type' in fields and fields['type'].text() in CLOSES


def _connection(name: str, entry: Entry, reader: UrdfReader) -> Connection:
    if 'type' not in entry.mapping():
        entry.mapping((*_KEYS, 'axis', 'axes'), _KEYS)
    kind = entry.mapping()['type'].text(AXES)
    keys = (*_KEYS, *((), ('axis',), ('axes',))[AXES[kind]])
    fields = entry.mapping(keys, keys)
    links = [side.text((*reader.links, GROUND)) for side in fields['between'].sequence(2)]
    (parent, pose), (child, _) = (reader.part(link, name) for link in links)
    axes = fields['axes'].sequence(2) if 'axes' in fields else ()
    axes = (fields['axis'],) if 'axis' in fields else axes
    along = tuple(pose.turn @ unit(axis, 3, {}) for axis in axes)
    place = pose.place(np.array(fields['at'].vector(3, {})))
    return Connection(name, kind, parent, child, place, along)
