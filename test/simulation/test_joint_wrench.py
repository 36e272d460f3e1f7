"""A force and torque sensor at a joint measures all that the parent does to the child.

A body on a joint, moved by gravity, efforts, friction and drives, against Newton and Euler: the
force m (a - g), and the moment J α + ω × J ω + r × m (a - g) about the joint.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.simulation.sensors import Sensors
from alf_ros.simulation.sensors.body_motion import body_motion

MASS, CENTRE = 2.0, np.array([0.2, -0.1, 0.15])
MOMENTS = np.array([[0.05, 0.004, -0.003], [0.004, 0.06, 0.002], [-0.003, 0.002, 0.07]])
GRAVITY = np.array([1.0, -2.0, -9.81])
ALONG = [0.6, 0.0, 0.8]
TURNING = 'revolute', 'universal', 'spherical'  # about a point that is fixed
JOINTS: dict[str, dict[str, Any]] = {
    'revolute': {'axis': ALONG},
    'prismatic': {'axis': ALONG},
    'cylindrical': {'axis': ALONG},
    'universal': {'axes': [ALONG, [0.0, 1.0, 0.0]]},
    'spherical': {},
    'screw': {'axis': ALONG, 'pitch': 0.1},
}


def scene(joint: dict[str, Any], **more: Any) -> Any:
    about = [*np.diag(MOMENTS), MOMENTS[0, 1], MOMENTS[0, 2], MOMENTS[1, 2]]
    return load_scene(
        {
            'mechanism': {
                'alf': 1,
                'space': 'spatial',
                'points': {'P': {'at': [0.1, 0.2, 0.3], 'fixed': joint['type'] in TURNING}},
                'bodies': {
                    'arm': {
                        'points': ['P'],
                        'mass': MASS,
                        'com': CENTRE.tolist(),
                        'inertia': {'about_com': [float(x) for x in about]},
                    }
                },
                'joints': {'held': {'between': ['ground', 'arm'], 'at': 'P', **joint}},
                'couplings': more.pop('couplings', {}),
            },
            'effects': {'gravity': {'acceleration': GRAVITY.tolist()}, **more.pop('effects', {})},
            'sensors': {'force_torque': {'joint': 'held'}},
            'solver': {'step': 1e-3, 'integrator': 'dop853'},
            **more,
        }
    )


def check(simulation: Simulation) -> None:
    sample = simulation.sample()
    (found,) = Sensors(simulation.scene).read(sample).values()
    motion = body_motion(sample, 'arm')
    omega, alpha = motion.to_body(motion.omega), motion.to_body(motion.alpha)
    felt = motion.acceleration_at(motion.to_world(CENTRE)) - GRAVITY
    force = MASS * motion.to_body(felt)
    moment = MOMENTS @ alpha + np.cross(omega, MOMENTS @ omega) + np.cross(CENTRE, force)
    np.testing.assert_allclose(found['force'], force, atol=1e-8)
    np.testing.assert_allclose(found['torque'], moment, atol=1e-8)


@pytest.mark.parametrize('kind', JOINTS)
def test_efforts_and_friction(kind: str) -> None:
    names = load_coordinates(kind)
    efforts = {f'push{n}': {'joint': name, 'effort': 1.0 + n} for n, name in enumerate(names)}
    rubbing = {f'rub{n}': {'joint': name, 'viscous': 0.3} for n, name in enumerate(names)}
    pulling = {
        f'pull{n}': {'joint': name, 'stiffness': 5.0, 'free_position': 0.2}
        for n, name in enumerate(names)
    }
    pushing = {'torsion_spring': pulling} if kind == 'universal' else {'joint_effort': efforts}
    effects = {**pushing, 'joint_friction': rubbing} if names else {}
    simulation = Simulation(scene({'type': kind, **JOINTS[kind]}, effects=effects))
    check(simulation)
    simulation.step(300)
    check(simulation)


def load_coordinates(kind: str) -> tuple[str, ...]:
    return Simulation(scene({'type': kind, **JOINTS[kind]})).model.coordinate_names


def test_a_driven_joint_and_a_held_effort() -> None:
    driven = scene(
        {'type': 'revolute', 'axis': ALONG},
        drives={'motor': {'joint': 'held', 'angle': 'sin(3*t)'}},
    )
    simulation = Simulation(driven)
    simulation.step(200)
    check(simulation)
    lifted = Simulation(scene({'type': 'prismatic', 'axis': ALONG}))
    lifted.apply_effort('held', 25.0)
    lifted.step(100)
    check(lifted)


@pytest.mark.parametrize('kind', ['revolute', 'prismatic'])
def test_the_inertia_of_a_rotor(kind: str) -> None:
    """It takes part of the effort of the motor, before the child."""
    motor = {'joint': 'held', 'effort': 3.0, 'armature': 0.5, 'velocity_gain': 0.2}
    simulation = Simulation(scene({'type': kind, **JOINTS[kind]}, effects={'motor': motor}))
    check(simulation)
    simulation.step(300)
    check(simulation)


def test_a_coupling() -> None:
    coupled = scene(
        {'type': 'cylindrical', 'axis': ALONG},
        couplings={'thread': {'joints': {'held_angle': 0.1, 'held_length': -1.0}}},
    )
    simulation = Simulation(coupled)
    check(simulation)
    simulation.step(300)
    check(simulation)
