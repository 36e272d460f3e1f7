"""The leg with springs in its linkage: its loops in closed form, its forces by Lagrange."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Sample, Simulation, equilibrium, load_scene
from alf_ros.arrays import Floats
from support.lagrange import Array, Reduced, distance, meet, planar, turned

FEMUR, ROD = 0.120, np.hypot(0.496, 0.067)  # m: K-T, and H-W, when the springs are unloaded
SKEW = np.radians(13)
JOINTS = ('guide', 'hip_pitch', 'knee', 'shin_leaf', 'heel_leaf', 'toe')
MOTORS, SPRINGS = (1, 2, 5), (3, 4)
STEPS = 1e-30j * np.eye(6)
DRAWN = {point.name: point.at for point in load_scene('spring_leg').mechanism.points}
GROUND = DRAWN['Z0'][1]


def turn(angle: Any, v: Array) -> Array:
    return np.cos(angle) * v + np.sin(angle) * turned(v)


def places(q: Array) -> dict[str, Array]:
    """All points for the coordinates of JOINTS: m, then rad, as the joints have them."""
    H = np.array([0.0, 1.0]) * q[0]
    right = np.array([1.0, 0.0])
    thigh = turn(q[1], right)
    K = H + FEMUR * thigh
    crank = turn(q[2], thigh)
    S = K + np.hypot(0.061, 0.047) * crank
    T = S + np.hypot(0.435, 0.020) * turn(q[3], crank)
    # heel and tarsus are one bar T-W for a given bend of the spring
    V, F, G = np.array([-0.013, -0.031]), np.array([0.408, -0.040]), np.array([0.058, -0.034])
    to_foot = F / np.hypot(*F)
    heel = np.hypot(*(turn(SKEW, -FEMUR * right) * [1, -1] - V))
    W = V + heel * turn(q[4], to_foot)
    long = distance(0 * W, W)
    at_W = meet(T, long, H, ROD)
    e = (at_W - T) / long
    # the frame of the tarsus: W lies along e
    x = (W[0] * e - W[1] * turned(e)) / long

    def of_tarsus(v: Array) -> Array:
        return T + v[0] * x + v[1] * turned(x)

    foot = of_tarsus(F) - T
    pedal = 0.055 * turn(q[5], foot / distance(0 * foot, foot))
    found = {'P': H - [0.10, 0.0], 'H': H, 'K': K, 'S': S, 'T': T, 'W': at_W}
    found |= {'V': of_tarsus(V), 'F': of_tarsus(F), 'G': of_tarsus(G)}
    found |= {'X': found['G'] + pedal, 'Y': found['F'] + pedal}
    # as drawn the pedal is at right angles to the frame of the tarsus, which is at -49 degrees
    level = turn(np.radians(90 - 28 - 13 + 90), pedal / 0.055)
    for name, v in (('Z0', (0.10, -0.05)), ('Z1', (-0.06, -0.05))):
        found[name] = found['F'] + v[0] * level + v[1] * turned(level)
    return found


def drawn() -> Floats:
    return coordinates(Simulation(load_scene('spring_leg')).sample())


def coordinates(sample: Sample) -> Floats:
    return np.array([sample.joints[name].position for name in JOINTS])


def reduced() -> Reduced:
    """Of the bodies, and of the rotors of the motors, which turn with their joints."""
    bars = planar(load_scene('spring_leg').mechanism.bodies, places)
    return Reduced(
        lambda q: np.concatenate([bars.x(q), q[list(MOTORS)]]),
        np.concatenate([bars.mass, [0.093, 0.093, 0.012]]),
        np.concatenate([bars.weight, np.zeros(3)]),
    )


def soles(q: Array) -> Array:
    """(2,) heights of the ends of the sole above the ground, where it is drawn, m."""
    return np.array([places(q)[name][1] for name in ('Z0', 'Z1')]) - GROUND


def test_the_loops_in_closed_form() -> None:
    lifted = []
    for sample in Simulation(load_scene('spring_leg')).run(2.0, every=80):
        q = coordinates(sample)
        exact = places(q)
        for point, place in sample.points.items():
            assert place == pytest.approx(exact[point], abs=1e-11), point
        lifted.append(min(soles(q)))
    assert max(lifted) > 0.05  # it jumps


def test_with_unloaded_springs_the_tarsus_keeps_its_angle_to_the_thigh() -> None:
    """H, K, T, W is a parallelogram whatever hip and knee do, and the foot follows the pedal."""
    q = drawn()
    for hip, knee in ((0.0, 0.0), (0.3, -0.5), (-0.2, 0.1)):
        at = places(q + [0.0, hip, knee, 0.0, 0.0, 0.0])
        thigh = (at['K'] - at['H']) / FEMUR
        assert at['T'] - at['W'] == pytest.approx(FEMUR * thigh, abs=1e-12)
        assert at['X'] - at['G'] == pytest.approx(at['Y'] - at['F'], abs=1e-12)


def test_standing_it_is_in_balance() -> None:
    """At rest: virtual work of motors, springs and ground, in all six coordinates."""
    zero = drawn()
    rest = equilibrium(load_scene('spring_leg'))
    q = np.array([rest.joints[name].position for name in JOINTS])
    given = np.zeros(6)
    for n, gain in zip(MOTORS, (2000.0, 2000.0, 200.0), strict=True):
        given[n] = gain * (zero - q)[n]
    for n, stiffness in zip(SPRINGS, (1500.0, 1250.0), strict=True):
        given[n] = stiffness * (zero - q)[n]
    slopes = np.array([soles(q + step).imag * 1e30 for step in STEPS]).T
    pressed = -5e4 * soles(q)
    assert min(pressed) > 0.0
    assert sum(pressed) == pytest.approx(-sum(reduced().weight), rel=1e-9)
    given += pressed @ slopes
    needed = reduced().efforts(q, np.zeros(6), np.zeros(6))
    assert given == pytest.approx(needed, abs=1e-7)
    assert np.abs(q - zero)[list(SPRINGS)].min() > 0.02


def test_a_kick_in_the_air() -> None:
    """Six freedoms and constant torques: Lagrange's equations, integrated to 1e-11."""
    torques, zero, model = np.array([30.0, 20.0, 5.0]), drawn(), reduced()

    def rate(_: float, state: Floats) -> Floats:
        q, qd = state[:6], state[6:]
        Q = np.zeros(6)
        Q[list(MOTORS)] = torques
        for n, stiffness in zip(SPRINGS, (1500.0, 1250.0), strict=True):
            Q[n] = stiffness * (zero - q)[n] - 2.0 * qd[n]
        return np.concatenate([qd, model.acceleration(q, qd, Q)])

    start = np.concatenate([zero, np.zeros(6)])
    exact = solve_ivp(rate, (0.0, 0.04), start, 'DOP853', rtol=1e-11, atol=1e-11).y[:, -1]
    scene = load_scene('spring_leg')
    kinds = ('gravity', 'torsion_spring')
    sim = Simulation(replace(scene, effects=tuple(e for e in scene.effects if e.kind in kinds)))
    for n, torque in zip(MOTORS, torques, strict=True):
        sim.apply_effort(JOINTS[n], torque)
    sim.step(80)
    assert coordinates(sim.sample()) == pytest.approx(exact[:6], abs=1e-9)
    assert np.abs(exact[:6] - zero)[[1, 2, 5]].min() > 0.01
