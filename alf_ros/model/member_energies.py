"""Energies of many members in one call: what a sample's energy is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats
from alf_ros.kernel import (
    Phase,
    Problem,
    add_mass_times,
    counted_angles,
    potential_energy,
)
from alf_ros.kernel.numba_ext.jit import ZERO, compiled
from alf_ros.kernel.numba_ext.lane_structs import struct_at
from alf_ros.kernel.numba_ext.structs import Struct
from alf_ros.kernel.numba_ext.vectors import zero


@dataclass(frozen=True, eq=False)
class MemberEnergies(Struct):
    """Momenta and stored energies, and where members stand."""

    addresses = ('problem', 'phase')

    problem: Addresses  # (members,) of its Problem
    phase: Addresses  # (members,) of its Phase
    momenta: Floats  # (members, movable D) M q̇, kg m/s
    stored: Floats  # (members,) J
    one: Floats  # (movable D,) momenta of one member
    angles: Floats  # (angles,) rad, of one member
    spins: Floats  # (angles,) rad/s
    near: Floats  # (angles,) rad


@compiled
def observe_energies(of: Problem, of_phase: Phase, t: float, what: MemberEnergies) -> None:
    """Read the energies of all members at t (s). `of`, `of_phase`: of any member."""
    unit, n = of.unit, np.uint64(what.one.size)
    for m in range(ZERO, np.uint64(what.problem.size)):
        member = struct_at(of, what.problem[m])
        phase = struct_at(of_phase, what.phase[m])
        system, q, qd, near = member.system, phase.q, phase.qd, what.near
        counted_angles(unit, system.angles, q, qd, phase.turns, what.angles, what.spins, near)
        what.stored[m] = potential_energy(member.forces.effects, t, q, near)
        zero(what.one)
        add_mass_times(unit, system.mass, 1.0, qd, what.one)
        for i in range(ZERO, n):
            what.momenta[m * n + i] = what.one[i]
