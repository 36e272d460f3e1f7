"""Numbers of a motion that an optimisation minimises, or keeps between limits.

max(norm(knee.force))                            an extreme, between samples
min, final, mean, integral, rms                  likewise
{at: 0.5, of: points.P.x}                        a value at an instant, s
{crossing: crank_pin.position, value: pi}        the first instant of a value, s
{path: P, through: [[0, 1], [1, 1]], at: [0.1, 0.2]}    a path error, m
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.simulation.input_checks import choice, closed, number, numbers, text
from alf_ros.simulation.named_number import CALL
from alf_ros.simulation.sample import Sample
from alf_ros.studies.ensemble.kept_outputs import DIRECTIONS
from alf_ros.studies.optimisation.design_quantity import DesignQuantity, design_quantity
from alf_ros.studies.optimisation.folds import (
    FOLDS,
    Folded,
    crossing,
    unit_of,
    value_at,
)
from alf_ros.studies.optimisation.instants import DesignMotion
from alf_ros.studies.optimisation.path_error import PathError

_FURTHEST = 1e100  # m, whose square is a number
_EQUAL = 1e-3  # of the largest value: peaks that differ by less count as equal
_KEYS = {
    'at': ('at', 'of'),
    'crossing': ('crossing', 'value', 'direction'),
    'path': ('path', 'through', 'at'),
}


@dataclass(frozen=True, eq=False)
class Asked:
    """A number of one design, its gradient (P,), and for a path error the residuals (m,), whose
    sum of squares is the square of the number, with their derivatives (m, P)."""

    value: float
    gradient: Floats
    residuals: Floats | None = None
    jacobian: Floats | None = None


@dataclass(frozen=True, eq=False)
class DesignGoal:
    """A number of a motion: of a path error, or of a quantity folded over time.

    `text` names it; `unit` of the number.
    """

    text: str
    unit: str
    kind: str
    quantity: DesignQuantity | None = None
    path: PathError | None = None
    at: float = 0.0
    direction: str = 'both'

    def of(self, motion: DesignMotion) -> Asked:
        """Of a motion, with its derivatives. Raises AlfError where it has none."""
        if self.path is not None:
            r, J = self.path.residuals(motion)
            value = float(np.linalg.norm(r))
            gradient = J.T @ r / value if value > 0.0 else np.zeros(J.shape[1])
            return Asked(value, gradient, r, J)
        assert self.quantity is not None
        y = self.quantity.values(motion.samples)
        folded = self._folded(motion, y)
        return Asked(folded.value, self._gradient(motion, folded, float(np.abs(y).max())))

    def has_equal_peaks(self, motion: DesignMotion) -> bool:
        """Whether two peaks of a motion are equal, with other gradients: there the number has a
        kink. Raises AlfError."""
        if self.quantity is None:
            return False
        y = self.quantity.values(motion.samples)
        size, folded = float(np.abs(y).max()), self._folded(motion, y)
        equal = [e for e in folded.others if abs(e.value - folded.value) <= _EQUAL * size]
        if not equal:
            return False
        first, *rest = (self._gradient(motion, each, size) for each in (folded, *equal))
        most = _EQUAL * max(np.abs(each).max() for each in (first, *rest))
        return any(np.abs(each - first).max() > most for each in rest)

    def _gradient(self, motion: DesignMotion, folded: Folded, size: float) -> Floats:
        assert self.quantity is not None
        if folded.jumps:
            motion.check_held(folded.jumps, self.quantity.text)
        which = np.flatnonzero(folded.weights)
        if not which.size:
            return np.zeros(len(motion.displaced.names))
        return folded.weights[which] @ self.quantity.slopes(motion, which.tolist(), size)

    def value(self, motion: DesignMotion) -> float:
        """The number alone. Raises AlfError."""
        if self.path is not None:
            return self.path.distance(motion)
        assert self.quantity is not None
        return self._folded(motion, self.quantity.values(motion.samples)).value

    def size(self, motion: DesignMotion) -> float:
        """A size, in its unit, with which errors of the number compare. Raises AlfError."""
        span = float(motion.t[-1] - motion.t[0])
        if self.quantity is None:
            return motion.simulation.model.size
        if self.kind == 'crossing':
            return span
        largest = float(np.abs(self.quantity.values(motion.samples)).max())
        return largest * span if self.kind == 'integral' else largest

    def _folded(self, motion: DesignMotion, y: Floats) -> Folded:
        t, kinks = motion.t, motion.kinks
        if self.kind == 'at':
            return value_at(t, y, self.at, kinks)
        if self.kind == 'crossing':
            assert self.quantity is not None
            return crossing(t, y, self.at, self.direction, self.quantity.text, kinks)
        return FOLDS[self.kind](t, y, kinks)


def design_goal(data: Any, key: str, sample: Sample, duration: float) -> DesignGoal:
    """The goal of a text or a mapping, for the scene of a sample. Raises InputError."""
    if isinstance(data, Mapping):
        return _mapped(data, key, sample, duration)
    called = CALL.fullmatch(closed(data.strip(), key)) if isinstance(data, str) else None
    if called is None:
        raise InputError('not a number of a motion', key=key, value=data, expected='max(NAME)')
    if called[1] not in FOLDS:
        raise InputError('no such number', key=key, value=called[1], choices=FOLDS)
    quantity = design_quantity(called[2], key, sample)
    unit = unit_of(called[1], quantity.unit)
    return DesignGoal(f'{called[1]}({quantity.text})', unit, called[1], quantity)


def _mapped(data: Mapping[str, Any], key: str, sample: Sample, duration: float) -> DesignGoal:
    kind = next((each for each in ('path', 'crossing', 'at') if each in data), None)
    if kind is None:
        raise InputError('no such number', key=key, value=next(iter(data), ''), choices=_KEYS)
    for name in data:
        if name not in _KEYS[kind]:
            raise InputError('unknown key', key=key, value=name, choices=_KEYS[kind])
    if kind == 'path':
        return _path(data, key, sample, duration)
    if kind == 'at':
        at = number(data['at'], f'{key}.at', 0.0)
        if at > duration:
            raise InputError('after the end', key=f'{key}.at', value=at, expected='the duration')
        quantity = design_quantity(data.get('of'), f'{key}.of', sample)
        return DesignGoal(f'{quantity.text} at {at:g} s', quantity.unit, 'at', quantity, at=at)
    quantity = design_quantity(data['crossing'], f'{key}.crossing', sample)
    value = number(data.get('value', 0.0), f'{key}.value')
    direction = data.get('direction', 'both')
    choice(direction, f'{key}.direction', DIRECTIONS, 'no direction')
    name = f'crossing({quantity.text}, {value:g})'
    return DesignGoal(name, 's', 'crossing', quantity, at=value, direction=direction)


def _path(data: Mapping[str, Any], key: str, sample: Sample, duration: float) -> DesignGoal:
    model, point = sample.model, text(data['path'], f'{key}.path')
    moving = [each.name for each in model.mechanism.points if not each.fixed]
    if point not in moving:
        raise InputError('no movable point', key=f'{key}.path', value=point, choices=moving)
    D, given = model.layout.dimension, data.get('through')
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if not isinstance(given, Sequence) or isinstance(given, str) or not given:
        raise InputError('no places', key=f'{key}.through', value=given, expected='[[x, y], …]')
    places = np.array(
        [numbers(each, f'{key}.through.{k}', D, _FURTHEST) for k, each in enumerate(given)]
    )
    times = None
    if data.get('at') is not None:
        times = np.array(numbers(data['at'], f'{key}.at', len(places)))
        outside = [t for t in times.tolist() if not 0.0 <= t <= duration * (1.0 + 1e-12)]
        if outside:
            raise InputError(
                'outside of the motion',
                key=f'{key}.at',
                value=outside[0],
                expected=f'0 to {duration:g} s',
            )
        times = np.minimum(times, duration)
    return DesignGoal(f'path error of {point}', 'm', 'path', path=PathError(point, places, times))


@dataclass(frozen=True, eq=False)
class DesignLimit:
    """A number of the motion that must lie between `least` and `most`; one of them is finite.

    usual: the size of the number, in its unit, with which it compares to a limit of 0.
    """

    goal: DesignGoal
    least: float
    most: float
    usual: float = 1.0

    def room(self, value: float) -> float:
        """How far a value is inside, in parts of the limit's size; negative outside."""
        return min(value - self.least, self.most - value) / self.size

    @property
    def size(self) -> float:
        """Size of the number, its scale."""
        return self._largest or self.usual

    @property
    def is_zero(self) -> bool:
        """Whether 0 is the only limit, which tells no size."""
        return self._largest == 0.0

    @property
    def _largest(self) -> float:
        return max(abs(x) for x in (self.least, self.most) if math.isfinite(x))


def design_limit(data: Any, pair: Any, key: str, sample: Sample, duration: float) -> DesignLimit:
    """The limit [least, most] of a goal; None in place of a bound that there is not.

    Raises InputError.
    """
    expected = '[least, most], ~ for none'
    if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
        raise InputError('not two limits', key=key, value=pair, expected=expected)
    bounds = []
    for given, none in zip(pair, (-math.inf, math.inf), strict=True):
        bounds.append(none if given is None else number(given, key))
    least, most = bounds
    if not least < most or math.isinf(least) and math.isinf(most):
        raise InputError('not two limits', key=key, value=pair, expected='least < most')
    return DesignLimit(design_goal(data, key, sample, duration), least, most)
