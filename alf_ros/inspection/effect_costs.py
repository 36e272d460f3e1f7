"""Costs of the effects of a scene, and the changes of the motion that they make."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.effects import Effect
from alf_ros.errors import StepError
from alf_ros.kernel import Effects
from alf_ros.scene.scene import Scene
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.stiffness import Mode, stiffest

_ROUNDS = 30  # the quickest of so many counts: on a busy machine the others measure its neighbours
_INSTANTS = 100  # of the run, at which stiffness is looked at
_CALL = 2e-3  # s, roughly, that one measurement takes
_CALLS = 1000  # in one compiled call: what that costs itself is then a nanosecond of each
_TURNS = 5  # of which the quickest counts


@dataclass(frozen=True)
class EffectCost:
    """Of the effect `label`: `added` alone to nothing, and `removed` from all (µs per step).

    change: largest distance (m) of a point from its position without the effect; inf if the run
    fails without it. work: done by the effect in the run, J. mode: the fastest one of the free
    motion with this effect alone.
    """

    label: str
    added: float
    removed: float
    change: float
    work: float
    mode: Mode


@dataclass(frozen=True)
class EffectCosts:
    """Each effect of a scene; the cost of a step (µs) without and with all of them, how far the
    same measurement differs from itself (µs), and the fastest mode of all of them together."""

    effects: tuple[EffectCost, ...]
    bare: float
    whole: float
    resolution: float
    mode: Mode


def effect_costs(scene: Scene, duration: float) -> EffectCosts:
    """Costs of runs of `duration` (s), and their differences.

    Raises StepError if the scene itself does not run.
    """
    effects = scene.effects
    sets: list[Sequence[Effect]] = [(), effects, effects]
    for effect in effects:
        sets += [(effect,), tuple(other for other in effects if other is not effect)]
    sims = [Simulation(replace(scene, effects=tuple(chosen))) for chosen in sets]
    bare, whole, again, *others = _costs(sims)
    path, work = _path(sims[1], duration), _work(sims[1], duration)
    modes, fastest = _modes(sims[1], duration)
    found = []
    for n, effect in enumerate(effects):
        change = math.inf
        try:
            other = _path(sims[4 + 2 * n], duration)
            change = float(np.linalg.norm(path - other, axis=2).max())
        except StepError:
            pass  # nothing else held the mechanism back
        added, removed = others[2 * n] - bare, min(whole, again) - others[2 * n + 1]
        label = effect.label
        found.append(EffectCost(label, added, removed, change, work[label], modes[label]))
    return EffectCosts(tuple(found), bare, min(whole, again), abs(whole - again), fastest)


def _modes(sim: Simulation, duration: float) -> tuple[dict[str, Mode], Mode]:
    sim.reset()
    every = max(1, math.ceil(duration / sim.h / _INSTANTS))
    return stiffest(sim.run(duration, every=every))


def _costs(sims: Sequence[Simulation]) -> list[float]:
    """µs per step of each, from its start, measured in turns."""
    sims[0].step()
    started = time.perf_counter()
    sims[0].step(10)
    steps = max(5, round(_CALL / (time.perf_counter() - started) * 10))
    least = [math.inf] * len(sims)
    for _ in range(_ROUNDS):
        for n, sim in enumerate(sims):
            sim.reset()
            started = time.perf_counter()
            try:
                sim.step(steps)
            except StepError:
                pass  # as far as it came
            done = max(sim.step_index, 1)
            least[n] = min(least[n], 1e6 * (time.perf_counter() - started) / done)
    return least


def _path(sim: Simulation, duration: float) -> Floats:
    """(steps, points, D) places of all points at every step, m."""
    sim.reset()
    names = sim.model.point_names
    return np.array([[s.points[name] for name in names] for s in sim.run(duration)])


def _work(sim: Simulation, duration: float) -> dict[str, float]:
    """Work of each effect, J, by the trapezoidal rule over the steps."""
    # Imported here: the node measures `call_costs` at its start and waits for no scipy.integrate.
    from scipy.integrate import trapezoid

    sim.reset()
    powers = [sample.powers for sample in sim.run(duration)]
    return {
        label: sim.h * float(trapezoid([power[label] for power in powers])) for label in powers[0]
    }


def call_costs(simulation: Simulation) -> dict[str, float]:
    """µs per step of each effect at present: one evaluation per stage of the method.

    The search for the load of friction under a true load is not included.
    """
    state, stages = simulation.state, simulation.stages
    near, loads = simulation.sample()._near, np.ones(1)  # N
    costs = {}
    for label, part in simulation.applied.each.items():
        many = _repeated(part.effects)
        Q = np.zeros(state.q.size)
        least = math.inf
        for _ in range(_TURNS):
            started = time.perf_counter()
            kernel.applied_forces(many, simulation.t, state.q, state.qd, near, Q)
            if part.loads:
                kernel.add_friction(many, simulation.t, state.q, state.qd, near, loads, Q)
            least = min(least, time.perf_counter() - started)
        costs[label] = 1e6 * least / _CALLS * stages
    return costs


def _repeated(effects: Effects) -> Effects:
    """One effect, many times."""
    names = ('force', 'potential', 'friction', 'slots_at', 'params_at', 'loads_at')
    return replace(effects, **{name: np.repeat(getattr(effects, name), _CALLS) for name in names})
