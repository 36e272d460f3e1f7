"""The convention of wrenches in space: case by case, against m a = F, J α = r × F + τ at rest."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import Simulation, load_scene
from alf_ros.ros.simulator.command_messages import read_wrench
from alf_ros.simulation.display_geometry import poses
from support.ros_node import wrench

MASS, MOMENTS, COM = 2.0, [0.3, 0.4, 0.5], np.array([0.3, 0.2, 0.1])
TURN = Rotation.from_rotvec([0.5, -0.4, 0.9])
LOCAL = {'P': (0, 0, 0), 'Q': (1, 0, 0), 'R': (0.2, 0.9, 0), 'S': (0.1, 0.3, 0.8)}
PLACES = {name: np.array([0.3, -0.2, 0.4]) + TURN.apply(place) for name, place in LOCAL.items()}
FORCE, TORQUE = np.array([3.0, -1.0, 0.7]), np.array([0.2, -0.3, 0.5])


@pytest.fixture
def simulation():
    """A free body, turned, at rest; its centre of mass is at none of its points."""
    body = {
        'points': list(PLACES),
        'mass': MASS,
        'com': COM.tolist(),
        'inertia': {'about_com': MOMENTS},
    }
    points = {name: {'at': place.tolist()} for name, place in PLACES.items()}
    mechanism = {'alf': 1, 'space': 'spatial', 'points': points, 'bodies': {'body': body}}
    return Simulation(load_scene({'name': 'body', 'mechanism': mechanism}))


def check(simulation, name, frame, force, torque, at=None):
    """After a command, the accelerations agree with a force and a torque in the world frame."""
    x, y, z = FORCE
    message = wrench(x, y, TORQUE[2] if name == 'body' else 0.0, frame=frame, forcez=z)
    if name == 'body':
        message.wrench.torque.x, message.wrench.torque.y = TORQUE[:2]
    simulation.apply_wrench(**read_wrench(message, name, ['body'], list(PLACES), dimension=3))
    sample = simulation.sample()
    found = sample.qdd.reshape(-1, 3)[:4]
    # the frame that tf says is the one that is drawn here
    (pose,) = poses(sample)
    assert Rotation.from_quat(pose[3:]).as_matrix() == pytest.approx(TURN.as_matrix(), abs=1e-12)
    centre = PLACES['P'] + TURN.apply(COM)
    moment = torque + (np.cross(at - centre, force) if at is not None else 0.0)
    J = TURN.as_matrix() @ np.diag(MOMENTS) @ TURN.as_matrix().T
    alpha = np.linalg.solve(J, moment)
    for acceleration, place in zip(found, PLACES.values(), strict=True):
        wanted = force / MASS + np.cross(alpha, place - centre)
        assert acceleration == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize('frame', ['', 'world'])
def test_world_frame_at_the_centre_of_mass(simulation, frame):
    check(simulation, 'body', frame, FORCE, TORQUE)


def test_body_frame_at_the_centre_of_mass(simulation):
    check(simulation, 'body', 'body', TURN.apply(FORCE), TURN.apply(TORQUE))


@pytest.mark.parametrize('point', PLACES)
def test_world_frame_at_an_offset_point(simulation, point):
    check(simulation, point, 'world', FORCE, np.zeros(3), PLACES[point])
