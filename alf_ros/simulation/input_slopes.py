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
from alf_ros.model.compile import Model
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation.applied import NO_INPUTS, Inputs
from alf_ros.simulation.named_inputs import named_inputs
from alf_ros.simulation.neighbour import ARRAYS, Neighbour
from alf_ros.simulation.parameter_slopes import ParameterSlopes
from alf_ros.simulation.state_direction import StateDirection

_NAME = re.compile(r'((?:joints|wrenches|targets)\..*?)(?:\[(\d*):(\d*)\])?')
_LINEAR = 1e-12  # of the size of a number, by which data that are linear in it may be off


def is_input(name: str, scene: Scene) -> bool:
    """Whether a name is of an input, and not of a number of the scene."""
    if _NAME.fullmatch(name) is None:
        return False
    try:
        overrides.number(scene, name)
    except InputError:
        return True
    return False


class InputSlopes:
    """Has the form of `ParameterSlopes`, with all slopes of the scene `here` zero.

    Raises InputError for an unknown input, and for one whose forces are not linear in it.
    """

    value = 0.0

    def __init__(self, name: str, here: Neighbour) -> None:
        found = _NAME.fullmatch(name)
        assert found is not None
        self.name, self._here = name, here
        (self.input,) = named_inputs(here.start.model, here.scene.effects, [found[1]], 'tangents')
        if self.input.name != found[1]:
            raise InputError(
                'not the whole name', key='tangents', value=found[1], expected=self.input.name
            )
        self.first = int(found[2] or 0)
        self.end = int(found[3]) if found[3] else None  # the step it does not act in any more
        if self.end is not None and self.end <= self.first:
            raise InputError(
                'no steps', key='tangents', value=name, expected=f'{found[1]}[100:200]'
            )
        self.arrays = {
            key: np.zeros_like(each) for key, each in zip(ARRAYS, here.arrays(), strict=True)
        }
        if self.is_target:
            self.params(NO_INPUTS)  # refused here, not at the first step

    @property
    def is_target(self) -> bool:
        """Whether it changes what an effect of the scene follows, and adds no force of its own."""
        return self.input.name.startswith('targets.')

    def params(self, inputs: Inputs) -> Floats:
        """The slope of the data of the effects, with inputs held; without places."""
        if not self.is_target:
            return np.zeros_like(self._here.effects(inputs).params)

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

    def by_effort(self, joint: str) -> Floats:
        """Zero, as many as the data of an effort on a joint has numbers."""
        return np.zeros_like(self._here.effort(joint))

    changes_drives = False
    acts = True

    def placed(self, model: Model, t: float) -> tuple[Floats, Floats]:
        """Zero: no block is placed by it."""
        return np.zeros(model.q.size), np.zeros(model.q.size)

    def opening(self, model: Model, q: Floats, t: float) -> Floats:
        """(rows,) zero: no row changes."""
        return np.zeros(model.system.rows.alpha.size)


Slopes: TypeAlias = ParameterSlopes | StateDirection | InputSlopes
