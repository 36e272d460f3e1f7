"""The leg of linear actuators: lengths from five angles, forces by Lagrange's equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from support.lagrange import Array, Reduced

ANGLES = ('hip_first', 'hip_second', 'knee', 'ankle_first', 'ankle_second')
ACTUATORS = tuple(f'actuator{n}' for n in range(5))
DRAWN = {p.name: np.array(p.at) for p in load_scene('actuator_leg').mechanism.points}
ENDS = [(DRAWN[f'A{n}'], DRAWN[f'B{n}']) for n in range(5)]
GRAVITY = {'gravity': {'acceleration': [0, 0, -9.81]}}
EYE = np.eye(5)


def about(axis: int, angle: Any) -> Array:
    """(3, 3) of a turn about x (0) or y (1)."""
    c, s, one = np.cos(angle), np.sin(angle), 1.0 + 0.0 * angle
    if axis == 0:
        return np.array([[one, 0, 0], [0, c, -s], [0, s, c]])
    return np.array([[c, 0, s], [0, one, 0], [-s, 0, c]])


def poses(q: Array) -> dict[str, tuple[Array, Array, Array]]:
    """(turn since drawn, its centre as drawn, and now) of pelvis, thigh, shank and foot."""
    thigh = about(0, q[0]) @ about(1, q[1])
    K = thigh @ DRAWN['K']
    shank = thigh @ about(1, q[2])
    F = K + shank @ (DRAWN['F'] - DRAWN['K'])
    foot = shank @ about(1, q[3]) @ about(0, q[4])
    still = np.zeros(3)
    return {
        'pelvis': (np.eye(3), still, still),
        'thigh': (thigh, still, still),
        'shank': (shank, DRAWN['K'], K),
        'foot': (foot, DRAWN['F'], F),
    }


def ends(q: Array) -> list[tuple[Array, Array]]:
    """Both ends of each actuator, m."""
    at = poses(q)

    def moved(body: str, place: Floats) -> Array:
        turn, before, now = at[body]
        return now + turn @ (place - before)

    between = [('pelvis', 'thigh')] * 2 + [('thigh', 'shank')] + [('shank', 'foot')] * 2
    return [(moved(a, A), moved(b, B)) for (a, b), (A, B) in zip(between, ENDS, strict=True)]


def lengths(q: Array) -> Array:
    """(5,) of the actuators, m."""
    return np.array([np.sqrt((B - A) @ (B - A)) for A, B in ends(q)])


def levers(q: Floats) -> Floats:
    """(5, 5) of the actuators for the angles, m/rad."""
    return np.array([lengths(q + 1e-30j * e).imag * 1e30 for e in EYE]).T


def reduced() -> Reduced:
    """Of the five angles. A body with moments of inertia J has ½ Σ P ė², P = ½ (sum of J) - J."""
    bars = (
        ('thigh', 'H', 'K', 4.0, 0.16, (0.01, 0.05)),
        ('shank', 'K', 'F', 2.0, 0.16, (0.005, 0.03)),
        ('foot', 'F', 'Z0', 0.8, 0.0, (2e-3, 3e-3)),
    )
    mass: list[float] = []
    for *_, m, _, (J_along, J_across) in bars:
        mass += [m] * 3 + [J_across - 0.5 * J_along] * 3 + [0.5 * J_along] * 6
    mass += ([0.5] * 3 + [1.5e-3] * 3 + [0.2] * 3 + [8e-4] * 3) * 5

    def x(q: Array) -> Array:
        at, rows = poses(q), []
        for body, first, second, _, com, _ in bars:
            turn, before, now = at[body]
            along = DRAWN[second] - DRAWN[first]
            axis = along / np.linalg.norm(along)
            across = np.array([0.0, 1.0, 0.0])
            base = now + turn @ (DRAWN[first] - before)
            rows += [base + com * turn @ axis, turn @ axis, turn @ across]
            rows += [turn @ np.cross(axis, across)]
        for A, B in ends(q):
            u = (B - A) / np.sqrt((B - A) @ (B - A))
            rows += [A + 0.07 * u, u, B - 0.07 * u, u]
        return np.concatenate(rows)

    weight = np.zeros(len(mass))
    weight[2:36:12] = [-9.81 * m for *_, m, _, _ in bars]
    weight[38::12], weight[44::12] = -9.81 * 0.5, -9.81 * 0.2
    return Reduced(x, np.array(mass), weight)


def angles(sample: Any, what: str = 'position') -> Floats:
    return np.array([getattr(sample.joints[name], what) for name in ANGLES])


def test_lengths_follow_the_angles() -> None:
    sim, zero, turned = Simulation(load_scene('actuator_leg')), lengths(np.zeros(5)), []
    for sample in sim.run(2.0, every=10):
        q, qd = angles(sample), angles(sample, 'velocity')
        found = [sample.joints[name].position for name in ACTUATORS]
        assert found == pytest.approx(lengths(q) - zero, abs=1e-11)
        speeds = [sample.joints[name].velocity for name in ACTUATORS]
        assert speeds == pytest.approx(levers(q) @ qd, abs=1e-10)
        for n, (A, B) in enumerate(ends(q)):
            assert sample.points[f'A{n}'] == pytest.approx(A, abs=1e-11)
            assert sample.points[f'B{n}'] == pytest.approx(B, abs=1e-11)
        turned.append(q)
    assert np.abs(turned).max(axis=0).min() > 0.05  # all five joints


def test_at_rest_the_actuators_carry_the_weight_by_virtual_work() -> None:
    """Lᵀ F = ∂V/∂q, L the levers of the lengths for the angles."""
    for moved in ((0.0,) * 5, (0.03, 0.04, -0.04, 0.01, -0.01), (-0.02, 0.0, 0.02, 0.0, 0.02)):
        each = zip(ACTUATORS, moved, strict=True)
        drives = {f'screw_{name}': {'joint': name, 'length': str(to)} for name, to in each}
        scene = {'mechanism': 'actuator_leg', 'drives': drives, 'effects': GRAVITY}
        sample = Simulation(load_scene(scene)).sample()
        q = angles(sample)
        needed = reduced().efforts(q, np.zeros(5), np.zeros(5))
        wanted = np.linalg.solve(levers(q).T, needed)
        found = [sample.drive_efforts[f'screw_{name}'][0] for name in ACTUATORS]
        assert found == pytest.approx(wanted, rel=1e-9)


def test_a_motion_under_constant_forces() -> None:
    """Five freedoms: Lagrange's equations of the angles, integrated to 1e-12."""
    forces, model = np.array([200.0, -90.0, -90.0, -1.0, -2.0]), reduced()

    def rate(_: float, state: Floats) -> Floats:
        q, qd = state[:5], state[5:]
        return np.concatenate([qd, model.acceleration(q, qd, levers(q).T @ forces)])

    exact = solve_ivp(rate, (0.0, 0.1), np.zeros(10), 'DOP853', rtol=1e-12, atol=1e-12).y[:, -1]
    pushes = zip(ACTUATORS, forces.tolist(), strict=True)
    effects = {**GRAVITY, 'joint_effort': {n: {'joint': n, 'effort': f} for n, f in pushes}}
    solver = {'step': 1e-3, 'integrator': 'dop853'}
    sim = Simulation(
        load_scene({'mechanism': 'actuator_leg', 'effects': effects, 'solver': solver})
    )
    sim.step(100)
    assert angles(sim.sample()) == pytest.approx(exact[:5], abs=1e-9)
    assert angles(sim.sample(), 'velocity') == pytest.approx(exact[5:], abs=1e-8)
    assert np.abs(exact[:5]).min() > 0.01
