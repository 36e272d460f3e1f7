"""Tangents: the derivatives of a motion by parameters, which follow its steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats, Integers, Unit
from alf_ros.kernel.data.problem import Problem
from alf_ros.kernel.data.work import Work
from alf_ros.kernel.numba_ext.structs import Lanes, Struct

DIRECTIONS = 24  # of δk in a stage of an implicit method, until they are begun anew


@dataclass(frozen=True, eq=False)
class FollowedStage(Struct):
    """A stage as its tangents read it, and the numbers of a solve for a group of parameters.

    Arrays of single numbers belong to the workspace.
    """

    work: Work
    diagonal: Floats
    off: Floats
    g: Floats
    g2: Floats
    gf: Floats
    g2f: Floats
    delta: Lanes  # (all blocks D,) right-hand side, then solution
    r2: Lanes  # (rows,)
    y: Lanes  # (rows,)


@dataclass(frozen=True, eq=False)
class Tangents(Struct):
    """How the numbers of a problem change with each of K parameters, and a workspace.

    Parameters are taken W at a time, as many as one register holds or two. `Lanes` are numbers of
    such a group, per unit of each parameter. Arrays (groups, …) hold one group after another. The
    derivatives of q and q̇ themselves are a part of the state: `Phase.tangents`.
    """

    addresses = ('force', 'drive')

    unit: Unit
    problem: Problem  # of the run, with a workspace of its own and without a ledger
    count: np.uint64  # K
    groups: np.uint64
    force: Addresses  # (effects,) of the forces for dual numbers in lanes
    mass_changes: Integers  # (groups,) whether M depends on one of the parameters
    mass_diagonal: Lanes  # (groups, movable) of `Mass`
    mass_k: Lanes  # (groups, pairs)
    mass_w: Lanes  # (groups, skew pairs)
    rows_change: Integers  # (groups,) whether Φ or N depends on one, or a fixed block does
    length2: Lanes  # (groups, distance rows) of `Rows`
    b: Lanes  # (groups, entries D)
    term: Lanes  # (groups, terms D D)
    c: Lanes  # (groups, quadratic rows)
    params: Lanes  # (groups, params) of `Effects`
    drive: Addresses  # (1,) of the motions for dual numbers in lanes; (0,) if none changes
    drive_slots: Integers  # (…,) of the motions, as of `Prescribed`
    drive_params: Floats  # (numbers,)
    drive_changes: Lanes  # (groups, numbers)
    drive_registers: Floats  # (instructions 3,)
    drive_slopes: Lanes  # (instructions 3,)
    drive_qdd: Lanes  # (groups, all blocks D) δs̈ of the stage
    here: FollowedStage  # of the run, as the step leaves it
    behind: FollowedStage  # of `problem`, where a step is taken again
    along: Integers  # (1,) whether a step adds up δξ and δw along its arcs, see `tangent_arcs`
    followed: Integers  # (2,) whether stage 0, and all others so far, were followed in the step
    first_q: Lanes  # (groups, all blocks D) δq where the step begins
    first_qd: Lanes  # (groups, all blocks D) δq̇
    first_qdd: Lanes  # (groups, all blocks D) δq̈
    start: Lanes  # (groups, 2, movable D) what a step adds up, there: δq and δq̇, or δξ and δw
    rates: Lanes  # (groups, stages, 2, movable D) their rates in the stages
    xi: Lanes  # (groups, 2, movable D) the same of the stage
    axes: Lanes  # (groups, movable, 2, D) δt and δn of the arcs
    bend: Lanes  # (groups, movable) δκ
    q: Lanes  # (groups, all blocks D) δq of the stage
    qd: Lanes  # (groups, all blocks D) δq̇
    qdd: Lanes  # (groups, all blocks D) δq̈
    begun_q: Lanes  # (groups, all blocks D) δq and δq̇ before it is interpolated
    begun_qd: Lanes  # (groups, all blocks D)
    whole_q: Lanes  # (groups, all blocks D) of an interpolated stage
    whole_qd: Lanes  # (groups, all blocks D)
    whole_qdd: Lanes  # (groups, all blocks D)
    pushed: Lanes  # (groups, all blocks D) δQ of that stage
    place: Floats  # (movable D,) ξ of the stage
    lam: Floats  # (rows,) -λ of the stage
    even: Floats  # (terms,) c of the terms T = c I of `Rows`; NaN of others
    g2d: Floats  # (entries D,) Φ̇_q of the quadratic rows of the stage
    term_qd: Floats  # (terms D,) Tᵀ q̇ of the block of its entry
    term_qdd: Floats  # (terms D,) Tᵀ q̈
    search: Lanes  # (2, DIRECTIONS, all blocks D) of δk and to what they are mapped, if implicit
    kept: Lanes  # (1,) of a residual of δk, the most that a pass of the step left
    f: Lanes  # (all blocks D,) right-hand side of a solve
    Q: Floats  # (all blocks D,) forces beside their derivatives
    lane_f: Floats  # (all blocks D,) right-hand side of a lane that is solved by itself
    lane_x: Floats  # (all blocks D,) its solution
