"""Sample -> the bytes of a ROS message: what each topic of the simulator says, and nothing else.

All numbers are SI in the world frame (planar mechanisms: x-y plane, angles about +z, REP-103).
Every message of a step carries the same stamp: the simulated time of the state it describes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Vector3, Wrench
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64, Header

from alf_ros.model.compile import Model
from alf_ros.model.constraints import drives as driving
from alf_ros.simulation import observables, state_vector
from alf_ros.simulation.observables import Reading
from alf_ros.simulation.sample import Sample

WORLD = 'world'

# A stamp that no run has, for templates; in CDR, little endian.
STAMP = Time(sec=0x5EED5EED, nanosec=0x1EAF1EAF)
_STAMP = struct.Struct('<iI')

Write = Callable[['Sample', int], bytes]


def to_time(ns: int) -> Time:
    """The stamp as a message."""
    seconds, nanoseconds = divmod(ns, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)


class Template:
    """A serialised message of which only stamps and numbers change.

    To fill and serialise a message object costs a microsecond for each number; its bytes have the
    numbers in blocks at fixed places. `make(marks)` builds the message with one value all over
    each block, and `STAMP` wherever the stamp belongs; the places of the blocks (`counts` of
    float64 each) and stamps are found by looking for them.
    """

    def __init__(self, make: Callable[[list[float]], Any], counts: list[int]) -> None:
        marks = [1.0 / (7 + k) for k in range(len(counts))]
        self._data = bytearray(serialize_message(make(marks)))
        self.blocks = []
        at = 0
        for mark, count in zip(marks, counts, strict=True):
            at = self._data.index(np.full(count, mark).tobytes(), at)
            self.blocks.append(np.frombuffer(self._data, np.float64, count, at))
        stamp = _STAMP.pack(STAMP.sec, STAMP.nanosec)
        self._stamps = [found.start() for found in re.finditer(re.escape(stamp), self._data)]

    def stamp(self, ns: int) -> None:
        """Write the stamp (ns)."""
        for at in self._stamps:
            _STAMP.pack_into(self._data, at, *divmod(ns, 1_000_000_000))

    def bytes(self) -> bytes:
        """The message as it is now."""
        return bytes(self._data)


def joint_states(model: Model) -> Write | None:
    """`joint_states`: all joints, passive ones too; angle (rad) or travel (m), its rate, and what
    acts on the free axis (N m or N): drive, spring, friction and command, not the reaction."""

    return _joint_state(model.coordinate_names, observables.JOINT_STATES)


def constraints(model: Model) -> Write | None:
    """`~/constraints`: per row, position = violation, velocity = its rate, effort = multiplier."""
    return _joint_state(model.row_names, observables.CONSTRAINTS)


def drives(model: Model) -> Write | None:
    """`~/drives`: of each motion prescribed, position, velocity and the effort it takes."""
    return _joint_state(driving.motion_names(model.mechanism), observables.DRIVES)


def state(model: Model) -> Write:
    """`~/state`: position = all numbers of the state (`state_vector`), velocity = their rates."""
    writers: dict[tuple[object, ...], Write] = {}

    def write(sample: Sample, ns: int) -> bytes:
        # Another formulation, set while the run goes on, may carry more.
        key = (sample.state.carried.size, sample.state.loads.size, *sample.state.works)
        if key not in writers:
            made = _joint_state(state_vector.names(model, sample.state), observables.STATE)
            assert made is not None  # there is always the step
            writers[key] = made
        return writers[key](sample, ns)

    return write


def _joint_state(names: tuple[str, ...], reading: Reading) -> Write | None:
    if not names:
        return None
    count = len(names)

    def make(marks: list[float]) -> JointState:
        # rosbags cannot read a last array that is empty
        arrays = {'effort': [0.0] * count}
        arrays |= {key: [mark] * count for key, mark in zip(reading.fields, marks, strict=True)}
        return JointState(header=Header(stamp=STAMP), name=list(names), **arrays)

    template = Template(make, [count] * len(reading.fields))

    def write(sample: Sample, ns: int) -> bytes:
        template.stamp(ns)
        for block, value in zip(template.blocks, reading.values(sample), strict=True):
            block[:] = value
        return template.bytes()

    return write


def reactions(model: Model) -> Write | None:
    """`~/reactions`: force (N) and torque (N m) of parent on child, world frame, at the joint."""
    if not model.joint_names:
        return None
    count = len(model.joint_names)

    def make(marks: list[float]) -> MultiDOFJointState:
        message = MultiDOFJointState(joint_names=list(model.joint_names))
        message.header = Header(stamp=STAMP, frame_id=WORLD)
        (mark,) = marks
        vector = Vector3(x=mark, y=mark, z=mark)
        message.wrench = [Wrench(force=vector, torque=vector)] * count
        return message

    template = Template(make, [6 * count])
    wrenches = template.blocks[0].reshape(count, 6)

    def write(sample: Sample, ns: int) -> bytes:
        template.stamp(ns)
        (wrenches[:],) = observables.REACTIONS.values(sample)
        return template.bytes()

    return write


def energy(model: Model) -> Write:
    """`~/energy`: total mechanical energy (J)."""
    template = Template(lambda marks: Float64(data=marks[0]), [1])

    def write(sample: Sample, ns: int) -> bytes:
        (template.blocks[0][:],) = observables.ENERGY.values(sample)
        return template.bytes()

    return write


def work(accounts: tuple[str, ...]) -> Write | None:
    """`~/work`: position = what each effect has given to the motion since the start (J)."""
    return _joint_state(accounts, observables.WORK)


def clock(model: Model) -> Write:
    """`/clock`: the simulated time."""
    template = Template(lambda marks: Clock(clock=STAMP), [])

    def write(sample: Sample, ns: int) -> bytes:
        template.stamp(ns)
        return template.bytes()

    return write
