"""The scenes around a scene: each of some numbers a little less and more."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError
from alf_ros.mechanism.form_of_rows import form_of
from alf_ros.model.compile import Model, compile_model
from alf_ros.model.prescribed import prescribe
from alf_ros.scene.scene import Scene, Solver
from alf_ros.simulation.differences import OFFSETS
from alf_ros.simulation.input_values import Inputs
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.state import State

_SHORTER, _MOST = 0.7, 8  # steps that are tried
_MOVED = 1e-2  # of the size and of the speed: how far the outer scenes may move a state
_FALL = 9.81  # m/s²: speeds compare with the fall over the size


class Simulated(Protocol):
    """A `Simulation`, as far as it is used here."""

    scene: Scene
    model: Model
    solver: Solver

    @property
    def state(self) -> State:
        """The present."""
        ...

    def restore(self, state: State) -> None:
        """Continue from a state."""

    def _sample(self, t: float, state: State, beside: bool | None) -> Sample: ...


class Middle(NamedTuple):
    """The scene in the middle: its model, how it is solved, what simulates scenes beside it."""

    scene: Scene
    model: Model
    solver: Solver
    simulate: Callable[..., Simulated]

    @classmethod
    def of(cls, simulation: Simulated) -> Middle:
        """The scene of a simulation."""
        return cls(simulation.scene, simulation.model, simulation.solver, type(simulation))


class DisplacedScene:
    """A scene with another value of one number: its equations at given positions."""

    def __init__(self, scene: Scene, middle: Middle) -> None:
        self._scene, self._middle = scene, middle
        self._lock = threading.Lock()

    def __getstate__(self) -> dict[str, Any]:
        """Without its equations, which are made again if they are needed."""
        return {'_scene': self._scene, '_middle': self._middle}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self.__dict__.update(saved, _lock=threading.Lock())

    @cached_property
    def model(self) -> Model:
        """Its equations; positions are not closed."""
        middle = self._middle.model
        with form_of(middle.layout.form):
            return compile_model(self._scene.mechanism, middle.penalty)

    @cached_property
    def _simulation(self) -> Simulated:
        solver = self._middle.solver
        with form_of(self._middle.model.layout.form):
            return self._middle.simulate(
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
        (blocks D, m and m/s), and its inputs. Raises AlfError."""
        q, qd = self.placed(t, state.q + dq, state.qd + dqd)
        with self._lock:
            simulation = self._simulation
            own = simulation.state
            if own.inputs != state.inputs:
                simulation.restore(replace(own, inputs=state.inputs))
            own = replace(own, step=state.step, inputs=state.inputs).moved(q, qd, state.turns)
            return simulation._sample(t, own, False)


class PushedScene(DisplacedScene):
    """A scene as it is, pushed by more than the inputs held."""

    def __init__(self, scene: DisplacedScene, pushed: Callable[[Inputs], Inputs]) -> None:
        self._base, self._pushed = scene, pushed

    def __getstate__(self) -> dict[str, Any]:
        return vars(self)

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self.__dict__.update(saved)

    @property
    def model(self) -> Model:
        """Its equations."""
        return self._base.model

    def sample(self, t: float, state: State, dq: Floats, dqd: Floats) -> Sample:
        """As of any displaced scene."""
        return self._base.sample(t, replace(state, inputs=self._pushed(state.inputs)), dq, dqd)


class Displaced(NamedTuple):
    """The eight scenes around a number, at `OFFSETS` steps from its value."""

    name: str
    step: float
    scenes: Sequence[DisplacedScene]


class Pushed(NamedTuple):
    """A scene as it is, and pushed by 1 N or 1 N m more by the force `name`."""

    name: str
    still: DisplacedScene
    by_one: DisplacedScene

    def along(self, around: Displaced) -> Displaced:
        """Without the push, where a state moves as far as in the scenes `around`."""
        return Displaced(self.name, around.step, [self.still] * len(OFFSETS))


class DisplacedScenes:
    """For each of P numbers eight scenes around a scene, made when they are asked for."""

    def __init__(
        self,
        names: Sequence[str],
        values: Floats,
        steps: Floats,
        changed: Callable[[int, float], Scene | Callable[[Inputs], Inputs]],
        middle: Middle,
        forces: Collection[int] = (),
    ) -> None:
        """values, steps (P,): of the numbers, and of the differences at first. changed: the scene
        with another value of number k, or what adds the value to the inputs held. forces: the
        numbers that are efforts or wrenches from outside."""
        self.names, self._values, self._steps = tuple(names), values, steps
        self._changed, self._middle = changed, middle
        self._forces = frozenset(forces)
        self._found: dict[tuple[int, int], Displaced] = {}
        self._still = DisplacedScene(middle.scene, middle)

    def __getstate__(self) -> dict[str, Any]:
        """Without the scenes, which are made again if they are needed."""
        return {**vars(self), '_found': {}}

    def around(self, k: int, halved: int = 0) -> Displaced:
        """Number k, with the step of its difference `halved` so many times. Raises InputError,
        with its name, if there is no scene beside it, or one whose equations have another form."""
        if (k, halved) not in self._found:
            self._found[k, halved] = self._around(k, 0.5**halved * float(self._steps[k]))
        return self._found[k, halved]

    def moving(self, k: int, state: State, dq: Floats, dqd: Floats) -> Displaced:
        """Number k, close enough that a state is moved little by dq and dqd (blocks D, m and m/s)
        per unit of the number."""
        times = float(self._steps[k]) / self._longest(state, dq, dqd)
        return self.around(k, max(0, math.ceil(math.log2(max(times, 1.0)))))

    def pushed(self, k: int) -> Pushed | None:
        """The scene without and with a unit of number k, if that is an effort or a wrench from
        outside; None otherwise."""
        if k not in self._forces:
            return None
        return Pushed(self.names[k], self._still, self._scene(k, 1.0))

    def along(self, state: State, dq: Floats, dqd: Floats) -> Displaced:
        """The scene itself, for a state that is moved along dq and dqd (blocks D)."""
        step = self._longest(state, dq, dqd)
        step = step if math.isfinite(step) else 1.0  # nothing moves
        return Displaced('the state', step, [self._still] * len(OFFSETS))

    def _longest(self, state: State, dq: Floats, dqd: Floats) -> float:
        """The step with which dq and dqd move a state as far as they may."""
        size = self._middle.model.size
        speed = max(float(np.abs(state.qd).max(initial=0.0)), math.sqrt(_FALL * size))
        far = max(float(np.abs(dq).max()) / size, float(np.abs(dqd).max()) / speed)
        return _MOVED / (max(OFFSETS) * far) if far > 0.0 else math.inf

    def _scene(self, k: int, value: float) -> DisplacedScene:
        changed = self._changed(k, value)
        if isinstance(changed, Scene):
            return DisplacedScene(changed, self._middle)
        return PushedScene(self._still, changed)

    @property
    def all(self) -> list[Displaced]:
        """(P,) around each number."""
        return [self.around(k) for k in range(len(self.names))]

    def _around(self, k: int, step: float) -> Displaced:
        form, value = _form(self._middle.model), self._values[k]
        for _ in range(_MOST):
            try:
                found = [self._scene(k, float(value + offset * step)) for offset in OFFSETS]
                if all(_same(_form(each.model), form) for each in found):
                    return Displaced(self.names[k], step, found)
                reason = 'the equations have another form beside it'
            except AlfError as error:
                reason = f'there is no scene beside it ({error})'
            step *= _SHORTER
        raise InputError(f'no derivative: {reason}', key=self.names[k], value=float(value))


def _form(model: Model) -> tuple[Floats, ...]:
    rows = model.system.rows
    each = (rows.i, rows.j, rows.first, rows.movable, rows.block, rows.term_block, rows.full)
    return tuple(np.asarray(x, dtype=float) for x in (*each, model.row, model.point_block))


def _same(one: Sequence[Floats], other: Sequence[Floats]) -> bool:
    return all(map(np.array_equal, one, other))
