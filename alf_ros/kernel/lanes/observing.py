"""Numbers of many members in one call: joint coordinates, coordinates, and their rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats, Indices
from alf_ros.kernel.data import JointCoordinates, Phase, Problem
from alf_ros.kernel.joint_coordinates import counted_angles, joint_coordinates
from alf_ros.kernel.numba_ext.jit import ZERO, compiled
from alf_ros.kernel.numba_ext.lane_structs import struct_at
from alf_ros.kernel.numba_ext.structs import Struct

JOINT, JOINT_RATE, PLACE, VELOCITY = np.uint64(0), np.uint64(1), np.uint64(2), np.uint64(3)


@dataclass(frozen=True, eq=False)
class Observing(Struct):
    """The numbers that are read of each member, and where members and numbers stand."""

    addresses = ('problem', 'phase', 'joints')

    problem: Addresses  # (members,) of its Problem
    phase: Addresses  # (members,) of its Phase
    joints: Addresses  # (members,) of its JointCoordinates
    kind: Indices  # (numbers,) JOINT, …
    which: Indices  # (numbers,) joint coordinate, or coordinate
    angles: Floats  # (angles,) rad, of one member
    spins: Floats  # (angles,) rad/s
    near: Floats  # (angles,) rad
    values: Floats  # (joint coordinates,)
    rates: Floats  # (joint coordinates,)
    numbers: Floats  # (members, numbers)


@compiled
def observe(of: Problem, of_phase: Phase, joints: JointCoordinates, what: Observing) -> None:
    """Read the numbers of all members. `of`, `of_phase`, `joints`: of any member."""
    unit, count = of.unit, what.kind.size
    for m in range(ZERO, np.uint64(what.problem.size)):
        system = struct_at(of, what.problem[m]).system
        phase = struct_at(of_phase, what.phase[m])
        own = struct_at(joints, what.joints[m])
        q, qd, angles, spins = phase.q, phase.qd, what.angles, what.spins
        counted_angles(unit, system.angles, q, qd, phase.turns, angles, spins, what.near)
        joint_coordinates(unit, own, q, qd, angles, spins, what.values, what.rates)
        for n in range(ZERO, np.uint64(count)):
            i, kind = what.which[n], what.kind[n]
            if kind == JOINT:
                number = what.values[i]
            elif kind == JOINT_RATE:
                number = what.rates[i]
            else:
                number = q[i] if kind == PLACE else qd[i]
            what.numbers[m * count + n] = number
