"""The fastest rate of each effect against closed forms, and that longer steps are unstable."""

from __future__ import annotations

import math
from contextlib import nullcontext

import numpy as np
import pytest

from alf_ros import Simulation, StepError
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.stiffness import Mode, stiffest
from support.effect_scenes import MASS, ROTOR, ROTOR_IN_SPACE

M, J, G = 2.0, 0.5, 9.81
LINKED = 'between: [O, P]'


def modes(mechanism: str, effects: str, initial: str = '') -> tuple[dict[str, Mode], Mode]:
    text = f'{mechanism}\neffects: {{{effects}}}\ninitial: {{{initial}}}\n'
    return stiffest([Simulation(scene_from_text(text)).sample()])


def test_spring_and_damper() -> None:
    k, c = 50.0, 3.0
    spring = f'spring: {{{LINKED}, stiffness: {k}}}'
    alone, both = modes(MASS, f'{spring}, damper: {{{LINKED}, damping: {c}}}')
    assert alone['spring'].rate == pytest.approx(math.sqrt(k / M), rel=1e-6)
    assert alone['damper'].value == pytest.approx(-c / M, rel=1e-6)
    decay = c / (2.0 * M)
    value = complex(-decay, math.sqrt(k / M - decay**2))
    assert both.value in (
        pytest.approx(value, rel=1e-6),
        pytest.approx(value.conjugate(), rel=1e-6),
    )


@pytest.mark.parametrize('mechanism', [ROTOR, ROTOR_IN_SPACE])
def test_stop_friction_and_motor(mechanism: str) -> None:
    """√(k n δ^(n-1) / J) at a depth δ; μ N r / (ε J) of dry friction at rest; √(k_p / J)."""
    k, n, depth, spin = 1e6, 1.5, 0.01, 3.0
    effects = (
        f'joint_stop: {{joint: pin, upper: {-depth}, stiffness: {k}, exponent: {n}}}, '
        'joint_friction: {joint: pin, dynamic: 0.2, load: 100, radius: 0.1, slip: 1.0e-2}, '
        'motor: {joint: pin, position: 0, position_gain: 80, velocity_gain: 0.5}'
    )
    third = ', ~' if mechanism is ROTOR_IN_SPACE else ''
    alone, _ = modes(mechanism, effects, f'velocities: {{A: [~, {spin}{third}]}}')
    stop = math.sqrt(k * n * depth ** (n - 1.0) / J)
    assert alone['joint_stop'].rate == pytest.approx(stop, rel=1e-4)
    assert alone['joint_friction'].value == pytest.approx(-0.2 * 100 * 0.1 / (1e-2 * J), rel=1e-3)
    decay = 0.5 / (2.0 * J)
    assert alone['motor'].rate == pytest.approx(math.sqrt(80 / J), rel=1e-5)
    assert alone['motor'].value.real == pytest.approx(-decay, rel=1e-5)


def test_friction_under_its_true_load() -> None:
    """N is the weight."""
    friction = 'joint_friction: {joint: pin, dynamic: 0.2, radius: 0.1, slip: 1.0e-2}'
    alone, _ = modes(ROTOR, f'gravity: {{acceleration: [0, {-G}]}}, {friction}')
    assert alone['joint_friction'].rate == pytest.approx(
        0.2 * 1.0 * G * 0.1 / (1e-2 * J), rel=1e-3
    )
    assert alone['gravity'].rate == 0.0 and alone['gravity'].step('rk4') == math.inf


def test_a_linkage_feels_it_with_the_mass_of_its_motion() -> None:
    """Spring at the slider of a slider-crank: K = k (dx_B/dθ)² / J(θ), with the angle."""
    k = 1e4
    text = f'mechanism: slider_crank\neffects: {{spring: {{between: [O, B], stiffness: {k}}}}}\n'
    sample = Simulation(scene_from_text(text)).sample()
    alone, _ = stiffest([sample])
    angle = math.pi / 4
    inertia = 2.0 / 3.0 + 2.0 * math.sin(angle) ** 2  # of two rods of 1 m and 1 kg
    rate = math.sqrt(k * (2.0 * math.sin(angle)) ** 2 / inertia)
    assert alone['spring'].rate == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853'])
@pytest.mark.parametrize(
    'effect',
    [
        f'spring: {{{LINKED}, stiffness: 800}}',
        f'damper: {{{LINKED}, damping: 40}}',
        f'spring: {{{LINKED}, stiffness: 800}}, damper: {{{LINKED}, damping: 40}}',
    ],
)
def test_longer_steps_are_unstable(effect: str, integrator: str) -> None:
    _, whole = modes(MASS, effect)
    longest, speeds = whole.step(integrator), []
    for part in (0.97, 1.03):
        text = f'{MASS}\neffects: {{{effect}}}\ninitial: {{velocities: {{P: [1.0e-3, 0]}}}}\n'
        sim = Simulation(scene_from_text(text), step=part * longest, integrator=integrator)
        named = (
            f'the step is too long for the stiff effect (spring|damper), .* {integrator} is stable'
        )
        unstable = pytest.raises(StepError, match=named)
        with unstable if part > 1.0 else nullcontext():
            sim.step(600)
        speeds.append(np.abs(sim.sample().velocities['P']).max())
    assert speeds[0] <= 1e-3 < speeds[1]


def test_limits_are_those_of_the_literature() -> None:
    """2.785 and 2.828 of RK4 on the real and the imaginary axis."""
    assert Mode(-1.0).step('rk4') == pytest.approx(2.785, abs=2e-3)
    assert Mode(1j).step('rk4') == pytest.approx(math.sqrt(8.0), abs=2e-3)
    assert Mode(3.0).step('rk4') == pytest.approx(math.sqrt(8.0) / 3.0, abs=2e-3)
    assert Mode(-10.0).step('dop853') == pytest.approx(0.64, abs=5e-3)
    assert Mode(0.0).step('rk4') == math.inf
    assert Mode(-1e9).step('esdirk43') == math.inf
