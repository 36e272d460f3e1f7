"""Inputs as parameters: derivatives by efforts, wrenches and targets from outside.

`joints.crank_pin.effort` stands for a number that is added to the held effort, over the whole run.
`joints.crank_pin.effort[100:200]` is added in steps 100 to 199, so that each of many values that
follow one another has a derivative. The scene does not change with it.
"""

from __future__ import annotations

import re
from typing import TypeAlias

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.input_values import NO_INPUTS, Inputs
from alf_ros.simulation.named_inputs import named_inputs
from alf_ros.simulation.neighbour import Neighbour
from alf_ros.simulation.parameter_slopes import ParameterSlopes
from alf_ros.simulation.state_direction import StateDirection
from alf_ros.simulation.still_scene import StillScene

_NAME = re.compile(r'((?:joints|wrenches|targets)\..*?)(?:\[([0-9]{0,16}):([0-9]{0,16})\])?')
_LINEAR = 1e-12  # of the size of a number, by which data that are linear in it may be off


def is_input(name: str, scene: Scene) -> bool:
    """Whether a name is of an input, and not of a number of the scene. A target is an input: one
    from outside acts in place of the number of its motor."""
    if _NAME.fullmatch(name) is None:
        return False
    if overrides.is_target(scene, name):
        return True
    try:
        overrides.number(scene, name)
    except InputError:
        return True
    return False


class InputSlopes(StillScene):
    """The slopes by an input. It acts from step `first` to before step `end`.

    Raises InputError for an unknown input, for steps that cannot be, and for an input whose forces
    are not linear in it.
    """

    def __init__(self, name: str, here: Neighbour) -> None:
        super().__init__(name, here)
        found = _NAME.fullmatch(name)
        assert found is not None
        (self.input,) = named_inputs(here.start.model, here.scene.effects, [found[1]], 'tangents')
        if self.input.name != found[1]:
            raise InputError(
                'not the whole name', key='tangents', value=found[1], expected=self.input.name
            )
        self.first = int(found[2] or 0)
        self.end = int(found[3]) if found[3] else check.MOST_STEPS
        if not self.first < self.end <= check.MOST_STEPS:
            raise InputError(
                'no steps', key='tangents', value=name, expected=f'{found[1]}[100:200]'
            )
        if self.is_target:
            self.params(NO_INPUTS)  # refused here, not at the first step

    @property
    def is_target(self) -> bool:
        """Whether it changes what an effect of the scene follows, and adds no force of its own."""
        return self.input.name.startswith('targets.')

    def params(self, inputs: Inputs = NO_INPUTS) -> Floats:
        """The slope of the data of the effects, with inputs held; without places."""
        if not self.is_target:
            return super().params(inputs)

        def data(value: float) -> Floats:
            return self._here.effects(self.input.added(inputs, value)).params

        here = data(0.0)
        if here.size != self._here.effects(inputs).params.size:
            raise InputError('no tangent: its effect has another form then', key=self.name)
        moved = data(1.0) != here
        # beside a large number, the difference of a small step would be rounding
        step = 2.0 ** np.ceil(np.log2(np.abs(here[moved]).max(initial=1.0)))
        less, more, twice = data(-step), data(step), data(2.0 * step)
        with np.errstate(invalid='ignore'):  # no limit is an infinite one
            change, next_one = (np.where(moved, more - x, 0.0) for x in (less, twice))
        if (np.abs(change + 2.0 * next_one) > _LINEAR * np.abs(step + np.abs(here))).any():
            raise InputError('no tangent: its forces are not linear in it', key=self.name)
        return np.asarray(change / (2.0 * step))


Slopes: TypeAlias = ParameterSlopes | StateDirection | InputSlopes
