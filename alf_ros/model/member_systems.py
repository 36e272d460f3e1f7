"""The systems of members of one geometry, and where they start.

Masses differ, so penalties, the numbers of M on the pattern and the velocities at the start do.
All are computed for many members at once, each with the bits that `compile_model`, `assembly` and
`ordinary_positions` give a single one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.kernel import System
from alf_ros.kernel.data import NOTHING
from alf_ros.model.assembly import AGREED, CLOSED, LEAST, TO_ROUNDING, Given, held
from alf_ros.model.compile import Model, allocate, hold, limits_of
from alf_ros.model.constraints.row_scales import RowLengths
from alf_ros.model.mass import BodyMasses, MassSums
from alf_ros.model.member_starts import (
    PLACES,
    MemberPlaces,
    MemberVelocities,
    close_members,
    complete_members,
)
from alf_ros.model.member_structs import MemberStructs
from alf_ros.model.ordinary_positions import NEAR, RESOLVING, SOFT, WHOLE, directions
from alf_ros.model.rank import distance
from alf_ros.model.symbolic_factor import filled

# parts of a System that differ between members of one geometry
NUMBERS = (
    'mass.diagonal',
    'mass.k',
    'mass.w',
    'rows.alpha',
    'pattern.mass_diagonal',
    'pattern.mass_off',
    'pattern.bar',
    'mean',
)
_SOFTER = RESOLVING[:2]  # penalties that show σ of mechanisms that are not soft


class Masses(NamedTuple):
    """M of each member: the arrays of `Mass`, (members, ...); and the members that have it in this
    form, (members,)."""

    diagonal: Floats
    k: Floats
    w: Floats
    usual: NDArray[np.bool_]


class Starts(NamedTuple):
    """Where members start.

    q, qd (members, blocks D) m, m/s; `ordinary`, `close`, `patience` (members,) as in `System`;
    usual (members,): whether all of this was found; the others start in a way of their own.
    """

    q: Floats
    qd: Floats
    ordinary: Floats
    close: Floats
    patience: Floats
    usual: NDArray[np.bool_]


class MemberSystems:
    """Finds the starts of members like a model, from masses and the velocities given.

    bodies: their masses in the model; given: velocities, as of its scene; `members`: how many.
    The model has no redundant rows, rows of velocities or motions as functions of time.
    """

    def __init__(
        self, model: Model, bodies: Sequence[BodyMasses], given: Given, members: int
    ) -> None:
        self._model, self._members = model, members
        self._sums = MassSums(model.layout, bodies)
        first = np.array([[each for body in bodies for each in body.bound]]).reshape(1, -1, 2)
        none = np.zeros((1, len(self._sums.blocks)))
        self._kept = self._sums.kept(self._sums.of(none, first)[1][0])  # pairs that M has
        rates = [replace(row, c=0.0) for row in held(model, given)]
        completing, names, self._given = hold(model, rates, velocities=True)
        self._own = _OneSystem(model, model.system, members)
        self._completing = _OneSystem(model, completing, members)
        self._soft = [_OneSystem(model, model.system, members, like=self._own) for _ in _SOFTER]
        system, n, size = model.system, model.n, model.q.size
        self._work = allocate(model, system, 0)
        self._work_to_complete = allocate(model, completing, 1)
        rows, off = len(model.row_names), system.pattern.row.size
        D, several = model.layout.dimension, members * len(_SOFTER)
        away = NEAR * model.size * directions(n)[:PLACES]
        self._places = MemberPlaces(
            system=self._own.structs.addresses,
            soft=np.concatenate([each.structs.addresses for each in self._soft]),
            drawn=model.q,
            away=away.ravel(),
            q=np.zeros(members * size),
            gap=np.zeros(members * PLACES),
            trace=np.zeros(members * PLACES),
            soft_trace=np.zeros(several),
            best=np.zeros(size),
            phi=np.zeros(rows),
            open=np.zeros(rows),
            Z=np.zeros(n * D),
            Zo=np.zeros(off * D * D),
        )
        self._velocities = MemberVelocities(
            system=self._completing.structs.addresses,
            q=self._places.q,
            wanted=np.zeros(members * len(names)),
            qd=np.zeros(members * size),
            wrong=np.zeros(members),
            x=np.zeros(size),
            rate=np.zeros(len(names)),
        )

    def start(self, masses: Floats, bound: Floats, given: Floats) -> Starts:
        """The starts of members: masses (members, ...) and bound (members, ..., 2) of all bodies,
        as in `BodyMasses`, and velocities given (members, ...), m/s."""
        with np.errstate(all='ignore'):
            return self._start(self._summed(masses, bound), given)

    def _summed(self, masses: Floats, bound: Floats) -> Masses:
        diagonal, values = self._sums.of(masses, bound)
        usual = (self._sums.kept(values) == self._kept).all(axis=1)
        values, skew = values[:, self._kept], self._model.system.mass.skew
        turned = np.zeros(values.shape[1], dtype=bool)
        turned[skew] = True
        usual &= ((values[:, :, 1] != 0.0) == turned).all(axis=1) & (diagonal.sum(axis=1) > 0.0)
        return Masses(diagonal, values[:, :, 0], values[:, skew, 1], usual)

    def _start(self, masses: Masses, given: Floats) -> Starts:
        model, found, members = self._model, self._places, self._members
        self._own.put(masses)
        for soft, penalty in zip(self._soft, _SOFTER, strict=True):
            soft.soften(penalty)
        unit, own = model.unit, self._own.structs.member(0)
        close_members(unit, own, self._work, float(LEAST * model.size), found)
        rows, n = len(model.row_names), model.n
        rank = n - found.trace.reshape(members, PLACES)
        gap = found.gap.reshape(members, PLACES)
        at_places = (gap <= CLOSED * model.size) & (np.abs(rank - rows) < WHOLE)
        missing = rows - (n - found.soft_trace.reshape(members, -1))
        shown = (missing > 0.0) & (missing < 0.5)
        sigma: Floats = np.full(members, np.nan)
        for s in reversed(range(len(_SOFTER))):
            values = distance(missing[:, s], _SOFTER[s])
            sigma = np.where(shown[:, s], values, sigma)
        ordinary = masses.usual & at_places.all(axis=1) & (sigma >= SOFT)
        sigma = np.where(ordinary, sigma, 1.0)
        limits = [limits_of(model.system.penalty, each) for each in sigma.tolist()]
        close, patience = np.array(limits).T
        ordinary &= ~(distance(rows - rank[:, 0], model.penalty) < close * sigma)
        ordinary &= self._complete(masses, given)
        q, qd = found.q.reshape(members, -1), self._velocities.qd.reshape(members, -1)
        return Starts(q, qd, sigma, close, patience, ordinary)

    def _complete(self, masses: Masses, given: Floats) -> NDArray[np.bool_]:
        """Complete the velocities; returns where they agree with those given."""
        found, of = self._velocities, self._completing
        of.put(masses)
        wanted = found.wanted.reshape(self._members, -1)
        wanted[:, self._given] = given
        unit, work = self._model.unit, self._work_to_complete
        complete_members(unit, of.structs.member(0), work, TO_ROUNDING, found)
        fastest = np.abs(given).max(axis=1, initial=0.0)
        return np.asarray(found.wrong <= AGREED * np.maximum(NOTHING, fastest))

    def put_into(self, systems: MemberStructs, starts: Starts) -> None:
        """Write the systems of the members, as their steps need them, where others stand."""
        self._own.copy_to(systems)
        systems.ordinary[:], systems.close[:] = starts.ordinary, starts.close
        systems.patience[:] = starts.patience


class _OneSystem:
    """Structs of the members' own systems, or of these with more rows."""

    def __init__(
        self, model: Model, system: System, members: int, like: _OneSystem | None = None
    ) -> None:
        self.structs = MemberStructs(system, members, NUMBERS)
        self._model, self._like = model, like
        layout = model.layout
        self._fill = filled(layout.movable, system.mass, system.rows)
        self._lengths = RowLengths(system.rows, model.q, layout.dimension)

    def put(self, masses: Masses) -> None:
        """The numbers of members with these masses, penalties too."""
        diagonal, k, w, _ = masses
        own, layout = self.structs, self._model.layout
        own.mass.diagonal[:], own.mass.k[:], own.mass.w[:] = diagonal, k, w
        own.mean[:] = diagonal.mean(axis=1)
        moved = self._lengths.masses(diagonal, np.array(own.mean), layout.blocks)
        own.rows.alpha[:] = self._model.penalty / moved
        skew = self._model.system.mass.skew
        for name, values in self._fill.masses_of(layout.dimension, diagonal, k, skew, w).items():
            getattr(own.pattern, name)[:] = values

    def soften(self, penalty: float) -> None:
        """The numbers of the system that this one is like, with another penalty."""
        assert self._like is not None
        self._like.copy_to(self.structs)
        self.structs.rows.alpha[:] *= penalty / self._model.penalty

    def copy_to(self, other: MemberStructs) -> None:
        """Write the numbers where others stand."""
        for path in NUMBERS:
            of, to = self.structs, other
            *parts, name = path.split('.')
            for part in parts:
                of, to = getattr(of, part), getattr(to, part)
            getattr(to, name)[:] = getattr(of, name)
