"""What the kernel reads and writes.

Conventions. Vectors are flat, block i at [i D, (i + 1) D); D, 2 or 3, is the length of the tuple
`unit` and so a constant when compiled. Movable blocks come first, in elimination order; fixed and
prescribed blocks, for which A has no columns, follow. Rows: distance rows between movable blocks,
distance rows with a fixed end, quadratic rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Addresses, Floats, Indices, Integers
from alf_ros.kernel.numba_ext.structs import Struct

SOLVED = 1e-12  # relative change at which a solve is finished
EPS = float(np.finfo(np.float64).eps)
NOTHING = 1e-150  # speeds and accelerations below, SI: a square of it is still a number
ORIGIN, FREE = -1, -2  # in place of a block that others turn about


@dataclass(frozen=True, eq=False)
class Mass(Struct):
    """M: diagonal blocks k I and pairs of off-diagonal blocks k I + w J (w only in the plane)."""

    constant = True

    diagonal: Floats  # (movable blocks,) kg
    i: Indices  # (pairs,) row block, i > j
    j: Indices  # (pairs,)
    k: Floats  # (pairs,) kg
    skew: Indices  # (skew pairs,) pairs that have a w
    w: Floats  # (skew pairs,) kg


@dataclass(frozen=True, eq=False)
class Rows(Struct):
    """Φ(q): distance rows ½(|q_i - q_j|² - L²), then quadratic ones Σ ½(g + b)·q + c.

    Behind them the rows that bind velocities only, N(q, t) q̇ + B(q, t) = 0 (38): their entries are
    those of N, and they have no Φ. Wherever velocities are meant, N stands below Φ_q. Entries of
    prescribed blocks are what t does: Φ_t and B are their part of Φ_q q̇ and N q̇.
    """

    constant = True

    both: np.uint64  # number of distance rows whose two blocks move; they come first
    i: Indices  # (distance rows,) movable block
    j: Indices  # (distance rows,) the other block
    length2: Floats  # (distance rows,) L², m²
    first: Indices  # (other rows + 1,) entries of a row: first[r] .. first[r + 1]
    movable: Indices  # (other rows,) entries of movable blocks end here; fixed ones follow
    block: Indices  # (entries,)
    b: Floats  # (entries D,); the gradient is g = T q + b
    first_term: Indices  # (entries + 1,)
    term_block: Indices  # (terms,)
    term: Floats  # (terms D D,)
    c: Floats  # (quadratic rows,)
    alpha: Floats  # (rows,) penalty α of each row
    scale: Floats  # (rows,) 1 / |Φ_q,r| as drawn: scale Φ is a distance in metres

    @property
    def velocity(self) -> int:
        """How many rows bind velocities only."""
        return int(self.alpha.size - self.i.size - self.c.size)


@dataclass(frozen=True, eq=False)
class Pattern(Struct):
    """Pattern of A and of its factor, analysed once: blocks below the diagonal, by columns."""

    constant = True

    first: Indices  # (movable + 1,) blocks of column k: first[k] .. first[k + 1]
    row: Indices  # (blocks,) row of each off-diagonal block, ascending in a column
    target: Indices  # (updates,) where the update of a pair of blocks of one column goes
    mass_diagonal: Floats  # (movable D D,) M on the pattern
    mass_off: Floats  # (blocks D D,)
    distance: Indices  # (both,) off-diagonal block of a distance row
    bar: Floats  # (both,) kg, k of the pair of blocks that a distance row binds
    apart: Indices  # (…,) pairs of M that none binds
    pair: Indices  # (pairs of entries, 4) entry, entry, block, row of the quadratic rows


@dataclass(frozen=True, eq=False)
class Prescribed(Struct):
    """What moves as a function of time: a program, and the compiled function that runs it."""

    program: Addresses  # (1,) address of run(), or (0,) where nothing is prescribed
    slots: Integers  # (…,) its instructions
    params: Floats  # (…,) its numbers
    registers: Floats  # (instructions 3,) what it writes on the way


@dataclass(frozen=True, eq=False)
class Soft(Struct):
    """Directions g in which effects yield, for an implicit method; else none. See `soft`."""

    effect: Indices  # (rows,) that yields
    number: Integers  # (rows,) which of its directions
    first: Indices  # (rows + 1,) entries of a row: first[r] .. first[r + 1]
    movable: Indices  # (rows,) entries of movable blocks end here
    block: Indices  # (entries,)
    first_pair: Indices  # (rows + 1,) pairs of a row, likewise
    pair: Indices  # (pairs, 3) entry, entry, block of the pattern
    g: Floats  # (entries D,)
    weight: Floats  # (rows,) kg, hγ c + (hγ)² k
    stiff: Floats  # (2,) k and c of one direction
    gradient: Floats  # (all blocks D,) its g
    k: Floats  # (movable D,) q̈ so far


@dataclass(frozen=True, eq=False)
class Arms(Struct):
    """Which blocks are at a constant distance from another: those of a body are."""

    order: Indices  # (movable,) after what they turn about
    about: Integers  # (movable,) the block that each turns about, or ORIGIN or FREE


@dataclass(frozen=True, eq=False)
class System(Struct):
    """A mechanism."""

    constant = True

    mass: Mass
    rows: Rows
    pattern: Pattern
    soft: Soft
    prescribed: Prescribed
    arms: Arms
    angles: Rows  # x, y of each angle whose turns are counted: it is atan2(y, x)
    size: float  # m, largest extent of the drawing
    mean: float  # kg, of the diagonal of M
    penalty: float  # α without dimension
    ordinary: float  # least singular value σ at ordinary positions
    rank: float  # of Φ_q there
    close: float  # σ over that, below which rounding would be felt
    # ratio of two rounds from which on a stage is placed wholly, and conjugate gradients take over
    patience: float


@dataclass(frozen=True, eq=False)
class Effects(Struct):
    """The effects of a scene: addresses of compiled functions and the packed data of each."""

    constant = True

    force: Addresses  # (effects,) address of force()
    potential: Addresses  # (effects,) address of potential(), 0 where there is none
    friction: Addresses  # (effects,) address of friction(), 0 where there is none
    tangent: Addresses  # (effects,) address of tangent(), 0 where there is none or nobody asks
    slots: Integers  # (…,) all effects in a row
    params: Floats  # (…,)
    slots_at: Addresses  # (effects,) where an effect's slots begin
    params_at: Addresses  # (effects,)
    loads_at: Addresses  # (effects,) where its loads begin, of one that has friction()


@dataclass(frozen=True, eq=False)
class Bearings(Struct):
    """What it takes to know the reactions that friction depends on: the cut mechanism, where each
    body has blocks of its own, and what sums to the reaction of each loaded joint.
    """

    settle: Addresses  # (1,) address of settle(), or (0,) where no effect has friction()
    mass: Mass  # cut
    rows: Rows  # cut
    effects: Effects  # cut
    source: Indices  # (cut blocks,) the block that each is a copy of
    source_row: Indices  # (cut rows,) the row that each is a copy of
    first: Indices  # (loads + 1,) shared blocks of a load: first[n] .. first[n + 1]
    block: Indices  # (…,) cut block whose force is summed
    sign: Floats  # (…,)
    first_entry: Indices  # (loads + 1,) entries of the joint's own rows, likewise
    entry: Indices  # (…,) of the cut rows
    entry_row: Indices  # (…,) row of each, in the assembled mechanism
    g: Floats  # (cut distance rows D,)
    g2: Floats  # (cut entries D,)
    q: Floats  # (cut blocks D,)
    qd: Floats  # (cut blocks D,)
    qdd: Floats  # (cut blocks D,)
    Q: Floats  # (cut blocks D,) of what does not depend on loads
    needed: Floats  # (cut blocks D,) what each block needs from the joints
    y: Floats  # (cut rows,) λ
    given: Floats  # (all blocks D,) Q of what does not depend on loads
    loads: Floats  # (loads,) N, at which friction and reactions agree; before a solve a guess
    force: Floats  # (loads, D) R there, N
    good: Floats  # (loads, D) R at the last point of the grid that an adaptive method reached
    begins: Integers  # (1,) whether the next solve is where a step begins
    passes: Integers  # (2,) how many solves that took, and the iterations of the longest
    ended: Floats  # (1,) t of the last solve without a balance, s
    trial: Floats  # (loads,) N, and what reactions they led to
    answer: Floats  # (loads,)
    reaction: Floats  # (loads, D) R of the trial, then of no friction
    response: Floats  # (loads, loads, D) what a unit of each load adds to R
    qdd_of: Floats  # (all blocks D,) q̈ of that
    kept_y: Floats  # (rows,) λ meanwhile
    kept_r2: Floats  # (rows,)
    softest: Floats  # (rows,) combination of rows that is nearest to losing its direction
    across: Floats  # (all blocks D,) least velocity that opens it
    branch: Floats  # (2,) how much it opens where the step begins, and the sense of the balance
    point: Floats  # (loads,) Newton's method: N
    next: Floats  # (loads,) N further on
    heading: Floats  # (loads, D) directions to begin with
    best: Floats  # (loads,) the nearest balance so far
    slope: Floats  # (loads, loads)
    change: Floats  # (loads,)
    past_trial: Floats  # (memory, loads) differences of those of the last passes
    past_gap: Floats  # (memory, loads) and of answer - trial
    gram: Floats  # (memory, memory)
    mix: Floats  # (memory,)


@dataclass(frozen=True, eq=False)
class Ledger(Struct):
    """What it takes to keep account of the work of each effect."""

    tally: Addresses  # (1,) address of tally(), or (0,) where nobody asks for it
    effects: Effects  # one by one
    account: Indices  # (effects,) to which each of them goes
    weights: Floats  # (stages,) of the method
    rates: (
        Floats  # (stages, accounts) W, in a step; the last account is that of what is prescribed
    )
    Q: Floats  # (all blocks D,) of one effect
    good: Floats  # (accounts,) works at the last point of the grid that an adaptive method reached


@dataclass(frozen=True, eq=False)
class Forces(Struct):
    """All that acts: effects, the bearings of those that rub, and the account of their work."""

    constant = True

    effects: Effects
    bearings: Bearings
    ledger: Ledger


@dataclass(frozen=True, eq=False)
class Method(Struct):
    """A Runge-Kutta method (a, b, c), and how its solves end."""

    constant = True

    a: Floats  # (stages, stages)
    b: Floats  # (stages,)
    c: Floats  # (stages,)
    embedded: Floats  # (2, stages) weights of the embedded errors of order 5 and 3, or (0,); of an
    # implicit method (stages,)
    estimate: Floats  # (2, stages) weights by which `step_error` judges fixed steps, or (0,)
    sharp: float  # part of h q̈ that an error exceeds where an acceleration is not resolved
    guess: Floats  # (stages, stages) q̈ of a stage extrapolated from those before; explicit: (0,)
    iterations: np.uint64  # at most, in one solve
    tolerance: float  # relative error of a step, of an adaptive method


@dataclass(frozen=True, eq=False)
class Phase(Struct):
    """Where the mechanism is: what a step begins with and ends with."""

    q: Floats  # (all blocks D,) m
    qd: Floats  # (all blocks D,) m/s
    turns: Integers  # (angles,) passages of (x, y) over the negative x axis
    pace: Floats  # (1,) the step an adaptive method would like to take next, s
    works: Floats  # (accounts,) J, done so far; none without a ledger
    # (loads, D) R (N) that friction depends on, as found last; zero where nothing is known
    loads: Floats = field(default_factory=lambda: np.zeros(0))
    # (1,) 1 in a singular position, where rows may have lost rank unfelt, else 0; NaN: not known
    within: Floats = field(default_factory=lambda: np.zeros(1))


@dataclass(frozen=True, eq=False)
class Modes(Struct):
    """The softest modes of Φ_q at a position: those of its least singular values. See `softest`.

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
    """What is kept from step to step for those who watch for singular positions."""

    modes: Modes  # where the last step ended
    quiet: Integers  # (1,) 1 if no mode can have vanished in it, as far as it tells itself
    look: Integers  # (1,) 1 if a pass in it is not out of the question
    t: Floats  # (2,) s, when it began and ended
    rate: Floats  # (1,) 1/s, how fast the rows turned when it ended
    before: Phase  # where it began
    after: Phase  # where it ended
    g2d: Floats  # (entries D,) Φ̇_q of the quadratic rows


@dataclass(frozen=True, eq=False)
class Chart(Struct):
    """The coordinates of a step, ξ = (a, c, e) of each block; see `chart`."""

    arcs: Integers  # (1,) how many blocks have one
    curvature: Floats  # (movable,) κ, 1/m; 0: they are places
    t: Floats  # (movable D,) tangent where the step begins
    n: Floats  # (movable D,) normal
    b: Floats  # (movable D,) t × n; (0,) in the plane
    rate: Floats  # (movable D,) ξ̇ where the step begins, m/s
    momentum: Floats  # (movable D,) w there, kg m/s
    rest: Floats  # (movable D,) of p there, that rounding loses in w
    w: Floats  # (movable D,) that of the stage unfolded last
    first: Floats  # (all blocks D,) q̈ there, m/s²
    sin: Floats  # (movable,) of κa, where it was unfolded last
    cos: Floats  # (movable,)
    rho: Floats  # (movable,) 1 - κc


@dataclass(frozen=True, eq=False)
class Work(Struct):
    """What else the kernel writes: allocated once by the caller."""

    evaluations: Integers  # (1,) stages evaluated so far: how often q̈ was
    rounded: Integers  # (1,) steps taken although rounding kept their error above the tolerance
    judged: Floats  # (8,) errors of fixed steps so far, see `step_error`
    diagonal: Floats  # (movable D D,) factor: unit lower triangles, reciprocal pivots between
    off: Floats  # (blocks D D,) factor
    inverse_det: Floats  # (4,) 1 / det A = c exp(d): c, d where the step began and where it ends
    inverse: Floats  # (movable D D,) A⁻¹ on the pattern, where the rank is counted
    inverse_off: Floats  # (blocks D D,)
    column: Floats  # (longest column D D,) one column before division by the pivots
    g: Floats  # (distance rows D,) q_i - q_j
    g2: Floats  # (entries D,) gradients of the quadratic rows
    g2d: Floats  # (entries D,) their time derivatives
    gf: Floats  # (distance rows D,) the same, of the place where A was factorised
    g2f: Floats  # (entries D,)
    q: Floats  # (all blocks D,) stage
    qd: Floats  # (all blocks D,)
    qdd: Floats  # (all blocks D,)
    p: Floats  # (movable D,) momenta p'
    Q: Floats  # (all blocks D,)
    delta: Floats  # (all blocks D,) right-hand side, then solution
    r2: Floats  # (rows,)
    y: Floats  # (rows,) σ' or λ
    z: Floats  # (rows,) direction of a conjugate gradient
    w: Floats  # (rows,) Φ_q A⁻¹ Φ_qᵀ z
    shift: Floats  # (all blocks D,) of the stage onto Φ = 0
    k: Floats  # (stages, 3, movable D) rates of the stages: ξ̇, ξ̈, and ẇ if there are arcs; of an
    # implicit method q̇ and q̈
    total: Floats  # (3, movable D) of those of some stages, with their weights
    pull: Floats  # (all blocks D,) q̈ where the step began
    along: Floats  # (all blocks D,) direction of the branch at a singular position
    bend: Floats  # (all blocks D,) q̈ of the unforced mechanism: the curvature of its path
    target: Floats  # (all blocks D,) a stage as the method has it, before it is put on Φ = 0
    base: Floats  # (all blocks D,) that stage again, while places around it are evaluated
    before_q: Floats  # (movable D,) what the stages before add to q and q̇, of an implicit method
    before_qd: Floats  # (movable D,)
    places: Floats  # (8, 2, movable D) q and q̇ of the places that a stage is interpolated from
    curve: Floats  # (movable D,) second derivative of the branch there, m/s²
    given: Floats  # (all blocks D,) Q at that stage
    lead: Floats  # (1,) from one place to the next, s, for what is prescribed; 0 from rest
    aside: Integers  # (2,) whether the end of the step is interpolated, and a rank lost there
    sum: Floats  # (movable D,) what is interpolated from those places, and other sums: q̈
    sum_q: Floats  # (movable D,) q
    sum_qd: Floats  # (movable D,) and q̇
    good_q: Floats  # (all blocks D,) the last point of the grid that an adaptive method reached
    good_qd: Floats  # (all blocks D,)
    good_turns: Integers  # (angles,)
    good_within: Floats  # (1,)
    chart: Chart
    angle: Floats  # (angles, 2) x, y of each
    angle_before: Floats  # (angles, 2) where the step began
    near: Floats  # (angles,) rad, turns counted: where the step began, to a quarter turn
