"""Tendons with gains follow targets that are given by their names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from alf_ros import Simulation, linearise, load_scene
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.ros.simulator.command_messages import Refused, read_joints
from alf_ros.simulation.input_checks import controlled

MECHANISM = {
    'alf': 1,
    'points': {
        'O': {'at': [0, 0], 'fixed': True},
        'W': {'at': [0, 0.5], 'fixed': True},
        'A': {'at': [0.4, 0]},
        'B': {'at': [0.8, 0]},
    },
    'bodies': {
        'upper': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
        'fore': {'points': ['A', 'B'], 'mass': 0.5, 'inertia': 'rod'},
    },
    'joints': {
        'shoulder': {'type': 'revolute', 'between': ['ground', 'upper'], 'at': 'O'},
        'elbow': {'type': 'revolute', 'between': ['upper', 'fore'], 'at': 'A'},
    },
}
SUM = {'joints': [['shoulder', 1], ['elbow', 2]]}
CORD = {'path': [['W', None], ['B', None]]}


def scene(own: dict[str, Any], cord: dict[str, Any] | None = None) -> Any:
    tendons = {'fingers': SUM | {'position_gain': 40, 'velocity_gain': 0.2, 'limit': 30} | own}
    tendons['cord'] = CORD | (cord or {'damping': 0.5})
    effects = {
        'tendon': tendons,
        'torsion_spring': {'joint': 'elbow', 'stiffness': 0, 'damping': 0.02},
    }
    return load_scene({'mechanism': MECHANISM, 'effects': effects, 'solver': {'step': 5e-4}})


def states(simulation: Simulation, steps: int = 200) -> bytes:
    simulation.step(steps)
    return np.concatenate([simulation.state.q, simulation.state.qd]).tobytes()


def test_a_target_acts_as_the_own_one_of_the_scene() -> None:
    given = Simulation(scene({'position': 0.0}))
    given.apply_target('fingers', position=0.7)
    assert states(given) == states(Simulation(scene({'position': 0.7})))
    given.apply_target('fingers', position=0.7, velocity=0.3)
    own = Simulation(scene({'position': 0.7, 'velocity': 0.3}))
    own.restore(given.state)
    own.clear_inputs()
    assert states(given) == states(own)


def test_it_comes_to_rest_at_its_target() -> None:
    simulation = Simulation(scene({'position': 0.0}))
    simulation.apply_target('fingers', position=Curve(((1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0),)))
    simulation.step(60_000)
    joints = simulation.sample().joints
    length = joints['shoulder'].position + 2.0 * joints['elbow'].position
    assert length == pytest.approx(0.5, abs=1e-6)


def test_what_no_tendon_follows_is_refused() -> None:
    simulation = Simulation(scene({'position': 0.0}, {'velocity_gain': 3}))
    known = controlled(simulation.model, simulation.scene.effects)
    assert known['fingers'] == (True, True) and known['cord'] == (False, True)
    assert known['elbow'] == (False, False)
    for name, target, text in (
        ('finger', {'position': 0.1}, "did you mean 'fingers'"),
        ('cord', {'position': 0.1}, 'position_gain'),
        ('elbow', {'velocity': 0.1}, 'velocity_gain'),
        ('fingers', {'position': float('nan')}, 'finite'),
    ):
        with pytest.raises(InputError, match=text):
            simulation.apply_target(name, **target)
    with pytest.raises(InputError, match='unknown joint'):
        simulation.apply_effort('fingers', 1.0)
    plain = Simulation(scene({'position': 0.0}))
    assert 'cord' not in controlled(plain.model, plain.scene.effects)


def test_a_target_of_a_joint_is_not_one_of_a_tendon_of_its_name() -> None:
    of_joint = {'joint': 'elbow', 'position': 0.1, 'position_gain': 3}
    effects = {
        'tendon': {'elbow': SUM | {'position': 0.2, 'position_gain': 40}},
        'motor': {'drive': of_joint},
    }
    simulation = Simulation(
        load_scene({'mechanism': MECHANISM, 'effects': effects, 'solver': {'step': 5e-4}})
    )
    simulation.apply_target('elbow', position=0.4)
    wanted = {
        effect.kind: effect.parameters.position for effect in simulation._run.applied.effects
    }
    assert wanted == {'tendon': 0.2, 'motor': 0.4}


def test_joint_commands_name_tendons_beside_joints() -> None:
    simulation = Simulation(scene({'position': 0.0}))
    joints = simulation.model.coordinate_names
    known = controlled(simulation.model, simulation.scene.effects)
    message = JointState(name=['fingers', 'elbow'], position=[0.4, float('nan')])
    assert read_joints(message, joints, known) == {'fingers': {'position': 0.4}}
    with pytest.raises(Refused, match='tendon') as error:
        read_joints(JointState(name=['fingers'], effort=[0.4]), joints, known)
    assert error.value.reason == 'not_controlled'
    with pytest.raises(Refused, match='fingers'):
        read_joints(JointState(name=['finger'], position=[0.4]), joints, known)


def test_a_linear_model_has_targets_of_tendons() -> None:
    """Against differences of the velocities after a short step from rest."""
    simulation = Simulation(scene({'position': 0.3}))
    inputs, outputs = ['targets.fingers.position'], ['elbow.velocity']
    model = linearise(simulation, inputs=inputs, outputs=outputs)
    rates = []
    for by in (-1e-3, 1e-3):
        beside = Simulation(scene({'position': 0.3 + by}), step=1e-7)
        beside.step()
        rates.append(beside.sample().joints['elbow'].velocity / 1e-7)
    slope = (rates[1] - rates[0]) / 2e-3
    assert (model.C @ model.B).item() == pytest.approx(slope, rel=1e-3)
