"""The delta robot: its Jacobian in closed form, its motion, and the forces in all its joints."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Sample, Simulation, load_scene
from alf_ros.arrays import Floats
from support.delta_arms import ALONG, OUT, UP, DeltaArms
from support.lagrange import Array, Reduced

BASE, ARM, ROD, PLATE, HALF = 0.20, 0.25, 0.45, 0.06, 0.05  # m
ARMS = DeltaArms(BASE, ARM, ROD, PLATE)
ARM_MASS, ROD_MASS, PLATE_MASS = 0.4, 0.1, 0.5  # kg
DRAWN = np.radians(30)  # the arms below the horizontal
G = -9.81 * UP
MOTORS = tuple(f'motor{k}' for k in range(3))
EFFORTS = np.array([-2.4, -0.9, -1.5])  # N m: -1.63 each holds the weight as drawn


def rates(C: Floats, theta: Floats) -> Floats:
    """(3, 3) ∂θ/∂C: s · Ċ = s · E' θ̇, for s along a rod and E' the way of an elbow."""
    rows = []
    for k in range(3):
        s = C + PLATE * OUT[k] - ARMS.elbow(theta[k], k)
        way = -ARM * (np.sin(theta[k]) * OUT[k] + np.cos(theta[k]) * UP)
        rows.append(s / (s @ way))
    return np.array(rows)


def reduced() -> Reduced:
    """Of C. A slender bar has ½ m ċ² + ½ (m l² / 12) ė²; the platform does not turn."""
    mass: list[float] = []
    weight: list[Floats] = []
    for _ in range(3):
        for m, length, count in ((ARM_MASS, ARM, 1), (ROD_MASS, ROD, 2)):
            mass += ([m] * 3 + [m * length**2 / 12.0] * 3) * count
            weight += [m * G, np.zeros(3)] * count
    mass += [PLATE_MASS] * 3
    weight.append(PLATE_MASS * G)

    def x(C: Array) -> Array:
        rows = []
        for k in range(3):
            A, E = BASE * OUT[k], ARMS.elbow(ARMS.angle(C, k), k)
            W = C + PLATE * OUT[k]
            rows += [0.5 * (A + E), (E - A) / ARM]
            rows += [0.5 * (E + W), (W - E) / ROD] * 2
        return np.concatenate([*rows, C])

    return Reduced(x, np.array(mass), np.concatenate(weight))


def pushed() -> Simulation:
    given = {name: {'joint': name, 'effort': x} for name, x in zip(MOTORS, EFFORTS, strict=True)}
    effects = {'gravity': {'acceleration': G.tolist()}, 'joint_effort': given}
    solver = {'step': 2e-3, 'integrator': 'dop853'}
    return Simulation(
        load_scene(
            {
                'mechanism': 'delta_robot',
                'effects': effects,
                'initial': {'velocities': {'C': [0.3, -0.2, 0.1]}},
                'solver': solver,
            }
        )
    )


@cache
def motion() -> tuple[Sample, ...]:
    """0.2 s in the scene, read each 0.02 s."""
    return tuple(pushed().run(0.2, every=10))


def angles(sample: Sample, what: str = 'position') -> Floats:
    return np.array([getattr(sample.joints[name], what) for name in MOTORS])


def test_rates_of_the_motors_by_the_jacobian() -> None:
    for sample in motion():
        C, theta = sample.points['C'], DRAWN + angles(sample)
        assert [ARMS.angle(C, k) for k in range(3)] == pytest.approx(theta, abs=1e-12)
        found = rates(C, theta) @ sample.velocities['C']
        assert found == pytest.approx(angles(sample, 'velocity'), abs=1e-11)
        assert np.linalg.norm(found) > 0.5


def test_a_motion_under_constant_efforts() -> None:
    """Three freedoms: Lagrange's equations of C, to 1e-12."""
    model = reduced()

    def rate(_: float, y: Floats) -> Floats:
        C = y[:3]
        theta = np.array([ARMS.angle(C, k) for k in range(3)])
        Q = rates(C, theta).T @ EFFORTS
        return np.concatenate([y[3:], model.acceleration(C, y[3:], Q)])

    first, last = motion()[0], motion()[-1]
    start = np.concatenate([first.points['C'], first.velocities['C']])
    exact = solve_ivp(rate, (0.0, 0.2), start, 'DOP853', rtol=1e-12, atol=1e-12).y[:, -1]
    assert last.t == pytest.approx(0.2)
    assert np.linalg.norm(exact[:3] - start[:3]) > 0.1
    assert last.points['C'] == pytest.approx(exact[:3], abs=1e-9)
    assert last.velocities['C'] == pytest.approx(exact[3:], abs=1e-8)


def test_the_energy_grows_by_the_work_of_the_motors() -> None:
    model, first = reduced(), motion()[0]
    for sample in motion():
        done = EFFORTS @ (angles(sample) - angles(first))
        assert sample.energy - first.energy == pytest.approx(done, abs=1e-9)
        C, Cd = sample.points['C'], sample.velocities['C']
        xd = model.jacobian(C) @ Cd
        lifted = -model.weight @ (model.x(C) - model.x(first.points['C']))
        kinetic = 0.5 * model.mass @ xd**2
        started = (
            0.5 * model.mass @ (model.jacobian(first.points['C']) @ first.velocities['C']) ** 2
        )
        assert kinetic - started + lifted == pytest.approx(done, abs=1e-9)


def newton_euler(C: Floats, Cd: Floats) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Forces (N) and torques of the motors' bearings (N m) on the second body of each joint, by
    the balance of each body.

    Across itself a rod takes what its own motion needs, by its moments about the other end. The
    pulls along the six rods are left, and balance force and moment of the platform.
    """
    model, theta = reduced(), np.array([ARMS.angle(C, k) for k in range(3)])
    Cdd = model.acceleration(C, Cd, rates(C, theta).T @ EFFORTS)
    ray, far = np.exp(0.25j * np.pi), 3e-3  # s: the second derivative along the motion

    def elbows(t: complex) -> Array:
        at = C + t * Cd + 0.5 * t * t * Cdd
        return np.array([ARMS.elbow(ARMS.angle(at, k), k) for k in range(3)])

    E = np.array([ARMS.elbow(theta[k], k) for k in range(3)])
    Edd = (elbows(ray * far) + elbows(-ray * far)).imag / far**2
    across, lines, levers = [], [], []
    for k in range(3):
        u = (C + PLATE * OUT[k] - E[k]) / ROD
        need = ROD_MASS * (Edd[k] / 6.0 + Cdd / 3.0 - 0.5 * G)  # at the wrist, on the rod
        for side in (1.0, -1.0):
            across.append(need - u * (u @ need))
            lines.append(u)
            levers.append(PLATE * OUT[k] + side * HALF * ALONG[k])
    whole = np.array([[*u, *np.cross(r, u)] for u, r in zip(lines, levers, strict=True)]).T
    left = np.concatenate([PLATE_MASS * (G - Cdd), np.zeros(3)])
    for force, r in zip(across, levers, strict=True):
        left -= np.concatenate([force, np.cross(r, force)])
    pulls = np.linalg.solve(whole, left)
    found = {}
    for n, (force, u, pull) in enumerate(zip(across, lines, pulls, strict=True)):
        k, name = n // 2, 'left' if n % 2 == 0 else 'right'
        wrist = force + pull * u  # on the rod
        found[f'{name}_wrist{k}'] = -wrist
        found[f'{name}_elbow{k}'] = ROD_MASS * (0.5 * (Edd[k] + Cdd) - G) - wrist
    for k in range(3):
        rods = found[f'left_elbow{k}'] + found[f'right_elbow{k}']
        found[f'motor{k}'] = ARM_MASS * (0.5 * Edd[k] - G) + rods
    torques = {}
    for k in range(3):
        r = E[k] - BASE * OUT[k]
        moment = np.cross(r, ARM_MASS * (Edd[k] / 3.0 - 0.5 * G)) - EFFORTS[k] * ALONG[k]
        for name, side in (('left', 1.0), ('right', -1.0)):
            moment += np.cross(r + side * HALF * ALONG[k], found[f'{name}_elbow{k}'])
        torques[f'motor{k}'] = moment
    return found, torques


def test_forces_in_all_joints() -> None:
    for sample in motion()[::5]:
        forces, torques = newton_euler(sample.points['C'], sample.velocities['C'])
        assert forces.keys() == sample.reactions.keys()
        for name, force in forces.items():
            reaction = sample.reactions[name]
            assert reaction.force == pytest.approx(force, abs=1e-8), name
            torque = torques.get(name, np.zeros(3))
            assert reaction.torque == pytest.approx(torque, abs=1e-8), name
        for k, torque in enumerate(torques.values()):
            assert torque @ ALONG[k] == pytest.approx(0.0, abs=1e-9)  # the effort of the motor
            assert np.linalg.norm(torque) > 0.05
        assert max(map(np.linalg.norm, forces.values())) > 10.0
