"""The systems of members of one structure, and where they start.

Masses and lengths differ, so the numbers of rows, penalties, the numbers of M on the pattern and
the positions and velocities at the start do. All are computed for many members at once, each with
the bits that `compile_model`, `assembly` and `ordinary_positions` give a single one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.kernel import System
from alf_ros.kernel.data import EPS, NOTHING
from alf_ros.kernel.solve_rounding import ASIDE
from alf_ros.model.assembly import AGREED, CLOSED, LEAST, TO_ROUNDING, Given, held
from alf_ros.model.compile import Model, allocate, close_to, hold, patience_of
from alf_ros.model.constraints.carried_masses import have_light
from alf_ros.model.mass import BodyMasses, MassSums
from alf_ros.model.member_rows import GEOMETRY, Geometry, MemberRows, MemberScales
from alf_ros.model.member_starts import (
    PLACES,
    MemberPlaces,
    MemberRanks,
    MemberVelocities,
    close_members,
    complete_members,
    round_members,
    trace_members,
)
from alf_ros.model.member_structs import MemberStructs
from alf_ros.model.ordinary_positions import (
    NEAR,
    RESOLVING,
    RISING,
    SOFT,
    WHOLE,
    directions,
)
from alf_ros.model.penalty import HIDDEN, light_penalty, rounding_of, stiff_penalty
from alf_ros.model.rank import distance
from alf_ros.model.symbolic_factor import filled

# parts of a System that differ between members of one structure
NUMBERS = (
    *GEOMETRY,
    'mass.diagonal',
    'mass.k',
    'mass.w',
    'rows.alpha',
    'pattern.mass_diagonal',
    'pattern.mass_off',
    'pattern.bar',
    'mean',
)
SOLVES = 'penalty', 'rounding'

Mask = NDArray[np.bool_]


class Masses(NamedTuple):
    """M of each member: the arrays of `Mass`, (members, ...); and the members that have it in this
    form, (members,)."""

    diagonal: Floats
    k: Floats
    w: Floats
    usual: Mask


class Starts(NamedTuple):
    """Where members start.

    q, qd (members, blocks D) m, m/s; `penalty`, `rounding`, `ordinary`, `close`, `patience`
    (members,) as in `System`; usual (members,): whether all of this was found; the others start in
    a way of their own.
    """

    q: Floats
    qd: Floats
    penalty: Floats
    rounding: Floats
    ordinary: Floats
    close: Floats
    patience: Floats
    usual: Mask


class MemberSystems:
    """Finds the starts of members like a model, from their geometry, masses and the velocities
    given.

    `rows` of the model; bodies: their masses there; given: velocities, as of its scene; penalty:
    of a model that is not soft; `members`: how many. The model has no redundant rows, rows of
    velocities or motions as functions of time.
    """

    def __init__(
        self,
        model: Model,
        rows: MemberRows,
        bodies: Sequence[BodyMasses],
        given: Given,
        penalty: float,
        members: int,
    ) -> None:
        self._model, self._members, self._penalty = model, members, penalty
        self._rows = rows
        self._sums = MassSums(model.layout, bodies)
        first = np.array([[each for body in bodies for each in body.bound]]).reshape(1, -1, 2)
        none = np.zeros((1, len(self._sums.blocks)))
        self._kept = self._sums.kept(self._sums.of(none, first)[1][0])  # pairs that M has
        rates = [replace(row, c=0.0) for row in held(model, given)]
        completing, names, self._given = hold(model, rates, velocities=True)
        self._own = OfOneSystem(model, model.system, members)
        self._completing = OfOneSystem(model, completing, members)
        self._soft = [OfOneSystem(model, model.system, members) for _ in RESOLVING]
        size = model.q.size
        self._work = allocate(model, model.system, 0)
        self._work_to_complete = allocate(model, completing, 1)
        self._places = MemberPlaces(
            system=self._own.structs.addresses,
            wanted=np.zeros(members, dtype=np.int64),
            drawn=np.zeros(members * size),
            away=directions(model.n)[:PLACES].ravel(),
            q=np.zeros(members * PLACES * size),
            gap=np.zeros(members * PLACES),
            best=np.zeros(size),
            **{name: np.zeros(len(model.row_names)) for name in ('phi', 'open')},
        )
        self._ranks = [self._ranks_of(each) for each in (self._own, *self._soft)]
        self._velocities = MemberVelocities(
            system=self._completing.structs.addresses,
            q=self._places.q,
            wanted=np.zeros(members * len(names)),
            qd=np.zeros(members * size),
            wrong=np.zeros(members),
            x=np.zeros(size),
            rate=np.zeros(len(names)),
        )

    def _ranks_of(self, of: OfOneSystem) -> MemberRanks:
        model, D = self._model, self._model.layout.dimension
        return MemberRanks(
            system=of.structs.addresses,
            wanted=np.zeros(self._members, dtype=np.int64),
            q=self._places.q,
            trace=np.zeros(self._members),
            rounding=np.zeros(self._members),
            Z=np.zeros(model.n * D),
            Zo=np.zeros(model.system.pattern.row.size * D * D),
        )

    def start(
        self, geometry: Sequence[Geometry], masses: Floats, bound: Floats, given: Floats
    ) -> Starts:
        """The starts of members of this geometry, masses (members, ...) and bound
        (members, ..., 2) of all bodies, as in `BodyMasses`, and velocities given (members, ...),
        m/s."""
        with np.errstate(all='ignore'):
            self._rows.put(geometry, self._own.structs)
            self._drawn[:] = [each.drawn for each in geometry]
            return self._start(self._summed(masses, bound), given)

    @property
    def _drawn(self) -> Floats:
        """(members, blocks D) m."""
        return self._places.drawn.reshape(self._members, -1)

    @property
    def _size(self) -> Floats:
        """(members,) m."""
        return np.asarray(self._own.structs.size)

    def _summed(self, masses: Floats, bound: Floats) -> Masses:
        diagonal, values = self._sums.of(masses, bound)
        usual = (self._sums.kept(values) == self._kept).all(axis=1)
        values, skew = values[:, self._kept], self._model.system.mass.skew
        turned = np.zeros(values.shape[1], dtype=bool)
        turned[skew] = True
        usual &= ((values[:, :, 1] != 0.0) == turned).all(axis=1) & (diagonal.sum(axis=1) > 0.0)
        usual &= ~have_light(diagonal)  # a single start decides what they carry
        return Masses(diagonal, values[:, :, 0], values[:, skew, 1], usual)

    def _start(self, masses: Masses, given: Floats) -> Starts:
        rows = len(self._model.row_names)
        base = np.full(self._members, self._penalty)
        self._own.put(self._drawn, masses, base, EPS * base)
        for soft, resolving in zip(self._soft, RESOLVING, strict=True):
            self._own.copy_to(soft.structs)
            soft.structs.rows.alpha[:] *= resolving / self._penalty
        usual = masses.usual & self._closed(0, masses.usual)
        usual &= np.abs(self._rank(0, 0, usual) - rows) < WHOLE
        ordinary = self._softness(0, usual)
        doubtful = usual & ~(ordinary >= SOFT)  # beside a singular position, or soft everywhere
        for place in range(1, PLACES if doubtful.any() else 1):
            usual &= ~doubtful | self._no_firmer(place, doubtful, ordinary)
        ordinary = np.where(usual, ordinary, 1.0)
        penalty, rounding = self._penalties(base, ordinary, usual)
        close, patience = self._limits(penalty, rounding, ordinary)
        usual &= self._ranks[0].rounding < HIDDEN  # a single start measures it again
        usual &= ~(distance(rows - self._rank(0, 0, usual), penalty) < close * ordinary)
        usual &= self._completed(masses, penalty, rounding, given)
        q = self._places.q.reshape(self._members, PLACES, -1)[:, 0]
        qd = self._velocities.qd.reshape(self._members, -1)
        return Starts(q, qd, penalty, rounding, ordinary, close, patience, usual)

    def _closed(self, place: int, wanted: Mask) -> Mask:
        """Close members; returns those that are closed."""
        found, own = self._places, self._own.structs.member(0)
        found.wanted[:] = wanted
        close_members(self._model.unit, own, self._work, LEAST, NEAR, place, found)
        gap = found.gap.reshape(self._members, PLACES)[:, place]
        return np.asarray(wanted & (gap <= CLOSED * self._size))

    def _no_firmer(self, place: int, wanted: Mask, ordinary: Floats) -> Mask:
        """Whether members are about as soft at a place around where they close, or have no
        position of full rank there."""
        there = self._closed(place, wanted)
        rank, rows = self._rank(0, place, there), len(self._model.row_names)
        unclear = there & ~(np.abs(rank - np.rint(rank)) < WHOLE)
        there &= np.rint(rank) == rows
        firmer = there & ~(self._softness(place, there) <= RISING * ordinary)
        return np.asarray(~unclear & ~firmer)

    def _rank(self, which: int, place: int, wanted: Mask) -> Floats:
        """(members,) effective ranks at a place, with the own penalty or one of the soft ones."""
        found, own = self._ranks[which], self._own.structs.member(0)
        found.wanted[:] = wanted
        trace_members(self._model.unit, own, self._work, place, found)
        return self._model.n - found.trace

    def _softness(self, place: int, wanted: Mask) -> Floats:
        """(members,) the distance σ at a place, with the smallest penalty that resolves it."""
        rows = len(self._model.row_names)
        sigma: Floats = np.full(self._members, 1e-5)
        left = wanted.copy()
        for which, penalty in enumerate(RESOLVING, 1):
            if left.any():
                missing = rows - self._rank(which, place, left)
                shown = left & (missing > 0.0) & (missing < 0.5)
                sigma = np.where(shown, distance(missing, penalty), sigma)
                left &= ~shown & (missing == missing)
        return sigma

    def _penalties(self, base: Floats, ordinary: Floats, wanted: Mask) -> tuple[Floats, Floats]:
        """(members,) penalties and `rounding`, which the own structs have then."""
        own, found = self._own.structs, self._ranks[0]
        sigmas = ordinary.tolist()
        stiff = np.array([stiff_penalty(self._penalty, sigma) for sigma in sigmas])
        own.rows.alpha[:] *= (stiff / base)[:, None]
        own.penalty[:] = stiff
        found.wanted[:] = wanted
        round_members(self._model.unit, own.member(0), self._work, ASIDE, found)
        before, parts = stiff.tolist(), np.where(wanted, found.rounding, 0.0).tolist()
        each = list(zip(before, sigmas, parts, strict=True))
        penalty = np.array([light_penalty(*one) for one in each])
        own.rows.alpha[:] *= (penalty / stiff)[:, None]
        own.penalty[:] = penalty
        roundings = [
            rounding_of(last, first, part)
            for last, (first, _, part) in zip(penalty.tolist(), each, strict=True)
        ]
        own.rounding[:] = roundings
        return penalty, np.array(roundings)

    def _limits(
        self, penalty: Floats, rounding: Floats, ordinary: Floats
    ) -> tuple[Floats, Floats]:
        """(members,) `close` and `patience`."""
        found = []
        for own, left, sigma in zip(
            penalty.tolist(), rounding.tolist(), ordinary.tolist(), strict=True
        ):
            close = close_to(sigma)
            found.append((close, patience_of(own, left, close, sigma)))
        close, patience = np.array(found).T.copy()
        return close, patience

    def _completed(self, masses: Masses, penalty: Floats, rounding: Floats, given: Floats) -> Mask:
        """Complete the velocities; returns where they agree with those given."""
        found, of = self._velocities, self._completing
        if of.is_of(self._model.system):
            self._own.copy_to(of.structs)
        else:
            of.take_rows(self._own)
            of.put(self._drawn, masses, penalty, rounding)
        wanted = found.wanted.reshape(self._members, -1)
        wanted[:, self._given] = given
        unit, work = self._model.unit, self._work_to_complete
        complete_members(unit, of.structs.member(0), work, TO_ROUNDING, found)
        fastest = np.abs(given).max(axis=1, initial=0.0)
        return np.asarray(found.wrong <= AGREED * np.maximum(NOTHING, fastest))

    def put_into(self, systems: MemberStructs, starts: Starts) -> None:
        """Write the systems of the members, as their steps need them, where others stand."""
        self._own.copy_to(systems)
        for name in (*SOLVES, 'ordinary', 'close', 'patience'):
            getattr(systems, name)[:] = getattr(starts, name)


class OfOneSystem:
    """Structs of the members' own systems, or of these with more rows behind theirs."""

    def __init__(self, model: Model, system: System, members: int) -> None:
        self.structs = MemberStructs(system, members, (*NUMBERS, *SOLVES))
        self._model, self._system = model, system
        self._fill = filled(model.layout.movable, system.mass, system.rows)
        self._scales = MemberScales(model.unit, self.structs, model.layout.blocks)

    def is_of(self, system: System) -> bool:
        """Whether the structs are like this system."""
        return self._system is system

    def take_rows(self, own: OfOneSystem) -> None:
        """The numbers of the rows that the members' own systems have; more rows keep theirs."""
        of, to = own.structs, self.structs
        to.size[:], to.rows.length2[:] = of.size, of.rows.length2
        for name in ('b', 'term', 'c'):
            numbers = getattr(of.rows, name)
            getattr(to.rows, name)[:, : numbers.shape[1]] = numbers

    def put(self, drawn: Floats, masses: Masses, penalty: Floats, rounding: Floats) -> None:
        """Scales of the rows as drawn (members, blocks D), m, and all numbers that depend on these
        masses, penalties and `rounding` (members,)."""
        diagonal, k, w, _ = masses
        own, layout = self.structs, self._model.layout
        own.mass.diagonal[:], own.mass.k[:], own.mass.w[:] = diagonal, k, w
        own.mean[:], own.penalty[:], own.rounding[:] = diagonal.mean(axis=1), penalty, rounding
        self._scales.put(drawn, diagonal, np.array(own.mean), penalty)
        skew = self._model.system.mass.skew
        for name, values in self._fill.masses_of(layout.dimension, diagonal, k, skew, w).items():
            getattr(own.pattern, name)[:] = values

    def copy_to(self, other: MemberStructs) -> None:
        """Write the numbers where others stand."""
        for path in (*NUMBERS, *SOLVES):
            of, to = self.structs, other
            *parts, name = path.split('.')
            for part in parts:
                of, to = getattr(of, part), getattr(to, part)
            getattr(to, name)[:] = getattr(of, name)
