"""Tangents by moments and products of inertia beside which few bodies are possible."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros import Scene, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene import overrides

STEPS = 50


@pytest.fixture
def pendulum() -> Scene:
    """A thin rod on a ball, thrown aside and turning about itself."""
    inertia = {'about_com': [4e-6, 8e-4, 8e-4, 0.0, 0.0, 0.0]}
    rod = {'points': ['O'], 'mass': 0.1, 'com': [0.15, 0.02, 0.01], 'inertia': inertia}
    return load_scene(
        {
            'mechanism': {
                'alf': 1,
                'space': 'spatial',
                'points': {'O': {'at': [0, 0, 0], 'fixed': True}},
                'bodies': {'rod': rod},
                'joints': {'ball': {'type': 'spherical', 'between': ['ground', 'rod'], 'at': 'O'}},
            },
            'effects': {'gravity': {'acceleration': [0.5, 1.0, -9.81]}},
            'solver': {'step': 2e-3, 'integrator': 'dop853'},
        }
    )


@pytest.mark.parametrize('entry', [1, 2, 5])
def test_of_a_thin_rod(pendulum: Scene, entry: int) -> None:
    """They were refused: a step of 0.01 from a product of 0, or of 1 % of a moment, leaves what a
    body can have."""
    name = f'mechanism.bodies.rod.inertia.about_com.{entry}'

    def moved(change: float) -> Floats:
        value = repr(overrides.number(pendulum, name) + change)
        simulation = Simulation(overrides.with_changes(pendulum, {name: value}))
        simulation.step(STEPS)
        return simulation.sample().q

    h = 2e-7
    weights = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
    expected = sum(w * (moved(k * h) - moved(-k * h)) / h for k, w in weights)
    simulation = Simulation(pendulum, tangents=[name])
    simulation.step(STEPS)
    tangent = simulation.sample().tangents[name].q
    assert np.abs(expected).max() > 1e-3
    assert np.abs(tangent - expected).max() < 1e-6 * np.abs(expected).max()
