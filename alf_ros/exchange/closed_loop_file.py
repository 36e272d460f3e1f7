"""The side file of the parallel robots of Gepetto: which frames of a URDF coincide.

    closed_loop: [[frame_A, frame_B], ...]
    type: [6d, 3d, ...]                    # both frames, or their origins only
    name_mot: [joint, ...]                 # joints with a motor
    joint_name: [joint, ...]               # joints of the URDF that are of another type
    joint_type: [SPHERICAL, FIXED, UJOINT_XY, ...]

Frames are links of the URDF. A joint `UJOINT_XY` turns about x of its frame, then about y.
"""

from __future__ import annotations

from pathlib import Path

from alf_ros.exchange.robot import STILL, Actuator
from alf_ros.exchange.two_ended_loops import LoopEnd, TwoEndedLoop
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.exchange.urdf_joint_types import CHANGES
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry

KEYS = ('closed_loop', 'type', 'name_mot', 'joint_name', 'joint_type')
_KINDS = {'3d': 'spherical', '3D': 'spherical', '6d': 'weld', '6D': 'weld'}


def _fields(path: Path) -> dict[str, Entry]:
    return yaml_document.read(path).mapping(KEYS, ('closed_loop',))


def joint_types(path: Path) -> dict[str, str]:
    """The type of each joint that is of another type than in the URDF. Raises InputError."""
    fields = _fields(path)
    names = fields['joint_name'].sequence() if 'joint_name' in fields else ()
    if not names:
        return {}
    types = fields['joint_type'].sequence(len(names)) if 'joint_type' in fields else ()
    if not types:
        raise fields['joint_name'].error('without joint_type', expected='a type for each')
    return {name.text(): kind.text(CHANGES) for name, kind in zip(names, types, strict=True)}


def loops(path: Path) -> list[TwoEndedLoop]:
    """The loops. Raises InputError."""
    fields = _fields(path)
    pairs = fields['closed_loop'].sequence()
    kinds = fields['type'].sequence(len(pairs)) if 'type' in fields else [None] * len(pairs)
    found = []
    for pair, kind in zip(pairs, kinds, strict=True):
        first, second = (side.text() for side in pair.sequence(2))
        of = 'weld' if kind is None else _KINDS[kind.text(_KINDS)]
        ends = LoopEnd(first, STILL), LoopEnd(second, STILL)
        found.append(TwoEndedLoop(f'{first}_{second}', of, ends))
    return found


def add_motors(path: Path, reader: UrdfReader) -> None:
    """A motor for each joint of `name_mot` that has none. Raises InputError."""
    fields = _fields(path)
    driven = {actuator.joint for actuator in reader.robot.actuators}
    moving = [each.name for each in reader.robot.connections]
    for entry in fields['name_mot'].sequence() if 'name_mot' in fields else ():
        name = entry.text(moving)
        if name in driven:
            continue
        joint = reader.joints.get(name)
        limit = joint.limit.effort or None if joint is not None and joint.limit else None
        reader.robot.actuators.append(Actuator(f'{name}_motor', name, limit=limit))
        reader.robot.leave('gains of actuators', name)
