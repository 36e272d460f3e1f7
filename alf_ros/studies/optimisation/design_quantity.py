"""One number of a sample: a quantity, its magnitude, or a transmission angle; with derivatives.

A quantity has the name that `record` knows, such as `knee.force.x`. `norm(knee.force)` is the
magnitude of one with components, `abs(motor.effort)` of a number. `transmission(A, B)` (rad, 0 to
π/2) is the transmission angle of the bar between two points, for the motion at the instant.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError, StepError
from alf_ros.simulation.quantities import Group, full_name, groups
from alf_ros.simulation.sample import Sample
from alf_ros.studies.atlas.transmission import bar_between
from alf_ros.studies.optimisation.differences import OFFSETS, slope
from alf_ros.studies.optimisation.displaced_scenes import DisplacedScene
from alf_ros.studies.optimisation.instants import DesignMotion

CALL = re.compile(r'(\w+)\((.+)\)')
_SIZES = ('norm', 'abs')
_WITHOUT = ('works.', 'diagnostics.')  # kinds of quantities without a derivative


@dataclass(frozen=True, eq=False)
class DesignQuantity:
    """`text` as it was given, its unit, and how it is read: the components (components,), of which
    the magnitude is taken if it `is_size`. turns: whether they are angles, which count turns."""

    text: str
    unit: str
    read: Callable[[Sample], Floats]
    is_size: bool
    turns: bool

    def values(self, samples: Sequence[Sample]) -> Floats:
        """(N,) of samples. Raises StepError where it is not defined, as in a singular position."""
        found = np.array([self.value(self.read(sample)) for sample in samples])
        for sample, value in zip(samples, found.tolist(), strict=True):
            if not np.isfinite(value):
                raise StepError(f'{self.text} has no value', 'as in a singular position', sample.t)
        return found

    def value(self, components: Floats) -> float:
        """The number of its components."""
        return float(np.linalg.norm(components) if self.is_size else components[0])

    def slopes(self, motion: DesignMotion, which: Sequence[int], size: float) -> Floats:
        """(which, P) its derivatives at samples of a motion by the numbers of the design.

        size: of its values. Raises InputError where it has none.
        """
        return np.array([self._slopes(motion, n, size) for n in which])

    def _slopes(self, motion: DesignMotion, n: int, size: float) -> Floats:
        sample, (dq, dqd) = motion.samples[n], motion.tangent(n)
        here = self.read(sample)
        along = here / np.linalg.norm(here) if self.is_size and here.any() else np.ones(here.size)
        found, displaced = np.zeros(len(dq)), motion.displaced
        for k, scenes in enumerate(displaced.of):
            step, name = float(displaced.steps[k]), displaced.names[k]
            each = [
                self._displaced(scene, sample, offset * step * dq[k], offset * step * dqd[k])
                for offset, scene in zip(OFFSETS, scenes, strict=True)
            ]
            change = np.array(each) - here
            if self.turns:
                change -= 2.0 * np.pi * np.round(change / (2.0 * np.pi))
            what = f'{self.text} at t = {sample.t:.6g} s'
            found[k] = along @ slope(change, step, name, what, size)
        return found

    def _displaced(self, scene: DisplacedScene, sample: Sample, dq: Floats, dqd: Floats) -> Floats:
        return self.read(scene.sample(sample.t, sample.state, dq, dqd))


def design_quantity(given: Any, key: str, sample: Sample) -> DesignQuantity:
    """The quantity of a text, for samples of a scene. Raises InputError, which says `key`."""
    if not isinstance(given, str) or not given.strip():
        expected = 'a quantity, norm(…), abs(…) or transmission(A, B)'
        raise InputError('not a quantity', key=key, value=given, expected=expected)
    text, inner = given.strip(), given.strip()
    called = CALL.fullmatch(text)
    if called and called[1] == 'transmission':
        return _transmission(text, called[2], key, sample)
    if called:
        if called[1] not in _SIZES:
            choices = (*_SIZES, 'transmission')
            raise InputError('no such function', key=key, value=called[1], choices=choices)
        inner = called[2].strip()
    known: dict[str, tuple[Group, int, int | None]] = {}
    for group in groups(sample):
        for n, name in enumerate(group.names):
            known[name] = group, n, None
            for c, axis in enumerate(group.components):
                known[f'{name}.{axis}'] = group, n, c
    full = full_name(inner, tuple(known), key)
    group, row, component = known[full]
    if full.startswith(_WITHOUT):
        raise InputError('this quantity has no derivative', key=key, value=inner)
    if called is None and group.components and component is None:
        raise InputError(
            'not a single number', key=key, value=inner, expected=f'norm({inner}) or {inner}.x'
        )
    if component is None:
        units = set(group.units)
    else:
        units = {group.units[component]}
    if len(units) > 1:
        raise InputError('components of several units have no norm', key=key, value=inner)
    unit = units.pop()

    def read(sample: Sample) -> Floats:
        found = np.asarray(group.read(sample)[row], dtype=float)
        return np.atleast_1d(found if component is None else found[component])

    return DesignQuantity(text, unit, read, called is not None, unit == 'rad')


def _transmission(text: str, inner: str, key: str, sample: Sample) -> DesignQuantity:
    try:
        bar = bar_between(sample.model.mechanism, [name.strip() for name in inner.split(',')])
    except InputError as error:
        raise error.about(key) from None

    def read(sample: Sample) -> Floats:
        state = sample.state
        return np.array([bar.angle(sample.model, state.q, state.qd)])

    return DesignQuantity(text, 'rad', read, False, False)
