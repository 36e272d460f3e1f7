"""Runs of a scene over windows: what the measurements should be, and how that changes.

Between two steps a joint coordinate is the cubic of Hermite through positions and velocities. A
delay d shifts the measurements: one with the stamp t is of the instant t - d.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import AlfError, InputError, StoppedError, argument_of
from alf_ros.mechanism.form_of_rows import form_of
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene, Solver
from alf_ros.simulation.explicit_choice import explicit_solver
from alf_ros.simulation.input_slopes import Slopes
from alf_ros.simulation.input_values import NO_INPUTS
from alf_ros.simulation.resolution import Resolution
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State
from alf_ros.simulation.state_direction import is_direction
from alf_ros.simulation.state_trail import StateArrays
from alf_ros.studies.identification.joint_readings import JointMotion, JointReadings
from alf_ros.studies.identification.posture_track import wrapped
from alf_ros.studies.identification.recording import MeasuredChannel
from alf_ros.studies.identification.window import Measurements, Window, below, grid
from alf_ros.studies.identification.window_start import SceneStart

_LONGEST = 5e-3  # s, between two steps of an adaptive method
WindowStart = tuple[Window, Floats]  # a window and the free numbers of its start


@dataclass(frozen=True, eq=False)
class Misfit:
    """Of a window: by how much each measurement is more than the run says.

    residuals (N,), rad or m, per s; jacobian (N, P + delay + free numbers), of the free numbers
    alone or empty if nobody asked for more; channel (N,): the number of the channel of each.
    resolution: of the steps of the run, computed when it is called.
    """

    residuals: Floats
    jacobian: Floats
    channel: Integers
    resolution: Callable[[], Resolution]


Attempt: TypeAlias = Misfit | AlfError  # of a run, or why it fails


def succeeded(attempt: Attempt) -> Misfit:
    """The misfit of a run. Raises its AlfError if it failed."""
    if isinstance(attempt, AlfError):
        raise attempt
    return attempt


class WindowRuns:
    """Runs of a scene with other values of `names`, over windows.

    `delay`: whether the delay is a number to differentiate by, behind the
    numbers of the scene.
    """

    def __init__(
        self, scene: Scene, names: Sequence[str], channels: Sequence[MeasuredChannel], delay: bool
    ) -> None:
        self.scene, self.names, self.delay = scene, tuple(names), delay
        self.channels = tuple(channels)
        begun = Simulation(scene)
        self._settings = _settled(explicit_solver(begun))
        self._joints = list(begun.model.coordinate_names)
        for each in self.channels:
            if each.joint not in self._joints:
                raise InputError(
                    'no such joint coordinate',
                    key='recording',
                    value=each.joint,
                    choices=self._joints,
                )
        # with tangents, so that its equations have the form of all runs
        with argument_of('fit', 'tangents'):
            self.reference = Simulation(scene, **self._settings, tangents=self.names)
        self.h = self.reference.h
        self._measured = sorted({self._joints.index(each.joint) for each in self.channels})
        self._known: dict[tuple[int | None, bool], tuple[tuple[float, ...], list[Simulation]]] = {}
        self._found: dict[Any, tuple[Any, Misfit]] = {}  # the last of a window
        self._secants: dict[Any, tuple[Any, Misfit]] = {}  # behind its last jacobian

    @property
    def numbers(self) -> int:
        """How many numbers all windows share."""
        return len(self.names) + self.delay

    def at(self, values: Sequence[float] | Floats) -> Scene:
        """The scene with values of `names`. Raises InputError if there is no such scene."""
        changes = {n: repr(float(x)) for n, x in zip(self.names, values, strict=True)}
        return overrides.with_changes(self.scene, changes, prefix='fit ')

    def simulation(
        self, values: Floats, directions: int | None = None, alone: bool = False
    ) -> Simulation:
        """The scene with values of `names`; `directions`: how many free numbers of a start are
        followed beside the names, None for a run without tangents; `alone`: without the names.
        Raises AlfError."""
        return self._crew(values, directions, alone, 1)[0]

    def _crew(
        self, values: Floats, directions: int | None, alone: bool, count: int
    ) -> Sequence[Simulation]:
        """So many of them, for as many threads."""
        key, kind = tuple(float(x) for x in values), (directions, alone)
        if kind not in self._known or self._known[kind][0] != key:
            tangents = [f'state.{k}' for k in range(directions or 0)]
            if directions is not None and not alone:
                tangents = [*self.names, *tangents]
            last = self._known[kind][1][0] if kind in self._known else self.reference
            with argument_of('fit', 'tangents'), form_of(self.reference.model.layout.asked):
                made = Simulation(self.at(values), **self._settings, tangents=tangents, like=last)
            self._check_coordinates(made, key)
            self._known[kind] = key, [made]
        crew = self._known[kind][1]
        crew += [copy(crew[0]) for _ in range(count - len(crew))]
        return crew[:count]

    def _check_coordinates(self, made: Simulation, values: tuple[float, ...]) -> None:
        """Raise InputError if a scene has other vectors than the given one: starts and derivatives
        of windows are in its coordinates."""
        there, own = ({*each.model.layout.of_vector} for each in (made, self.reference))
        if there != own:
            text = f'a body has other directions there than in the scene: {min(there ^ own)}'
            raise InputError(text, key=f'fit {", ".join(self.names)}', value=values)

    def misfits_at(
        self, values: Floats, starts: Sequence[WindowStart], delay: float, directions: int | None
    ) -> list[Misfit]:
        """Of windows with their starts, of the scene with values of `names`, on all cores. The
        last one of a window is kept, as a fit asks for some again, with other noise. `directions`:
        None for no jacobian. Raises AlfError."""
        return [*map(succeeded, self.attempts_at(values, starts, delay, directions))]

    def attempts_at(
        self, values: Floats, starts: Sequence[WindowStart], delay: float, directions: int | None
    ) -> list[Attempt]:
        """The same with the reasons of runs that fail."""
        kept = [self._kept(values, *each, delay, directions) for each in starts]
        missing = [each for each, known in zip(starts, kept, strict=True) if known is None]
        made = iter(self._run(values, missing, delay, directions, alone=False))
        found = [next(made) if known is None else known for known in kept]
        for (window, free), each in zip(starts, found, strict=True):
            if isinstance(each, AlfError):
                continue
            self._found[_place(window), directions is not None] = _at(values, delay, free), each
            if directions is not None:
                self._secants.pop(_place(window), None)
        return found

    def by_starts(
        self, values: Floats, starts: Sequence[WindowStart], delay: float
    ) -> list[Attempt]:
        """The same with jacobians by the free numbers of the starts alone."""
        most = max((free.size for _, free in starts), default=0)
        return self._run(values, starts, delay, most, alone=True)

    def _run(
        self,
        values: Floats,
        starts: Sequence[WindowStart],
        delay: float,
        directions: int | None,
        alone: bool,
    ) -> list[Attempt]:
        if not starts:
            return []
        crew = self._crew(values, directions, alone, min(len(starts), _cores()))
        found: dict[int, Attempt] = {}

        def run(k: int) -> None:
            for n in range(k, len(starts), len(crew)):
                try:
                    found[n] = self.misfit(crew[k], *starts[n], delay)
                except StoppedError:
                    raise
                except AlfError as error:
                    found[n] = error

        try:
            _side_by_side(run, crew)
        except BaseException:
            self._known.clear()  # some may have been stopped
            raise
        return [found[n] for n in range(len(starts))]

    def _kept(
        self, values: Floats, window: Window, free: Floats, delay: float, directions: int | None
    ) -> Misfit | None:
        at = _at(values, delay, free)
        for differentiated in (True, False) if directions is None else (True,):
            known = self._found.get((_place(window), differentiated))
            if known is not None and known[0] == at:
                return known[1]
        return None

    def last(self, window: Window) -> tuple[Floats, Misfit] | None:
        """The last one of a window with a jacobian, and the numbers, delay included, and the start
        that it is of."""
        known = self._found.get((_place(window), True))
        if known is None:
            return None
        at, misfit = self._secants.get(_place(window), known)
        x, P = np.array(at), len(self.names)
        return (x if self.delay else np.delete(x, P)), misfit

    def has_secant(self, window: Window) -> bool:
        """Whether what `last` gives is a secant."""
        return _place(window) in self._secants

    def keep_secant(
        self, values: Floats, window: Window, free: Floats, delay: float, misfit: Misfit
    ) -> None:
        """A misfit with an approximate jacobian, which `last` gives until there is a new one."""
        self._secants[_place(window)] = _at(values, delay, free), misfit

    def misfit(self, simulation: Simulation, window: Window, free: Floats, delay: float) -> Misfit:
        """Of a window with a start; its jacobian, if the simulation has tangents. Raises AlfError
        where the run fails, or cannot be differentiated."""
        steps, following = grid(window, delay, self.h), simulation.following
        motion = self._motion(simulation, window, free, steps)
        numbers = 0 if following is None else len(_of_numbers(following.slopes))
        found = [
            self._part(window, part, steps, motion, delay, numbers) for part in window.measured
        ]
        count = [each.values.size for each in window.measured]
        columns = free.size + (self.numbers if numbers else 0)
        return Misfit(
            np.concatenate([residuals for residuals, _ in found]),
            np.concatenate([jacobian for _, jacobian in found])[:, :columns],
            np.repeat([each.channel for each in window.measured], count),
            simulation._run.stepper.resolution_later(),
        )

    def state(self, simulation: Simulation, window: Window, free: Floats) -> State:
        """The state in which a window begins, nothing held."""
        return self._begun(simulation, window, free, None)

    def _begun(
        self,
        simulation: Simulation,
        window: Window,
        free: Floats,
        numbers: Sequence[Slopes] | None,
    ) -> State:
        """The same with the derivatives of the start by the numbers, and by the free ones."""
        assert window.chart is not None
        if isinstance(window.chart, SceneStart):
            simulation.reset()
            return replace(simulation.state, pace=self.h, inputs=NO_INPUTS)
        start = window.chart.start(simulation.model, free, numbers)
        state = simulation.state
        first = np.zeros_like(state.tangents).reshape(-1, 2, start.q.size)
        first[: len(start.dq), 0], first[: len(start.dqd), 1] = start.dq, start.dqd
        return replace(
            state.moved(start.q, start.qd, window.chart.turns),
            step=window.first,
            pace=self.h,
            inputs=NO_INPUTS,
            tangents=first.ravel(),
        )

    def _motion(
        self, simulation: Simulation, window: Window, free: Floats, steps: Integers
    ) -> JointMotion:
        following = simulation.following
        slopes = following.slopes if following is not None else []
        numbers = None if following is None else _of_numbers(slopes)
        begun = self._begun(simulation, window, free, numbers)
        simulation.restore(begun)
        states = passed(simulation, window, steps)
        if following is not None and following.placing:
            tangents = simulation.sample().tangents
            for name in following.placing:
                if name in self.names:
                    _ = tangents[name]  # refused if it unfolds a singular position
        arrays = [each.arrays for each in slopes]
        return JointReadings(simulation.model, arrays, self._measured).read(states)

    def _part(
        self,
        window: Window,
        part: Measurements,
        steps: Integers,
        motion: JointMotion,
        delay: float,
        numbers: int,
    ) -> tuple[Floats, Floats]:
        """Residuals (N,) and their derivatives, by so many numbers of the scene first."""
        channel = self.channels[part.channel]
        joint = self._measured.index(self._joints.index(channel.joint))
        first = below(window, part, delay, self.h)
        k = np.searchsorted(steps, first)
        weights = _hermite((part.t - delay) / self.h - first, self.h)
        x, v = motion.x[:, joint], motion.v[:, joint]
        each = [_mixed(w, k, x, v) for w in weights]
        order = 0 if channel.kind == 'position' else 1
        residuals = part.values - each[order]
        if order == 0 and self.reference.model.coordinates[self._measured[joint]].is_angle:
            residuals = wrapped(residuals)
        slopes = -_mixed(weights[order], k, motion.dx[:, joint], motion.dv[:, joint])
        if self.delay and numbers:
            late = each[order + 1][:, None]
            slopes = np.hstack([slopes[:, :numbers], late, slopes[:, numbers:]])
        return residuals, slopes


def _place(window: Window) -> tuple[Any, ...]:
    counts = [part.values.size for part in window.measured]
    return window.recording, window.first, window.last, window.chart, *counts


def _at(values: Floats, delay: float, free: Floats) -> tuple[float, ...]:
    return (*values.tolist(), delay, *free.tolist())


def _cores() -> int:
    """The number of cores that this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _side_by_side(run: Callable[[int], None], crew: Sequence[Simulation]) -> None:
    """run(0), run(1), … in a thread for each simulation; an interrupt stops them all."""
    if len(crew) == 1:
        return run(0)
    with ThreadPoolExecutor(len(crew)) as pool:
        parts = [pool.submit(run, k) for k in range(len(crew))]
        try:
            wait(parts)
        except BaseException:
            for each in crew:
                each.stop()
            raise
    for part in parts:
        part.result()


def _of_numbers(slopes: Sequence[Slopes]) -> list[Slopes]:
    """Of numbers of the scene, not of directions of the state."""
    return [each for each in slopes if not is_direction(each.name)]


def _settled(solver: Solver) -> dict[str, Any]:
    """The settings of all runs: those that the scene has or picks, with a step that resolves the
    motion between two steps."""
    step = solver.step
    if solver.method.embedded.size:
        step = step / max(1, round(np.ceil(step / _LONGEST)))
    if not step <= 2.0 * _LONGEST:
        raise InputError(
            'too long to read the motion between two steps',
            key='solver.step',
            value=solver.step,
            expected=f'{2.0 * _LONGEST:g} s at most',
        )
    return {'step': step, 'integrator': solver.integrator, 'tolerance': solver.tolerance}


def passed(simulation: Simulation, window: Window, steps: Integers) -> StateArrays:
    """The states at `steps` (N,) of a run on to them, with the inputs of the window."""
    trail, last = simulation._trail(steps), int(steps[-1])
    for at, held in window.inputs:
        if at >= last:
            break
        if at > simulation.step_index:  # several at once are packed once
            simulation._step_along(at - simulation.step_index, trail)
        held.apply(simulation)
    simulation._step_along(last - simulation.step_index, trail)
    return trail.arrays


def _hermite(u: Floats, h: float) -> tuple[Floats, Floats, Floats]:
    """(N, 4) weights of x₀, ẋ₀, x₁, ẋ₁ in x, ẋ and ẍ, at a part u of a step h (s)."""
    p = u * u
    value = (
        1.0 - p * (3.0 - 2.0 * u),
        h * u * (1.0 - u) ** 2,
        p * (3.0 - 2.0 * u),
        h * p * (u - 1.0),
    )
    rate = (6.0 * (p - u) / h, 3.0 * p - 4.0 * u + 1.0, 6.0 * (u - p) / h, 3.0 * p - 2.0 * u)
    second = (
        (12.0 * u - 6.0) / h**2,
        (6.0 * u - 4.0) / h,
        (6.0 - 12.0 * u) / h**2,
        (6.0 * u - 2.0) / h,
    )
    return tuple(np.array(each).T for each in (value, rate, second))  # type: ignore[return-value]


def _mixed(weights: Floats, k: Integers, x: Floats, v: Floats) -> Floats:
    """Of quantities (G, …) and their rates at steps k and k + 1."""
    w = weights.reshape(*weights.shape, *[1] * (x.ndim - 1))
    return np.asarray(w[:, 0] * x[k] + w[:, 1] * v[k] + w[:, 2] * x[k + 1] + w[:, 3] * v[k + 1])
