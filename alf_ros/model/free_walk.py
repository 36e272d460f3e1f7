"""Positions along the free motion of a mechanism, closed as far as its rows agree.

Where redundant rows contradict each other by a little, Φ = 0 has no solution nearby; in a singular
position the rows that lose their direction there may contradict the others likewise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel.data import EPS
from alf_ros.mechanism import Mechanism
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.closing_newton import settle_as_far_as_rows_agree
from alf_ros.model.compile import Model, allocate, compile_model, hold
from alf_ros.model.golden_section import lowest
from alf_ros.model.rank import distance, effective_rank
from alf_ros.model.shape_fit import Projector, rounded_violation, violation
from alf_ros.model.smooth_branch import BETWEEN, SmoothBranch

LARGEST = 1e-8  # gap, of the size: lengths that differ by more are not meant to be equal
EXACT = 16.0  # rounding units: lengths that leave no more than that open agree
FELT = 64.0  # the same: below that no motion feels it
PENALTY = 1e8  # tells σ above 1e-3 from those that a small gap makes
_CLEAR = 0.1  # distance to a singular position, of the ordinary one, below which nothing counts
_ASTRAY = 1e-3  # gap, of the size, above which a way has lost the mechanism
_STEP = 0.1  # of the size, from place to place
_STRAIGHT = 0.95  # cosine between tangent and chord, as short cranks in a large mechanism turn
_WHOLE = 0.5  # of a mode: more is lost in a singular position
_FINEST = 0.02  # of a step, from which down that does not count
_TURNS = 4  # of a step, at most
_WAYS = 6  # at most; one freedom has two
_SOFT = 1e4  # penalty that feels modes of σ up to 0.1
_LOST = 0.02  # of a mode: from there on a singular position may be near
_HALVED = 4.0  # times more of a mode is lost where its σ is halved
_FELT_THERE = 1e-3  # of a mode
SEARCHED = 3000  # coordinates up to which singular positions are looked for
_IN = 1e-2  # of a lost mode: σ below 1e-3
_FIRM = 1e6  # penalty that tells a lost mode, of σ below 1e-4, from others that are always soft
_PARTS = 16  # of a branch that is followed through a singular position
_TURN = 200  # of a way that turns sharply
_FURTHER = 1.1  # times its length
_WIDTH = 6e-11  # of that length, to which a singular position is found on it
_NARROWEST = 5e-7  # of the size: a turn between branches that are further apart is clearly one
_NARROW = 0.03  # of an ordinary σ: modes as soft as that are of lengths that nearly agree
# of places on either side of a singular position, of those on a way
_SPACINGS = 0.25, 0.1, 0.04, 0.016
_OFFSETS = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
_CLOSED = 256.0  # rounding units that these places may leave open
_ROUNDS = 3  # of putting places on a branch
# of the polynomial of seventh order through such places: value and three derivatives at 0
_DERIVATIVES = np.linalg.inv(np.vander(_OFFSETS, increasing=True))[:4] * [[1], [1], [2], [6]]


class SoftPlace(NamedTuple):
    """Where a mode is softest on a branch: q, blocks D, m; first and second derivative of the
    branch by parts of the way beside it, m; by how much places on the branch may be open, m; and
    whether it could not be followed further."""

    q: Floats
    along: Floats
    bend: Floats
    usual: float
    ends: bool


class Walk:
    """Positions along the free motion of a model, each closed as far as its rows agree."""

    def __init__(self, model: Model, dependent_rows: int) -> None:
        self.model, self.dependent_rows = model, dependent_rows
        self._work = allocate(model, model.system, 0)
        reach = max(model.size, float(np.abs(model.q).max()))
        self.rounding = EPS * reach  # m
        self._soft_model, self._firm_model = model.with_penalty(_SOFT), model.with_penalty(_FIRM)
        self._step = _STEP

    def places(self, q: Floats, count: int, seed: int = 0) -> tuple[list[Floats], list[Floats]]:
        """Positions on ways from q, forth and back, so many on each if it goes as far; and those
        singular positions between them in which rows contradict each other by so little that
        they are meant to agree."""
        model, random = self.model, np.random.default_rng(seed)
        self._step = _STEP * random.uniform(0.8, 1.0)
        freedoms = model.n - (len(model.row_names) - self.dependent_rows)
        start = self.settled(q)
        found, singular = [start], list[Floats]()
        for _ in range(min(_WAYS, 2 * freedoms) // 2):
            direction = random.standard_normal(model.n)
            forth, back = (list(self._way(q, s * direction, count)) for s in (1.0, -1.0))
            found += forth + back
            if model.n <= SEARCHED:
                singular += self._singular([*reversed(back), start, *forth])
        least, most = FELT * self.rounding, LARGEST * model.size
        near = [place for place in singular if least < self.widest(place) <= most]
        return [place for place in found if self.is_ordinary(place)], near

    def _way(self, q: Floats, direction: Floats, count: int) -> Iterator[Floats]:
        model, at, longest = self.model, q, self._step * self.model.size
        for _ in range(count):
            along = self._free(at, direction)
            length = float(np.abs(along).max())
            if not length > 0.0:
                return
            step, turns = longest, _TURNS
            while step > longest / 100.0:  # a short crank takes shorter steps
                ahead = at.copy()
                ahead[: model.n] += step / length * along
                ahead = self.settled(ahead)
                gone = ahead[: model.n] - at[: model.n]
                if not (self.widest(ahead) <= _ASTRAY * model.size and gone @ along > 0.0):
                    step *= 0.25
                    continue
                reached = float(np.abs(gone).max())
                came, lengths = reached > 0.5 * step, np.linalg.norm(gone) * np.linalg.norm(along)
                if came and gone @ along >= _STRAIGHT * lengths:
                    break
                is_singular = not came and self._missing(at) > _WHOLE
                if step > _FINEST * longest and not is_singular:
                    step *= 0.5
                    continue
                if came or not turns:
                    break
                # in a singular position what is free leads aside of branches, chords along them
                along, length, turns = gone, reached, turns - 1
            else:
                return
            at, direction = ahead, gone
            yield at

    def _free(self, q: Floats, direction: Floats) -> Floats:
        """(n,) What the rows leave of a direction: in modes of σ it becomes 1 / (1 + s²)³."""
        model, work = self.model, self._work
        if not kernel.linearise(model.unit, model.system, work, q):
            return np.zeros(model.n)
        x = np.concatenate([direction, np.zeros(q.size - model.n)])
        for _ in range(3):
            work.p[:] = 0.0
            kernel.add_mass_times(model.unit, model.system.mass, 1.0, x, work.p)
            x[: model.n] = work.p
            kernel.solve(model.unit, model.system.pattern, work.diagonal, work.off, x)
        return np.asarray(x[: model.n])

    def settled(self, q: Floats, soft: bool = False) -> Floats:
        """The position near q (blocks D, m) at which only contradictions stay open.

        Newton's method along M. It leaves a contradiction alone: its σ is as small as its gap.
        `soft`: what rows that are about to lose their direction contradict is left alone too.
        """
        model, work = self._soft_model if soft else self.model, self._work
        work.q[:] = q
        part, most = (0.9, 200) if soft else (0.5, 30)
        phi, gap = np.empty((2, len(model.row_names)))
        settle_as_far_as_rows_agree(
            model.unit, model.system, work, part, most, np.empty(q.size), phi, gap
        )
        return work.q.copy()

    def _closed(self, q: Floats) -> Floats | None:
        """As `settled`; None if that leads far off Φ = 0."""
        place = self.settled(q)
        return place if self.widest(place) <= _ASTRAY * self.model.size else None

    def is_ordinary(self, q: Floats) -> bool:
        """Whether the residual at q is a contradiction; beside a singular position it is not."""
        if self.excess([q]) <= EXACT:
            return True
        model, work = self.model, self._work
        if not kernel.linearise(model.unit, model.system, work, q):
            return False
        missing = len(model.row_names) - self.dependent_rows - effective_rank(model, work)
        if distance(missing, model.penalty) < _CLEAR * model.system.ordinary:
            return False
        phi = np.sqrt(model.system.rows.alpha[model.row]) * violation(model, q)
        return bool(np.linalg.norm(Projector(model, q)(phi)) > 0.5 * np.linalg.norm(phi))

    def _singular(self, way: list[Floats]) -> list[Floats]:
        """The singular positions that successive places of a way lie around."""
        found = [self._of_branches(each) for each in self._soft(way)]
        return [place for place in found if place is not None]

    def _missing(self, q: Floats, model: Model | None = None) -> float:
        """By how much rank falls at q: Σ 1 / (1 + s²), with a penalty that feels soft modes, or
        the one of `model`."""
        model = model or self._soft_model
        if not kernel.linearise(model.unit, model.system, self._work, q):
            return 0.0
        rank = effective_rank(model, self._work)
        return len(model.row_names) - self.dependent_rows - rank

    def _is_lost(self, q: Floats) -> bool:
        """Whether whole modes are missing at q, with one of two penalties."""
        missing = self._missing(q), self._missing(q, self._firm_model)
        return missing[0] > 0.5 and any(abs(lost - round(lost)) < _IN for lost in missing)

    def _soft(self, way: list[Floats]) -> Iterator[SoftPlace]:
        """The places between successive places of a way where a mode is softest."""
        missing = [self._missing(q) for q in way]
        for n in range(1, len(way) - 1):
            least, most = sorted((missing[n - 1], missing[n + 1]))
            # beside a position that a long step leaps over, σ is halved at least
            if most <= missing[n] > (_LOST if missing[n] < _HALVED * least else _FELT_THERE):
                found = self._softest(way[n - 1 : n + 2])
                if found is not None:
                    yield found

    def _softest(self, around: list[Floats]) -> SoftPlace | None:
        """The same between three places; None if there is none.

        It is looked for on the branch of the first of them. The others may lie on another one.
        """
        a, b, c = around
        length = float(np.linalg.norm(b - a) + np.linalg.norm(c - b))
        branch = self._branch(a, b - a, length)
        missing = [self._missing(q) for q in branch.places]
        most, last = int(np.argmax(missing)), len(missing) - 1
        usual = max(_CLOSED * self.rounding, 2.0 * self.gap([a, branch.places[-1]]))
        if last + 1 < BETWEEN or not most:
            return None
        if most == last:
            one, two = branch.places[-2:]
            return self._sharpest(one, two, 2.0 * length / _PARTS)
        best: list[Floats] = []

        def height(s: float) -> float:
            best[:] = [self.settled(branch.at(s)[0], soft=True)]
            return 1.0 / max(self._missing(best[0]), 1e-6)

        softest = lowest(height, branch.s[most - 1], branch.s[most + 1], _WIDTH * length)
        height(softest)
        _, along, bend, _ = branch.at(softest)
        return SoftPlace(best[0], 0.5 * length * along, 0.25 * length**2 * bend, usual, False)

    def _sharpest(self, one: Floats, two: Floats, length: float) -> SoftPlace | None:
        """Where a mode is softest in a turn that begins at two places of a branch, too sharp for
        its steps; None if there is no turn on a `length` (m) from there."""
        branch = self._branch(one, two - one, length, length / _TURN)
        missing = [self._missing(q) for q in branch.places]
        most, nothing = int(np.argmax(missing)), np.zeros_like(one)
        if len(missing) < BETWEEN or not 0 < most < len(missing) - 1:
            return None
        return SoftPlace(branch.places[most], nothing, nothing, 0.0, True)

    def _of_branches(self, soft: SoftPlace) -> Floats | None:
        """The singular position at a place; None if there is none, or branches do not tell."""
        if soft.ends or not self._is_lost(soft.q):
            return None
        least, before = FELT * self.rounding, math.inf
        if self.widest(soft.q) <= least:
            return soft.q
        for spacing in _SPACINGS:
            place = self._on_branch(soft, spacing)
            if place is None:
                continue
            # what interpolation leaves open changes with the spacing; a contradiction stays
            gap = self.widest(place)
            if 0.5 * before - least < gap < 1.5 * before + least:
                return place
            before = gap
        return None

    def _branch(
        self, start: Floats, direction: Floats, length: float, step: float = 0.0
    ) -> SmoothBranch:
        """The branch through a place, followed a little further than a length (m), if it goes as
        far. `step` (m): of 16 parts of the length if absent."""
        branch = SmoothBranch(start)
        along = self._free(start, direction[: self.model.n])
        size = float(np.linalg.norm(along))
        if size > 0.0:
            unit = np.zeros_like(start)
            unit[: along.size] = along / size
            branch.follow(unit, step or length / _PARTS, _FURTHER * length, self._closed)
        return branch

    def _on_branch(self, soft: SoftPlace, spacing: float) -> Floats | None:
        """The singular position near a place, on the branch that goes through it; None if there is
        no such branch.

        Nothing tells at q itself how far off the branch it is: at x, an error of y leaves x y
        open. It is interpolated from places on either side, which contradictions put beside the
        branch to opposite sides. `spacing`: of these, in parts of the first derivative.
        """
        q, along, bend, usual, _ = soft
        to_derivatives = _DERIVATIVES / spacing ** np.arange(4.0)[:, None]
        cubic = np.zeros_like(q)
        for _ in range(_ROUNDS):  # a place far off its branch comes to lie elsewhere along it
            places = []
            for s in spacing * _OFFSETS:
                guess = q + s * along + s**2 / 2.0 * bend + s**3 / 6.0 * cubic
                places.append(self.settled(guess))
                if self.widest(places[-1]) > usual:  # its modes are too soft there
                    return None
            q, along, bend, cubic = to_derivatives @ np.array(places)
        return self.settled(q, soft=True)

    def missed(self, q: Floats, direction: Floats, nearby: bool) -> float:
        """By how much (m) lengths miss singular positions, forth and back from q (blocks D, m) in
        a direction (n,), or only those that are `nearby`; 0 if there are none, or too little is
        missed to be felt."""
        start, gap = self.settled(q), 0.0
        for self._step, count in ((0.03, 6), (_STEP, 3)) if nearby else ((_STEP, 48),):
            forth, back = (list(self._way(start, s * direction, count)) for s in (1.0, -1.0))
            for soft in self._soft([*reversed(back), start, *forth]):
                gap = max(gap, self._missed_by(soft))
        return gap if gap > FELT * self.rounding else 0.0

    def _missed_by(self, soft: SoftPlace) -> float:
        """By how much (m) lengths miss a singular position at a place where a mode is softest; 0
        if that is no such position or is not known.

        Branches that cross, x y = 0, become x y = e. There σ, about √(x² + y²), is √2 √e at least,
        unless what the rows contradict is left open.
        """
        if self._is_lost(soft.q):
            place = self._of_branches(soft)
            return 0.0 if place is None else self.widest(place)
        sigma = float(distance(self._missing(soft.q, self._firm_model), _FIRM))
        if not sigma < _NARROW * self.model.system.ordinary:
            return 0.0
        missed = max(0.5 * sigma**2 * self.model.size, self.widest(soft.q))
        return missed if missed > _NARROWEST * self.model.size else 0.0

    def gaps(self, q: Floats) -> Floats:
        """By how much each row is open, m, in the order of `row_names`."""
        return np.abs(violation(self.model, q) * self.model.system.rows.scale[self.model.row])

    def widest(self, q: Floats) -> float:
        """The largest of them, m."""
        return float(self.gaps(q).max(initial=0.0))

    def gap(self, places: list[Floats]) -> float:
        """The largest at any of the places, m."""
        return max((self.widest(q) for q in places), default=0.0)

    def excess(self, places: list[Floats]) -> float:
        """The same in units of the rounding that rows feel there.

        This grows with the square of the way that a slide is pulled out: a direction is the
        difference of two far places, divided by a short length.
        """
        return max((self.widest(q) / self._rounding_at(q) for q in places), default=0.0)

    def _rounding_at(self, q: Floats) -> float:
        """The largest gap that rounding of q leaves, m."""
        scale = self.model.system.rows.scale[self.model.row]
        felt = float((rounded_violation(self.model, q) * scale).max(initial=0.0))
        return max(self.rounding, felt)


def compiled(mechanism: Mechanism) -> Model:
    """A model with the rows that bind positions; rows that bind velocities only have no Φ."""
    model = compile_model(mechanism, PENALTY)
    if not model.system.rows.velocity:
        return model
    system, names, _ = hold(model, (), velocities=False)
    return replace(model, system=system, row_names=tuple(names), row=np.arange(len(names)))


def carried(layout: Layout, q: Floats, model: Model) -> Floats:
    """The movable part of q (blocks D, m) as coordinates of another model of a like mechanism."""
    D, other = layout.dimension, model.layout
    found, places = model.q.copy().reshape(-1, D), q.reshape(-1, D)
    scale = other.length / layout.length  # of unit vectors
    for one, two, unit in (
        (layout.of_point, other.of_point, 1.0),
        (layout.of_vector, other.of_vector, scale),
        (layout.of_auxiliary, other.of_auxiliary, 1.0),
    ):
        for name, block in two.items():
            if block < other.movable and name in one:
                found[block] = unit * places[one[name]]
    return found.ravel()
