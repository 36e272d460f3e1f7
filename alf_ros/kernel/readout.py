"""Readings of an instant in one call: the passes of a sample, each where somebody reads it.

A `Sample` has the same numbers, to the last bit: the same functions, in the same order. An
instant whose accelerations are limits, in or near a singular position, is left to the sample.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.applied_forces import add_friction, applied_forces, potential_energy
from alf_ros.kernel.augmented_solve import accelerate, restore_reactions
from alf_ros.kernel.ball_angles import ball_angles
from alf_ros.kernel.constraints import times_jacobian, violation
from alf_ros.kernel.data import HeldForces, Phase, Problem, ReadOut
from alf_ros.kernel.inverse_trace import mass_trace
from alf_ros.kernel.joint_coordinates import counted_angles, joint_coordinates
from alf_ros.kernel.joint_efforts import add_joint_efforts
from alf_ros.kernel.joint_wrenches import joint_wrenches, place_on_cut
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, ZERO, compiled, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.slip import add_slips, begin_slips
from alf_ros.kernel.softest_modes import softest

# what is read; sums of these
STATE, JOINTS, REACTIONS, CONSTRAINTS, ENERGY, WORKS, DISTANCE = (1 << n for n in range(7))
POTENTIAL, SIGMA, RANK = range(3)  # places in `told`


@compiled
def read_out(
    problem: Problem,
    phase: Phase,
    held: HeldForces,
    out: ReadOut,
    t: float,
    wanted: int,
    rounds: int,
    tolerance: float,
) -> bool:
    """Write the `wanted` results of `phase` at t (s) into `out`.

    The distance to a singular position is read only with reactions or constraints; `rounds` and
    `tolerance` are for `softest`. False, with results undefined, if accelerations are limits,
    or cannot be computed.
    """
    unit, system, work = problem.unit, problem.system, problem.work
    q, qd, near = phase.q, phase.qd, out.near
    rows = system.rows
    counted_angles(unit, system.angles, q, qd, phase.turns, out.angles, out.spins, near)
    if wanted & STATE:
        _write_state(problem, phase, out)
    if wanted & WORKS:
        copy(phase.works, out.work)
    if wanted & JOINTS:
        angles, spins = out.angles, out.spins
        joint_coordinates(unit, out.joints, q, qd, angles, spins, out.position, out.velocity)
        ball_angles(unit, out.balls, q, qd, out.joints.place.size, out.position, out.velocity)
    if wanted & ENERGY:
        zero(out.momenta)
        add_mass_times(unit, system.mass, 1.0, qd, out.momenta)
        effects = problem.forces.effects
        out.told[POTENTIAL] = potential_energy(effects, t, q, near)
    loaded = held.axis_loads.size > ZERO
    if wanted & (REACTIONS | CONSTRAINTS) or (wanted & JOINTS and loaded):
        copy(q, work.q)
        copy(qd, work.qd)
        copy(near, work.near)
        if not linearise(unit, system, work, work.q):
            return False
        restore_reactions(problem.forces.bearings, phase.loads)
        count, sigma = accelerate(problem, t, True)
        if count < 0 or sigma < system.close * system.ordinary:
            return False
    acts_on_axes = held.axes.coordinate.size > ZERO
    if wanted & REACTIONS or (wanted & JOINTS and acts_on_axes):
        place_on_cut(unit, out.cut, out.there, q, qd)
    if wanted & JOINTS:
        copy(held.efforts, out.effort)
        if acts_on_axes:
            for n in each(0, held.axis_loads.size):
                out.axis_load[n] = problem.forces.bearings.loads[held.axis_loads[n]]
            add_joint_efforts(
                unit,
                held.axes,
                held.on_axes,
                out.there,
                t,
                near,
                out.axis_load,
                out.effort,
            )
    if wanted & REACTIONS:
        _write_reactions(problem, held, out, t)
    if wanted & CONSTRAINTS:
        violation(unit, rows, q, out.phi)
        begin_slips(unit, system, work, phase)
        add_slips(unit, system, work, q, out.phi)
        times_jacobian(unit, rows, work.g, work.g2, work.qd, out.rate)
        for n in each(0, out.row.size):
            r = out.row[n]
            out.violation[n] = out.phi[r]
            out.violation_rate[n] = out.rate[r]
            out.multiplier[n] = work.y[r]
    if wanted & DISTANCE:
        _find_distance(problem, out, rounds, tolerance)
    return True


@inner
def _write_state(problem: Problem, phase: Phase, out: ReadOut) -> None:
    """The numbers of the state and their rates, in the order of `state_vector`."""
    D = np.uint64(len(problem.unit))
    number, rate = out.number, out.number_rate
    at = ZERO
    for n in each(0, out.coordinate.size):
        of = out.coordinate[n] * D
        for a in range(D):
            number[at], rate[at] = phase.q[of + a], phase.qd[of + a]
            at += ONE
    for n in each(0, phase.turns.size):
        number[at] = phase.turns[n]
        at += ONE
    number[at] = phase.pace[0]
    at += ONE
    for n in each(0, phase.works.size):
        number[at] = phase.works[n]
        at += ONE
    for n in each(0, phase.loads.size):
        number[at] = phase.loads[n]
        at += ONE
    for n in each(0, phase.sums.size):
        number[at] = phase.sums[n]
        at += ONE
    number[at] = phase.step[0]


@inner
def _write_reactions(problem: Problem, held: HeldForces, out: ReadOut, t: float) -> None:
    """Force and torque of each joint, each three numbers; zero out of the plane."""
    unit, there, loads = problem.unit, out.there, problem.forces.bearings.loads
    applied_forces(held.on_cut, t, there.q, there.qd, out.near, there.Q)
    if loads.size > ZERO:
        add_friction(held.on_cut, t, there.q, there.qd, out.near, loads, there.Q)
    joint_wrenches(unit, out.cut, there, problem.work, out.force, out.torque)
    force, torque, wrench = out.force, out.torque, out.wrench
    for n in each(0, out.cut.first.size - ONE):
        to = n * (THREE + THREE)
        if np.uint64(len(unit)) == THREE:
            for a in range(THREE):
                wrench[to + a] = force[n * THREE + a]
                wrench[to + THREE + a] = torque[n * THREE + a]
        else:
            wrench[to] = force[n * TWO]
            wrench[to + ONE] = force[n * TWO + ONE]
            wrench[to + THREE + TWO] = torque[n]


@inner
def _find_distance(problem: Problem, out: ReadOut, rounds: int, tolerance: float) -> None:
    """σ of the softest mode, from the beginning of the iteration; and the rank, if rows depend on
    others. Where modes are so soft that this does not tell, `softest_modes.found` does."""
    unit, system, work, modes = problem.unit, problem.system, problem.work, out.modes
    copy(out.mode_start, modes.z)
    zero(modes.s2)
    softest(unit, system, work, modes, rounds, tolerance)
    out.told[SIGMA] = modes.sigma[0]
    if modes.redundant > ZERO:
        pattern, n = system.pattern, work.p.size
        inverse, off = out.inverse, out.inverse_off
        lost = mass_trace(unit, pattern, work.diagonal, work.off, work.column, inverse, off)
        out.told[RANK] = n - lost
