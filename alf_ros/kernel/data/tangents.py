"""Tangents: the derivatives of a motion by parameters, which follow its steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats, Integers, Unit
from alf_ros.kernel.data.problem import Problem
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class Tangents(Struct):
    """How the numbers of a problem change with each of K parameters, and a workspace.

    Arrays (K, …) hold one parameter after another, per unit of the parameter. The derivatives of
    q and q̇ themselves are a part of the state: `Phase.tangents`.
    """

    addresses = ('force',)

    unit: Unit
    problem: Problem  # of the run, with a workspace of its own and without a ledger
    count: np.uint64  # K
    force: Addresses  # (effects,) of the forces for dual numbers
    mass_changes: Integers  # (K,) whether M depends on the parameter
    mass_diagonal: Floats  # (K, movable) of `Mass`
    mass_k: Floats  # (K, pairs)
    mass_w: Floats  # (K, skew pairs)
    rows_change: Integers  # (K,) whether Φ or N depends on the parameter, or a fixed block does
    length2: Floats  # (K, distance rows) of `Rows`
    b: Floats  # (K, entries D)
    term: Floats  # (K, terms D D)
    c: Floats  # (K, quadratic rows)
    params: Floats  # (K, params) of `Effects`
    start: Floats  # (K, 2, movable D) δq and δq̇ where the step begins, in the axes of the arcs
    rates: Floats  # (K, stages, 2, movable D) their rates in the stages
    q: Floats  # (K, all blocks D) δq of the stage
    qd: Floats  # (K, all blocks D) δq̇
    qdd: Floats  # (K, all blocks D) δq̈
    begun_q: Floats  # (K, all blocks D) δq and δq̇ of a stage before it is interpolated
    begun_qd: Floats  # (K, all blocks D)
    pushed: Floats  # (K, all blocks D) δQ of that stage
    good: Floats  # (K, 2, all blocks D) at the last point of the grid
    lam: Floats  # (rows,) -λ of the stage
    dq: Floats  # (all blocks D,) of one parameter
    dqd: Floats  # (all blocks D,)
    x: Floats  # (all blocks D,) what is solved for
    f: Floats  # (all blocks D,) its right-hand side
    Q: Floats  # (all blocks D,) forces beside their derivatives
    g: Floats  # (distance rows D,) δΦ_q
    g2: Floats  # (entries D,)
    g2v: Floats  # (entries D,) of δΦ̇_q
