"""Forces: effects, friction that depends on reactions, and the ledger of work."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Addresses, Floats, Indices, Integers
from alf_ros.kernel.data.system import Mass, Rows
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class Effects(Struct):
    """The effects of a scene: addresses of compiled functions and the packed data of each."""

    constant = True
    addresses = ('force', 'potential', 'friction', 'tangent', 'side')

    force: Addresses  # (effects,) address of force()
    potential: Addresses  # (effects,) address of potential(), 0 where there is none
    friction: Addresses  # (effects,) address of friction(), 0 where there is none
    tangent: Addresses  # (effects,) address of tangent(), 0 where there is none or none is needed
    side: Addresses  # (effects,) address of side(), 0 where there is none; (0,) if none is needed
    undated: Integers  # as `side`; 1: it may jump at instants that it does not tell
    slots: Integers  # (…,) all effects in a row
    params: Floats  # (…,)
    slots_at: Addresses  # (effects,) where an effect's slots begin
    params_at: Addresses  # (effects,)
    loads_at: Addresses  # (effects,) where its loads begin, of one that has friction()


@dataclass(frozen=True, eq=False)
class ForceDirection(Struct):
    """A direction in which forces are differentiated, and their derivative."""

    addresses = ('force',)

    force: Addresses  # (effects,) address of force() for dual numbers; 0 leaves an effect out
    dq: Floats  # (blocks D,) m
    dqd: Floats  # (blocks D,) m/s
    dparams: Floats  # as `Effects.params`
    Q: Floats  # (blocks D,) N
    dQ: Floats  # (blocks D,) N


@dataclass(frozen=True, eq=False)
class Bearings(Struct):
    """Data and workspace of friction that depends on reactions: the cut mechanism, where each body
    has blocks of its own, and the terms whose sum is the reaction of each loaded joint.
    """

    addresses = ('settle',)

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
    Q: Floats  # (cut blocks D,) of forces that do not depend on loads
    needed: Floats  # (cut blocks D,) force that joints must exert on each block, N
    y: Floats  # (cut rows,) λ
    given: Floats  # (all blocks D,) Q of forces that do not depend on loads
    loads: Floats  # (loads,) N, at which friction and reactions agree; before a solve a guess
    force: Floats  # (loads D + 1,) R there, N, and the sense of the balance; 0: unknown
    good: Floats  # (loads D + 1,) the same at the last point of the grid that was reached
    begins: Integers  # (1,) whether the next solve is where a step begins
    passes: Integers  # (2,) solves of the last balance, and the iterations of the longest
    ended: Floats  # (1,) t of the last solve without a balance, s
    trial: Floats  # (loads,) N, trial loads
    answer: Floats  # (loads,) N, reactions that the trial loads lead to
    reaction: Floats  # (loads, D) R under the trial loads, then without friction, N
    response: Floats  # (loads, loads, D) ∂R/∂N
    qdd_of: Floats  # (all blocks D,) q̈ of a unit load
    kept_y: Floats  # (rows,) λ, saved during another solve
    kept_r2: Floats  # (rows,)
    softest: Floats  # (rows,) combination of rows that is nearest to losing its direction
    across: Floats  # (all blocks D,) least velocity that opens this combination
    branch: Floats  # (2,) its opening where the step begins, and the sense of the balance
    point: Floats  # (loads,) Newton's method: N
    next: Floats  # (loads,) the next N
    heading: Floats  # (loads, D) directions of R to begin with
    best: Floats  # (loads,) the nearest balance so far
    slope: Floats  # (loads, loads) 1 - d|R|/dN
    change: Floats  # (loads,)
    past_trial: Floats  # (memory, loads) differences of `trial` between passes
    past_gap: Floats  # (memory, loads) differences of `answer` - `trial`
    gram: Floats  # (memory, memory)
    mix: Floats  # (memory,)


@dataclass(frozen=True, eq=False)
class Ledger(Struct):
    """Data and workspace of the work ledger, the account of the work of each effect."""

    addresses = ('tally',)

    tally: Addresses  # (1,) address of the function that records, or (0,) without a ledger
    effects: Effects  # one by one
    account: Indices  # (effects,) account of each effect
    weights: Floats  # (stages,) of the method
    rates: Floats  # (stages, accounts) W, in a step; the last account belongs to drives
    Q: Floats  # (all blocks D,) of one effect
    good: Floats  # (accounts,) works at the last point of the grid that an adaptive method reached


@dataclass(frozen=True, eq=False)
class Kinks(Struct):
    """The kinks over time, and data and workspace of the search for kinks that are met and left
    within a step, by the scalars of effects that have `interval`."""

    addresses = ('search', 'interval')

    instants: Floats  # (instants,) s, ascending, at which steps end
    search: Addresses  # (1,) address of the function that searches, or (0,) without scalars
    interval: Addresses  # (scalars,) address of interval()
    effect: Indices  # (scalars,) number of the effect
    number: Integers  # (scalars,) n of the scalar in this effect
    path: Floats  # (scalars + 1, places, 4) x, ẋ and the ends of its interval along the step
    doubt: Floats  # (scalars, 2) of x in the middle of the step, as interpolated; and workspace
    crossed: Floats  # (1,) 1 if steps may cross kinks, 0 if they end there
    near: (
        Floats  # (1,) of the last step: 2 if a scalar left its interval where it ended, 3 where it
    )
    # began, 1 if one was near
    # an end of it, or 0


@dataclass(frozen=True, eq=False)
class Forces(Struct):
    """All forces: effects, reactions that their friction depends on, the account of work, and the
    search for kinks."""

    constant = common = True

    effects: Effects
    bearings: Bearings
    ledger: Ledger
    kinks: Kinks
