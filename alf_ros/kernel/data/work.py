"""Arrays that a step writes: its workspace, allocated once by the caller."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.kernel.data.motion import Watch
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class Chart(Struct):
    """The coordinates of a step, ξ = (a, c, e) of each block; see `arc_coordinates`."""

    counted = ('arcs',)

    arcs: Integers  # (1,) 1 if a block has one
    curvature: Floats  # (movable,) κ, 1/m; 0: they are places
    radius: Floats  # (movable,) 1/κ, m, of those with an arc
    t: Floats  # (movable D,) tangent where the step begins
    n: Floats  # (movable D,) normal
    b: Floats  # (movable D,) t × n; (0,) in the plane
    rate: Floats  # (movable D,) ξ̇ where the step begins, m/s
    momentum: Floats  # (movable D,) w there, kg m/s
    rest: Floats  # (movable D,) of p there, that rounding loses in w
    w: Floats  # (movable D,) of the stage unfolded last
    first: Floats  # (all blocks D,) q̈ there, m/s²
    sin: Floats  # (movable,) of κa, where it was unfolded last
    cos: Floats  # (movable,)
    rho: Floats  # (movable,) 1 - κc
    per_rho: Floats  # (movable,) 1/(1 - κc): to divide takes long


@dataclass(frozen=True, eq=False)
class StepEnd(Struct):
    """Where a step has ended, while the motion in it is searched for kinks; see `grazed_kinks`."""

    q: Floats  # (all blocks D,) m
    qd: Floats  # (all blocks D,) m/s
    xi: Floats  # (movable D,) ξ, from the begin of the step
    xid: Floats  # (movable D,) ξ̇
    sin: Floats  # (movable,) of the arcs, as `Chart` has them
    cos: Floats  # (movable,)
    rho: Floats  # (movable,)


@dataclass(frozen=True, eq=False)
class Trail(Struct):
    """States at the ends of N steps of a run; empty where nobody asks for them."""

    common = True

    steps: Integers  # (N,) numbers of the steps, ascending
    count: Integers  # (1,) how many are written down
    q: Floats  # (N, all blocks D) m
    qd: Floats  # (N, all blocks D) m/s
    turns: Integers  # (N, angles)
    tangents: Floats  # (N, K, 2, all blocks D)


@dataclass(frozen=True, eq=False)
class Work(Struct):
    """Workspace of the kernel: allocated once by the caller."""

    addresses = borrowed = 'caller', 'follow', 'companion', 'divider'

    pulse: Integers  # (3,) see `stopping`: stages and rounds left, given; whether to stop
    caller: Addresses  # (4,) the Python object that is asked then, or 0; and what it raised
    evaluations: Integers  # (1,) stages evaluated so far: how often q̈ was
    rounded: Integers  # (1,) steps taken although rounding kept their error above the tolerance
    judged: Floats  # (8,) errors of fixed steps so far, see `step_error`
    diagonal: Floats  # (movable D D,) factor: unit lower triangles, reciprocal pivots between
    off: Floats  # (blocks D D,) factor
    inverse_det: Floats  # (4,) 1 / det A = c exp(d): c, d where the step began and where it ends
    inverse: Floats  # (movable D D,) A⁻¹ on the pattern, where the rank is counted
    inverse_off: Floats  # (blocks D D,)
    column: Floats  # (longest column D D,) one column before division by the pivots
    sigma: Floats  # (rows,) σ of the stage, or of the end of the step
    g: Floats  # (distance rows D,) q_i - q_j
    g2: Floats  # (entries D,) gradients of the quadratic rows
    g2d: Floats  # (entries D,) their time derivatives
    gf: Floats  # (distance rows D,) q_i - q_j where A was factorised
    g2f: Floats  # (entries D,)
    q: Floats  # (all blocks D,) stage
    qd: Floats  # (all blocks D,)
    qdd: Floats  # (all blocks D,)
    p: Floats  # (movable D,) momenta p'
    Q: Floats  # (all blocks D,)
    delta: Floats  # (all blocks D,) right-hand side, then solution
    r2: Floats  # (rows,)
    y: Floats  # (rows,) σ' or λ
    z: Floats  # (rows,) rows that conjugate residuals combine
    w: Floats  # (rows,) Φ_q A⁻¹ Φ_qᵀ z
    search: Floats  # (movable D + 2 rows,) see `augmented_solve.search_of`
    shift: Floats  # (all blocks D,) of the stage onto Φ = 0
    k: Floats  # (stages, 3, movable D) rates of the stages: ξ̇, ξ̈, and ẇ if there are arcs; of an
    # implicit method q̇ and q̈
    total: Floats  # (3, movable D) weighted sum of the rates of stages
    pull: Floats  # (all blocks D,) q̈ where the step began
    along: Floats  # (all blocks D,) direction of the branch at a singular position
    bend: Floats  # (all blocks D,) q̈ of the unforced mechanism: the curvature of its path
    target: Floats  # (all blocks D,) a stage of the method, before it is put on Φ = 0
    base: Floats  # (all blocks D,) copy of that stage, while places around it are evaluated
    before_q: Floats  # (movable D,) contribution of earlier stages to q, of an implicit method
    before_qd: Floats  # (movable D,)
    places: Floats  # (8, 2, movable D) q and q̇ of the places that a stage is interpolated from
    curve: Floats  # (movable D,) second derivative of the branch there, m/s²
    given: Floats  # (all blocks D,) Q at that stage
    nearest: Floats  # (1,) x of the stage nearest to a singular position; inf: none is near
    crossing: Floats  # (4,) m, see `interpolated_stages`: most that was passed, and that is not;
    # the longest way of a step beside a singular position, and of one that leapt over it
    trend: Floats  # (2,) of the last step: det A at its end over det A where it began; its way, m
    sides: Floats  # (2,) `applied_forces.sides` where the step began, NaN: not yet known; and 1 if
    # it was another number at a stage, else 0
    place_step: Floats  # (1,) s between two support positions, for prescribed motions; 0 from rest
    place_shift: Floats  # (1,) from the stage to the middle of the support positions, in spacings
    place_weights: Floats  # (8,) of the support positions in the interpolation
    place_x: Floats  # (8,) distances x of the support positions
    aside: Integers  # (2,) whether the end of the step is interpolated, and a rank lost there
    sum: Floats  # (movable D,) q̈ interpolated from those places; also other sums
    sum_q: Floats  # (movable D,) q interpolated from those places
    sum_qd: Floats  # (movable D,) q̇
    good_q: Floats  # (all blocks D,) the last point of the grid that an adaptive method reached
    good_qd: Floats  # (all blocks D,)
    good_turns: Integers  # (angles,)
    good_within: Floats  # (1,)
    good_tangents: Floats  # (K, 2, all blocks D) of the phase, where tangents follow; else (0,)
    chart: Chart
    ended: StepEnd
    angle: Floats  # (angles, 2) x, y of each
    angle_before: Floats  # (angles, 2) where the step began, or at an earlier step: since then no
    # (x, y) has crossed the x axis
    near: Floats  # (angles,) rad, turns counted: where the step began, to a quarter turn
    begun: Floats  # (angles of integrals,) rad, turns counted: where the step began
    measured: Floats  # (angles of integrals, 2) remainder, rad, and turns, as measured last
    sums: Floats  # (integrals,) m, their values
    trail: Trail
    interval: Floats  # (3,) s: begin, end and length of the step
    companion: Addresses  # (2,) code and struct of what accompanies the steps; else (0,)
    divider: Addresses  # (3,) the function that finds kinks that steps cross; the number of the
    # kind of effects whose force jumps there, and 1 if it jumps over time; else (0,)
    follow: Addresses  # (1,) the function that follows the modes of a watched run; else (0,)
    watch: Watch
