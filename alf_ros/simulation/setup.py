"""A simulation and its ticks from a scene and parameters; and the effect of a change."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from alf_ros.errors import InputError, StepError
from alf_ros.scene.effect_values import with_effect_values
from alf_ros.scene.scene import PICKED, Scene, Solver, joined
from alf_ros.simulation.formulations import check_going_on
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State

# Shortest tick (s) chosen by default: at 500 Hz a small mechanism, recorded and published, takes a
# fifth of a core, and 500 Hz is more than RViz, plots and most controllers use.
DEFAULT_TICK = 2e-3


@dataclass(frozen=True)
class Setup:
    """A scene, its simulation, and the solver steps in a tick."""

    scene: Scene
    simulation: Simulation
    steps: int

    @property
    def tick(self) -> float:
        """Simulated seconds of a tick."""
        return self.steps * self.simulation.h


def default_rate(step: float) -> float:
    """Ticks per simulated second (Hz) for a solver step (s), if nobody says how many."""
    return 1.0 / (step * max(1, math.ceil(DEFAULT_TICK / step * (1.0 - 1e-9))))


def steps_per_tick(rate: float, step: float) -> int:
    """Number of solver steps (s) in a tick at `rate` (Hz). Raises InputError if not whole."""
    steps = 1.0 / (rate * step)
    whole = max(1, round(steps))
    if abs(steps - whole) > 1e-6 * whole:
        below, above = max(1, math.floor(steps)), math.ceil(steps)
        near = ' or '.join(f'{1.0 / (n * step):.9g}' for n in sorted({above, below}))
        raise InputError(
            f'a tick of 1/rate must be a whole number of solver steps of {step:g} s',
            key='rate',
            value=rate,
            expected=f'{near} Hz',
        )
    return whole


def made(
    scene: Scene, solver: Mapping[str, Any], rate: float | None = None, ledger: bool = False
) -> Setup:
    """The setup of a scene: `solver` and `rate` (Hz) replace what it says itself.

    Raises InputError, AssemblyError.
    """
    simulation = Simulation(scene, **solver, ledger=ledger)
    steps = steps_per_tick(rate or default_rate(simulation.h), simulation.h)
    with suppress(StepError):  # the first tick will say so, with the log open
        simulation.step(0)  # compiles and packs: what cannot act shows here and not in a tick
    return Setup(scene, simulation, steps)


def chosen(solver: Mapping[str, Any], accuracy: float, said: Collection[str]) -> dict[str, Any]:
    """Arguments of a simulation: `solver`, of which an `accuracy` (m; 0: none) chooses the values
    that were not `said`. An earlier choice in a dump of parameters stays."""
    if not accuracy:
        return dict(solver)
    kept = {k: v for k, v in solver.items() if k not in PICKED or k in said}
    return {**kept, 'accuracy': accuracy}


def asked(before: Solver, accuracy: float) -> dict[str, Any]:
    """The change of a solver that requests an accuracy (m); 0 keeps the chosen settings."""
    return {'accuracy': accuracy} if accuracy else {k: getattr(before, k) for k in PICKED}


def changed(
    setup: Setup, solver: Mapping[str, Any], effects: Mapping[str, Any], rate: float
) -> Setup:
    """The setup with other numbers, as `remade`, at the same state, as `continued`."""
    return continued(setup, remade(setup, solver, effects, rate))


def searches(before: Solver, solver: Mapping[str, Any]) -> float:
    """The accuracy (m) for which settings with these changes are searched; 0 without."""
    given = joined(dataclasses.asdict(before), solver)
    return float(given.get('accuracy') or 0.0)


def remade(
    setup: Setup, solver: Mapping[str, Any], effects: Mapping[str, Any], rate: float
) -> Setup:
    """The setup with other solver settings, numbers of effects, or ticks (Hz), at the start of the
    scene, for `continued`. This may take long; it reads no state, and `setup` may run in another
    thread. Raises InputError for what cannot be."""
    if not solver and not effects:
        return dataclasses.replace(setup, steps=steps_per_tick(rate, setup.simulation.h))
    scene, before = with_effect_values(setup.scene, effects), setup.simulation
    given = joined(dataclasses.asdict(before.solver), solver)
    steps = steps_per_tick(rate, given['step'])
    simulation = Simulation(scene, **given, ledger=before.ledger)
    if simulation.model.layout.of_auxiliary != before.model.layout.of_auxiliary:
        text = 'an armature from or to zero changes the rotors: load the scene again'
        raise InputError(text, key=next(name for name in effects if name.endswith('armature')))
    with suppress(StepError):
        simulation.step(0)
    return Setup(scene, simulation, steps)


def continued(before: Setup, new: Setup) -> Setup:
    """`new`, which was `remade` from `before`, at the present state of `before`.

    Raises InputError if the time is not a whole number of the new steps, and if the formulation
    of `new` cannot continue from that state.
    """
    if new.simulation is not before.simulation:
        solvers = before.simulation.solver, new.simulation.solver
        check_going_on(*(each.formulation for each in solvers))
        state = before.simulation.state
        new.simulation.restore(on_grid(state, before.simulation.h, new.simulation.h))
        with suppress(StepError):
            new.simulation.step(0)
    return new


def on_grid(state: State, h: float, new: float) -> State:
    """A state reached with steps of `h` (s), for steps of `new`. Raises InputError."""
    return dataclasses.replace(state, h=h).counted(new)
