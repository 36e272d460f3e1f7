"""Redundant constraint rows that contradict each other by a little, as drawn by CAD.

A redundant mechanism moves only if its lengths fulfil conditions, such as equal cranks. Where the
lengths miss a condition by e, the rows are closed as drawn, but at no position nearby: strictly
the mechanism is a structure, and steps fail or lose energy. Up to 1e-8 of the size the
ideal mechanism is meant: shapes are adjusted by the least changes with which all rows agree, and
the changes are stated. What cannot be adjusted is refused.

A mechanism without redundant rows is not looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.mechanism import Mechanism
from alf_ros.model import branch_words
from alf_ros.model.compile import Model
from alf_ros.model.firm_closing import lie_beside
from alf_ros.model.free_walk import (
    EXACT,
    FELT,
    LARGEST,
    PENALTY,
    SEARCHED,
    Walk,
    carried,
    compiled,
)
from alf_ros.model.ordinary_positions import ordinary
from alf_ros.model.shape_fit import fitted
from alf_ros.model.shape_numbers import changes
from alf_ros.model.singular_branches import SMOOTH, position

_FEW, _MANY = 8, 48  # places on each way: to see whether rows agree, and to make them agree
_FITTED = 32  # of them, about
_ROUNDS = 8  # of Gauss and Newton, at most
_FLAT = 1e-2  # distance to a singular position below which lengths that should agree seem to be


@dataclass(frozen=True)
class Adjustment:
    """By how much shapes were changed so that redundant rows agree.

    changes: the largest change (m) of each body, joint, fixed point or vector, by name; of a
    direction, times the size of the mechanism. gap: by how much rows were open before, m.
    """

    changes: Mapping[str, float]
    gap: float

    def __str__(self) -> str:
        largest = sorted(self.changes.items(), key=lambda each: -each[1])
        named = ', '.join(f'{name} by {change:.2g} m' for name, change in largest[:6])
        more = f' and {len(largest) - 6} more' if largest[6:] else ''
        return (
            f'redundant constraints contradict each other by {self.gap:.2g} m where the mechanism '
            f'moves; adjusted so that they agree: {named}{more}'
        )


def made_consistent(
    model: Model, q: Floats, dependent_rows: int
) -> tuple[Mechanism, Adjustment] | None:
    """The mechanism of `model` with shapes whose redundant rows agree; None if they do already.

    q (blocks D, m): a closed position, of which so many rows depend on others. Raises
    AssemblyError if rows contradict each other by more than 1e-8 of the size, or whatever
    the shapes.
    """
    if not dependent_rows:
        return None
    drives = model.mechanism.drives
    model, q, dependent_rows = freed(model, q, dependent_rows)
    if not dependent_rows:
        return None
    model = model.with_penalty(PENALTY)
    walk = Walk(model, dependent_rows)
    places, singular = walk.places(q, _MANY if model.n <= SEARCHED else _FEW)
    if walk.excess(places + singular) <= EXACT:
        return None
    if model.n > SEARCHED:
        places, singular = walk.places(q, _MANY)
    if lie_beside(walk, q, places):
        return None
    gap = walk.gap(places + singular)
    if gap > LARGEST * model.size:
        raise _shaky(model, q, dependent_rows) or _contradiction(walk, places)
    try:
        found = _fitted(walk, places, singular)
    except AssemblyError as contradiction:
        raise _shaky(model, q, dependent_rows) or contradiction from None
    if found is model.mechanism:
        return (
            None  # hardly above rounding, or in singular positions only, and no better otherwise
        )
    amounts = changes(model.mechanism, found, model.size)
    changed = {name: amount for name, amount in amounts if amount > 0.0}
    return replace(found, drives=drives), Adjustment(changed, gap)


def freed(model: Model, q: Floats, dependent_rows: int) -> tuple[Model, Floats, int]:
    """(model, q, dependent rows) without drives and rows of velocities, so that all rows can be
    met where the mechanism is moved; q (blocks D, m)."""
    mechanism = model.mechanism
    if not (mechanism.drives or model.system.rows.velocity):
        return model, q, dependent_rows
    free = compiled(replace(mechanism, drives=()))
    q = carried(model.layout, q, free)
    dependent_rows, _, sigma = ordinary(free, q)
    return free.accustomed(sigma, dependent_rows), q, dependent_rows


def _fitted(walk: Walk, places: list[Floats], singular: list[Floats]) -> Mechanism:
    """The mechanism whose rows agree at the places, by Gauss and Newton.

    The mechanism of the walk if rows disagree by too little to be felt, or in singular positions
    only: it is then as drawn, and steps report it where the motion comes there.
    """
    drawn, alone = walk.model.mechanism, walk.excess(places) <= EXACT
    start, contradiction = walk.excess(places + singular), _contradiction(walk, places + singular)
    best, found = start, drawn
    for n in range(_ROUNDS):
        # places say the same again and again: some do, as the next round looks at others
        some = places[:: max(1, len(places) // _FITTED)] + singular
        mechanism = fitted(walk.model, some, walk.rounding)
        sigma = walk.model.system.ordinary
        model = compiled(mechanism).accustomed(sigma, walk.dependent_rows)
        q = carried(walk.model.layout, some[0], model)
        walk = Walk(model, walk.dependent_rows)
        places, singular = walk.places(q, _MANY, n + 1)
        if not places:
            break
        excess, before = walk.excess(places + singular), best
        if excess < best:
            found, best = mechanism, excess
        if best <= EXACT and excess > 0.5 * before:
            break
    if best <= EXACT:
        return found
    if alone or start <= FELT:
        return drawn
    raise contradiction


def _shaky(model: Model, q: Floats, dependent_rows: int) -> AssemblyError | None:
    """An error if q (blocks D, m) is infinitesimally mobile and nothing else, as two bars in line.

    Where rows depend on others everywhere because lengths agree, no velocity breaks them.
    """
    here = replace(position(model, q), x=_FLAT)
    if here.kind == SMOOTH or len(here.lost) != dependent_rows:
        return None
    if any(branch.dimension for branch in here.branches):
        return None
    return AssemblyError(branch_words.shaky(model, here.free), key='initial.positions')


def _contradiction(walk: Walk, places: list[Floats]) -> AssemblyError:
    model = walk.model
    gaps = np.max([walk.gaps(q) for q in places], axis=0)
    order = np.argsort(-gaps, kind='stable')[:6]
    named = ', '.join(
        f'{model.row_names[n]} by {gaps[n]:.3g} m' for n in order if gaps[n] > 0.05 * gaps.max()
    )
    return AssemblyError(
        f'redundant constraints contradict each other where the mechanism moves: {named}; '
        'make the lengths agree, or leave redundant bodies or joints out',
        key='mechanism',
    )
