"""Experiment design: what further motions would tell, by hand and by real fits."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Identification, Recording, identify, load_scene
from alf_ros.errors import InputError
from support.foreign_bags import joints, written
from support.recordings import Machine, changed, pushes, scene

NOISE = 1e-3
LENGTH, MASS, OIL, LOAD = 0.7, 1.3, 0.25, 2.0


def pendulum(load: float = 0.0) -> dict[str, Any]:
    """A point mass with oil in its pin; a known load is clamped to it, at the same place."""
    points = {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [LENGTH, 0]}}
    bodies = {'bob': {'points': ['O', 'A'], 'mass': MASS, 'inertia': 'point', 'com': [LENGTH, 0]}}
    joints = {'pin': {'type': 'revolute', 'between': ['ground', 'bob'], 'at': 'O'}}
    if load:
        points['B'] = {'at': [2 * LENGTH, 0]}
        bodies['load'] = {'points': ['A', 'B'], 'mass': load, 'inertia': 'point', 'com': [0, 0]}
        joints['clamp'] = {'type': 'weld', 'between': ['bob', 'load'], 'at': 'A'}
    return {
        'name': 'loaded' if load else 'pendulum',
        'mechanism': {
            'alf': 1,
            'name': 'pendulum',
            'space': 'planar',
            'points': points,
            'bodies': bodies,
            'joints': joints,
        },
        'effects': {
            'gravity': {'acceleration': [0, -9.81]},
            'joint_friction': {'oil': {'joint': 'pin', 'viscous': OIL}},
        },
        'solver': {'step': 2e-3, 'integrator': 'rk4'},
    }


FIT = ['bob.mass', 'oil.viscous']


@cache
def swung() -> Identification:
    """The motion depends on oil / mass alone."""
    of = load_scene(pendulum())
    recording = Machine(of, ('pin',), 2.0).recording(NOISE, seed=3)
    return identify(of, recording, FIT, window=1.0, noise={'pin': NOISE})


def test_a_known_load_tells_the_mass() -> None:
    """By hand: the recording knows b = c / m l², the loaded motion a = c / (m + M) l². The
    information of a comes from a fit of c alone; both together give the covariance of m and c."""
    found = swung()
    assert np.isinf(found.deviations).all()
    design = found.design({'again': pendulum(), 'loaded': pendulum(LOAD)}, duration=2.0)
    again, loaded = design['again'], design['loaded']
    assert design.motions[0] is loaded and design.by_volume[0] is loaded
    assert again.known.untold == 1 and loaded.known.untold == 0

    m, c = found.place  # of its derivatives
    square = LENGTH**2
    inverse = np.zeros((2, 2))
    for mass, of in ((m, pendulum()), (m + LOAD, pendulum(LOAD))):
        model = changed(load_scene(of), {'bob.mass': float(m), 'oil.viscous': float(c)})
        if mass == m:
            (recording,) = found.recordings
        else:
            recording = Machine(model, ('pin',), 2.0).recording()
        alone = identify(model, recording, ['oil.viscous'], window=1.0, noise={'pin': NOISE})
        information = (mass * square / alone.deviations[0]) ** 2  # of c / mass l²
        slope = np.array([-c / (mass**2 * square), 1.0 / (mass * square)])
        inverse += information * np.outer(slope, slope)
    expected = np.linalg.inv(inverse)
    assert np.allclose(loaded.known.covariance, expected, rtol=1e-4)


@cache
def coasting() -> Identification:
    """Masses and friction have a common factor."""
    motion = Machine(scene(), ('crank_pin', 'guide'), 2.0)
    names = ['m', 'pin.viscous', 'rail.viscous']
    return identify(scene(), motion.recording(NOISE, seed=5), names, window=1.0)


@pytest.mark.thorough
def test_a_refit_has_the_deviations_of_the_design(tmp_path: Path) -> None:
    """Known efforts tell the factor, in a plan without measurements as in the bag of a machine
    that has them."""
    found = coasting()
    inputs = pushes('crank_pin', 8.0, 2.0)
    plan = Recording('pushes', (), tuple(inputs))
    design = found.design([plan, 'initial.velocities.B.0=-6'], duration=2.0)
    assert [each.name for each in design.motions] == ['pushes', 'initial.velocities.B.0=-6']
    (left,) = design.motions[1].undetermined
    assert np.isinf(left.deviation) and all(name in left.text for name in found.names)

    pushed = Machine(scene(), ('crank_pin', 'guide'), 2.0, inputs=inputs)
    both = [each.recording(NOISE, seed=6) for each in (pushed, _coasted())]
    refit = identify(scene(), both, found.names, window=1.0)
    expected = design['pushes'].known.deviations
    assert np.allclose(refit.deviations, expected, rtol=0.1)

    commands = [
        joints('/joint_commands', 10**18 + round(each.t * 1e9), ['crank_pin'], effort=[x])
        for each in inputs
        for x in each.said.values()
    ]
    states = [
        joints('/joint_states', 10**18 + round(t * 1e9), pushed.joints, position=x)
        for t, x in zip(pushed.t, pushed.x, strict=True)
    ]
    bags = [
        str(written(tmp_path / name, each))
        for name, each in (('orders', commands), ('measured', [*states, *commands]))
    ]
    for bag in found.design(bags, duration=2.0).motions:
        assert np.allclose(bag.known.deviations, expected, rtol=0.02)
    (own,) = found.design([f'{bags[1]},gravity.acceleration.1=-5']).motions
    assert own.duration == pytest.approx(2.0)


def _coasted() -> Machine:
    return Machine(scene(), ('crank_pin', 'guide'), 2.0)


def test_a_motion_that_fails_is_named() -> None:
    """The others are judged."""
    found = swung()
    short = Recording('short', (), ())
    design = found.design({'short': short, 'again': pendulum()}, duration=2.0)
    assert not design['again'].failure
    none = found.design([short], duration=0.005)
    assert 'too few measurements in a window' in none['short'].failure
    assert 'short: cannot be used: ' in str(none)
    with pytest.raises(InputError, match='too few measurements'):
        _ = none['short'].known


def test_what_is_written(tmp_path: Path) -> None:
    found = swung()
    design = found.design({'again': pendulum(), 'loaded': pendulum(LOAD)}, duration=2.0)
    found.save(tmp_path, design)
    data = json.loads((tmp_path / 'design.json').read_text('utf-8'))
    assert [each['name'] for each in data['motions']] == ['loaded', 'again']
    assert data['numbers'] == FIT
    assert data['motions'][0]['deviations'] == design['loaded'].known.deviations.tolist()
    assert data['motions'][1]['deviations'] == [None, None]
    report = (tmp_path / 'report.html').read_text('utf-8')
    assert 'Further motions' in report and 'loaded' in report
    lines = str(design).splitlines()
    assert lines[0].split()[:2] == ['further', 'motion']
    assert any(line.startswith('again: not determined at all: ') for line in lines)
    assert 'loaded' in design._repr_html_()


@pytest.mark.parametrize(
    ('candidates', 'keywords', 'expected'),
    [
        ([], {}, 'design: no candidates'),
        ([3], {}, 'design: no candidate, got 3'),
        (['bob.mass=2'], {}, 'is fitted: a further motion has the same value'),
        (['bo.mass=2'], {}, "did you mean 'bob'?"),
        (['no_such_scene'], {}, 'no_such_scene'),
        (['gravity.acceleration.1=-1', 'gravity.acceleration.1=-1'], {}, 'named twice'),
        (['slider_crank'], {}, 'design slider_crank: recording: no such joint coordinate'),
        (['pendulum'], {}, 'design pendulum: '),
        ({'x': pendulum()}, {'duration': 0.0}, 'design duration: out of range'),
    ],
)
def test_refused_in_one_line(candidates: Any, keywords: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError) as caught:
        swung().design(candidates, **keywords)
    assert expected in str(caught.value)
    assert '\n' not in str(caught.value)
