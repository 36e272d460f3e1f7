"""Members that differ from each other, and all that a step leaves behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from alf_ros import Simulation, load_scene
from alf_ros.scene.overrides import with_changes
from alf_ros.scene.scene import Scene


def member(name: str | Scene, changes: Mapping[str, Any], k: int, **settings: Any) -> Simulation:
    """Member k of a scene; `changes` are texts of Python with k in braces."""
    of = load_scene(name) if isinstance(name, str) else name
    texts = {key: str(eval(f'f{text!r}', {'k': k})) for key, text in changes.items()}
    return Simulation(with_changes(of, texts), **settings)


def told(simulation: Simulation) -> tuple[Any, ...]:
    """State, counts and judgements."""
    state, stepper = simulation.state, simulation._run.stepper
    return (
        simulation.step_index,
        state.q.tobytes(),
        state.qd.tobytes(),
        state.turns.tolist(),
        state.pace,
        simulation.evaluations,
        simulation.rounded_steps,
        repr(simulation.step_error),
        repr(simulation.resolution),
        stepper.beside(simulation._run.present),
        simulation.sample().energy,
    )


def check(members: Sequence[Simulation], alone: Sequence[Simulation]) -> None:
    """Each member has the bits of its single run."""
    for one, other in zip(members, alone, strict=True):
        assert told(one) == told(other)
