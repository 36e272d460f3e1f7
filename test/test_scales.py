"""Micrometres to hundreds of metres, dust to mountains: the same motion, the same settings."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene import scene_from_text

STEPS = 2000


def motion(length: float, mass: float) -> Floats:
    """q / length of a slider-crank at the same phases of its motion, through two passes."""
    time = np.sqrt(length)  # of a mechanism that large in the same gravity
    source = {
        'mechanism': 'slider_crank',
        'parameters': {'L': length, 'm': mass},
        'effects': {'gravity': {'acceleration': [0, -9.81]}},
        'initial': {'velocities': {'B': [-4.0 * np.sqrt(length), 0]}},
    }
    sim = Simulation(load_scene(source), integrator='dop853', step=1e-3 * time)
    sim.step(STEPS)
    return sim.sample().q / length


@pytest.mark.parametrize('length', [1e-6, 1e-3, 300.0])
@pytest.mark.parametrize('mass', [1e-9, 1.0, 1e9])
def test_size_and_mass_do_not_matter(length: float, mass: float) -> None:
    assert motion(length, mass) == pytest.approx(motion(1.0, 1.0), abs=1e-9)


def pendulum(light: float) -> str:
    """A rod of 1 kg, and on its end one of so much less that it goes with it."""
    return f"""
mechanism:
  alf: 1
  points: {{O: {{at: [0, 0], fixed: true}}, A: {{at: [1, 0]}}, B: {{at: [2, 0]}}}}
  bodies:
    heavy: {{points: [O, A], mass: 1, inertia: rod}}
    light: {{points: [A, B], mass: {light}, inertia: rod}}
  joints:
    pin: {{type: revolute, between: [ground, heavy], at: O}}
    knee: {{type: revolute, between: [heavy, light], at: A}}
effects: {{gravity: {{acceleration: [0, -9.81]}}}}
"""


@pytest.mark.parametrize('ratio', [1e3, 1e6, 1e9])
def test_a_light_body_does_not_disturb_a_heavy_one(ratio: float) -> None:
    """The heavy rod swings as alone, and what is light keeps its own energy balance."""
    sim = Simulation(scene_from_text(pendulum(1.0 / ratio)), integrator='dop853', step=1e-3)
    alone = Simulation(
        load_scene(
            {
                'mechanism': {
                    'alf': 1,
                    'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
                    'bodies': {'heavy': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'}},
                    'joints': {
                        'pin': {'type': 'revolute', 'between': ['ground', 'heavy'], 'at': 'O'}
                    },
                },
                'effects': {'gravity': {'acceleration': [0, -9.81]}},
            }
        ),
        integrator='dop853',
        step=1e-3,
    )
    sim.step(STEPS)
    alone.step(STEPS)
    sample = sim.sample()
    assert sample.points['A'] == pytest.approx(alone.sample().points['A'], abs=100.0 / ratio)
    assert sample.energy == pytest.approx(0.0, abs=1e-10)
    assert sample.diagnostics.position_violation < 1e-13
