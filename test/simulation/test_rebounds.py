"""Rebounds that last a few fixed steps: what they lose is bounded, or reported."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from alf_ros import Scene, Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.scene import scene_from_text
from support.effect_scenes import ROTOR
from support.thorough import LONG, combined

SPEED = 3.0  # rad/s
INTEGRATORS = ['rk4', 'dop853', 'esdirk43']
LINEAR, HERTZ = 1.0, 1.5


def met_by_a_rotor(within: float, step: float, exponent: float, stop: float) -> Scene:
    """A rotor of 0.5 kg m² that an elastic stop at an angle (rad) throws back within so many
    steps."""
    lasts = within * step
    if exponent == LINEAR:
        stiffness = 0.5 * (math.pi / lasts) ** 2
    else:  # Hertz: as deep as it gets it has 2.5 E / d^2.5, and it lasts 2.94 d / v
        deepest = SPEED * lasts / 2.943
        stiffness = 0.5 * 0.5 * SPEED**2 * 2.5 / deepest**2.5
    numbers = f'upper: {stop}, stiffness: {stiffness:e}, exponent: {exponent}'
    return scene_from_text(
        f'{ROTOR}\neffects: {{joint_stop: {{joint: pin, {numbers}}}}}\n'
        f'initial: {{velocities: {{A: [~, {SPEED}]}}}}\n'
    )


def lost(sim: Simulation) -> float:
    """The part of its speed that the rotor has lost, or gained."""
    return abs(sim.sample().joints['pin'].velocity / SPEED + 1.0)


@pytest.mark.parametrize(
    ('integrator', 'within', 'exponent', 'most'),
    [
        ('dop853', 1.5, LINEAR, 1e-4),
        ('dop853', 3, LINEAR, 2e-6),
        ('dop853', 1.5, HERTZ, 5e-3),
        ('dop853', 3, HERTZ, 1.5e-4),
        ('esdirk43', 1.5, LINEAR, 7e-2),
        ('esdirk43', 2, LINEAR, 2e-2),
        ('esdirk43', 3, LINEAR, 2e-3),
        ('esdirk43', 5, LINEAR, 2e-4),
        ('esdirk43', 5, HERTZ, 2e-3),
        ('rk4', 1.5, LINEAR, 0.3),
        ('rk4', 2, LINEAR, 0.1),
        ('rk4', 3, LINEAR, 3e-2),
        ('rk4', 5, LINEAR, 3e-3),
        ('rk4', 12, LINEAR, 5e-5),
        ('rk4', 12, HERTZ, 2e-4),
    ],
)
def test_fixed_steps_end_at_a_stop(
    integrator: str, within: float, exponent: float, most: float
) -> None:
    """Met anywhere in a step the stop takes so much of the speed (doc/method.md)."""
    for step in 1e-4 * (1.0 + 0.013 * np.arange(15 if LONG else 5)):
        scene = met_by_a_rotor(within, step, exponent, stop=0.03)
        sim = Simulation(scene, integrator=integrator, step=float(step))
        sim.step(150)
        assert lost(sim) < most


@pytest.mark.parametrize(
    ('integrator', 'exponent', 'step'), combined(INTEGRATORS, [LINEAR, HERTZ], [1e-3, 1e-4])
)
def test_a_rebound_that_steps_do_not_resolve_is_reported(
    integrator: str, exponent: float, step: float
) -> None:
    """Also one shorter than a step, of which the stages between the stop's kinks are few."""
    for within in (0.3, 0.7, 1.5, 2.0, 3.0):
        for h in step * (1.0 + 0.013 * np.arange(15 if LONG else 5)):
            scene = met_by_a_rotor(within, h, exponent, stop=30 * step)
            sim = Simulation(scene, integrator=integrator, step=float(h))
            try:
                sim.step(30)
            except StepError:
                continue
            assert sim.resolution.too_long or lost(sim) < 2e-4


@functools.cache
def landed() -> Floats:
    """Where a leg is 4 s after it jumps, in the steps of its scene."""
    sim = Simulation(load_scene('spring_leg'))
    sim.step(round(4.0 / sim.h))
    return sim.state.q


@pytest.mark.parametrize(
    ('integrator', 'step'), [('rk4', 1e-3), ('dop853', 2e-3), ('esdirk43', 1e-3)]
)
def test_landings_that_steps_resolve_are_not_reported(integrator: str, step: float) -> None:
    """A leg jumps and lands on rubber: its motors and dampers change the force at stages, too."""
    sim = Simulation(load_scene('spring_leg'), integrator=integrator, step=step)
    sim.step(round(4.0 / sim.h))
    assert sim.state.q == pytest.approx(landed(), abs=5e-6)
    assert not sim.resolution.too_long
