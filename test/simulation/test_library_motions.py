"""Scenes that come along, against closed forms and against Lagrange's equations of few angles."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from alf_ros import Sample, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.scene import scene_from_text
from support.paths import DATA

G = 9.81


def test_planetary_gear() -> None:
    """Willis: ω_c = ω_s rs / (rs + rr), planets ω_p = ω_c - ω_c rr / rp; constant acceleration."""
    rs, rr = 0.03, 0.09
    rp, rc = 0.5 * (rr - rs), 0.5 * (rr + rs)
    carrier = rs / (rs + rr)
    planet = carrier * (1.0 - rr / rp)
    inertia = 5e-4 + carrier**2 * (1e-3 + 3 * 0.2 * rc**2) + 3 * planet**2 * 1e-4
    sim = Simulation(load_scene('planetary_gear'))
    start, spin = sim.sample().joints['pin1'].position, planet - carrier
    for sample in sim.run(1.0, every=50):
        angle = 0.5 * 0.02 / inertia * sample.t**2
        assert sample.joints['shaft'].position == pytest.approx(angle, abs=1e-9)
        assert sample.joints['output'].position == pytest.approx(carrier * angle, abs=1e-9)
        assert sample.joints['pin1'].position - start == pytest.approx(spin * angle, abs=1e-9)
    assert angle > 10.0  # rad
    flags = {name for name, reaction in sample.reactions.items() if reaction.indeterminate}
    assert {'mesh0', 'mesh1', 'mesh2', 'ring0', 'ring1', 'ring2'} <= flags


def test_one_planet_is_determinate() -> None:
    """Its tooth forces: T = F rs drives the sun, and each mesh is tangential."""
    text = load_scene('planetary_gear').text.replace('k: [0, 2]', 'k: [0, 0]')
    scene = scene_from_text(text.replace('[O, P0, P1, P2]', '[O, P0]'))
    assert len(scene.mechanism.bodies) == 3
    sim = Simulation(scene, step=2e-3, integrator='dop853')
    sim.step(100)
    sample = sim.sample()
    assert sample.diagnostics.redundant == 0
    out = sample.points['P0'] / np.linalg.norm(sample.points['P0'])
    for joint in ('mesh0', 'ring0'):
        assert sample.reactions[joint].force @ out == pytest.approx(0.0, abs=1e-10)
    # the sun: J α = T - F rs, F on the planet
    rs, rr, rp, rc = 0.03, 0.09, 0.03, 0.06
    carrier = rs / (rs + rr)
    planet = carrier * (1.0 - rr / rp)
    alpha = 0.02 / (5e-4 + carrier**2 * (1e-3 + 0.2 * rc**2) + planet**2 * 1e-4)
    force = sample.reactions['mesh0'].force @ [-out[1], out[0]]
    assert force * rs == pytest.approx(0.02 - 5e-4 * alpha, abs=1e-9)
    # the planet: J α_p = -F rp + G rp, about its centre (F on the inner side, G on the outer)
    other = sample.reactions['ring0'].force @ [-out[1], out[0]]
    assert (other - force) * rp == pytest.approx(1e-4 * planet * alpha, abs=1e-9)
    torques = [sample.reactions[joint].torque for joint in ('mesh0', 'ring0')]
    assert torques == pytest.approx([-force * rp, other * rp], abs=1e-9)


def test_rack_and_pinion() -> None:
    """a (m + J / r²) = 2 m."""
    r, J, m = 0.05, 0.002, 1.5
    a = 2.0 * m / (m + J / r**2)
    for sample in Simulation(load_scene('rack_and_pinion')).run(1.0, every=20):
        moved = 0.5 * a * sample.t**2
        assert sample.joints['guide'].position == pytest.approx(moved, abs=1e-10)
        # the rack below moves to the right: the pinion turns counter-clockwise
        assert sample.joints['axle'].position == pytest.approx(moved / r, abs=1e-9)
        tooth = sample.reactions['mesh'].force
        assert tooth == pytest.approx([J * a / r**2, 0.0], abs=1e-9)


def test_pendulum() -> None:
    """IFToMM A01, 10 s."""
    exact = json.loads((DATA / 'A01_simple_pendulum.json').read_text())
    sim = Simulation(load_scene('pendulum'))
    times = [each['t'] for each in exact['samples']]
    for sample, wanted in zip(sim.run(10.0, at=times), exact['samples'], strict=True):
        assert sample.points['A'] == pytest.approx(wanted['q'], abs=1e-10)
        assert sample.velocities['A'] == pytest.approx(wanted['qd'], abs=1e-9)
        assert sample.qdd == pytest.approx(wanted['qdd'], abs=1e-8)
        # Φ = ½ (|q|² - L²), so that λ is the pull of the bar over L
        assert sample.lam == pytest.approx(wanted['lambda'], abs=1e-8)


def test_bricard() -> None:
    exact = json.loads((DATA / 'A04_bricard.json').read_text())['slender']['samples'][:11]
    sim = Simulation(load_scene('bricard'))
    for sample, wanted in zip(sim.run(1.0, at=[s['t'] for s in exact]), exact, strict=True):
        assert sample.points['P2'] == pytest.approx(wanted['P3'], abs=1e-10)


def test_double_pendulum() -> None:
    """Two angles, by Lagrange."""
    a, b = 1.0, 0.8

    def rate(_: float, state: Floats) -> Floats:
        one, two, w, v = state
        c, s = np.cos(one - two), np.sin(one - two)
        M = np.array([[a * a / 3 + a * a, a * b * c / 2], [a * b * c / 2, b * b / 3]])
        Q = [-a * b / 2 * s * v * v - 1.5 * G * a * np.cos(one)]
        Q += [a * b / 2 * s * w * w - 0.5 * G * b * np.cos(two)]
        return np.array([w, v, *np.linalg.solve(M, Q)])

    start = [0.0, 0.5 * np.pi, 0.0, 0.0]
    exact = solve_ivp(rate, (0.0, 2.0), start, 'DOP853', rtol=1e-13, atol=1e-13).y[:, -1]
    sim = Simulation(load_scene('double_pendulum'))
    sim.step(400)
    sample = sim.sample()
    assert sample.joints['shoulder'].position == pytest.approx(exact[0], abs=1e-9)
    assert sample.joints['elbow'].position == pytest.approx(exact[1] - exact[0], abs=1e-9)
    assert sample.joints['shoulder'].velocity == pytest.approx(exact[2], abs=1e-9)


def test_governor() -> None:
    """At its steady rate the balls stay where they are; faster, the angular momentum is kept."""
    L, m, M, J, phi = 0.2, 0.5, 1.0, 0.01, np.radians(35)
    rate = np.sqrt((m + M) * G / (m * L * np.cos(phi)))
    for sample in Simulation(load_scene('governor', {'faster': 1.0})).run(1.0, every=50):
        assert sample.points['S'] == pytest.approx([0.0, 0.0, -2 * L * np.cos(phi)], abs=1e-9)
        assert sample.joints['bearing'].position == pytest.approx(rate * sample.t, abs=1e-8)
        assert sample.points['B1'][:2] == pytest.approx(
            L * np.sin(phi) * np.array([np.cos(rate * sample.t), np.sin(rate * sample.t)]),
            abs=1e-9,
        )

    def momentum(sample: Sample) -> float:
        radius = sample.points['B1'][:2]
        return float((J + 1e-3 + 2 * m * radius @ radius) * sample.joints['bearing'].velocity)

    samples = list(Simulation(load_scene('governor')).run(1.0, every=25))
    assert np.ptp([momentum(s) for s in samples]) < 1e-11
    assert np.ptp([s.points['S'][2] for s in samples]) > 0.02


def test_delta_robot_moves_without_turning() -> None:
    rb, a, length, rp = 0.20, 0.25, 0.45, 0.06
    sim = Simulation(load_scene('delta_robot'))
    plate = sim.model.body_names.index('plate')
    start = Rotation.from_quat(sim.sample().body_poses[plate, 3:])
    for sample in sim.run(1.0, every=20):
        turn = Rotation.from_quat(sample.body_poses[plate, 3:]) * start.inv()
        assert turn.magnitude() < 1e-12
        for k in range(3):
            out = np.array([np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3), 0.0])
            theta = np.radians(30) + sample.joints[f'motor{k}'].position
            elbow = (rb - rp + a * np.cos(theta)) * out - [0.0, 0.0, a * np.sin(theta)]
            rod = np.linalg.norm(sample.points['C'] - elbow)
            assert rod == pytest.approx(length, abs=1e-12)


@pytest.mark.parametrize('name', ['delta_robot', 'stewart_platform'])
def test_actuators_hold_the_weight(name: str) -> None:
    """The scene's efforts satisfy virtual work: a mechanism that starts at rest stays at rest."""
    sim = Simulation(replace(load_scene(name), velocities={}))
    first = sim.sample()
    sim.step(100)
    assert sim.sample().points['C'] == pytest.approx(first.points['C'], abs=1e-10)
    assert first.qdd == pytest.approx(0.0, abs=1e-9)


def test_double_wishbone() -> None:
    """Where the lower ball joint is, the wheel is, by another way of closing the loops."""
    sim = Simulation(load_scene('double_wishbone'))
    drawn = {p.name: np.array(p.at) for p in sim.model.mechanism.points}
    hinge = drawn['UF'] - drawn['UR']
    rod = np.linalg.norm(drawn['S'] - drawn['T'])

    def place(name: str, x: Floats, D: Floats) -> Floats:
        return np.asarray(D + Rotation.from_rotvec(x[:3]).apply(drawn[name] - drawn['D']))

    def gaps(x: Floats, D: Floats) -> list[float]:
        swing = Rotation.from_rotvec(x[3] * hinge / np.linalg.norm(hinge))
        upper = drawn['UR'] + swing.apply(drawn['U'] - drawn['UR'])
        return [*(place('U', x, D) - upper), np.linalg.norm(place('S', x, D) - drawn['T']) - rod]

    for sample in sim.run(1.0, every=20):
        D = sample.points['D']
        x = fsolve(gaps, np.zeros(4), args=(D,), xtol=1e-14)
        for name in 'WUS':
            assert sample.points[name] == pytest.approx(place(name, x, D), abs=1e-10)
        assert D[0] == pytest.approx(0.0, abs=1e-12)  # its wishbone swings about x
    assert sample.points['W'][2] > 0.4
    flags = {name for name, reaction in sample.reactions.items() if reaction.indeterminate}
    assert flags == {'lower_front', 'lower_rear', 'upper_front', 'upper_rear'}


def test_rolling_disk() -> None:
    roll, yaw, R = 3.0, 0.8, 0.5
    for sample in Simulation(load_scene('rolling_disk')).run(1.0, every=20):
        angle, radius = yaw * sample.t, R * roll / yaw
        wanted = radius * np.sin(angle), radius * (1.0 - np.cos(angle)), R
        assert sample.points['C'] == pytest.approx(wanted, abs=1e-10)


def path(speed: Callable[[float], float], heading: Callable[[float], float], t: float) -> Floats:
    """m: where something is that moves the way it points."""
    parts = [lambda s: speed(s) * np.cos(heading(s)), lambda s: speed(s) * np.sin(heading(s))]
    return np.array([quad(f, 0.0, t, epsabs=1e-13, epsrel=1e-13)[0] for f in parts])


def test_differential_drive_cart() -> None:
    """m v̇ = F_l + F_r, J ψ̈ = w (F_r - F_l)."""
    m, J, w, left, right = 8.0, 0.3, 0.2, 6.0, 8.0
    a, spin = (left + right) / m, w * (right - left) / J
    for sample in Simulation(load_scene('differential_drive_cart')).run(1.0, every=20):
        where = path(lambda t: a * t, lambda t: 0.5 * spin * t * t, sample.t)
        assert sample.points['C'] == pytest.approx(where, abs=1e-10)
        assert sample.body_poses[0, 2] == pytest.approx(0.5 * spin * sample.t**2, abs=1e-10)
        kinetic = 0.5 * (m * a**2 + J * spin**2) * sample.t**2
        assert sample.energy == pytest.approx(kinetic, abs=1e-10)


def test_chaplygin_sleigh_turns_round() -> None:
    """v = c tanh(τ), ω = (c / k) sech(τ), τ = a c (t - t0) / k², k² = J / m + a²."""
    m, J, a, speed, turn = 1.5, 0.2, 0.4, -1.0, 0.2
    k = np.sqrt(J / m + a**2)
    c = np.hypot(speed, k * turn)
    start = np.arctanh(speed / c)

    def tau(t: float) -> float:
        return float(start + a * c * t / k**2)

    def heading(t: float) -> float:
        return float(
            2.0 * k / a * (np.arctan(np.tanh(tau(t) / 2)) - np.arctan(np.tanh(start / 2)))
        )

    for sample in Simulation(load_scene('chaplygin_sleigh')).run(5.0, every=100):
        where = path(lambda t: c * np.tanh(tau(t)), heading, sample.t)
        assert sample.points['A'] == pytest.approx(where, abs=1e-9)
        assert sample.body_poses[0, 2] == pytest.approx(heading(sample.t), abs=1e-9)
    assert c * np.tanh(tau(5.0)) > 0.9 * c  # forwards in the end
