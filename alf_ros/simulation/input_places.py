"""The places of inputs that are parameters among the forces, and the steps in which they act.

Behind all that acts, the tangents hold an effort or a wrench of zero for each such input. So the
data of the effects have a place for the number that a derivative is by. The forces of the run stay
as they are. A target needs no place: it has one in the data of its motor.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model.compile import Model
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.held_inputs import place_of
from alf_ros.simulation.input_checks import MOST_STEPS
from alf_ros.simulation.input_slopes import InputSlopes, Slopes
from alf_ros.simulation.input_values import NO_INPUTS, Inputs


class InputPlaces:
    """The places of the inputs among K parameters, and the steps in which these act.

    slopes (K, numbers): of the data of the places, by the parameters.
    """

    def __init__(self, model: Model, slopes: Sequence[Slopes]) -> None:
        self._inputs = {k: s for k, s in enumerate(slopes) if isinstance(s, InputSlopes)}
        found = {s.input.name: s for s in self._inputs.values()}
        self._targets = [s.input for s in found.values() if s.is_target]
        pushing = [s.input for s in found.values() if not s.is_target]
        self._places = {s.name: place_of(model, s.added(NO_INPUTS, 1.0)) for s in pushing}
        self._steps = np.tile([0, MOST_STEPS], (len(slopes), 1))  # in which a parameter acts
        for k, of in self._inputs.items():
            self._steps[k] = of.first, of.end
        self._changes = np.unique(self._steps)
        sizes = [each.slope.size for each in self._places.values()]
        self.slopes = np.zeros((len(slopes), sum(sizes)))
        ends = dict(zip(self._places, np.cumsum(sizes), strict=True))
        for k, of in self._inputs.items():
            if not of.is_target:
                slope, end = self._places[of.input.name].slope, ends[of.input.name]
                self.slopes[k, end - slope.size : end] = slope
        self._known: tuple[Applied, Applied] | None = None

    def __getstate__(self) -> dict[str, object]:
        """Without forces, which belong to this process."""
        return {**vars(self), '_known': None}

    def check(self, inputs: Inputs) -> None:
        """Raises InputError for a motor that follows a curve, where its target is a parameter."""
        for each in self._targets:
            each.added(inputs, 0.0)

    def applied(self, applied: Applied) -> Applied:
        """The same forces, with a place for each input."""
        if not self._places:
            return applied
        if self._known is None or self._known[0] is not applied:
            self._known = applied, applied.holding(applied.inputs, tuple(self._places.values()))
        return self._known[1]

    def check_steps(self, first: int, last: int, key: str) -> None:
        """Raises InputError, which says `key`, for a parameter that acts in no step of a run."""
        for of in self._inputs.values():
            if of.first >= last or of.end <= first:
                raise InputError(
                    'acts in no step of the run',
                    key=key,
                    value=of.name,
                    expected=f'within [{first}:{last}]',
                )

    def acting(self, step: int) -> Floats:
        """(K,) 1 of the parameters that act in a step, 0 of the others."""
        first, end = self._steps.T
        return ((first <= step) & (step < end)).astype(float)

    def stretches(self, step: int, n: int) -> list[int]:
        """n steps from a step on, divided where parameters begin or end to act."""
        inner = self._changes[(self._changes > step) & (self._changes < step + n)]
        edges = [step, *inner.tolist(), step + n]
        return [end - begin for begin, end in pairwise(edges)]
