"""Springs and dampers against oscillators with a closed form."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from support.effect_scenes import MASS, ROTOR, ROTOR_IN_SPACE, TWO_ROTORS, simulate


def test_damped_oscillator() -> None:
    """m ẍ + c ẋ + k x = 0 along the line of spring and damper."""
    k, c, m, v = 50.0, 3.0, 2.0, 2.0
    sim = simulate(
        MASS,
        f'spring: {{between: [O, mass], stiffness: {k}}}, '
        f'damper: {{between: [O, P], damping: {c}}}',
        f'P: [{v}, 0]',
    )
    decay = c / (2.0 * m)
    omega = math.sqrt(k / m - decay**2)
    for sample in sim.run(2.0, every=200):
        x = 1.0 + v / omega * math.exp(-decay * sample.t) * math.sin(omega * sample.t)
        assert sample.points['P'] == pytest.approx([x, 0.0], abs=1e-11)


def test_bilinear_spring() -> None:
    """A table with a corner: half a period of each stiffness, and no energy lost."""
    stiff, soft, m = 200.0, 50.0, 2.0
    table = f'[[-1, -{stiff}], [0, 0], [1, {soft}]]'
    sim = simulate(MASS, f'spring: {{between: [O, P], table: {table}}}', 'P: [0.5, 0]', step=1e-4)
    period = math.pi * (math.sqrt(m / stiff) + math.sqrt(m / soft))
    energy = sim.sample().energy
    assert energy == pytest.approx(0.25, abs=1e-14)
    (_, half, sample) = sim.run(1.0, at=[0.0, math.pi * math.sqrt(m / soft), period])
    assert half.points['P'] == pytest.approx([1.0, 0.0], abs=1e-8)
    assert half.velocities['P'] == pytest.approx([-0.5, 0.0], abs=1e-7)
    assert sample.points['P'] == pytest.approx([1.0, 0.0], abs=1e-8)
    assert sample.energy == pytest.approx(energy, abs=1e-8)


def test_pendulum_on_a_spring_without_free_length() -> None:
    """A spring of free length zero to the origin: both coordinates swing on their own."""
    k, m = 50.0, 2.0
    spring = f'spring: {{between: [O, P], stiffness: {k}, free_length: 0}}'
    sim = simulate(MASS, f'gravity: {{acceleration: [0, -9.81]}}, {spring}', 'P: [0, 1.5]')
    omega, sag = math.sqrt(k / m), m * 9.81 / k
    for sample in sim.run(2.0, every=100):
        c, s = math.cos(omega * sample.t), math.sin(omega * sample.t)
        y = -sag + sag * c + 1.5 / omega * s
        assert sample.points['P'] == pytest.approx([c, y], abs=1e-11)


@pytest.mark.parametrize('mechanism', [ROTOR, ROTOR_IN_SPACE])
def test_torsion_spring_winds_up_several_turns(mechanism: str) -> None:
    k, J, c = 0.5, 0.5, 0.02
    v = 22.0  # more than three turns
    sim = simulate(
        mechanism,
        f'torsion_spring: {{joint: pin, stiffness: {k}, damping: {c}}}',
        f'A: [~, {v}{", ~" * ("spatial" in mechanism)}]',
    )
    decay = c / (2.0 * J)
    omega = math.sqrt(k / J - decay**2)
    angles = []
    for sample in sim.run(8.0, every=50):
        angle = v / omega * math.exp(-decay * sample.t) * math.sin(omega * sample.t)
        angles.append(sample.joints['pin'].position)
        assert angles[-1] == pytest.approx(angle, abs=1e-8)
    assert max(angles) > 6.5 * math.pi and min(angles) < -5.0 * math.pi


def test_torsion_spring_between_two_that_spin() -> None:
    """Only the angle between them winds it, from the drawn one on, however far both turn."""
    k, J1, J2 = 0.5, 0.5, 0.25
    both, apart = 30.0, 20.0  # rad/s
    v1, v2 = both, both + apart
    sim = simulate(
        TWO_ROTORS,
        f'torsion_spring: {{joint: pin, stiffness: {k}}}',
        f'P: [0, 0], A: [~, {v1}], B: [{-v2}, ~]',
    )
    omega = math.sqrt(k * (1.0 / J1 + 1.0 / J2))
    for sample in sim.run(4.0, every=50):
        angle = 0.5 * math.pi + apart / omega * math.sin(omega * sample.t)
        assert sample.joints['pin'].position == pytest.approx(angle, abs=1e-8)
        assert sample.energy == pytest.approx(0.5 * (J1 * v1**2 + J2 * v2**2), rel=1e-11)
    assert np.abs(sim.state.turns).max() > 10


def test_an_angle_as_drawn_is_the_difference_of_two_directions() -> None:
    """Bars at 3.1 and 3.2 rad: the second direction is 3.2 - 2 pi, a whole turn less."""
    first, second, k = 3.1, 3.2, 3.0
    knee = [math.cos(first), math.sin(first)]
    tip = [knee[0] + math.cos(second), knee[1] + math.sin(second)]
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': knee}, 'B': {'at': tip}},
            'bodies': {
                'upper': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'},
                'lower': {'points': ['A', 'B'], 'mass': 1.0, 'inertia': 'rod'},
            },
            'joints': {
                'hip': {'type': 'revolute', 'between': ['ground', 'upper'], 'at': 'O'},
                'knee': {'type': 'revolute', 'between': ['upper', 'lower'], 'at': 'A'},
            },
        },
        'effects': {'torsion_spring': {'joint': 'knee', 'stiffness': k, 'free_position': 0.0}},
    }
    sample = Simulation(load_scene(scene)).sample()
    angle = second - first - 2.0 * math.pi
    assert sample.joints['knee'].position == pytest.approx(angle, abs=1e-14)
    assert sample.joints['knee'].effort == pytest.approx(-k * angle, abs=1e-12)
    assert sample.stored['torsion_spring'] == pytest.approx(0.5 * k * angle**2, abs=1e-12)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_wound_up_run_repeats_bit_for_bit(integrator: str) -> None:
    """The turns are state: restored in the third of them, the spring knows."""
    from alf_ros import Simulation

    scene = simulate(ROTOR, 'torsion_spring: {joint: pin, stiffness: 0.5}', 'A: [~, 22]').scene
    sim = Simulation(scene, integrator=integrator)
    sim.step(1300)
    assert sim.sample().joints['pin'].position > 6.0 * math.pi
    state = pickle.loads(pickle.dumps(sim.state))
    sim.step(700)
    once = sim.state.q.tobytes()
    other = Simulation(scene, integrator=integrator)
    other.restore(state)
    for _ in range(700):
        other.step()
    assert other.state.q.tobytes() == once


def test_spring_on_a_length() -> None:
    """A slider on its rail: the joint's coordinate is a length."""
    line = '{through: [0, 0], direction: [1, 0]}'
    rail = f'{MASS}  joints: {{rail: {{type: slider, point: P, on: {line}}}}}\n'
    sim = simulate(rail, 'torsion_spring: {joint: rail, stiffness: 50, free_position: 0.5}')
    for sample in sim.run(1.0, every=100):
        x = 0.5 + 0.5 * math.cos(5.0 * sample.t)
        assert sample.joints['rail'].position == pytest.approx(x, abs=1e-11)
