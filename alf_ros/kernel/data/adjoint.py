"""The adjoint of a run: its steps, kept to be taken back, and what a number of its motion changes
by with each array of the problem."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Addresses, Floats, Integers, Unit
from alf_ros.kernel.data.force_trace import ForceTrace
from alf_ros.kernel.data.motion import Phase
from alf_ros.kernel.data.tangents import Tangents
from alf_ros.kernel.numba_ext.structs import Lanes, Struct


@dataclass(frozen=True, eq=False)
class StepRecord(Struct):
    """Accepted steps, each with the states where it began and ended; at most C of them. Of a step
    without a stage beside a singular position the stages are kept too; of an implicit method only
    their rates, v and k of the movable blocks."""

    count: Integers  # (1,) steps taken, also those that did not fit
    q: Floats  # (C, all blocks D) where the step began
    qd: Floats  # (C, all blocks D)
    turns: Integers  # (C, angles)
    sums: Floats  # (C, integrals)
    span: Floats  # (C, 4) s: begin, end, length; σ as of `step`
    ended_q: Floats  # (C, all blocks D)
    ended_qd: Floats  # (C, all blocks D)
    regular: Integers  # (C,) whether the stages are kept
    stage_q: Floats  # (C, stages, all blocks D)
    stage_qd: Floats  # (C, stages, all blocks D)
    stage_qdd: Floats  # (C, stages, all blocks D)
    stage_lam: Floats  # (C, stages, rows) -λ
    sin: Floats  # (C, stages + 1, movable) of `Chart`, as are the following; the last of the end
    cos: Floats  # (C, stages + 1, movable)
    xid: Floats  # (C, stages, movable D) ξ̇ of the stages
    # in the plane also ẇ, and ξ, w and σ, the last of the end; (0,) in space
    wd: Floats  # (C, stages, movable D)
    xi: Floats  # (C, stages + 1, movable D)
    w: Floats  # (C, stages + 1, movable D)
    sigma: Floats  # (C, stages + 1, rows)
    curvature: Floats  # (C, movable)
    t: Floats  # (C, movable D)
    n: Floats  # (C, movable D)
    b: Floats  # (C, movable D); (0,) in the plane
    followed: Integers  # (2,) whether stage 0, and all others so far, are kept of the step
    lam: Floats  # (rows,) -λ of stage 0


@dataclass(frozen=True, eq=False)
class Tape(Struct):
    """The stages of one step, as tangents are carried through them."""

    kind: Integers  # (stages,) how its tangents are computed, see `tangent_step`
    q: Floats  # (stages, all blocks D)
    qd: Floats  # (stages, all blocks D)
    qdd: Floats  # (stages, all blocks D)
    lam: Floats  # (stages, rows) -λ
    sin: Floats  # (stages + 1, movable) of κa; the last of the end
    cos: Floats  # (stages + 1, movable)
    xi: Floats  # (stages + 1, movable D) ξ, w and σ, of steps with arcs in the plane
    w: Floats  # (stages + 1, movable D)
    sigma: Floats  # (stages + 1, rows)
    places: Floats  # (stages, 8, 2, movable D) of `Work`, as are the following
    place_weights: Floats  # (stages, 8)
    place_step: Floats  # (stages,)
    place_shift: Floats  # (stages,)
    sum_q: Floats  # (stages, movable D)
    sum_qd: Floats  # (stages, movable D)
    given: Floats  # (stages, all blocks D)
    projected: Integers  # (1,) whether the end of the step is projected


@dataclass(frozen=True, eq=False)
class ForceColumns(Struct):
    """Directions in which the force of an effect is differentiated at once, one in each lane: the
    first ones are along numbers of q and q̇, and then, for each effect, along its own numbers."""

    addresses = ('force',)

    force: Addresses  # (effects,) for dual numbers in lanes; (0,): forces are traced instead
    number: Integers  # (columns of the state,) the number of q, or of q̇ behind it, of each
    dq: Lanes  # (all blocks D,) m
    dqd: Lanes  # (all blocks D,) m/s
    dparams: Lanes  # (params,)
    Q: Floats  # (all blocks D,) forces beside their derivatives
    dQ: Lanes  # (all blocks D,) of one effect
    own: Lanes  # (effects,) ∂J/∂ the numbers of each effect, summed up over all stages
    sum: Lanes  # (1,) ∂J/∂ the numbers of the state, in a stage


@dataclass(frozen=True, eq=False)
class Adjoint(Struct):
    """Derivatives of a number J of a motion: by the state, and by the arrays of the problem.

    Fields with the names of arrays of the problem are ∂J/∂ that array, summed up over the steps.
    """

    unit: Unit
    tangents: Tangents  # of no parameter: problem and workspace
    phase: Phase  # where a step began
    record: StepRecord
    tape: Tape
    at: Integers  # (1,) the step that is taken back
    columns: ForceColumns  # of small mechanisms
    trace: ForceTrace  # of all others
    bar_q: Floats  # (all blocks D,) ∂J/∂q of the state; of fixed blocks the sum over all stages
    bar_qd: Floats  # (all blocks D,) ∂J/∂q̇
    mass_diagonal: Floats  # (movable,) of `Mass`
    mass_k: Floats  # (pairs,)
    mass_w: Floats  # (skew pairs,)
    length2: Floats  # (distance rows,) of `Rows`
    b: Floats  # (entries D,)
    term: Floats  # (terms D D,)
    c: Floats  # (quadratic rows,)
    drive: Floats  # (numbers,) of the motions of drives
    drive_seeds: Lanes  # (groups of numbers, numbers) 1 for the number of a lane
    drive_q: Lanes  # (all blocks D,) of the prescribed blocks
    drive_qd: Lanes  # (all blocks D,)
    drive_qdd: Lanes  # (all blocks D,)
    terms_count: Integers  # whether ∂J/∂`term` is wanted
    # ∂J/∂ of the numbers of the trace: q and q̇ of the stage, `Effects.params` summed up over all
    # stages, and the operations
    of_trace: Floats
    start: Floats  # (2, movable D) of what a step adds up, where it begins
    rates: Floats  # (stages, 2, movable D) of their rates in the stages
    first_q: Floats  # (all blocks D,) of δq and δq̇ where a step with arcs in the plane begins
    first_qd: Floats  # (all blocks D,)
    xi: Floats  # (2, movable D) of δξ and δw of its stage
    axes: Floats  # (movable, 2, D) of δt and δn of its arcs
    bend: Floats  # (movable,) of δκ
    q: Floats  # (all blocks D,) of δq of the stage
    qd: Floats  # (all blocks D,) of δq̇
    qdd: Floats  # (all blocks D,) of δq̈
    whole_q: Floats  # (all blocks D,) of an interpolated stage; of an implicit one for its solve
    whole_qd: Floats  # (all blocks D,)
    whole_qdd: Floats  # (all blocks D,)
    begun_q: Floats  # (all blocks D,) of δq and δq̇ before it is interpolated, or without δk
    begun_qd: Floats  # (all blocks D,)
    pushed: Floats  # (all blocks D,) of δQ of that stage
    u: Floats  # (all blocks D,) of the forces of a solve
    f: Floats  # (all blocks D,) right-hand side of a solve
    g: Floats  # (distance rows D,) of δΦ_q
    g2: Floats  # (entries D,)
    g2v: Floats  # (entries D,) of δΦ̇_q
    x: Floats  # (all blocks D,)
    ended: Floats  # (rows,) σ where a step ended that is taken again: 0, as it has no arcs
    search: Floats  # (2, DIRECTIONS, all blocks D) of a stage, if implicit
