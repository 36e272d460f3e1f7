"""`check` on angles that begin beyond half a turn, where an effect counts from there."""

from __future__ import annotations

from typing import Any

import pytest

from alf_ros import load_scene
from alf_ros.inspection.answer import NOTE
from alf_ros.inspection.soundness import examine

BEGINS = 'elbow begins at -6.183 rad, not at 0.1; from there it counts for '


def told(effects: dict[str, Any]) -> list[tuple[str, str]]:
    """Answers about angles of two bars that are drawn at 3.2 and 3.1 rad."""
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': ['cos(3.1)', 'sin(3.1)']},
            'B': {'at': ['cos(3.1) + cos(3.2)', 'sin(3.1) + sin(3.2)']},
        },
        'bodies': {
            'upper': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
            'lower': {'points': ['A', 'B'], 'mass': 1, 'inertia': 'rod'},
        },
        'joints': {
            'shoulder': {'type': 'revolute', 'between': ['ground', 'upper'], 'at': 'O'},
            'elbow': {'type': 'revolute', 'between': ['upper', 'lower'], 'at': 'A'},
        },
    }
    found = examine(load_scene({'mechanism': mechanism, 'effects': effects}))
    return [(each.verdict, each.answer) for each in found.answers if 'angles' in each.question]


@pytest.mark.parametrize(
    ('kind', 'numbers'),
    [
        ('joint_stop', {'lower': -1, 'stiffness': 100}),  # pushes at once
        ('joint_stop', {'upper': 1, 'stiffness': 100}),  # a turn later than drawn
        ('torsion_spring', {'free_position': 0, 'stiffness': 1}),
    ],
)
def test_effects_that_count_from_a_far_angle(kind: str, numbers: dict[str, float]) -> None:
    assert told({kind: {'limit': {'joint': 'elbow', **numbers}}}) == [
        (NOTE, f'{BEGINS}{kind}.limit')
    ]


@pytest.mark.parametrize(
    ('kind', 'numbers'),
    [
        ('joint_stop', {'lower': -7, 'upper': -6, 'stiffness': 100}),  # as it begins
        ('torsion_spring', {'stiffness': 1}),  # free as drawn
        ('joint_friction', {'viscous': 1}),
    ],
)
def test_effects_that_fit_a_far_angle_are_not_told(kind: str, numbers: dict[str, float]) -> None:
    assert not told({kind: {'limit': {'joint': 'elbow', **numbers}}})
    assert not told({'gravity': {'acceleration': [0, -9.81]}})


@pytest.mark.parametrize('name', ['spring_leg', 'two_finger_gripper'])
def test_scenes_of_the_library_are_meant_as_they_begin(name: str) -> None:
    assert not [each for each in examine(load_scene(name)).answers if 'angles' in each.question]
