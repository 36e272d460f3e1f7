"""The delta robot with a telescopic shaft: inverse kinematics, and its crosses in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from alf_ros import Scene, Simulation, load_scene
from alf_ros.arrays import Floats
from support.delta_arms import OUT, UP, DeltaArms
from support.lagrange import Array, Reduced

BASE, ARM, ROD, PLATE, HALF = 0.164, 0.524, 1.244, 0.044, 0.0655  # m
ARMS = DeltaArms(BASE, ARM, ROD, PLATE)
DRAWN = np.radians(20)  # the arms below the horizontal
MOTORS = tuple(f'motor{k}' for k in range(4))


def shaft(C: Array, turn: Any) -> Array:
    """Axes (3, 3) of the shaft: down along it, along the pin of both crosses on it, and the third.

    The pin is perpendicular to the shaft and to the pin on the fork, which has turned.
    """
    down = C / np.sqrt(C @ C)
    pin = np.cross(down, np.array([np.cos(turn), np.sin(turn), 0.0 * turn]))
    pin = pin / np.sqrt(pin @ pin)
    return np.array([down, -pin, np.cross(down, -pin)])


def reduced() -> Reduced:
    """Of C and of the turn of the fork: places and directions of all masses.

    A body with moments of inertia J has ½ Σ P ė², e its axes, P = ½ (sum of J) - J.
    """
    mass: list[float] = []
    heavy: list[float] = []

    def add(m: float, inertia: tuple[float, ...]) -> None:
        mass.extend([m] * 3)
        heavy.append(m)
        for P in inertia:
            mass.extend([P] * 3)

    for _ in range(3):
        add(1.2, (1.2 * ARM**2 / 12,))
        add(0.25, (0.25 * ROD**2 / 12,))
        add(0.25, (0.25 * ROD**2 / 12,))
    add(0.6 + 0.4, ())  # platform and tool
    across = 0.5 * (1e-4 + 1e-2 + 1e-2) - 1e-2
    for _ in range(2):
        add(0.3, (across + 1e-2 - 1e-4, across, across))
    mass.extend([0.5 * (1e-4 + 5e-4)] * 4)  # fork and tool: one axis, twice half

    def x(q: Array) -> Array:
        C, turn, rows = q[:3], q[3], []
        for k in range(3):
            E = ARMS.elbow(ARMS.angle(C, k), k)
            A = BASE * OUT[k]
            along = (C + PLATE * OUT[k] - E) / ROD
            rows += [0.5 * (A + E), (E - A) / ARM]
            rows += [E + 0.5 * ROD * along, along] * 2
        axes = shaft(C, turn)
        rows += [C, 0.35 * axes[0], *axes, C - 0.35 * axes[0], *axes]
        fork = np.array([np.cos(turn), np.sin(turn), -np.sin(turn), np.cos(turn)])
        return np.concatenate([*rows, fork])

    weight = np.zeros(len(mass))
    at = 0
    for m, size in zip(heavy, [6] * 9 + [3] + [12] * 2, strict=True):
        weight[at + 2] = -9.81 * m
        at += size
    return Reduced(x, np.array(mass), weight)


def test_the_tool_turns_as_the_fork_and_the_platform_does_not() -> None:
    sim = Simulation(load_scene('four_axis_delta'))
    plate = sim.model.body_names.index('plate')
    start, tilts = Rotation.from_quat(sim.sample().body_poses[plate, 3:]), []
    for sample in sim.run(1.6, every=20):
        C, joints = sample.points['C'], sample.joints
        turn = Rotation.from_quat(sample.body_poses[plate, 3:]) * start.inv()
        assert turn.magnitude() < 1e-11
        for k in range(3):
            theta = DRAWN + joints[f'motor{k}'].position
            assert ARMS.angle(C, k) == pytest.approx(theta, abs=1e-12)
            assert sample.points[f'E{k}'] == pytest.approx(ARMS.elbow(theta, k), abs=1e-12)
        assert joints['bearing'].position == pytest.approx(joints['motor3'].position, abs=1e-11)
        assert joints['bearing'].velocity == pytest.approx(joints['motor3'].velocity, abs=1e-10)
        stretch = np.linalg.norm(C) - np.linalg.norm(sim.scene.mechanism.points[1].at)
        assert joints['telescope'].position == pytest.approx(stretch, abs=1e-12)
        # the upper cross turns about the pin of the fork, then about the pin of the tube
        fork = np.array([np.cos(joints['motor3'].position), np.sin(joints['motor3'].position), 0])
        down, pin, _ = shaft(C, joints['motor3'].position)
        first = np.arctan2(pin @ UP, pin @ np.cross(UP, fork))
        across = np.cross(fork, pin)  # upwards, before the second turn
        second = np.arctan2(-down @ np.cross(pin, across), -down @ across)
        assert joints['upper_cross_first'].position == pytest.approx(first, abs=1e-11)
        assert joints['upper_cross_second'].position == pytest.approx(second, abs=1e-11)
        tilts.append(np.arccos(-down[2]))
    assert max(tilts) > 0.2


def unsprung(**efforts: float) -> Scene:
    """The scene with constant efforts in place of its controllers, and without springs."""
    given = {name: {'joint': name, 'effort': effort} for name, effort in efforts.items()}
    return load_scene(
        {
            'mechanism': 'four_axis_delta',
            'effects': {'gravity': {'acceleration': [0, 0, -9.81]}, 'joint_effort': given},
            'solver': {'step': 2e-3, 'integrator': 'dop853'},
        }
    )


def test_motors_hold_the_weight() -> None:
    """Virtual work: as drawn the efforts of the scene keep it at rest."""
    sim = Simulation(load_scene('four_axis_delta'))
    hold = sim.scene.effects[1].parameters.effort
    still = np.zeros(4)
    C = np.array([*sim.sample().points['C'], 0.0])
    arms = [[ARMS.angle(C[:3] + 1e-30j * e, k).imag * 1e30 for e in np.eye(3)] for k in range(3)]
    given = np.array([*(np.array(arms).T @ np.full(3, hold)), 0.0])
    assert reduced().efforts(C, still, still) == pytest.approx(given, abs=1e-12)
    sim = Simulation(unsprung(motor0=hold, motor1=hold, motor2=hold))
    assert sim.sample().qdd == pytest.approx(0.0, abs=1e-9)


def test_springs_press_the_balls_into_their_sockets() -> None:
    """Two springs of 20 N at each pair of rods: 20 N more in each of its balls, nothing moves."""
    scene = load_scene('four_axis_delta')
    loose = replace(scene, effects=tuple(e for e in scene.effects if e.kind != 'spring'))
    runs = [Simulation(each) for each in (scene, loose)]
    for sim in runs:
        sim.step(300)
    tight, free = (sim.sample() for sim in runs)
    assert tight.q == pytest.approx(free.q, abs=1e-12)
    for k in range(3):
        pair = tight.points[f'R{k}'] - tight.points[f'L{k}']
        pull = 2000.0 * 0.01 * pair / (2.0 * HALF)
        for joint, sign in (('left_elbow', -1), ('right_elbow', 1)):
            more = tight.reactions[f'{joint}{k}'].force - free.reactions[f'{joint}{k}'].force
            assert more == pytest.approx(sign * pull, abs=1e-7)
        for joint, sign in (('left_wrist', 1), ('right_wrist', -1)):
            more = tight.reactions[f'{joint}{k}'].force - free.reactions[f'{joint}{k}'].force
            assert more == pytest.approx(sign * pull, abs=1e-7)


def test_a_motion_under_constant_efforts() -> None:
    """Four freedoms: Lagrange's equations of C and of the turn of the fork, to 1e-12."""
    efforts, model = np.array([2.0, -9.0, -14.0, 0.02]), reduced()

    def rate(_: float, state: Floats) -> Floats:
        q, qd = state[:4], state[4:]
        steps = 1e-30j * np.eye(4)[:, :3]
        arms = [[ARMS.angle(q[:3] + s, k).imag * 1e30 for s in steps] for k in range(3)]
        Q = np.array(arms).T @ efforts[:3] + [0.0, 0.0, 0.0, efforts[3]]
        return np.concatenate([qd, model.acceleration(q, qd, Q)])

    sim = Simulation(unsprung(**dict(zip(MOTORS, efforts, strict=True))))
    start = np.array([*sim.sample().points['C'], 0.0, *np.zeros(4)])
    exact = solve_ivp(rate, (0.0, 0.2), start, 'DOP853', rtol=1e-12, atol=1e-12).y[:, -1]
    sim.step(100)
    sample = sim.sample()
    assert np.linalg.norm(exact[:3] - start[:3]) > 0.1 and exact[3] > 0.1
    assert sample.points['C'] == pytest.approx(exact[:3], abs=1e-9)
    assert sample.joints['bearing'].position == pytest.approx(exact[3], abs=1e-9)
