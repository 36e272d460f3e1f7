"""A Stewart platform driven along a path: leg forces against Newton's and Euler's equations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import yaml

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats

RB, RP, H, PLATE, MASS, INERTIA, HALF, G = 1.0, 0.6, 1.2, 20.0, 2.0, 0.1, 0.4, 9.81
WEIGHT = np.array([0.0, 0.0, -G])
PATH = ('0.1*sin(2*t)', '0.08*(1 - cos(3*t))', '1.2 + 0.05*sin(t)')  # of the plate's centre, m
TILT, YAW = '0.1*sin(2.5*t)', '0.2*sin(t)'  # about its y axis, then about z, rad
ANGLES = [
    np.radians((120 * j + 20 * s - 10, 120 * j + 100 * s - 50)) for j in range(3) for s in (0, 1)
]
BASE = np.array([[RB * np.cos(a), RB * np.sin(a), 0.0] for a, _ in ANGLES])
RIM = np.array([[RP * np.cos(a), RP * np.sin(a), 0.0] for _, a in ANGLES])


def driven() -> Simulation:
    """The library's platform, each leg given the length that the path of the plate asks for."""
    drives = {}
    for n, (B, P) in enumerate(zip(BASE.tolist(), RIM.tolist(), strict=True)):
        x, y, z = (
            f'({PATH[0]} + ({P[0]})*cos({TILT})*cos({YAW}) - ({P[1]})*sin({YAW}) - ({B[0]}))',
            f'({PATH[1]} + ({P[0]})*cos({TILT})*sin({YAW}) + ({P[1]})*cos({YAW}) - ({B[1]}))',
            f'({PATH[2]} - ({P[0]})*sin({TILT}))',
        )
        length = f'hypot(hypot({x}, {y}), {z}) - long'
        drives[f'push{n}'] = {'joint': f'leg{n}', 'length': length}
    scene = yaml.safe_load(load_scene('stewart_platform').text)
    scene['mechanism']['drives'] = drives
    scene['effects'] = {'gravity': {'acceleration': list(WEIGHT)}}
    scene['initial'] = {}
    return Simulation(load_scene(scene))


def plate(t: float) -> tuple[Floats, Floats]:
    """Centre (3,) and rotation (3, 3) of the plate."""
    c = np.array([0.1 * np.sin(2 * t), 0.08 * (1 - np.cos(3 * t)), 1.2 + 0.05 * np.sin(t)])
    a, b = 0.1 * np.sin(2.5 * t), 0.2 * np.sin(t)
    tilt = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    yaw = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
    return c, yaw @ tilt


def rate(f: Callable[[float], Any], t: float) -> Any:
    """df/dt by differences of eighth order."""
    h, total = 1e-2, 0.0
    for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), 1):
        total = total + weight * (f(t + k * h) - f(t - k * h)) / h
    return total


def spin(R: Callable[[float], Floats], t: float) -> Floats:
    """Angular velocity of a rotation R(t), world frame."""
    W = rate(R, t) @ R(t).T
    return np.array([W[2, 1], W[0, 2], W[1, 0]])


class Leg:
    """One leg: lower half on a universal joint at B, upper half on a ball at P."""

    def __init__(self, n: int) -> None:
        self.B, self.p = BASE[n], RIM[n]
        drawn = self.p + [0.0, 0.0, H] - self.B
        self.first = np.cross([0.0, 0.0, 1.0], drawn)  # the axis on the ground is horizontal
        self.first /= np.linalg.norm(self.first)

    def along(self, t: float) -> Floats:
        c, R = plate(t)
        return np.asarray(c + R @ self.p - self.B)

    def length(self, t: float) -> float:
        return float(np.linalg.norm(self.along(t)))

    def axes(self, t: float) -> Floats:
        """Columns u along the leg, v the axis of the universal joint on it, and across."""
        u = self.along(t) / self.length(t)
        v = np.cross(self.first, u)
        v /= np.linalg.norm(v)
        return np.column_stack([u, v, np.cross(u, v)])

    def momentum(self, t: float) -> Floats:
        """Angular momentum about B."""
        u, omega, away = self.axes(t)[:, 0], spin(self.axes, t), self.length(t) - HALF
        across = 2 * INERTIA + MASS * (HALF**2 + away**2)
        return np.asarray(2 * INERTIA / 10 * (omega @ u) * u + across * (omega - (omega @ u) * u))

    def across(self, t: float) -> Floats:
        """The part of the force of the plate across the leg, by moments about B, N."""
        R, length = self.axes(t), self.length(t)
        u = R[:, 0]
        weight = MASS * length * np.cross(u, WEIGHT)  # halves at HALF and length - HALF
        held = np.cross(self.first, R[:, 1])  # a universal joint takes moments about this axis
        unknown = np.column_stack(
            [length * np.cross(u, R[:, 1]), length * np.cross(u, R[:, 2]), held]
        )
        f = np.linalg.solve(unknown, rate(self.momentum, t) - weight)
        return np.asarray(f[0] * R[:, 1] + f[1] * R[:, 2])

    def push(self, t: float, axial: float) -> float:
        """Force of the actuator on the upper half if the plate exerts `axial` along it, N."""

        def centre(t: float) -> Floats:
            return np.asarray((self.length(t) - HALF) * self.axes(t)[:, 0])

        u = self.axes(t)[:, 0]
        acceleration = rate(lambda s: rate(centre, s), t)
        return float(MASS * (acceleration - WEIGHT) @ u - axial)


def leg_forces(t: float) -> list[float]:
    """Of the six actuators, N."""
    legs = [Leg(n) for n in range(6)]
    c, R = plate(t)
    inertia = PLATE * RP**2 * np.diag([0.25, 0.25, 0.5])

    def momentum(t: float) -> Floats:
        R = plate(t)[1]
        return np.asarray(R @ inertia @ R.T @ spin(lambda s: plate(s)[1], t))

    acceleration = rate(lambda s: rate(lambda r: plate(r)[0], s), t)
    wanted = np.concatenate([PLATE * (acceleration - WEIGHT), rate(momentum, t)])
    columns = []
    for leg in legs:
        arm, u, f = R @ leg.p, leg.axes(t)[:, 0], leg.across(t)
        wanted += np.concatenate([f, np.cross(arm, f)])
        columns.append(-np.concatenate([u, np.cross(arm, u)]))
    axial = np.linalg.solve(np.array(columns).T, wanted)
    return [leg.push(t, a) for leg, a in zip(legs, axial, strict=True)]


def test_leg_forces_of_a_stewart_platform() -> None:
    sim = driven()
    for sample in sim.run(2.0, at=[0.0, 0.35, 1.1, 2.0]):
        c, R = plate(sample.t)
        assert sample.points['C'] == pytest.approx(c, abs=1e-11)
        for n in range(6):
            assert sample.points[f'P{n}'] == pytest.approx(c + R @ RIM[n], abs=1e-11)
        wanted = leg_forces(sample.t)
        got = [sample.drive_efforts[f'push{n}'][0] for n in range(6)]
        assert got == pytest.approx(wanted, rel=1e-9)
        assert [sample.joints[f'leg{n}'].effort for n in range(6)] == pytest.approx(got)


def test_forward_dynamics_agree() -> None:
    """The forces of the drives applied to the free platform give the same accelerations."""
    sim = driven()
    sim.step(70)
    sample = sim.sample()
    scene = yaml.safe_load(load_scene('stewart_platform').text)
    scene['effects'] = {'gravity': {'acceleration': list(WEIGHT)}}
    free = Simulation(load_scene(scene))
    of, into, phase = sim.model.layout, free.model.layout, free.state
    for mine, theirs in ((of.of_point, into.of_point), (of.of_vector, into.of_vector)):
        for name, block in theirs.items():
            for here, there in ((phase.q, sim.state.q), (phase.qd, sim.state.qd)):
                here[3 * block : 3 * block + 3] = there[3 * mine[name] : 3 * mine[name] + 3]
    free.restore(phase)
    for n in range(6):
        free.apply_effort(f'leg{n}', sample.drive_efforts[f'push{n}'][0])
    assert free.sample().qdd == pytest.approx(sample.qdd, abs=1e-8)
