"""One number of a sample: a quantity, its magnitude, or a transmission angle; with derivatives.

`named_number` describes the names. `transmission(A, B)` (rad, 0 to π/2) is the transmission angle
of the bar between two points, for the motion at the instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError, StepError
from alf_ros.simulation.input_checks import closed
from alf_ros.simulation.named_number import CALL, named_number, number_of
from alf_ros.simulation.named_quantity import NamedQuantity, slope_along
from alf_ros.simulation.sample import Sample
from alf_ros.studies.atlas.transmission import angle_of, bar_between, slope_of
from alf_ros.studies.optimisation.instants import DesignMotion

_TRANSMISSION = 'transmission'


@dataclass(frozen=True, eq=False)
class DesignQuantity:
    """`text` as it was given, its unit, and how it is read: the components (components,).

    value: the number of these components; slope: its derivatives by them (components,). So the
    components are smooth where the number has a kink. turns: whether they are angles, which count
    turns. named: the quantity, if it has a name."""

    text: str
    unit: str
    read: Callable[[Sample], Floats]
    value: Callable[[Floats], float]
    slope: Callable[[Floats], Floats]
    turns: bool
    named: NamedQuantity | None

    def values(self, samples: Sequence[Sample]) -> Floats:
        """(N,) of samples. Raises StepError where it is not defined, as in a singular position."""
        found = np.array([self.value(self.read(sample)) for sample in samples])
        for sample, value in zip(samples, found.tolist(), strict=True):
            if not np.isfinite(value):
                raise StepError(f'{self.text} has no value', 'as in a singular position', sample.t)
        return found

    def slopes(self, motion: DesignMotion, which: Sequence[int], size: float) -> Floats:
        """(which, P) its derivatives at samples of a motion by the numbers of the design.

        size: of its values. Raises InputError where it has none.
        """
        return np.array([self._slopes(motion, n, size) for n in which])

    def _slopes(self, motion: DesignMotion, n: int, size: float) -> Floats:
        sample, (dq, dqd) = motion.samples[n], motion.tangent(n)
        if self.named is not None:
            self.named.check_unique(sample)
        along = self.slope(self.read(sample))
        return np.array(
            [
                along @ slope_along(self.read, self.turns, sample, *each, self.text, size)
                for each in zip(motion.displaced.all, dq, dqd, strict=True)
            ]
        )


def design_quantity(given: Any, key: str, sample: Sample) -> DesignQuantity:
    """The quantity of a text, for samples of a scene. Raises InputError, which says `key`."""
    if not isinstance(given, str) or not given.strip():
        expected = 'a quantity, norm(…), abs(…) or transmission(A, B)'
        raise InputError('not a quantity', key=key, value=given, expected=expected)
    given = closed(given.strip(), key)
    called = CALL.fullmatch(given)
    if called and called[1] == _TRANSMISSION:
        return _transmission(given, called[2], key, sample)
    number = named_number(given, key, sample, (_TRANSMISSION,))
    of = number.quantity
    value = partial(number_of, is_size=number.is_size)
    slope = _direction if number.is_size else np.ones_like
    return DesignQuantity(number.text, number.unit, of.read, value, slope, of.turns, of)


def _direction(components: Floats) -> Floats:
    """The derivative of their magnitude."""
    size = np.linalg.norm(components)
    return components / size if size > 0.0 else np.ones_like(components)


def _transmission(text: str, inner: str, key: str, sample: Sample) -> DesignQuantity:
    try:
        bar = bar_between(sample.model.mechanism, [name.strip() for name in inner.split(',')])
    except InputError as error:
        raise error.about(key) from None

    def read(sample: Sample) -> Floats:
        state = sample.state
        return bar.along_and_across(sample.model, state.q, state.qd)

    return DesignQuantity(text, 'rad', read, angle_of, slope_of, False, None)
