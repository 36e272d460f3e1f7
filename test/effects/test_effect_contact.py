"""Stops, contacts and friction against impacts, brakings and slopes with a closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from support.effect_scenes import BALL, DISC, MASS, ROTOR, simulate

G = 9.81


def rebound(v: float, c: float) -> float:
    """The speed left of an impact at v: c (u + v) = ln (1 + c v) - ln (1 - c u)."""

    def balance(u: float) -> float:
        return c * (u + v) - math.log((1.0 + c * v) / (1.0 - c * u))

    return float(brentq(balance, 1e-9, min(v, (1.0 - 1e-12) / c), xtol=1e-15))


def test_elastic_bounce() -> None:
    """A linear contact: half a period of the oscillator on the ground, then free flight."""
    m, k, v = 2.0, 8e3, 1.5
    contact = f'on: P, stiffness: {k}, exponent: 1, normal: [-1, 0], through: [1, 0]'
    sim = simulate(MASS, f'ground_contact: {{{contact}}}', f'P: [{v}, 0.3]', step=1e-4)
    omega = math.sqrt(k / m)
    for sample in sim.run(0.1, at=[0.0, 0.3 * math.pi / omega, 0.1]):
        s = min(omega * sample.t, math.pi)
        x = 1.0 + v / omega * math.sin(s) - v * max(0.0, sample.t - math.pi / omega)
        assert sample.points['P'] == pytest.approx([x, 0.3 * sample.t], abs=1e-8)
        assert sample.energy == pytest.approx(0.5 * m * (v**2 + 0.3**2), rel=1e-6)


@pytest.mark.parametrize('exponent, stiffness', [(1.0, 4e4), (1.5, 4e5), (3.0, 1e9)])
def test_bouncing_point_loses_what_hunt_and_crossley_say(
    exponent: float, stiffness: float
) -> None:
    v, c = 1.5, 0.4
    contact = f'on: P, stiffness: {stiffness}, exponent: {exponent}, damping: {c}, through: [0, 0]'
    sim = simulate(MASS, f'ground_contact: {{{contact}}}', f'P: [0.2, {-v}]', step=2e-5)
    sim.step(5000)
    sample = sim.sample()
    assert sample.points['P'][1] > 0.0
    assert sample.velocities['P'] == pytest.approx([0.2, rebound(v, c)], rel=1e-6)


def test_joint_stops_throw_back_a_rotor() -> None:
    """Off the upper stop, then off the lower one; both as the law of the losses says."""
    v, c = 3.0, 0.2
    stops = f'joint_stop: {{joint: pin, lower: -7, upper: 0.5, stiffness: 1e5, damping: {c}}}'
    sim = simulate(ROTOR, stops, f'A: [~, {v}]', step=1e-4)
    sim.step(4000)
    once = rebound(v, c)
    assert sim.sample().joints['pin'].velocity == pytest.approx(-once, rel=1e-6)
    sim.step(math.ceil(1e4 * 7.6 / once))  # past a whole turn
    twice = rebound(once, c)
    assert sim.sample().joints['pin'].velocity == pytest.approx(twice, rel=1e-6)
    lost = 0.25 * (v**2 - twice**2)
    assert sim.sample().energy == pytest.approx(0.25 * v**2 - lost, rel=1e-6)


def test_block_brakes_on_the_ground() -> None:
    """m v̇ = -μ m g v / √(v² + ε²): √(v² + ε²) - ε asinh(ε / v) = C - μ g t; at last no way on."""
    m, k, mu, eps, v0 = 2.0, 1e4, 0.3, 1e-2, 1.0
    depth = m * G / k
    sim = simulate(
        MASS,
        f'gravity: {{acceleration: [0, {-G}]}}, '
        f'ground_contact: {{on: P, stiffness: {k}, exponent: 1, friction: {mu}, slip: {eps}}}',
        f'P: [{v0}, 0]',
        f'P: [~, {-depth}]',
    )

    def invariant(v: float) -> float:
        return math.hypot(v, eps) - eps * math.asinh(eps / v)

    for sample in sim.run(0.36, every=20):
        v = sample.velocities['P'][0]
        assert invariant(v) == pytest.approx(invariant(v0) - mu * G * sample.t, abs=1e-9)
    sim.step(1000)
    stop = sim.sample()
    assert abs(stop.velocities['P'][0]) < 1e-9
    assert stop.points['P'][0] - 1.0 == pytest.approx(v0**2 / (2.0 * mu * G), rel=1e-2)


@pytest.mark.parametrize('mu', [0.5, 0.05], ids=['rolls', 'slips'])
@pytest.mark.parametrize('mechanism, share', [(DISC, 0.5), (BALL, 0.4)], ids=['disc', 'ball'])
def test_round_body_on_a_slope(mechanism: str, share: float, mu: float) -> None:
    """Rolling: v̇ = g sin α / (1 + J / m r²). Slipping: g (sin α - μ cos α), ω̇ = μ m g r cos α / J.

    It starts at rest, at the depth at which the ground carries it.
    """
    m, r, k, alpha, eps = 2.0, 0.1, 1e5, 0.3, 1e-3
    spatial = mechanism is BALL
    J, depth = share * m * r * r, m * G * math.cos(alpha) / k
    gx, gn = G * math.sin(alpha), -G * math.cos(alpha)
    height = f'{r - depth}'
    gravity = f'[{gx}, 0, {gn}]' if spatial else f'[{gx}, {gn}]'
    place = f'[~, ~, {height}]' if spatial else f'[~, {height}]'
    sim = simulate(
        mechanism,
        f'gravity: {{acceleration: {gravity}}}, '
        f'ground_contact: {{on: {"ball" if spatial else "disc"}, radius: {r}, stiffness: {k}, '
        f'exponent: 1, friction: {mu}, slip: {eps}}}',
        '',
        f'C: {place}',
        step=1e-4,
    )
    sim.step(5000)
    sample, t = sim.sample(), 0.5
    if mu >= math.tan(alpha) * share / (1.0 + share):
        held = gx * share / (1.0 + share) / (mu * -gn)  # part of the friction there could be
        slip = eps * held / math.sqrt(1.0 - held**2)
        v = (gx * t + share * slip) / (1.0 + share)  # v + share r ω = g sin α t, v - r ω = slip
        spin = (v - slip) / r
    else:
        across = -mu * gn * (1.0 + 1.0 / share)  # of the slip's acceleration, by full friction

        def missing(x: float) -> float:  # friction is not full at a slip of x ε
            part = x / math.hypot(x, 1.0)
            return (1.0 - part) / (gx - across * part)

        late = eps * quad(missing, 0.0, (gx - across) * t / eps, limit=500)[0]
        v = gx * t + mu * gn * (t - late)
        spin = -mu * m * gn * r / J * (t - late)
    assert sample.velocities['C'][0] == pytest.approx(v, abs=1e-6)
    turning = sample.qd[3:6] if spatial else sample.qd[2:] - sample.qd[:2]  # of a unit vector
    assert np.linalg.norm(turning) == pytest.approx(spin, abs=1e-5)
    if not spatial:
        assert sample.body_poses[0, 2] < 0.0  # it rolls forwards


def test_block_on_a_slope_creeps() -> None:
    """Where dry friction would hold it, at ε tan α / √(μ² - tan² α); the ground carries it."""
    k, mu, alpha, eps = 1e4, 0.5, 0.3, 1e-2
    tangent = math.tan(alpha)
    creep = eps * tangent / math.sqrt(mu**2 - tangent**2)
    normal = f'[{-math.sin(alpha)}, {math.cos(alpha)}]'
    contact = f'on: P, through: [1, 0], normal: {normal}, stiffness: {k}, exponent: 1'
    sim = simulate(
        MASS,
        f'gravity: {{acceleration: [0, {-G}]}}, '
        f'ground_contact: {{{contact}, damping: 5, friction: {mu}, slip: {eps}}}',
    )
    sim.step(4000)
    sample = sim.sample()
    down = -creep * np.array([math.cos(alpha), math.sin(alpha)])
    assert sample.velocities['P'] == pytest.approx(down, abs=1e-7)
    depth = 2.0 * G * math.cos(alpha) / k
    height = sample.points['P'] - [1.0, 0.0]
    assert height @ [-math.sin(alpha), math.cos(alpha)] == pytest.approx(-depth, rel=1e-6)


def test_rotor_brakes_in_its_bearing() -> None:
    """J ω̇ = -b ω - F: ω = (ω₀ + F / b) exp(-b t / J) - F / b until it stands."""
    J, b, mu, load, r, v = 0.5, 0.2, 0.15, 200.0, 0.01, 4.0
    friction = f'viscous: {b}, dynamic: {mu}, load: {load}, radius: {r}, slip: 1e-6'
    sim = simulate(ROTOR, f'joint_friction: {{joint: pin, {friction}}}', f'A: [~, {v}]')
    F = mu * load * r
    end = J / b * math.log(1.0 + v * b / F)
    for sample in sim.run(end - 0.01, every=200):
        omega = (v + F / b) * math.exp(-b * sample.t / J) - F / b
        assert sample.joints['pin'].velocity == pytest.approx(omega, abs=1e-10)


def test_stribeck_curve() -> None:
    """From μ_s N r down to μ_d N r, and a static effort below μ_s N r only creeps."""
    mu_d, mu_s, load, r, vs, eps = 0.1, 0.3, 100.0, 0.02, 0.5, 1e-2
    friction = (
        f'dynamic: {mu_d}, static: {mu_s}, load: {load}, radius: {r}, stribeck: {vs}, slip: {eps}'
    )
    for v in (0.05, 0.3, 1.0, -2.0):
        sim = simulate(ROTOR, f'joint_friction: {{joint: pin, {friction}}}', f'A: [~, {v}]')
        mu = mu_d + (mu_s - mu_d) * math.exp(-((v / vs) ** 2))
        effort = -mu * load * r * v / math.hypot(v, eps)
        sample = sim.sample()
        spin = sample.qdd[1]  # of A: at x = 1
        assert 0.5 * spin == pytest.approx(effort, rel=1e-12)
    effort = 0.9 * mu_s * load * r
    sim = simulate(
        ROTOR,
        f'joint_friction: {{joint: pin, {friction}}}, '
        f'joint_effort: {{joint: pin, effort: {effort}}}',
    )
    sim.step(2000)
    creep = sim.sample().joints['pin'].velocity
    assert 0.0 < creep < 3.0 * eps
