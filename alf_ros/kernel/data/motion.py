"""State and method of a run, and the known modes of Φ_q along it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class Method(Struct):
    """A Runge-Kutta method (a, b, c), and how its solves end."""

    constant = common = True

    a: Floats  # (stages, stages)
    b: Floats  # (stages,)
    c: Floats  # (stages,)
    lag: Floats  # (stages,) how far a stage is behind the path, in h² of its curvature
    embedded: Floats  # (2, stages) weights of the embedded errors of order 5 and 3, or (0,); of an
    # implicit method (stages,)
    estimate: Floats  # (2, stages) weights by which `step_error` judges fixed steps, or (0,)
    sharp: float  # part of h q̈ that an error exceeds where an acceleration is not resolved
    lasting: float  # the ratio of both estimates above which errors do not outlast their step
    caution: float  # by how much the estimate of `step_error` may be too small
    impact: Floats  # (2,) c and p: a step of ω h loses c (ω h)^p of what a stop changes of q̇
    guess: Floats  # (stages, stages) q̈ of a stage extrapolated from those before; explicit: (0,)
    iterations: np.uint64  # at most, in one solve
    tolerance: float  # relative error of a step, of an adaptive method


@dataclass(frozen=True, eq=False)
class Phase(Struct):
    """State of the mechanism, where a step begins and where it ends."""

    counted = ('turns',)

    q: Floats  # (all blocks D,) m
    qd: Floats  # (all blocks D,) m/s
    turns: Integers  # (angles,) passages of (x, y) over the negative x axis
    pace: Floats  # (1,) the next step of an adaptive method, s
    works: Floats  # (accounts,) J, done so far; none without a ledger
    # (loads D + 1,) R (N) that friction depends on, as found last, and the sense of that balance,
    # 1 or -1; zero where nothing is known
    loads: Floats = field(default_factory=lambda: np.zeros(0))
    # (1,) 1 in a singular position, where solves may not show a lost rank, else 0; NaN: unknown
    within: Floats = field(default_factory=lambda: np.zeros(1))
    # (1,) the number of steps taken: it changes together with the state
    step: Integers = field(default_factory=lambda: np.zeros(1, dtype=np.int64))
    # (integrals,) m, of the sums that rows of velocities keep constant
    sums: Floats = field(default_factory=lambda: np.zeros(0))
    # (K, 2, all blocks D) derivatives of q and q̇ by each of K parameters, per unit of it
    tangents: Floats = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class Modes(Struct):
    """The softest modes of Φ_q at a position: the modes of its least singular values. See
    `softest`.

    Rows are scaled by α^½, so that the singular values are s, with s² = penalty σ².
    """

    root: Floats  # (rows,) α^½
    penalty: float
    redundant: np.uint64  # rows that depend on the others at ordinary positions
    s2: Floats  # (modes,) s², ascending
    sigma: Floats  # (modes,) σ
    error: Floats  # (modes,) by which σ may be off
    z: Floats  # (modes, rows) left singular vectors, of length one
    v: Floats  # (modes, all blocks D) A⁻¹ Φ_qᵀ α^½ y with z = y - w: along the right ones
    w: Floats  # (modes, rows) α^½ Φ_q v, which is s² z
    gram: Floats  # (modes, modes)
    fresh: Floats  # (rows,) a combination of all rows, in which every mode takes part
    x: Floats  # (rows,)
    g: Floats  # (distance rows D,) Φ_q at that position
    g2: Floats  # (entries D,)
    gb: Floats  # (distance rows D,) and at the one before
    g2b: Floats  # (entries D,)


@dataclass(frozen=True, eq=False)
class Watch(Struct):
    """Data of the singularity monitor, stored from step to step; empty where nobody watches."""

    common = True

    modes: Modes  # where the last step ended
    quiet: Integers  # (1,) 1 if that step alone shows that no mode vanished in it
    look: Integers  # (1,) 1 if a pass in it is not excluded
    t: Floats  # (2,) s, when it began and ended
    rate: Floats  # (1,) 1/s, how fast the rows turned when it ended
    before: Phase  # where it began
    after: Phase  # where it ended
    g2d: Floats  # (entries D,) Φ̇_q of the quadratic rows
