"""Derivatives of named quantities of samples, along the tangents of their states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation.displaced_scenes import DisplacedScenes, Middle
from alf_ros.simulation.input_slopes import InputSlopes, Slopes
from alf_ros.simulation.input_values import Inputs
from alf_ros.simulation.named_inputs import NamedInput
from alf_ros.simulation.named_quantity import named_quantity, slope_along, slope_by_push
from alf_ros.simulation.named_values import read_only
from alf_ros.simulation.parameter_slopes import LONGEST
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.state_direction import StateDirection
from alf_ros.simulation.tangent_following import TangentFollowing


class QuantityTangents:
    """Of the parameters that a run follows; `displaced`: the scenes around its scene."""

    def __init__(self, following: TangentFollowing, middle: Middle) -> None:
        values = np.array([each.value for each in following.slopes])
        steps = LONGEST * np.where(values == 0.0, 1.0, np.abs(values))
        changed = partial(_changed, tuple(following.slopes), middle.scene)
        self._places = following.places
        forces = [k for k, each in enumerate(following.slopes) if _is_force(each)]
        self.displaced = DisplacedScenes(following.names, values, steps, changed, middle, forces)

    def of(self, sample: Sample, k: int, name: str) -> float | Floats:
        """Of a quantity by parameter k: a number, or (components,). Raises InputError."""
        if not isinstance(name, str):
            raise InputError('no name', key='quantity', value=name, expected='energy')
        found = named_quantity(name, 'quantity', sample).checked('quantity')
        found.check_unique(sample)
        dq, dqd = sample.state.tangents.reshape(-1, 2, sample.state.q.size)[k]
        # the step that ended there, or the first one
        acts = self._places.acting(max(0, sample.state.step - 1))[k]
        pushed = self.displaced.pushed(k) if acts else None
        beside = partial(self.displaced.moving, k) if acts else self.displaced.along
        around = beside(sample.state, dq, dqd)
        if pushed is not None:
            around = pushed.along(around)
        size = found.read_beside(sample)[1]
        slope = slope_along(found.read, found.turns, sample, around, dq, dqd, found.name, size)
        if pushed is not None:
            slope = slope + slope_by_push(found.read, sample, pushed)
        return read_only(slope) if found.is_vector else float(slope[0])


def _is_force(slopes: Slopes) -> bool:
    """Whether a number is an effort or a wrench from outside."""
    return isinstance(slopes, InputSlopes) and not slopes.is_target


def _pushed(by: NamedInput, value: float, inputs: Inputs) -> Inputs:
    return by.added(inputs, value)


def _changed(
    slopes: Sequence[Slopes], scene: Scene, k: int, value: float
) -> Scene | Callable[[Inputs], Inputs]:
    """The scene with another value of number k, or what adds the value to the inputs held; a
    direction of the state leaves the scene as it is."""
    of = slopes[k]
    if isinstance(of, InputSlopes):
        return partial(_pushed, of.input, value)
    if isinstance(of, StateDirection):
        return scene
    return overrides.with_changes(scene, {of.name: repr(value)})
