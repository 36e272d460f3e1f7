"""One convention for wrenches, case by case: the frame turns the axes, the topic says the place.

A wrench command is held against the accelerations that mechanics gives, worked out here from the
rigid body alone: m a = F, J α = r × F + τ.
"""

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.ros.simulator.command_messages import read_wrench
from support.ros_node import wrench

MASS, MOMENT, COM, ANGLE = 2.0, 0.3, np.array([0.4, 0.25]), 0.7
C, S = np.cos(ANGLE), np.sin(ANGLE)
TURN = np.array([[C, -S], [S, C]])
ORIGIN = np.array([0.3, -0.2])
PLACES = {'P': ORIGIN, 'Q': ORIGIN + TURN @ [1.0, 0.0], 'R': ORIGIN + TURN @ [0.2, 0.9]}


@pytest.fixture
def simulation():
    """A free plate, turned by ANGLE, at rest; its centre of mass is at none of its points."""
    plate = {
        'points': ['P', 'Q', 'R'],
        'mass': MASS,
        'com': COM.tolist(),
        'inertia': {'about_com': MOMENT},
    }
    points = {name: {'at': place.tolist()} for name, place in PLACES.items()}
    bodies = {'plate': plate, 'bob': {'points': ['X'], 'mass': 1.5, 'inertia': 'point'}}
    points['X'] = {'at': [3.0, 3.0]}
    mechanism = {'alf': 1, 'space': 'planar', 'points': points, 'bodies': bodies}
    return Simulation(load_scene({'name': 'plate', 'mechanism': mechanism}))


def command(simulation, name, message, prefix=''):
    bodies, points = ('plate', 'bob'), ('P', 'Q', 'R', 'X')
    simulation.apply_wrench(**read_wrench(message, name, bodies, points, prefix))


def acceleration(simulation):
    """Acceleration of the centre of mass (m/s^2) and of the angle (rad/s^2) of the plate."""
    p, q = simulation.sample().qdd.reshape(-1, 2)[:2]
    across = TURN @ [0.0, 1.0]
    alpha = (q - p) @ across  # at rest, one metre apart
    arm = TURN @ COM
    return p + alpha * np.array([-arm[1], arm[0]]), alpha


def expected(force, torque=0.0, at=None):
    arm = np.zeros(2) if at is None else at - (ORIGIN + TURN @ COM)
    moment = torque + arm[0] * force[1] - arm[1] * force[0]
    return np.array(force) / MASS, moment / MOMENT


@pytest.mark.parametrize('frame', ['', 'world'])
def test_world_frame_at_the_centre_of_mass(simulation, frame):
    command(simulation, 'plate', wrench(3.0, -1.0, 0.5, frame=frame))
    linear, angular = acceleration(simulation)
    a, alpha = expected([3.0, -1.0], 0.5)
    assert linear == pytest.approx(a, abs=1e-9) and angular == pytest.approx(alpha, abs=1e-9)


@pytest.mark.parametrize(('frame', 'prefix'), [('plate', ''), ('left/plate', 'left/')])
def test_body_frame_at_the_centre_of_mass(simulation, frame, prefix):
    command(simulation, 'plate', wrench(3.0, -1.0, 0.5, frame=frame), prefix)
    linear, angular = acceleration(simulation)
    a, alpha = expected(TURN @ [3.0, -1.0], 0.5)
    assert linear == pytest.approx(a, abs=1e-9) and angular == pytest.approx(alpha, abs=1e-9)


@pytest.mark.parametrize('point', ['P', 'Q', 'R'])
def test_world_frame_at_an_offset_point(simulation, point):
    command(simulation, point, wrench(3.0, -1.0))
    linear, angular = acceleration(simulation)
    a, alpha = expected([3.0, -1.0], at=PLACES[point])
    assert abs(alpha) > 0.5
    assert linear == pytest.approx(a, abs=1e-9) and angular == pytest.approx(alpha, abs=1e-9)


def test_the_body_frame_turns_with_the_body(simulation):
    # a free plate pushed along its own axis, and spun: the force keeps its direction in the body
    command(simulation, 'plate', wrench(1.0, 0.0, 3.0, frame='plate'))
    simulation.step(600)
    x, y, angle = simulation.sample().body_poses[0]
    assert angle - ANGLE > 1.5
    p, q = simulation.sample().qdd.reshape(-1, 2)[:2]
    pv, qv = simulation.sample().qd.reshape(-1, 2)[:2]
    c, s = np.cos(angle), np.sin(angle)
    spin = (qv - pv) @ [-s, c]
    alpha = (q - p) @ [-s, c]
    arm = np.array([[c, -s], [s, c]]) @ COM
    linear = p + alpha * np.array([-arm[1], arm[0]]) - spin**2 * arm
    assert alpha == pytest.approx(3.0 / MOMENT, abs=1e-6)
    assert linear == pytest.approx(np.array([c, s]) / MASS, abs=1e-6)


def test_a_body_of_one_point_takes_forces_in_the_world(simulation):
    command(simulation, 'bob', wrench(3.0, -1.5))
    assert simulation.sample().qdd.reshape(-1, 2)[3] == pytest.approx([2.0, -1.0], abs=1e-9)
