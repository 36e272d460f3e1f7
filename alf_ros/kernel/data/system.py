"""A mechanism: masses, constraint rows, the pattern of A, and what moves as a function of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats, Indices, Integers
from alf_ros.kernel.numba_ext.structs import Struct

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

    Rows of velocities follow, N(q, t) q̇ + B(q, t) = 0 (38): their entries form N. Some have an
    integral (`Integrals`), the others no Φ. In equations of velocities, N is appended to Φ_q.
    Entries of prescribed blocks express the dependence on t: Φ_t and B are their part of Φ_q q̇ and
    N q̇.
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
    full: Indices  # (terms,) 0 of a T = c I in space, which is what all but wheels have
    term: Floats  # (terms D D,) T
    c: Floats  # (quadratic rows,)
    alpha: Floats  # (rows,) penalty α of each row
    scale: Floats  # (rows,) 1 / |Φ_q,r| as drawn: scale Φ is a distance in metres
    bend: Floats  # (rows,) |T| / |Φ_q,r| as drawn, 1/m: how far a distance turns the row

    @property
    def velocity(self) -> int:
        """How many rows bind velocities only."""
        return int(self.alpha.size - self.i.size - self.c.size)


@dataclass(frozen=True, eq=False)
class Integrals(Struct):
    """Sums of angles, with their turns, and of lengths that rows of velocities keep constant."""

    constant = True

    row: Indices  # (sums,) place of its row among the rows of velocities
    angle: Indices  # (angles,) of those that are counted
    first: Indices  # (sums + 1,) terms of a sum: first[n] .. first[n + 1]
    place: Indices  # (terms,) among these angles, and behind them among the lengths
    factor: Floats  # (terms,) m/rad, or of a length 1
    lengths: Rows


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
    """Motions as functions of time: a program, and the compiled function that runs it."""

    addresses = ('program',)

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
class Departures(Struct):
    """How a mechanism may leave a singular position where it is set at rest; else nothing."""

    constant = common = True

    q: Floats  # (movable D,) that position
    branch: Integers  # (directions,) the branch that each is of, in ascending order
    directions: Floats  # (directions, movable D) of a branch orthonormal in the metric of M
    # (movable D,) 1 on what rests there while all that no row connects with it moves, else 0;
    # empty if all rests
    part: Floats


@dataclass(frozen=True, eq=False)
class Arms(Struct):
    """Pairs of blocks at a constant distance, such as blocks of one body."""

    order: Indices  # (movable,) after what they turn about
    about: Integers  # (movable,) the block that each turns about, or ORIGIN or FREE
    # in space, what tells how a body turns: spokes of body m are first[m] .. first[m + 1]
    first: Indices  # (bodies + 1,)
    spoke: Indices  # (spokes,) block
    hub: Integers  # (spokes,) the block of the same body that it stands out from, or ORIGIN
    turns: Integers  # (spokes,) 1 if the arc of this block is about a block of the body


@dataclass(frozen=True, eq=False)
class System(Struct):
    """A mechanism."""

    constant = True

    mass: Mass
    rows: Rows
    pattern: Pattern
    soft: Soft
    departures: Departures
    prescribed: Prescribed
    arms: Arms
    angles: Rows  # x, y of each angle whose turns are counted: it is atan2(y, x)
    integrals: Integrals
    size: float  # m, largest extent of the drawing
    mean: float  # kg, of the diagonal of M
    penalty: float  # α without dimension
    rounding: float  # part of a free motion that rounding leaves in a solve, at least ε penalty
    ordinary: float  # least singular value σ at ordinary positions
    rank: float  # of Φ_q there
    close: float  # σ over that, below which rounding would be felt
    # ratio of two rounds from which on a stage is placed wholly, and conjugate residuals take over
    patience: float
