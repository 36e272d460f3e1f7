"""Turning points, branch points and flutter points of a path of equilibria.

In both the stiffness Zᵀ (K + L) Z has a zero eigenvalue μ. In a turning point (limit point, fold)
the path turns back in its number. In a branch point another path crosses, and the path continues.
On the side branch of a pitchfork the number turns there, and μ touches zero without a change of
sign.

Along a step of length s, μ(s) is smooth. A bracket of its zero is found by bisection. Then μ, the
number and the position are interpolated from eight points around the zero (Chebyshev nodes). So no
point is computed very near to it, where Newton's method has few digits.

In a flutter point an oscillation begins to grow, or ends to. The stiffness is regular there, and
the loads have no potential, or damping gives energy. It is found by bisection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import brentq

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.studies.statics.arc_length import PathStep, corrected
from alf_ros.studies.statics.path_point import PathDirection, PathPoint
from alf_ros.studies.statics.rest_stability import UNSTABLE, growing_motion

TURN, BRANCH, FLUTTER = 'turn', 'branch', 'flutter'
_NODES = 8
_AROUND = 0.15  # of a step, that the nodes reach
_BRACKET = 0.02  # of a step
_FLUTTER = 1e-10  # of a step: how near to each other stable and unstable points come
_TOGETHER = 1e-5  # of a step, within which zeros count as one
_TURNED = 1e-3  # of the slope of the number before, that is left where it turns
_SMOOTH = 1e-6  # of the largest coefficient, that the last ones of a smooth μ may be


@dataclass(frozen=True, eq=False)
class CriticalPoint:
    """kind: TURN, BRANCH or FLUTTER. point; leaving: the direction of the path there; soft: the
    motion that has no stiffness, or that flutters. count: how many eigenvalues of the stiffness
    vanish. smooth: False if the stiffness jumps."""

    kind: str
    point: PathPoint
    leaving: PathDirection
    soft: PathDirection
    count: int
    smooth: bool


@dataclass(frozen=True, eq=False)
class _Mark:
    """A point at s along a step, with the direction of the path there."""

    s: float
    point: PathPoint
    direction: PathDirection


Measure = Callable[[PathPoint, PathDirection], float]
Measures = tuple[Measure, ...]  # of one zero: others than the first are smooth where it has a kink


def critical_points(step: PathStep) -> Iterator[CriticalPoint]:
    """Those between the two ends of a step, in their order."""
    a, b = step.before, step.after
    length = a.scales.product(step.leaving, b.since(a))
    first, last = _Mark(0.0, a, step.leaving), _Mark(length, b, step.arriving)
    yield from _Zeros(step, length).between(first, last)


class _Zeros:
    """Where the stiffness is singular along a step."""

    def __init__(self, step: PathStep, length: float) -> None:
        self._step, self._length = step, length

    def _mark(self, s: float) -> _Mark:
        point = corrected(self._step.before, self._step.leaving, s)
        return _Mark(s, point, point.tangent(self._step.leaving))

    def between(self, first: _Mark, last: _Mark) -> Iterator[CriticalPoint]:
        """The critical points between two marks."""
        measures, count = _changes(first.point, last.point)
        turns = first.direction.value * last.direction.value < 0.0
        if count > 1 and last.s - first.s > _TOGETHER * self._length:
            middle = self._mark(0.5 * (first.s + last.s))
            yield from self.between(first, middle)
            yield from self.between(middle, last)
        elif count:
            found = self._located(first, last, measures, TURN if turns else BRANCH, count)
            apart = (
                self._between_apart(first, last) if turns and not _turns(found, first) else None
            )
            if apart is None:
                yield found
            else:
                yield from self.between(first, apart)
                yield from self.between(apart, last)
        elif turns and _is_beyond(first) and _is_beyond(last):
            opposite = self._between_opposite(first, last)
            if opposite is not None:
                yield from self.between(first, opposite)
                yield from self.between(opposite, last)
                return
            # the eigenvalue touches zero: the number turns where another path crosses
            touched = self._located(first, last, (lambda _, along: along.value,), BRANCH, 1)
            yield replace(touched, count=_vanish(touched.point, first.point, last.point))
        elif _flutters(first.point) != _flutters(last.point):
            yield self._flutter(first, last)

    def _between_opposite(self, first: _Mark, last: _Mark) -> _Mark | None:
        """A mark between a turn and a branch point that change the sign of two eigenvalues the
        opposite way, so that as many are negative at both ends; None if there is none."""
        while last.s - first.s > _TOGETHER * self._length:
            middle = self._mark(0.5 * (first.s + last.s))
            if not _is_beyond(middle):
                return None
            if _changes(first.point, middle.point)[1]:
                return middle
            turned = first.direction.value * middle.direction.value < 0.0
            first, last = (first, middle) if turned else (middle, last)
        return None

    def _between_apart(self, first: _Mark, last: _Mark) -> _Mark | None:
        """A mark between where the number turns and a zero of an eigenvalue elsewhere; None if
        there is none."""
        while last.s - first.s > _TOGETHER * self._length:
            middle = self._mark(0.5 * (first.s + last.s))
            if not _is_beyond(middle):
                return None
            turned = first.direction.value * middle.direction.value < 0.0
            if turned != bool(_changes(first.point, middle.point)[1]):
                return middle
            first, last = (first, middle) if turned else (middle, last)
        return None

    def _flutter(self, first: _Mark, last: _Mark) -> CriticalPoint:
        """Where an oscillation begins or ends to grow between two marks."""
        before = _grows(first.point)
        while last.s - first.s > _FLUTTER * self._length:
            middle = self._mark(0.5 * (first.s + last.s))
            first, last = (middle, last) if _grows(middle.point) == before else (first, middle)
        found = last.point if _grows(last.point) else first.point
        moves = PathDirection(growing_motion(found.instant, found.lam), 0.0)
        return CriticalPoint(
            FLUTTER,
            found,
            found.tangent(self._step.leaving),
            moves.times(1.0 / found.scales.size(moves)),
            0,
            True,
        )

    def _located(
        self, first: _Mark, last: _Mark, measures: Measures, kind: str, count: int
    ) -> CriticalPoint:
        """The zero of the first measure between two marks."""
        known = {each.s: each for each in (first, last)}

        def value(s: float) -> float:
            at = known[s] if s in known else self._mark(s)
            return measures[0](at.point, at.direction)

        s = 0.5 * (first.s + last.s)
        if count == 1:
            s = brentq(value, first.s, last.s, xtol=_BRACKET * self._length)
        reach = min(_AROUND * self._length, 0.5 * (last.s - first.s))
        try:
            found = self._interpolated(s, reach, measures, (first.s, last.s))
        except InputError:
            found = None
        smooth = found is not None
        if found is None:
            found = self._mark(brentq(value, first.s, last.s, xtol=1e-12 * self._length)).point
        return CriticalPoint(
            kind, found, found.tangent(self._step.leaving), found.soft, count, smooth
        )

    def _interpolated(
        self, near: float, reach: float, measures: Measures, within: tuple[float, float]
    ) -> PathPoint | None:
        """The point where an interpolated measure is zero; None if none is smooth there."""
        nodes = chebyshev.chebpts1(_NODES)
        marks = [self._mark(near + reach * x) for x in nodes]
        root = None
        for measure in measures:
            values = np.array([measure(each.point, each.direction) for each in marks])
            fitted = chebyshev.chebfit(nodes, values, _NODES - 1)
            if np.abs(fitted[-2:]).max() > _SMOOTH * np.abs(fitted).max():
                continue
            roots = chebyshev.chebroots(fitted)
            real = roots.real[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) < 1.0)]
            at = near + reach * real
            real = real[(within[0] <= at) & (at <= within[1])]
            if real.size:
                root = float(real[np.argmin(np.abs(real))])
                break
        if root is None:
            return None

        def there(numbers: Floats) -> Floats:
            return np.asarray(
                chebyshev.chebval(root, chebyshev.chebfit(nodes, numbers, _NODES - 1))
            )

        start = self._step.before
        value = float(there(np.array([each.point.value - start.value for each in marks])))
        q = there(np.array([each.point.since(start).q for each in marks]))
        found = start.beside(PathDirection(q, value))
        rests = found.left <= 1e-9 * max(found.scale, start.scale)
        return found if rests else None


def _changes(a: PathPoint, b: PathPoint) -> tuple[Measures, int]:
    """An eigenvalue that changes its sign between two points, or the determinant of loads without
    potential; and how many change.

    Eigenvalues are in their order, so one that crosses another has a kink, and their product has
    none. One that is zero at an end does not count: there the path begins or ends in a critical
    point.
    """
    if not (a.stability.conservative and b.stability.conservative):
        size = float(np.abs(a.stiffness).max(initial=0.0)) or 1.0
        signs = [np.linalg.det(each.stiffness / size) for each in (a, b)]
        return (lambda at, _: float(np.linalg.det(at.stiffness / size)),), int(
            signs[0] * signs[1] < 0.0
        )
    changed = np.flatnonzero((a.squares * b.squares < 0.0) & ~a.are_zero & ~b.are_zero)
    which = int(changed[0]) if changed.size else 0
    spans = (which, which + 1), (which, which + 2), (max(which - 1, 0), which + 1)
    return tuple(partial(_product, *span) for span in spans), int(changed.size)


def _product(first: int, last: int, at: PathPoint, _: PathDirection) -> float:
    """Of some eigenvalues."""
    return float(np.prod(at.squares[first:last]))


def _turns(found: CriticalPoint, before: _Mark) -> bool:
    """Whether the number turns at a critical point, and not elsewhere in its step."""
    return abs(found.leaving.value) <= _TURNED * abs(before.direction.value)


def _vanish(found: PathPoint, a: PathPoint, b: PathPoint) -> int:
    """How many eigenvalues vanish between two points, at least one: two may change their signs the
    opposite way at one place."""
    most = np.maximum(np.abs(a.squares), np.abs(b.squares))
    return max(1, int(np.count_nonzero(np.abs(found.squares) <= _TOGETHER * most)))


def _flutters(point: PathPoint) -> bool:
    """Whether a motion grows at a point whose loads have no potential, or damping gives energy."""
    told = point.stability
    return told.verdict == UNSTABLE and not (told.conservative and told.draining)


def _grows(point: PathPoint) -> bool:
    """Whether a motion grows, by however little."""
    told = point.stability
    return told.verdict == UNSTABLE if told.growth is None else told.growth > 0.0


def _is_beyond(mark: _Mark) -> bool:
    """Whether the stiffness is not singular at a mark."""
    return not mark.point.are_zero.any()
