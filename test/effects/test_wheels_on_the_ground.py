"""Wheels in space that touch a plane, against rolling without slip and against energy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import InputError, Simulation, load_scene
from alf_ros.arrays import Floats

G, MASS, R = 9.81, 2.0, 0.3
J = MASS * R**2 * np.array([0.25, 0.5, 0.25])  # a disc about y
AXLE = [0.0, 1.0, 0.0]


def turned(lean: float) -> Floats:
    """The axes of the body, as columns: about x from an upright wheel along x."""
    c, s = math.cos(lean), math.sin(lean)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def wheel(height: float, lean: float = 0.0, gravity: Any = (0, 0, -G), **contact: Any) -> Any:
    """A disc with its centre at a height, m, from rest."""
    axes, centre = turned(lean), np.array([0.0, 0.0, height])
    points = {'C': {'at': centre.tolist()}}
    for name, axis in zip('PQS', axes.T, strict=True):
        points[name] = {'at': (centre + axis).tolist()}
    body = {
        'points': list(points),
        'mass': MASS,
        'com': [0, 0, 0],
        'inertia': {'about_com': J.tolist()},
    }
    touch = {'on': 'wheel', 'at': 'C', 'radius': R, 'exponent': 1, 'axle': AXLE, **contact}
    return {
        'mechanism': {'alf': 1, 'space': 'spatial', 'points': points, 'bodies': {'wheel': body}},
        'effects': {'gravity': {'acceleration': list(gravity)}, 'ground_contact': touch},
        'solver': {'integrator': 'dop853_adaptive', 'step': 0.01, 'tolerance': 1e-9},
    }


def moving(scene: Any, v: Floats, omega: Floats) -> Simulation:
    """With a velocity of its centre, m/s, and an angular velocity, rad/s, in the world."""
    at = {name: np.array(point['at']) for name, point in scene['mechanism']['points'].items()}
    speeds = {name: (v + np.cross(omega, p - at['C'])).tolist() for name, p in at.items()}
    return Simulation(load_scene({**scene, 'initial': {'velocities': speeds}}))


def test_it_rolls_down_a_slope() -> None:
    """v + ½ R ω = g sin α t, and v - R ω is the slip at which friction holds what it must."""
    alpha, k, mu, slow, t = 0.3, 1e5, 0.8, 1e-3, 0.5
    gravity = (G * math.sin(alpha), 0.0, -G * math.cos(alpha))
    depth = MASS * G * math.cos(alpha) / k
    scene = wheel(R - depth, 0.0, gravity, stiffness=k, friction=mu, slip=slow)
    sim = Simulation(load_scene(scene))
    sim.step(50)
    held = math.tan(alpha) / 3.0 / mu
    slip = slow * held / math.sqrt(1.0 - held**2)
    speed = (gravity[0] * t + 0.5 * slip) / 1.5
    assert sim.sample().velocities['C'] == pytest.approx([speed, 0.0, 0.0], abs=1e-6)


def rolled(lean: float, omega: Floats, duration: float) -> Floats:
    """Place of the centre (3,), m, of a wheel that rolls without slip: m v̇ = F + m g,
    d(I ω)/dt = r × F and v = -ω × r, for the axes of the body, ω and the place."""

    def place(axes: Floats) -> Floats:
        a = axes[:, 1]
        r: Floats = np.array([0.0, 0.0, -1.0]) + a[2] * a
        return R * r / np.linalg.norm(r)

    def rate(_: float, y: Floats) -> Floats:
        axes, w = y[:9].reshape(3, 3), y[9:12]
        inertia = axes @ np.diag(J) @ axes.T
        r = place(axes)
        h = 1e-6  # ṙ by a central difference
        turn = np.cross(w, axes, axisb=0, axisc=0)
        rr = (place(axes + h * turn) - place(axes - h * turn)) / (2.0 * h)
        lever = np.array([np.cross(r, e) for e in np.eye(3)]).T  # r × F = lever F
        # v̇ = r × ω̇ - ω × ṙ = lever ω̇ - ω × ṙ
        A = np.zeros((6, 6))
        A[:3, :3], A[:3, 3:] = MASS * lever, -np.eye(3)
        A[3:, :3], A[3:, 3:] = inertia, -lever
        b = np.concatenate(
            (
                MASS * np.cross(w, rr) + MASS * np.array([0.0, 0.0, -G]),
                -np.cross(w, inertia @ w),
            )
        )
        alpha = np.linalg.solve(A, b)[:3]
        return np.concatenate((turn.ravel(), alpha, -np.cross(w, r)))

    start = np.concatenate((turned(lean).ravel(), omega, np.zeros(3)))
    y = solve_ivp(rate, (0.0, duration), start, 'DOP853', rtol=1e-10, atol=1e-12).y[:, -1]
    return np.asarray(y[12:])


def test_it_leans_and_turns_like_a_wheel_that_rolls() -> None:
    """Path of 1.5 s in a curve; the ground gives by 0.2 mm, and friction creeps."""
    lean, k = 0.35, 1e5
    axis = turned(lean)[:, 1]
    omega = 9.0 * axis + 0.4 * np.array([0.0, 0.0, 1.0])
    r = R * (np.array([0.0, 0.0, -1.0]) + axis[2] * axis) / math.sqrt(1.0 - axis[2] ** 2)
    scene = wheel(-r[2] - MASS * G / k, lean, stiffness=k, friction=2.0, slip=1e-3)
    scene['effects']['ground_contact']['damping'] = 2.0
    sim = moving(scene, -np.cross(omega, r), omega)
    begun = sim.sample().points['C']
    sim.step(150)
    path = sim.sample().points['C'] - begun
    expected = rolled(lean, omega, 1.5)
    assert np.linalg.norm(expected[:2]) > 0.5
    assert np.abs(path - expected).max() < 1e-3


@pytest.mark.parametrize('lean', [0.0, 0.4, 1.2])
def test_without_friction_it_keeps_its_energy(lean: float) -> None:
    """It falls, is thrown back, and turns over, onto its face too."""
    scene = wheel(R + 0.05, lean, stiffness=1e4)
    sim = moving(scene, np.array([0.3, 0.0, 0.0]), np.array([0.5, 3.0, 0.2]))
    energy, lowest = sim.sample().energy, math.inf
    for sample in sim.run(1.0):
        assert sample.energy == pytest.approx(energy, abs=2e-6)
        lowest = min(lowest, sample.points['C'][2])
    assert lowest < R * math.cos(lean)


def test_it_spins_on_its_face_with_long_steps() -> None:
    """Stages that are not yet projected lengthen the axle; friction slows the spin alone."""
    scene = wheel(0.0, math.pi / 2, stiffness=1e4, damping=1.0, friction=0.5)
    scene['solver'] = {'integrator': 'esdirk43', 'step': 0.005}
    sim = moving(scene, np.zeros(3), np.array([0.0, 0.0, 40.0]))
    sim.step(100)
    after = sim.sample()
    assert np.linalg.norm(after.points['P'] - after.points['C']) == pytest.approx(1.0, abs=1e-9)
    assert abs(after.points['C'][2]) < 0.01
    assert np.isfinite(after.energy)


@pytest.mark.parametrize(
    'axle, on, radius, told',
    [
        ([0, 0, 0], 'wheel', R, 'axle has no direction'),
        ([0, 1, 0], 'C', R, 'only a body in space'),
        ([0, 1, 0], 'wheel', 0, 'a wheel has a radius greater than zero'),
    ],
)
def test_a_wheel_that_cannot_be(axle: Any, on: str, radius: float, told: str) -> None:
    scene = wheel(R, stiffness=1e4)
    scene['effects']['ground_contact'] |= {'axle': axle, 'on': on, 'radius': radius}
    if on == 'C':
        del scene['effects']['ground_contact']['at']
    with pytest.raises(InputError, match=f'effects.ground_contact.axle: {told}'):
        Simulation(load_scene(scene))
