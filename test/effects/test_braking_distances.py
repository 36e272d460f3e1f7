"""Dry friction to the end: how far bodies slide and turn before they stand, and slopes on which
they just stick or just slide, in the plane and in space."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats

G, M, K, MU = 9.81, 2.0, 1e4, 0.35
ALPHA = 0.3  # rad, of the slopes
SPACES = ('planar', 'spatial')


def way(v: float, mu_g: float, slip: float) -> float:
    """m, to the end: v dv / ds = -μ g v / √(v² + ε²). Without slip it is v² / 2 μ g."""
    return (v * math.hypot(v, slip) + slip**2 * math.asinh(v / slip)) / (2.0 * mu_g)


def vector(space: str, along: float, up: float) -> list[float]:
    return [along, up] if space == 'planar' else [along, 0.0, up]


def block(space: str, place: list[float], effects: Any, **more: Any) -> Simulation:
    """A mass P, free."""
    mechanism = {
        'alf': 1,
        'space': space,
        'points': {'P': {'at': place}},
        'bodies': {'mass': {'points': ['P'], 'mass': M, 'inertia': 'point'}},
    }
    solver = {'step': 1e-3, 'integrator': 'dop853_adaptive', 'tolerance': 1e-10}
    return Simulation(
        load_scene({'mechanism': mechanism, 'effects': effects, 'solver': solver, **more})
    )


@pytest.mark.parametrize('slip', [1e-2, 1e-3])
@pytest.mark.parametrize('v', [[1.2], [0.9, -0.4]], ids=['planar', 'spatial'])
def test_a_block_slides_as_far_as_friction_lets_it(v: list[float], slip: float) -> None:
    """Straight on, also across the axes of the ground."""
    low = -M * G / K
    touch = {'on': 'P', 'stiffness': K, 'exponent': 1, 'friction': MU, 'slip': slip}
    space, zeros = SPACES[len(v) - 1], [0.0] * len(v)
    gravity = {'acceleration': [*zeros, -G]}
    effects = {'gravity': gravity, 'ground_contact': touch}
    sim = block(space, [*zeros, low], effects, initial={'velocities': {'P': [*v, 0.0]}})
    speed = float(np.linalg.norm(v))
    sim.step(600)
    sample = sim.sample()
    far = way(speed, MU * G, slip)
    assert far == pytest.approx(speed**2 / (2.0 * MU * G), rel=1e-2)
    wanted = far * np.array(v) / speed
    assert sample.points['P'] == pytest.approx([*wanted, low], abs=1e-8)
    assert np.linalg.norm(sample.velocities['P']) < 1e-8


def on_slope(part: float, slip: float, t: float) -> float:
    """m/s from rest, with μ = part · tan α: v̇ = g sin α - μ g cos α v / √(v² + ε²)."""
    pull = G * math.sin(ALPHA)

    def rate(_: float, v: Floats) -> Floats:
        return np.asarray(pull * (1.0 - part * v / np.sqrt(v**2 + slip**2)))

    return float(solve_ivp(rate, (0.0, t), [0.0], 'LSODA', rtol=1e-11, atol=1e-13).y[0, -1])


def check_slope(speed: float, part: float, slip: float, t: float) -> None:
    """Just above tan α it creeps at a speed below which it does not fall, just below it slides."""
    assert speed == pytest.approx(on_slope(part, slip, t), rel=1e-6)
    if part > 1.0:
        assert speed == pytest.approx(slip / math.sqrt(part**2 - 1.0), rel=1e-5)
    else:
        assert speed > (1.0 - part) * G * math.sin(ALPHA) * t > 10.0 * slip


@pytest.mark.parametrize('space', SPACES)
@pytest.mark.parametrize('part', [1.02, 0.98])
def test_a_block_just_sticks_or_just_slides_on_a_slope(space: str, part: float) -> None:
    slip, mu, depth = 1e-3, part * math.tan(ALPHA), M * G * math.cos(ALPHA) / K
    normal = vector(space, math.sin(ALPHA), math.cos(ALPHA))
    touch = {'on': 'P', 'normal': normal, 'stiffness': K, 'exponent': 1}
    effects = {
        'gravity': {'acceleration': vector(space, 0.0, -G)},
        'ground_contact': {**touch, 'friction': mu, 'slip': slip},
    }
    sim = block(space, [-depth * x for x in normal], effects)
    sim.step(800)
    sample = sim.sample()
    down = vector(space, math.cos(ALPHA), -math.sin(ALPHA))
    check_slope(float(sample.velocities['P'] @ down), part, slip, 0.8)
    assert sample.points['P'] @ normal == pytest.approx(-depth, abs=1e-9)


@pytest.mark.parametrize('space', SPACES)
@pytest.mark.parametrize('part', [1.02, 0.98])
def test_a_guide_just_sticks_or_just_slides_on_a_slope(space: str, part: float) -> None:
    """Its load is the force in the joint, M g cos α."""
    slip, mu = 1e-3, part * math.tan(ALPHA)
    axis = vector(space, math.cos(ALPHA), -math.sin(ALPHA))
    body: dict[str, Any] = {'points': ['P', 'Q'], 'mass': M, 'com': vector(space, 0.0, 0.0)}
    body['inertia'] = {'about_com': 0.1 if space == 'planar' else [0.1, 0.1, 0.1]}
    guide = {'type': 'prismatic', 'between': ['ground', 'sled'], 'at': 'P', 'axis': axis}
    points = {'P': {'at': vector(space, 0.0, 0.0)}, 'Q': {'at': axis}}
    mechanism = {'alf': 1, 'space': space, 'points': points, 'bodies': {'sled': body}}
    friction = {'joint': 'guide', 'dynamic': mu, 'slip': slip}
    scene = {
        'mechanism': {**mechanism, 'joints': {'guide': guide}},
        'effects': {
            'gravity': {'acceleration': vector(space, 0.0, -G)},
            'joint_friction': friction,
        },
        'solver': {'step': 1e-3, 'integrator': 'dop853_adaptive', 'tolerance': 1e-10},
    }
    sim = Simulation(load_scene(scene))
    sim.step(800)
    sample = sim.sample()
    check_slope(sample.joints['guide'].velocity, part, slip, 0.8)
    load = np.linalg.norm(sample.reactions['guide'].force)
    assert load == pytest.approx(M * G * math.cos(ALPHA), rel=1e-9)
