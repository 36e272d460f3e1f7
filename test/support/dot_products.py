"""The dot-product test of an adjoint: ȳᵀ (∂x/∂θ) by the tangents and by the adjoint of one run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alf_ros import Simulation
from alf_ros.scene.scene import Scene
from alf_ros.studies.gradients.legs import RunInstant
from alf_ros.studies.gradients.taped_run import TapedRun
from support.tangent_robot import AT_ONCE


def dot_products(
    scene: Scene, names: Sequence[str], steps: int, **settings: Any
) -> tuple[Any, Any, Any]:
    """For random ȳ at the end of a run: ȳᵀ δx by the tangents, by the adjoint, and the size of
    the sum."""
    parts = []
    for k in range(0, len(names), AT_ONCE):
        some = names[k : k + AT_ONCE]
        followed = Simulation(scene, tangents=some, **settings)
        followed.step(steps)
        state = followed.state
        parts.append(state.tangents.reshape(len(some), 2, state.q.size))
    tangents = np.concatenate(parts)
    simulation = Simulation(scene, **settings)
    run = TapedRun(simulation, names)
    list(run.go_on(steps))
    assert simulation.state.q.tobytes() == state.q.tobytes()
    assert simulation.state.qd.tobytes() == state.qd.tobytes()
    bars = np.zeros((2, state.q.size))
    bars[:, : simulation.model.n] = np.random.default_rng(1).normal(size=(2, simulation.model.n))

    class AnySum:
        def add(self, sample: Any, weight: float, to: Any) -> None:
            to.q[:] += weight * bars[0]
            to.qd[:] += weight * bars[1]

    run._check_unfolding = lambda last: None  # type: ignore[method-assign]
    found = run.derivatives(AnySum(), {RunInstant(steps): 1.0})  # type: ignore[arg-type]
    size = np.abs(tangents).reshape(len(names), -1) @ np.abs(bars).ravel()
    return np.einsum('kha,ha->k', tangents, bars), found, size
