"""Data of inverse dynamics: a motion in instants, and the efforts of actuators that it needs."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Floats, Integers, Unit
from alf_ros.kernel.data.forces import Effects
from alf_ros.kernel.data.problem import Problem
from alf_ros.kernel.data.readings import JointCoordinates
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class Actuation(Struct):
    """A motion of T instants, a actuators, and what the kernel finds about them."""

    unit: Unit
    problem: Problem  # with a workspace of its own
    actuators: Effects  # (a,) each with an effort of 1
    joints: JointCoordinates
    t: Floats  # (T,) s
    q: Floats  # (T, blocks D) m
    qd: Floats  # (T, blocks D) m/s
    qdd: Floats  # (T, blocks D) m/s²
    turns: Integers  # (T, angles)
    loads: Floats  # (T, loads) N, on which friction depends
    efforts: Floats  # (T, a) N or N m; NaN where the normal equations are too badly conditioned
    left: Floats  # (T,) √kg m/s², size of what they leave of f, in the metric of M
    whole: Floats  # (T,) √kg m/s², sizes of M q̈, Q and the effort of each actuator, added up
    rank: Floats  # (T,) of Φ_q, not rounded; NaN without a factor
    missing: Floats  # (T, joint coordinates) accelerations that they leave, rad/s² or m/s²
    gram: Floats  # (T, a, a) Bᵀ P B, if asked for
    pull: Floats  # (T, a) Bᵀ P f, if asked for
    alone: Floats  # (T, a) 1/kg, what `gram` would be about without rows
    B: Floats  # (a, blocks D) force of a unit of each actuator
    X: Floats  # (a, blocks D) P B, nearly
    f: Floats  # (blocks D,) right-hand side
    x: Floats  # (blocks D,) P f
    G: Floats  # (a, a) the normal equations of an instant, then their factor
    c: Floats  # (a,)
    u: Floats  # (a,)
    Z: Floats  # as `Work.diagonal`
    Zo: Floats  # as `Work.off`
    turned: Integers  # (angles,) turns of an instant
    angles: Floats  # (angles,) rad
    spins: Floats  # (angles,) rad/s
    values: Floats  # (joint coordinates,)
    speeds: Floats  # (joint coordinates,)
