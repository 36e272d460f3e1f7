"""The numbers that an optimisation varies, each between two bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation.differences import OFFSETS
from alf_ros.simulation.displaced_scenes import DisplacedScenes, Middle
from alf_ros.simulation.input_checks import numbers
from alf_ros.simulation.simulation import Simulation

# steps of differences: of the number, which counts as this part of its range at least
_STEP, _LEAST = 2.5e-3, 0.1
_FRAME = 4.0  # of the size of the drawing
_INWARD = 1e-4  # of the range: differences find scenes on both sides of a place so far within


@dataclass(frozen=True, eq=False)
class DesignNumbers:
    """Names of numbers of a scene, as of `fork --set`, with bounds.

    framed: the scene as it is computed. before (P,): the values in the scene, which may lie
    outside. asked (2, P): the bounds asked for. lower, upper (P,): the bounds of the search. A
    bound beyond which there is no scene, such as a mass of 0, is moved inwards, because a
    derivative needs scenes on both sides.
    """

    scene: Scene
    framed: Scene
    names: tuple[str, ...]
    before: Floats
    asked: Floats
    lower: Floats
    upper: Floats

    @property
    def width(self) -> Floats:
        """(P,) from bound to bound."""
        return self.upper - self.lower

    def at(self, values: Sequence[float] | Floats) -> Scene:
        """The scene with other values (P,). Raises InputError if there is no such scene."""
        return self._changed(self.scene, values)

    def framed_at(self, values: Sequence[float] | Floats) -> Scene:
        """The same of `framed`."""
        return self._changed(self.framed, values)

    def _changed(self, scene: Scene, values: Sequence[float] | Floats) -> Scene:
        changes = {n: repr(float(x)) for n, x in zip(self.names, values, strict=True)}
        return overrides.with_changes(scene, changes, prefix='vary.')


def displaced(numbers: DesignNumbers, values: Floats, simulation: Simulation) -> DisplacedScenes:
    """The scenes around values (P,) of the numbers, of which there is a simulation."""
    steps = _STEP * np.minimum(numbers.width, np.maximum(np.abs(values), _LEAST * numbers.width))

    def changed(k: int, value: float) -> Scene:
        other = values.copy()
        other[k] = value
        return numbers.framed_at(other)

    return DisplacedScenes(numbers.names, values, steps, changed, Middle.of(simulation))


def design_numbers(scene: Scene, vary: Any) -> DesignNumbers:
    """The numbers of `{name: [least, largest]}`. Raises InputError."""
    if not isinstance(vary, Mapping) or not vary:
        raise InputError(
            'nothing varies', key='vary', value=vary, expected='{name: [least, largest]}'
        )
    scene = overrides.with_inputs(scene, [name for name in vary if isinstance(name, str)], 'vary.')
    lower, upper, before = [], [], []
    for name, pair in vary.items():
        key = f'vary.{name}'
        if not isinstance(name, str):
            raise InputError('no name', key='vary', value=name, expected='coupler.mass')
        try:
            low, high = numbers(pair, 'pair of bounds', 2)
        except InputError:
            expected = '[least, largest], both finite'
            raise InputError('not two bounds', key=key, value=pair, expected=expected) from None
        if not low < high:
            raise InputError('not two bounds', key=key, value=pair, expected='least < largest')
        if name.partition('.')[0] == 'solver':
            raise InputError('a setting of the solver is no number of the design', key=key)
        try:
            before.append(overrides.number(scene, name))
        except InputError as error:
            raise error.about(key) from None
        lower.append(low)
        upper.append(high)
    return _inward(
        DesignNumbers(
            scene,
            _framed(scene),
            tuple(vary),
            np.array(before),
            np.array([lower, upper]),
            np.array(lower),
            np.array(upper),
        )
    )


def _inward(asked: DesignNumbers) -> DesignNumbers:
    """With bounds a little inwards where the scenes end."""
    reach = max(OFFSETS) * _STEP * _LEAST * asked.width
    lower, upper = asked.lower.copy(), asked.upper.copy()
    for k in range(len(asked.names)):
        for bounds, side in ((lower, 1.0), (upper, -1.0)):
            beyond = asked.before.copy()
            beyond[k] = bounds[k] - side * reach[k]
            try:
                asked.at(beyond)
            except InputError:
                bounds[k] += side * _INWARD * asked.width[k]
    return replace(asked, lower=lower, upper=upper)


def _framed(scene: Scene) -> Scene:
    """The scene in a frame of two fixed points, which do nothing but keep the size of the drawing.

    This size is the length of blocks of directions. It is the largest distance of points along an
    axis, with a kink where another pair of points becomes the furthest.
    """
    mechanism = scene.mechanism
    places = np.array([point.at for point in mechanism.points])
    middle, size = places.mean(axis=0), float(np.ptp(places, axis=0).max(initial=0.0)) or 1.0
    corners = {
        f'mechanism.points.{name}': (
            f'{{at: {(middle + side * _FRAME * size).tolist()}, fixed: true}}'
        )
        for name, side in (('frame_first', -0.5), ('frame_last', 0.5))
    }
    return overrides.with_changes(scene, corners)
