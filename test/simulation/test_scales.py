"""Micrometres to hundreds of metres, dust to mountains: the same motion, the same settings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.scene import scene_from_text

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
    """The heavy rod swings as alone, and the light rod keeps its own energy balance."""
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


def chain(bars: int, **settings: Any) -> Simulation:
    """Of bars of 1 m and 1 kg, drawn level, hanging from its first point."""
    points = {f'P{k}': {'at': [k, 0], 'fixed': k == 0} for k in range(bars + 1)}
    bodies = {
        f'b{k}': {'points': [f'P{k}', f'P{k + 1}'], 'mass': 1, 'inertia': 'rod'}
        for k in range(bars)
    }
    joints = {
        f'j{k}': {
            'type': 'revolute',
            'between': [f'b{k - 1}' if k else 'ground', f'b{k}'],
            'at': f'P{k}',
        }
        for k in range(bars)
    }
    mechanism = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    scene = {'mechanism': mechanism, 'effects': {'gravity': {'acceleration': [0, -9.81]}}}
    return Simulation(load_scene(scene), **settings)


@pytest.mark.parametrize('bars', [10, 300, 3000])
def test_rounds_do_not_grow_with_a_chain(bars: int) -> None:
    """The softest wave of the chain has σ ≈ 1 / bars.

    With the penalty of a short chain, every stage would need conjugate gradients.
    """
    sim = chain(bars, step=1e-4)
    sim.step(5)
    assert sim.sample().diagnostics.iterations <= 3
    assert sim.sample().diagnostics.redundant == 0


def test_a_long_chain_falls_as_with_any_penalty() -> None:
    """The chain falls alike with any penalty.

    Its end falls freely, except for the part of the pull that has reached the end.
    """
    ends, before = [], chain(100).sample().energy
    for penalty in (1e6, 1e11):
        sim = chain(100, step=1e-3, integrator='dop853', penalty=penalty)
        sim.step(500)
        ends.append(sim.sample().q)
        assert sim.sample().energy == pytest.approx(before, abs=1e-8 * 100 * 9.81)
    assert ends[0] == pytest.approx(ends[1], abs=1e-8)
