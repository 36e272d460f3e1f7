"""Efforts and wrenches from outside as numbers that vary in a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, ensemble, load_scene, optimise
from alf_ros.__main__ import main as program
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.scene import overrides
from support.log_files import make
from support.thorough import LONG

EFFORT, FORCE, TORQUE = 'joints.crank_pin.effort', 'wrenches.B.force.x', 'wrenches.coupler.torque'


def pushed(effort: float, force: float, torque: float, steps: int) -> Simulation:
    simulation = Simulation(load_scene('slider_crank'))
    simulation.apply_effort('crank_pin', effort)
    simulation.apply_wrench('B', [force, 0.0])
    simulation.apply_wrench('coupler', torque=torque)
    simulation.step(steps)
    return simulation


def test_members_are_pushed() -> None:
    """As by inputs that are held."""
    efforts, forces, torques = [0.0, 1.5, -2.0], [0.5, 0.0, 3.0], [0.0, 0.2, -0.1]
    found = ensemble(
        'slider_crank',
        {EFFORT: efforts, FORCE: forces, TORQUE: torques},
        sampling='table',
        outputs=['final(points.B.x)'],
        duration=0.5,
        workers=1 if LONG else 0,
    )
    ends = found['final_points.B.x'].to_numpy()
    for k, values in enumerate(zip(efforts, forces, torques, strict=True)):
        wanted = pushed(*values, steps=500).sample().points['B'][0]
        assert ends[k] == pytest.approx(wanted, abs=1e-11)


@pytest.mark.thorough
def test_a_design_may_be_an_effort() -> None:
    """The effort that holds a slider-crank at rest, by an independent formula."""
    at_rest = {'initial.velocities': '{}', 'effects.gravity.acceleration': '[0, -9.81]'}
    scene = overrides.with_changes(load_scene('slider_crank'), at_rest)
    found = optimise(scene, {EFFORT: [0.0, 20.0]}, 'rms(joints.crank_pin.velocity)', duration=0.1)
    # both rods of 1 kg and 1 m at 45 degrees: each centre of mass rises by cos 45 / 2 a radian
    assert found[EFFORT] == pytest.approx(9.81 * np.cos(np.pi / 4), rel=1e-3)


def test_a_fork_is_pushed(tmp_path: Path) -> None:
    log, _ = make(tmp_path / 'log', 'slider_crank', ticks=20, push_at=5)
    new = tmp_path / 'fork'
    assert program(['fork', str(log), '--at', '0', '--set', f'{EFFORT}=2', '-o', str(new)]) == 0
    (made,) = new.rglob('*.mcap')
    effects = load(made).scene(False).effects
    assert [(e.kind, e.name) for e in effects][1:] == [('joint_effort', 'crank_pin_effort')]


@pytest.mark.parametrize(
    ('name', 'told'),
    [
        ('joints.crank_pn.effort', "joints.crank_pn.effort.*got 'crank_pn'.*'crank_pin'"),
        ('wrenches.Q.force.x', "wrenches.Q.force.x.*got 'Q'"),
        ('wrenches.coupler.torque.z', "no such input.*did you mean 'wrenches.coupler.torque'"),
        ('wrenches.coupler.force.z', "did you mean 'wrenches.coupler.force.y'"),
        ('wrenches.coupler', "no such input.*did you mean 'wrenches.coupler.torque'"),
        (
            'joints.crank_pin.effort[0:9]',
            'in some of the steps.*expected joints.crank_pin.effort,',
        ),
        ('targets.crank_pin.position', 'no motor or tendon of the scene follows one'),
    ],
)
def test_what_is_refused(name: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        overrides.with_changes(load_scene('slider_crank'), {name: '1'})


@pytest.mark.parametrize(
    ('refused', 'key'),
    [
        (lambda name: overrides.with_changes(load_scene('slider_crank'), {name: '1'}), '--set '),
        (lambda name: ensemble('slider_crank', {name: [0.0, 1.0]}, sampling='grid'), 'vary.'),
        (lambda name: optimise('slider_crank', {name: [0.0, 1.0]}, 'max(energy)'), 'vary.'),
    ],
)
def test_a_torque_on_a_point_is_refused_where_it_is_named(refused: Any, key: str) -> None:
    """B is a point: the message is about the name that was given, and no line of the scene."""
    with pytest.raises(InputError, match="'B' has no orientation") as raised:
        refused('wrenches.B.torque')
    assert str(raised.value).startswith(f'{key}wrenches.B.torque: ')


@pytest.mark.parametrize(
    ('name', 'expected'),
    [
        ('joints.crank_pin.position', 'initial.positions.A'),
        ('crank_pin.velocity', 'initial.velocities.A'),
        ('joints.guide.position', 'initial.positions.B'),
        ('joints.knee.position', 'drives.bend.angle'),
    ],
)
def test_a_state_of_a_joint_is_no_number(name: str, expected: str) -> None:
    """The message names the numbers that decide it."""
    drives = {'bend': {'joint': 'knee', 'angle': 't'}}
    scene = load_scene({'mechanism': 'slider_crank', 'drives': drives})
    with pytest.raises(InputError, match=f'of a joint is no number.*; expected {expected}$'):
        overrides.with_changes(scene, {name: '1'})


def test_a_number_of_the_scene_comes_first() -> None:
    """An effect that has the name is not made twice."""
    scene = load_scene('slider_crank')
    once = overrides.with_changes(scene, {EFFORT: '1', FORCE: '2'})
    again = overrides.with_changes(once, {EFFORT: '3'})
    assert [e.name for e in again.effects] == ['gravity', 'crank_pin_effort', 'B_force']
    assert overrides.number(again, EFFORT) == 3.0


@pytest.mark.parametrize(
    'taken',
    [
        {'joint_effort': {'crank_pin_effort': {'joint': 'knee', 'effort': 5}}},
        {'motor': {'crank_pin_effort': {'joint': 'crank_pin', 'effort': [[0, 1], [1, 2]]}}},
    ],
)
def test_an_effect_of_this_name_stays(taken: dict[str, Any]) -> None:
    """An effect of the user that has the name, and acts elsewhere or is of another kind."""
    effects = {'gravity': {'acceleration': [0, -9.81]}, **taken}
    scene = load_scene({'mechanism': 'slider_crank', 'effects': effects})
    once = overrides.with_changes(scene, {EFFORT: '2'})
    again = overrides.with_changes(once, {EFFORT: '3'})
    before, after = ({e.label: e for e in each.effects} for each in (scene, again))
    assert {label: after[label] for label in before} == before
    (new,) = after.keys() - before.keys()
    assert (after[new].parameters.joint, after[new].parameters.effort) == ('crank_pin', 3.0)
    assert overrides.number(again, EFFORT) == 3.0
