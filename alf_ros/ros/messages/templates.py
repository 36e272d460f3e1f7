"""Sample -> the bytes of a ROS message: what each topic of the simulator says, and nothing else.

All numbers are SI in the world frame (planar mechanisms: x-y plane, angles about +z, REP-103).
Every message of a step carries the same stamp: the simulated time of the state it describes.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Vector3, Wrench
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64, Header

from alf_ros.logs import cdr
from alf_ros.model.compile import Model
from alf_ros.model.constraints import drives as driving
from alf_ros.simulation import observables, state_vector
from alf_ros.simulation.observables import Reading
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.state import State

WORLD = 'world'

# A stamp that no run has, for templates.
STAMP = Time(sec=0x5EED5EED, nanosec=0x1EAF1EAF)

Write = Callable[['Sample', int], bytes]


def to_time(ns: int) -> Time:
    """The stamp as a message."""
    seconds, nanoseconds = divmod(ns, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)


def template(make: Callable[[list[float]], Any], counts: list[int]) -> cdr.Template:
    """A message of any type, serialised once, of which only stamps and numbers change.

    To fill and serialise a message object costs a microsecond for each number; its bytes have the
    numbers in blocks at fixed places. `make(marks)` builds the message with one value all over
    each block, and `STAMP` wherever the stamp belongs; the places of the blocks (`counts` of
    float64 each) and stamps are found by looking for them.
    """
    marks = [1.0 / (7 + k) for k in range(len(counts))]
    data = serialize_message(make(marks))
    blocks, at = [], 0
    for mark, count in zip(marks, counts, strict=True):
        at = data.index(np.full(count, mark).tobytes(), at)
        blocks.append((at, count))
    stamp = re.escape(cdr.STAMP.pack(STAMP.sec, STAMP.nanosec))
    return cdr.Template(data, (found.start() for found in re.finditer(stamp, data)), blocks)


class ReadingMessage:
    """The message of a topic of which only the stamp and the numbers of its `reading` change.

    The numbers come from a sample, or have been written into `blocks` before.
    """

    def __init__(self, message: cdr.Template, reading: Reading | None = None) -> None:
        self._message, self.reading = message, reading
        self.blocks = message.blocks

    def __call__(self, sample: Sample, ns: int) -> bytes:
        """The message of a sample, with the stamp `ns`."""
        if self.reading is not None:
            for block, value in zip(self.blocks, self.reading.values(sample), strict=True):
                block[:] = value.ravel()
        return self.stamped(ns)

    def stamped(self, ns: int) -> bytes:
        """The message of the numbers in `blocks`, with the stamp `ns`."""
        self._message.stamp(ns)
        return self._message.bytes()

    def of(self, state: State) -> ReadingMessage:
        """The message that fits simulations with such states."""
        return self


class StateMessage:
    """`~/state`: position = all numbers of the state (`state_vector`), velocity = their rates."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._known: dict[tuple[object, ...], ReadingMessage] = {}

    def __call__(self, sample: Sample, ns: int) -> bytes:
        """The message of a sample, with the stamp `ns`."""
        return self.of(sample.state)(sample, ns)

    def of(self, state: State) -> ReadingMessage:
        """The message that fits states like this one: another formulation, set during the run,
        may carry more."""
        key = (state.carried.size, state.loads.size, *state.works)
        if key not in self._known:
            made = _joint_state(state_vector.names(self._model, state), observables.STATE)
            assert made is not None  # there is always the step
            self._known[key] = made
        return self._known[key]


def joint_states(model: Model) -> Write | None:
    """`joint_states`: all joints, passive ones too; angle (rad) or travel (m), its rate, and the
    effort on the free axis (N m or N): drive, spring, friction and command, not the reaction. Then
    the angles of balls that have some."""

    return _joint_state(observables.joint_state_names(model), observables.JOINT_STATES)


def constraints(model: Model) -> Write | None:
    """`~/constraints`: per row, position = violation, velocity = its rate, effort = multiplier."""
    return _joint_state(model.row_names, observables.CONSTRAINTS)


def drives(model: Model) -> Write | None:
    """`~/drives`: of each motion prescribed, position, velocity and the effort of the drive."""
    return _joint_state(driving.motion_names(model.mechanism), observables.DRIVES)


def _joint_state(names: tuple[str, ...], reading: Reading) -> ReadingMessage | None:
    if not names:
        return None
    count = len(names)

    def make(marks: list[float]) -> JointState:
        # rosbags cannot read a last array that is empty
        arrays = {'effort': [0.0] * count}
        arrays |= {key: [mark] * count for key, mark in zip(reading.fields, marks, strict=True)}
        return JointState(header=Header(stamp=STAMP), name=list(names), **arrays)

    return ReadingMessage(template(make, [count] * len(reading.fields)), reading)


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

    return ReadingMessage(template(make, [6 * count]), observables.REACTIONS)


def energy(model: Model) -> Write:
    """`~/energy`: total mechanical energy (J)."""
    return ReadingMessage(template(lambda marks: Float64(data=marks[0]), [1]), observables.ENERGY)


def energy_parts(effects: tuple[str, ...]) -> Write | None:
    """`~/energy_stamped`: position = total and kinetic energy, and the part of each effect (J)."""
    return _joint_state(observables.energy_names(effects), observables.ENERGY_PARTS)


def work(accounts: tuple[str, ...]) -> Write | None:
    """`~/work`: position = what each effect has given to the motion since the start (J)."""
    return _joint_state(accounts, observables.WORK)


def clock(model: Model) -> Write:
    """`/clock`: the simulated time."""
    return ReadingMessage(template(lambda marks: Clock(clock=STAMP), []))
