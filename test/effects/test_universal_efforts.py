"""Efforts about both axes of a universal joint, against uniform acceleration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import InputError, Simulation, load_scene

EFFORT, INERTIA, TILT = 0.7, 0.05, 0.4


def top(effects: dict[str, Any]) -> dict[str, Any]:
    """A ball on a universal joint in its centre, with the child's axis at an angle."""
    axes = [[0.0, 0.0, 1.0], [np.cos(TILT), np.sin(TILT), 0.0]]
    ball = {'points': ['O', 'A', 'B', 'C'], 'mass': 2.0, 'com': [0, 0, 0]}
    return {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {
                'O': {'at': [0, 0, 0], 'fixed': True},
                'A': {'at': [1, 0, 0]},
                'B': {'at': [0, 1, 0]},
                'C': {'at': [0, 0, 1]},
            },
            'bodies': {'ball': {**ball, 'inertia': {'about_com': 3 * [INERTIA]}}},
            'joints': {
                'u': {'type': 'universal', 'between': ['ground', 'ball'], 'at': 'O', 'axes': axes}
            },
        },
        'effects': effects,
    }


@pytest.mark.parametrize('axis', ['u_first', 'u_second'])
def test_a_motor_turns_either_axis_and_leaves_the_other(axis: str) -> None:
    scene = load_scene(top({'motor': {'joint': axis, 'effort': EFFORT}}))
    simulation = Simulation(scene, step=1e-3, integrator='dop853')
    before = simulation.sample().joints
    simulation.step(300)
    for name, joint in simulation.sample().joints.items():
        turned = 0.5 * EFFORT / INERTIA * 0.3**2 if name == axis else 0.0
        assert joint.position - before[name].position == pytest.approx(turned, abs=1e-11)
        assert joint.effort == pytest.approx(EFFORT if name == axis else 0.0, abs=1e-12)


@pytest.mark.parametrize('axis', ['u_first', 'u_second'])
def test_a_joint_effort_names_the_effect_that_does_it(axis: str) -> None:
    with pytest.raises(InputError, match='name the effect motor') as error:
        load_scene(top({'joint_effort': {'joint': axis, 'effort': EFFORT}}))
    assert '\n' not in str(error.value) and 'no single free axis' not in str(error.value)


def test_a_joint_without_an_axis_lists_the_coordinates() -> None:
    with pytest.raises(InputError, match="'w'|no such") as error:
        load_scene(top({'joint_effort': {'joint': 'w', 'effort': EFFORT}}))
    assert 'u_first' in str(error.value)
