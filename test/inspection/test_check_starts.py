"""`check` on starts in singular positions, on velocities, on drives and on armature."""

from __future__ import annotations

from typing import Any

import pytest

from alf_ros import load_scene
from alf_ros.inspection.answer import BAD, NOTE, OK
from alf_ros.inspection.soundness import examine
from support.singular_starts import (
    IN_LINE,
    answers,
    motor,
    scene,
)
from support.thorough import thinned


def test_check_calls_correct_starts_sound() -> None:
    given: tuple[dict[str, Any], ...] = ({'B': [-4, 0]}, {'A': [1, 0], 'B': [0, 0]}, {})
    for speeds in given:
        found = examine(scene(**speeds))
        assert found.sound
        told = {each.question: (each.verdict, each.answer) for each in found.answers}
        verdict, text = told['initial position']
        assert verdict == NOTE and '1 freedom more' in text
        assert 'crossing, 2 branches: A: [1, 0] with 1) B: [2, 0], or 2) B: [0, 0]' in text
        assert told['initial velocities'][0] == OK
    verdict, text = answers(scene('change_point', IN_LINE))['initial velocities']
    assert verdict == NOTE and 'at rest: leaves along branch 1, A: [0, 1], B: [0, 1.58]' in text


def test_check_judges_velocities() -> None:
    verdict, text = answers(scene(A=[1, 0]))['initial velocities']
    assert verdict == BAD and 'fit 2 branches' in text
    verdict, text = answers(scene(A=[1, 0], B=[1, 0]))['initial velocities']
    assert verdict == BAD and 'no motion begins' in text
    verdict, text = answers(scene(positions={}, A=[-2, 1]))['initial velocities']
    assert verdict == BAD and 'contradict each other' in text and 'crank_length' in text
    assert answers(scene(positions={}, B=[-4, 0]))['initial velocities'][0] == OK


def test_check_tells_drives_that_begin_off_the_drawing() -> None:
    found = examine(scene(positions={}, drives=motor('pi/4 + 0.1 + t')))
    told = [(each.verdict, each.answer) for each in found.answers if each.question == 'drives']
    text = '1 motion for 1 freedom; none left free; motor begins 0.1 rad from the drawing'
    assert found.sound and told == [(NOTE, text)]
    at_once = answers(scene(positions={}, drives=motor('pi/4 + t')))['drives']
    assert at_once == (OK, '1 motion for 1 freedom; none left free')
    verdict, text = answers(scene(positions={}, drives=motor('pi/4 + 3')))['drives']
    assert verdict == BAD and 'more than a right angle' in text and '3 rad from' in text
    length = {'push': {'joint': 'guide', 'length': '2*cos(pi/4) + 0.2 + t'}}
    verdict, text = answers(scene(positions={}, drives=length))['drives']
    assert verdict == NOTE and text.endswith('push begins 0.2 m from the drawing')
    assert answers(scene(drives=motor('pi/2 + t')))['initial velocities'][0] == BAD
    assert answers(scene(drives=motor('pi/2 + t'), B=[0, 0]))['initial velocities'][0] == OK


@pytest.mark.parametrize(
    'name', thinned(['slider_crank', 'spatial_slider_crank'], keep=['slider_crank'])
)
def test_armature_is_no_freedom(name: str) -> None:
    plain = load_scene(name)
    motor = {'motor': {'joint': 'crank_pin', 'effort': 0.0, 'armature': 0.1}}
    with_rotor = load_scene({'mechanism': name, 'effects': motor})
    bare = load_scene({'mechanism': name})
    one, two = answers(bare), answers(with_rotor)
    assert two['mobility'] == one['mobility'] == (OK, '1 freedom')
    assert two['size'] == one['size'] and two['redundant rows'] == one['redundant rows']
    assert two['singular positions'] == one['singular positions']
    assert answers(plain)['mobility'] == one['mobility']


def test_armature_may_be_the_mass_of_what_moves() -> None:
    motor = {'motor': {'joint': 'pin', 'effort': 0.0, 'armature': 0.1}}
    mechanism = {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'arm': {'points': ['O', 'A'], 'mass': 0}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O'}},
    }
    found = answers(load_scene({'mechanism': mechanism, 'effects': motor}))
    assert found['mass'][0] == OK and found['mobility'] == (OK, '1 freedom')
