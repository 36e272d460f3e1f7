"""The motion of a design whose drives decide on all of it: positions follow from the drives.

At an instant Φ(q, θ) = 0 and Φ_q q̇ + Φ_s ṡ = 0 hold with the prescribed blocks s. So the
derivatives by a number θ are the solutions of

    Φ_q δq = -∂Φ/∂θ        Φ_q δq̇ = -d(Φ_q q̇ + Φ_s ṡ)/dθ

where d/dθ takes θ and δq along, at constant q̇. Nothing is integrated, so the instants are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene.text.scene_document import SceneDocument
from alf_ros.simulation.closed_instant import ClosedInstant
from alf_ros.simulation.displaced_scenes import DisplacedScenes
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.time_kinks import time_kinks
from alf_ros.studies.optimisation.design_numbers import DesignNumbers, displaced
from alf_ros.studies.optimisation.instants import PointTrack, path

_BESIDE = 1e-6  # of the range of a number
_HELD = 1e-12  # s: an instant that is off by less has not moved
_SINGULAR = 1e-6  # singular value, of the largest, from which down the drives do not decide


def is_driven(simulation: Simulation) -> bool:
    """Whether the drives decide on all freedoms."""
    model = simulation.model
    return bool(model.mechanism.drives) and model.n <= round(model.system.rank)


class DrivenDesign:
    """The motion of a scene with values of its numbers, over a duration (s).

    Raises AlfError for a design that cannot be assembled or driven, and one that is singular on
    the way.
    """

    def __init__(
        self, numbers: DesignNumbers, values: Floats, duration: float, period: float
    ) -> None:
        self._numbers, self._values, self._duration = numbers, values, duration
        scene = numbers.framed_at(values)
        self.simulation = Simulation(scene)
        if self.simulation.model.system.rows.velocity:
            raise InputError('positions do not follow from drives where wheels or gears roll')
        # nothing is integrated: the step is the way between two closed positions
        step = self.simulation.solver.step
        bare = replace(scene, effects=(), document=SceneDocument(''))
        self._moved = Simulation(bare, step=step, integrator='rk4')
        self.t: Floats = np.asarray(np.arange(round(duration / period) + 1) * period, dtype=float)
        self.samples: Sequence[Sample] = self._at(self.t)

    def _at(self, times: Floats) -> list[Sample]:
        """Of ascending instants."""
        self._moved.reset()
        found, state = [], self.simulation.state
        for each in self._moved.run(self._duration, at=times.tolist()):
            own = each.state
            state = replace(state, step=own.step).moved(own.q, own.qd, own.turns)
            found.append(self.simulation._sample(each.t, state, False))
        return found

    @cached_property
    def kinks(self) -> Floats:
        """The instants (s) at which functions of time of drives and effects have a kink."""
        return self._kinks(self.simulation)

    def _kinks(self, simulation: Simulation) -> Floats:
        n = self.t.size - 1
        return time_kinks(simulation, 0.0, n, float(self.t[-1]) / n)

    def check_held(self, instants: Sequence[float], what: str) -> None:
        """Raise InputError, which says `what` jumps, if a number of the design moves one of these
        kinks (s): the derivative would leave out the jump."""
        numbers = self._numbers
        for k, name in enumerate(numbers.names):
            beside = self._values.copy()
            inwards = 1.0 if 2.0 * beside[k] < numbers.lower[k] + numbers.upper[k] else -1.0
            beside[k] += inwards * _BESIDE * numbers.width[k]
            kinks = self._kinks(Simulation(numbers.framed_at(beside)))
            for t in instants:
                if np.abs(kinks - t).min(initial=np.inf) > _HELD:
                    text = f'no derivative: {what} jumps at t = {t:.6g} s, which moves with it'
                    raise InputError(text, key=name, value=float(self._values[k]))

    @property
    def trouble(self) -> str:
        """None: no step is integrated."""
        return ''

    @cached_property
    def displaced(self) -> DisplacedScenes:
        """The scenes beside it."""
        if self.simulation.adjustment is not None:
            raise InputError('no derivative: redundant lengths are adjusted, so none is free')
        return displaced(self._numbers, self._values, self.simulation)

    def tangent(self, n: int) -> tuple[Floats, Floats]:
        """δq, δq̇ (P, blocks D) of sample n. Raises InputError where they do not exist."""
        return self._tangent(self.samples[n])

    def places(self, point: str, times: Floats) -> tuple[Floats, Floats]:
        """(K, D) positions and velocities of a point at instants (s)."""
        order = np.argsort(times, kind='stable')
        back = np.argsort(order, kind='stable')
        x, v = path(self._at(times[order]), point)
        return x[back], v[back]

    def track(self, point: str, times: Floats) -> PointTrack:
        """A point at instants (s)."""
        order = np.argsort(times, kind='stable')
        back = np.argsort(order, kind='stable')
        samples = self._at(times[order])
        x, v = path(samples, point)
        layout = self.simulation.model.layout
        block = layout.of_point[point]
        dx = []
        for each in samples:
            closed = self._closed(each)
            dq = np.array([closed.moved(around) for around in self.displaced.all])
            dx.append(dq.reshape(len(self._values), -1, layout.dimension)[:, block])
        return PointTrack(x[back], v[back], np.array(dx)[back])

    def _tangent(self, sample: Sample) -> tuple[Floats, Floats]:
        closed = self._closed(sample)
        found = [closed.smallest(each) for each in self.displaced.all]
        return np.array([dq for dq, _ in found]), np.array([dqd for _, dqd in found])

    def _closed(self, sample: Sample) -> ClosedInstant:
        found = ClosedInstant(sample.model, sample.t, sample.state.q, sample.state.qd)
        if found.weakest <= _SINGULAR:
            raise InputError(
                f'singular at t = {sample.t:.6g} s: the drives do not determine the motion there',
                key='drives',
            )
        return found
