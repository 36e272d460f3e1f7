"""The scenes around a design: each number of it a little less and more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError
from alf_ros.model.compile import Model, compile_model
from alf_ros.model.prescribed import prescribe
from alf_ros.scene.scene import Scene
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State
from alf_ros.studies.optimisation.design_numbers import DesignNumbers
from alf_ros.studies.optimisation.differences import OFFSETS

_SHORTER, _MOST = 0.7, 8  # steps that are tried


class DisplacedScene:
    """A scene with another value of one number: its equations at given positions."""

    def __init__(self, scene: Scene, like: Simulation) -> None:
        """`like`: of the design."""
        self._scene, self._like = scene, like

    @cached_property
    def model(self) -> Model:
        """Its equations; positions are not closed."""
        return compile_model(self._scene.mechanism, self._like.model.penalty)

    @cached_property
    def _simulation(self) -> Simulation:
        solver = self._like.solver
        return Simulation(
            self._scene,
            step=solver.step,
            integrator=solver.integrator,
            tolerance=solver.tolerance,
        )

    def placed(self, t: float, q: Floats, qd: Floats) -> tuple[Floats, Floats]:
        """q, q̇ (blocks D) with the fixed and the prescribed blocks of this scene at t (s)."""
        model, n = self.model, self.model.n
        q, qd = q.copy(), qd.copy()
        q[n:], qd[n:] = model.q[n:], 0.0
        prescribe(model.system, t, q, qd, np.zeros_like(q))
        return q, qd

    def violation(self, q: Floats) -> Floats:
        """(rows,) Φ at q (blocks D), in the order of the kernel."""
        rows = self.model.system.rows
        found = np.zeros(rows.alpha.size)
        kernel.violation(self.model.unit, rows, q, found)
        return found

    def rate(self, q: Floats, qd: Floats) -> Floats:
        """(rows,) Φ_q q̇."""
        rows, unit, D = self.model.system.rows, self.model.unit, self.model.layout.dimension
        g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
        found = np.zeros(rows.alpha.size)
        kernel.jacobian(unit, rows, q, g, g2)
        kernel.times_jacobian(unit, rows, g, g2, qd, found)
        return found

    def sample(self, t: float, state: State, dq: Floats, dqd: Floats) -> Sample:
        """The instant t (s) of this scene, with a state of the other one changed by dq and dqd
        (blocks D, m and m/s). Raises AlfError."""
        q, qd = self.placed(t, state.q + dq, state.qd + dqd)
        own = replace(self._simulation.state, step=state.step).moved(q, qd, state.turns)
        return self._simulation._sample(t, own, False)


class DisplacedScenes:
    """For each number of a design eight scenes around it.

    Raises InputError, with the name, for a number beside which there is no scene, or whose
    equations have another form.
    """

    def __init__(self, numbers: DesignNumbers, values: Floats, simulation: Simulation) -> None:
        self.names = numbers.names
        self.steps = numbers.steps(values)
        self._numbers, self._values, self._simulation = numbers, values, simulation
        self.of: list[Sequence[DisplacedScene]] = [self._around(k) for k in range(values.size)]

    def _around(self, k: int) -> Sequence[DisplacedScene]:
        form = _form(self._simulation.model)
        for _ in range(_MOST):
            try:
                found = [self._displaced(k, offset) for offset in OFFSETS]
                if all(_same(_form(each.model), form) for each in found):
                    return found
                reason = 'the equations have another form beside it'
            except AlfError as error:
                reason = f'there is no scene beside it ({error})'
            self.steps[k] *= _SHORTER
        raise InputError(
            f'no derivative: {reason}', key=self.names[k], value=float(self._values[k])
        )

    def _displaced(self, k: int, offset: int) -> DisplacedScene:
        values = self._values.copy()
        values[k] += offset * self.steps[k]
        return DisplacedScene(self._numbers.framed_at(values), self._simulation)


def _form(model: Model) -> tuple[Floats, ...]:
    rows = model.system.rows
    each = (rows.i, rows.j, rows.first, rows.movable, rows.block, rows.term_block, model.row)
    return tuple(np.asarray(x, dtype=float) for x in (*each, model.point_block))


def _same(one: Sequence[Floats], other: Sequence[Floats]) -> bool:
    return all(map(np.array_equal, one, other))
