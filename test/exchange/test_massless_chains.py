"""Two and three revolutes in a row through massless links, as URDF writes universal and ball
joints: they move as these joints do, and take as many evaluations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from alf_ros import InputError, Scene, Simulation, StepError
from alf_ros.arrays import Floats
from alf_ros.exchange import ball_rows, gimbal_lock, mechanism_text
from alf_ros.exchange.robot import (
    GROUND,
    Actuator,
    Connection,
    FixedPlane,
    GroundTouch,
    Robot,
    RobotPart,
    Tendon,
)
from alf_ros.model.compile import compile_model
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation import locked_rows

X, Y, Z = np.eye(3)
Place = tuple[float, float, float] | Floats


class RobotMaker:
    """A robot with universal and ball joints; or, if `chains`, with rows of revolutes for them."""

    def __init__(self, chains: bool) -> None:
        self.chains = chains
        self.robot = Robot('robot', 'test', (0.0, 0.0, -9.81))

    def rod(self, name: str, start: Place, end: Place, mass: float, radius: float = 0.05) -> None:
        a, b = np.array(start), np.array(end)
        length = float(np.linalg.norm(b - a))
        u = (b - a) / length
        along, across = 0.5 * mass * radius**2, mass * (length**2 / 12.0 + radius**2 / 4.0)
        inertia = across * (np.eye(3) - np.outer(u, u)) + along * np.outer(u, u)
        self.robot.parts.append(RobotPart(name, a, mass, 0.5 * (a + b), inertia))

    def join(
        self, name: str, kind: str, parent: str, child: str, at: Place, *axes: Floats
    ) -> None:
        place = np.array(at)
        if kind in ('revolute', 'prismatic') or not self.chains:
            own = () if kind == 'spherical' else axes
            self.robot.connect(Connection(name, kind, parent, child, place, own))
            return
        links = [f'{name}_link{n}' for n in range(len(axes) - 1)]
        for link in links:
            self.robot.parts.append(RobotPart(link, place, 0.0, place, np.zeros((3, 3))))
        row = [parent, *links, child]
        for n, axis in enumerate(axes):
            self.robot.connect(
                Connection(f'{name}_{n}', 'revolute', row[n], row[n + 1], place, (axis,))
            )

    def scene(self) -> Scene:
        return scene_from_text(mechanism_text.text(self.robot, True, None, '0'))


def pendulum(chains: bool) -> Scene:
    """Two rods on balls."""
    maker = RobotMaker(chains)
    maker.rod('upper', (0, 0, 0), (0.4, 0.1, -0.3), 1.0)
    maker.rod('lower', (0.4, 0.1, -0.3), (0.8, 0.3, -0.4), 1.0)
    maker.join('hook', 'spherical', GROUND, 'upper', (0, 0, 0), X, Y, Z)
    maker.join('knee', 'spherical', 'upper', 'lower', (0.4, 0.1, -0.3), X, Y, Z)
    return maker.scene()


def walker(chains: bool) -> Scene:
    """A floating body in free fall, with balls at the hips and universal ankles."""
    maker = RobotMaker(chains)
    maker.rod('torso', (0, 0, 1.0), (0, 0, 1.5), 10.0, 0.2)
    for side, y in (('left', 0.1), ('right', -0.1)):
        hip, knee, ankle = (0, y, 1.0), (0.05, y, 0.55), (0, y, 0.1)
        maker.rod(f'{side}_thigh', hip, knee, 3.0)
        maker.rod(f'{side}_shin', knee, ankle, 2.0)
        maker.rod(f'{side}_foot', ankle, (0.2, y, 0.05), 0.8)
        maker.join(f'{side}_hip', 'spherical', 'torso', f'{side}_thigh', hip, Z, X, Y)
        maker.join(f'{side}_knee', 'revolute', f'{side}_thigh', f'{side}_shin', knee, Y)
        maker.join(f'{side}_ankle', 'universal', f'{side}_shin', f'{side}_foot', ankle, Y, X)
    return maker.scene()


def hexapod(chains: bool) -> Scene:
    """Six legs, each universal at the ground, a slider, and a ball at the plate."""
    maker = RobotMaker(chains)
    maker.rod('plate', (0, 0, 0.6), (0.3, 0, 0.6), 5.0, 0.2)
    for n in range(6):
        third, side = 2.0 * np.pi * (n // 2) / 3.0, 1.0 if n % 2 else -1.0
        low, high = third + 0.25 * side, third + 0.8 * side
        foot = np.array([0.5 * np.cos(low), 0.5 * np.sin(low), 0.0])
        head = np.array([0.3 * np.cos(high), 0.3 * np.sin(high), 0.6])
        u = (head - foot) / np.linalg.norm(head - foot)
        e = np.cross(u, Z) / np.linalg.norm(np.cross(u, Z))
        middle, f = 0.5 * (foot + head), np.cross(u, e)
        maker.rod(f'tube{n}', foot, middle, 0.5)
        maker.rod(f'piston{n}', middle, head, 0.3)
        maker.join(f'foot{n}', 'universal', GROUND, f'tube{n}', foot, e, f)
        maker.join(f'leg{n}', 'prismatic', f'tube{n}', f'piston{n}', middle, u)
        maker.join(f'head{n}', 'spherical', f'piston{n}', 'plate', head, e, f, u)
    return maker.scene()


@pytest.mark.parametrize(('model', 'seconds'), [(pendulum, 0.5), (walker, 0.5), (hexapod, 0.3)])
def test_massless_chains_move_as_their_joints_with_as_many_evaluations(
    model: type, seconds: float
) -> None:
    places, evaluations = [], []
    for chains in (False, True):
        simulation = Simulation(model(chains), integrator='rk4', step=1e-3)
        simulation.step(round(1000 * seconds))
        bodies = [n for n, b in enumerate(simulation.model.mechanism.bodies) if b.mass > 0.0]
        places.append(simulation.sample().body_poses[bodies])
        evaluations.append(simulation.evaluations)
    np.testing.assert_allclose(places[1], places[0], atol=1e-9)
    assert evaluations[1] <= 1.02 * evaluations[0]
    assert evaluations[0] <= 1.05 * 4000 * seconds


def slender(chains: bool) -> Scene:
    """Crank and rocker, with a rod between balls that hardly has inertia about itself."""
    maker = RobotMaker(chains)
    crank, rocker = (0.05, 0, 0.02), (0.3, 0.12, 0.25)
    maker.rod('crank', (0, 0, 0), crank, 0.8)
    maker.rod('rod', crank, rocker, 0.05, 0.002)
    maker.rod('rocker', (0.4, 0.12, 0.05), rocker, 2.0)
    maker.join('first', 'revolute', GROUND, 'crank', (0, 0, 0), Y)
    maker.join('last', 'revolute', GROUND, 'rocker', (0.4, 0.12, 0.05), Y + 0.3 * X)
    maker.join('near', 'spherical', 'crank', 'rod', crank, X, Y, Z)
    maker.join('far', 'spherical', 'rod', 'rocker', rocker, X, Y, Z)
    return maker.scene()


def test_a_rod_that_hardly_has_inertia_about_itself_feels_no_rounding() -> None:
    """A large penalty would be rounded by more than the spin of the rod has mass."""
    stiff: dict[str, Any] = {
        'step': 1e-3,
        'integrator': 'dop853_adaptive',
        'tolerance': 1e-8,
        'penalty': 1e10,
    }
    row, ball = (Simulation(slender(chains), **stiff) for chains in (True, False))
    for simulation in (row, ball):
        simulation.step(120)
    bodies = [n for n, b in enumerate(row.model.mechanism.bodies) if b.mass > 0.0]
    np.testing.assert_allclose(
        row.sample().body_poses[bodies], ball.sample().body_poses, atol=1e-8
    )
    assert row.evaluations <= 1.05 * ball.evaluations
    energies = [row.sample().energy, Simulation(slender(True), **stiff).sample().energy]
    assert energies[0] == pytest.approx(energies[1], abs=1e-8)
    assert row.model.penalty < 1e9 < ball.model.penalty


@pytest.mark.parametrize('angle', [0.0, 0.05, 0.5])
def test_a_row_in_gimbal_lock_is_refused_and_near_it_listed(angle: float) -> None:
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0.1, -0.3), 1.0)
    last = np.cos(angle) * X + np.sin(angle) * Z
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), X, Y, last)
    if angle == 0.0:
        with pytest.raises(InputError) as caught:
            gimbal_lock.checked(maker.robot)
        assert 'hook_0, hook_1, hook_2 are parallel' in str(caught.value)
        assert 'expected --set hook_1=NUMBER, or a ball' in str(caught.value)
        return
    gimbal_lock.checked(maker.robot)
    listed = maker.robot.left_out.names.get('joints near gimbal lock', [])
    assert listed == (['hook_0, hook_1, hook_2'] if angle == 0.05 else [])
    others = maker.robot.left_out.names.get('rows of joints for balls', [])
    assert others == (['hook_0, hook_1, hook_2'] if angle == 0.5 else [])


def test_a_ball_in_place_of_a_row_swings_through_gimbal_lock() -> None:
    """A rod falls from the horizontal: the second joint of the row passes 90°."""
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0, 0), 1.0)
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), X, Y, Z)
    ball_rows.joined(maker.robot, stops=True)
    assert [(each.name, each.kind) for each in maker.robot.connections] == [
        ('hook_0', 'spherical')
    ]
    assert [part.name for part in maker.robot.parts] == ['rod']
    assert maker.robot.left_out.names == {
        'rows of joints that are balls': ['hook_0, hook_1, hook_2']
    }
    simulation = Simulation(maker.scene(), integrator='dop853', step=5e-3)
    lever, inertia = 0.2, 0.05**2 / 4.0 + 0.4**2 / 3.0

    def rates(_: float, y: Floats) -> list[float]:
        return [y[1], 9.81 * lever * np.cos(y[0]) / inertia]

    wanted = solve_ivp(rates, (0, 2), [0, 0], 'DOP853', rtol=1e-12, atol=1e-12, dense_output=True)
    row = simulation.model.body_names.index('rod')
    first = Rotation.from_quat(simulation.sample().body_poses[row, 3:])
    for sample in simulation.run(2.0, every=40):
        turn = Rotation.from_quat(sample.body_poses[row, 3:]) * first.inv()
        fallen = wanted.sol(sample.t)[0]
        along = [np.cos(fallen), 0.0, -np.sin(fallen)]
        np.testing.assert_allclose(turn.apply([1.0, 0.0, 0.0]), along, atol=1e-8)


def two_rods(chains: bool, tilt: float = 0.4) -> RobotMaker:
    maker = RobotMaker(chains)
    maker.rod('upper', (0, 0, 0), (0.4, 0.1, -0.3), 1.0)
    maker.rod('lower', (0.4, 0.1, -0.3), (0.8, 0.3, -0.4), 1.0)
    maker.join('hook', 'spherical', GROUND, 'upper', (0, 0, 0), X, Y, Z)
    last = np.cos(tilt) * X + np.sin(tilt) * Z
    maker.join('knee', 'spherical', 'upper', 'lower', (0.4, 0.1, -0.3), X, Y, last)
    return maker


def test_a_rod_without_spin_has_no_angles() -> None:
    """Between two balls nothing determines how it turns about itself."""
    maker = two_rods(True)
    maker.rod('slender', (0.8, 0.3, -0.4), (1.2, 0.3, -0.4), 1.0, 0.0)
    maker.rod('bob', (1.2, 0.3, -0.4), (1.2, 0.3, -0.2), 1.0)
    maker.join('near', 'spherical', 'lower', 'slender', (0.8, 0.3, -0.4), X, Y, Z)
    maker.join('far', 'spherical', 'slender', 'bob', (1.2, 0.3, -0.4), X, Y, Z)
    ball_rows.joined(maker.robot, stops=False)
    assert [len(each.angles) for each in maker.robot.connections] == [3, 3, 0, 0]
    assert len(maker.robot.left_out.names['angles of balls']) == 2
    simulation = Simulation(maker.scene(), integrator='dop853', step=5e-3)
    simulation.step(40)
    assert np.isfinite(simulation.sample().energy)


@pytest.mark.parametrize('tilt', [0.9, -0.9, 2.2, -2.2])
def test_a_ball_keeps_the_angles_of_its_row(tilt: float) -> None:
    """Also where the row is written from the other body."""
    row, balls = (two_rods(True, tilt) for _ in range(2))
    for maker in (row, balls):
        maker.robot.connections[3:] = [
            replace(each, parent=each.child, child=each.parent)
            for each in reversed(maker.robot.connections[3:])
        ]
    ball_rows.joined(balls.robot, stops=False)
    settings: dict[str, Any] = {'integrator': 'dop853_adaptive', 'tolerance': 1e-11}
    one, other = (Simulation(maker.scene(), **settings) for maker in (row, balls))
    for _ in range(6):
        found, wanted = other.sample(), one.sample()
        assert set(found.ball_angles) == set(wanted.joints) and len(found.ball_angles) == 6
        for name, (angle, rate) in found.ball_angles.items():
            assert angle == pytest.approx(wanted.joints[name].position, abs=1e-9)
            assert rate == pytest.approx(wanted.joints[name].velocity, abs=1e-8)
        one.step(20)
        other.step(20)


@pytest.mark.parametrize('tilt', [0.0, np.pi, 1.3, -0.2])
def test_angles_of_a_ball_give_its_orientation_in_gimbal_lock_too(tilt: float) -> None:
    maker = two_rods(True, tilt)
    ball_rows.joined(maker.robot, stops=False)
    simulation = Simulation(maker.scene(), integrator='dop853', step=5e-3)
    axes = X, Y, np.cos(tilt) * X + np.sin(tilt) * Z
    start = simulation.sample().body_poses[:, 3:]
    for sample in simulation.run(1.0, every=20):
        upper, lower = (
            Rotation.from_quat(now) * Rotation.from_quat(before).inv()
            for now, before in zip(sample.body_poses[:, 3:], start, strict=True)
        )
        angles = [sample.ball_angles[f'knee_{n}'][0] for n in range(3)]
        turns = [Rotation.from_rotvec(a * e) for a, e in zip(angles, axes, strict=True)]
        apart = turns[0] * turns[1] * turns[2] * (upper.inv() * lower).inv()
        assert apart.magnitude() < 1e-12


@pytest.mark.parametrize('acts', ['damping', 'friction', 'armature', 'limits', 'actuator'])
def test_a_row_stays_if_something_acts_on_it(acts: str) -> None:
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0, 0), 1.0)
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), X, Y, Z)
    robot = maker.robot
    if acts == 'actuator':
        robot.actuators.append(Actuator('motor', 'hook_1'))
    else:
        value: Any = (-1.0, 1.0) if acts == 'limits' else 0.1
        robot.connections[1] = replace(robot.connections[1], **{acts: value})
    ball_rows.joined(robot, stops=True)
    assert len(robot.connections) == 3
    ball_rows.joined(robot, stops=False)
    assert len(robot.connections) == (1 if acts == 'limits' else 3)


SKEW, IN_PLANE, TWICE = (X + Y, 0.3 * Y + Z), (X + Y, Y), (X, Y)


@pytest.mark.parametrize(('middle', 'last'), [SKEW, TWICE, (Y, Y)])
def test_a_row_of_other_axes_is_no_ball(middle: Floats, last: Floats) -> None:
    """Some directions are out of its reach; of two parallel axes one freedom is missing."""
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0.1, -0.3), 1.0)
    axes = (each / np.linalg.norm(each) for each in (X, middle, last))
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), *axes)
    ball_rows.joined(maker.robot, stops=False)
    gimbal_lock.checked(maker.robot)
    assert [each.kind for each in maker.robot.connections] == ['revolute'] * 3
    listed = {'rows of joints with skew axes': ['hook_0, hook_1, hook_2']}
    assert maker.robot.left_out.names == listed


def test_a_row_of_axes_in_one_plane_is_refused() -> None:
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0.1, -0.3), 1.0)
    axes = (each / np.linalg.norm(each) for each in (X, *IN_PLANE))
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), *axes)
    with pytest.raises(InputError, match='hook_0, hook_1, hook_2 lie in one plane'):
        gimbal_lock.checked(maker.robot)
    with pytest.raises(StepError):  # and no traceback of a number of rows below zero
        Simulation(maker.scene(), integrator='dop853', step=5e-3).step(10)


@pytest.mark.parametrize('acts', ['touch', 'tendon', 'inertia'])
def test_a_row_stays_if_a_link_between_has_a_part(acts: str) -> None:
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0, 0), 1.0)
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), X, Y, Z)
    robot, link = maker.robot, 'hook_link1'
    if acts == 'touch':
        plane = FixedPlane(np.zeros(3), Z)
        robot.touches.append(GroundTouch('foot', link, np.zeros(3), 0.01, plane, 0.5))
    elif acts == 'tendon':
        robot.tendons.append(Tendon('cord', path=[('rod', np.zeros(3)), (link, X)]))
    else:
        robot.parts = [
            replace(part, inertia=np.eye(3)) if part.name == link else part for part in robot.parts
        ]
    ball_rows.joined(robot, stops=False)
    assert [each.kind for each in robot.connections] == ['revolute'] * 3


def test_limits_that_a_ball_does_not_have_are_listed() -> None:
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0, 0), 1.0)
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), X, Y, Z)
    robot = maker.robot
    robot.connections[1] = replace(robot.connections[1], limits=(-1.0, 1.0))
    ball_rows.joined(robot, stops=False)
    assert robot.left_out.names['limits (see --stops)'] == ['hook_1']


def test_a_step_that_fails_beside_gimbal_lock_says_so() -> None:
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 1e-4, 0), 1.0)
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), X, Y, Z)
    simulation = Simulation(maker.scene(), integrator='rk4', step=5e-3)
    with pytest.raises(StepError) as caught:
        simulation.step(400)
    assert 'hook_0, hook_1, hook_2 are ' in str(caught.value)
    assert 'degrees from gimbal lock' in str(caught.value)
    assert '(`spherical` with `angles`)' in str(caught.value)


def test_of_four_revolutes_three_become_a_ball() -> None:
    maker = RobotMaker(True)
    maker.rod('rod', (0, 0, 0), (0.4, 0, 0), 1.0)
    maker.join('hook', 'spherical', GROUND, 'rod', (0, 0, 0), X, Y, Z, X)
    ball_rows.joined(maker.robot, stops=False)
    kinds = {each.name: each.kind for each in maker.robot.connections}
    assert kinds == {'hook_0': 'spherical', 'hook_3': 'revolute'}
    assert [part.name for part in maker.robot.parts] == ['rod', 'hook_link2']


IN_THE_PLANE = """
mechanism:
  alf: 1
  space: planar
  points: {O: {at: [0, 0], fixed: true}, A: {at: [0.3, 0]}, B: {at: [0.6, 0.1]}, C: {at: [1, 0]}}
  bodies:
    one: {points: [O, A], mass: 0}
    two: {points: [A, B], mass: 0}
    rod: {points: [B, C], mass: 1, inertia: rod}
  joints:
    first: {type: revolute, between: [ground, one], at: O}
    second: {type: revolute, between: [one, two], at: A}
    third: {type: revolute, between: [two, rod], at: B}
"""


def test_links_without_mass_between_joints_at_other_places_are_no_ball() -> None:
    maker = RobotMaker(True)
    maker.rod('one', (0, 0, 0), (0.3, 0, 0), 0.0)
    maker.rod('two', (0.3, 0, 0), (0.6, 0, 0.1), 0.0)
    maker.rod('rod', (0.6, 0, 0.1), (1, 0, 0), 1.0)
    maker.join('first', 'revolute', GROUND, 'one', (0, 0, 0), Y)
    maker.join('second', 'revolute', 'one', 'two', (0.3, 0, 0), Y)
    maker.join('third', 'revolute', 'two', 'rod', (0.6, 0, 0.1), Y)
    for scene in (maker.scene(), scene_from_text(IN_THE_PLANE)):
        model = compile_model(scene.mechanism, 1e8)
        assert locked_rows.explained(model, model.q) is None
