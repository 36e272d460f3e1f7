"""Values of a scene by name: of its drives."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import alf_ros
from alf_ros import InputError, Simulation, load_scene
from alf_ros.effects import load
from alf_ros.scene import overrides
from alf_ros.scene.scene import scene_from_text
from support.effect_scenes import PENDULUM

TABLE = '{joint: motor_shaft, angle: {table: [[0, -1.5708], [1, 0], [2, 1]]}}'

# effects with the names of their joints, as imported robots have them
ROBOT = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [0.5, 0]}
    E: {at: [1, 0], fixed: true}
    F: {at: [1, 0.4]}
  bodies:
    upper: {points: [O, A], mass: 1, inertia: rod}
    lower: {points: [E, F], mass: 1, inertia: rod}
  joints:
    shoulder: {type: revolute, between: [ground, upper], at: O}
    elbow: {type: revolute, between: [ground, lower], at: E}
  couplings: {belt: {joints: {shoulder: 0.5, elbow: -1}}}
effects:
  gravity: {acceleration: [0, -9.81]}
  joint_friction: {shoulder: {joint: shoulder, viscous: 0.1}}
  torsion_spring: {shoulder: {joint: shoulder, stiffness: 2.0}}
  joint_stop: {shoulder: {joint: shoulder, lower: -2, upper: 2, stiffness: 300}}
"""


@pytest.mark.parametrize(
    ('name', 'place'),
    [
        ('shoulder.viscous', 'effects.joint_friction.shoulder.viscous'),
        ('shoulder.upper', 'effects.joint_stop.shoulder.upper'),
        ('shoulder.dynamic', 'effects.joint_friction.shoulder.dynamic'),  # by default 0
    ],
)
def test_a_short_name_is_of_the_one_thing_that_has_it(name: str, place: str) -> None:
    scene = scene_from_text(ROBOT)
    changed = overrides.with_changes(scene, {name: '0.25'})
    assert overrides.number(changed, place) == 0.25
    assert changed.text == overrides.with_changes(scene, {place: '0.25'}).text


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        (
            'shoulder.stiffness',
            'several things of this name, .*expected effects.torsion_spring.shoulder.stiffness or '
            'effects.joint_stop.shoulder.stiffness$',
        ),
        ('shoulder.viscus', "did you mean 'effects.joint_friction.shoulder.viscous'"),
        ('joints.shoulder.at', "known: mechanism.joints.shoulder$|mean 'mechanism.joints.should"),
    ],
)
def test_names_that_are_proposed_exist(name: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        overrides.with_changes(scene_from_text(ROBOT), {name: '1'})


@pytest.mark.parametrize('kind', ['{folder}/wind.py', 'wind.py', 'wind', '{text}'])
def test_effects_from_files_have_full_names(kind: str, tmp_path: Path) -> None:
    """Names of files have dots, and the text of a scene has a digest in them."""
    shutil.copy(load('drag').__file__ or '', tmp_path / 'wind.py')
    file = tmp_path / 'robot.yaml'
    file.write_text(ROBOT + '  wind.py: {lower: {on: lower, linear: 8.0}}\n', 'utf-8')
    scene = load_scene(file)
    text = list(scene.document.root.mapping()['effects'].mapping())[-1]
    name = f'effects.{kind.format(folder=tmp_path, text=text)}.lower.linear'
    assert overrides.number(scene, name) == 8.0
    changed = overrides.with_changes(scene, {name: '9'})
    assert changed.text == overrides.with_changes(scene, {'lower.linear': '9'}).text != scene.text
    assert list(Simulation(scene, tangents=[name]).sample().tangents) == [name]


def test_the_name_of_a_file_names_its_effect(tmp_path: Path) -> None:
    """Also without `effects` before it; the message was about a part `py` that there is not."""
    shutil.copy(load('drag').__file__ or '', tmp_path / 'wind.py')
    file = tmp_path / 'robot.yaml'
    file.write_text(ROBOT + '  wind.py: {lower: {on: lower, linear: 8.0}}\n', 'utf-8')
    scene = load_scene(file)
    assert overrides.number(scene, 'wind.py.lower.linear') == 8.0
    changed = overrides.with_changes(scene, {'wind.py.lower.linear': '9'})
    assert overrides.number(changed, 'lower.linear') == 9.0
    with pytest.raises(InputError, match="'lineal'; did you mean 'linear'"):
        overrides.number(scene, 'wind.py.lower.lineal')


def test_a_coupling_has_a_short_name() -> None:
    """In changes, ensembles and tangents."""
    scene, name = scene_from_text(ROBOT), 'belt.joints.shoulder'
    full = f'mechanism.couplings.{name}'
    changed = overrides.with_changes(scene, {name: '0.75'})
    assert changed.text == overrides.with_changes(scene, {full: '0.75'}).text
    found = alf_ros.ensemble(
        scene,
        {name: [0.4, 0.75]},
        sampling='table',
        workers=0,
        duration=0.1,
        outputs={'elbow': 'final(elbow.position)'},
    )
    assert len(set(found.elbow.values)) == 2
    both = []
    for each in (name, full):
        simulation = Simulation(scene, tangents=[each])
        simulation.step(20)
        both.append(simulation.sample().tangents[each].joints['elbow'].position)
    assert both[0] == both[1] != 0.0
    with pytest.raises(InputError, match="'mechanism.couplings.belt'"):
        overrides.with_changes(scene, {f'couplings.{name}': '1'})
    with pytest.raises(InputError, match='known: belt.joints.shoulder, belt.joints.elbow'):
        overrides.number(scene, 'belt')


def test_a_drive_of_a_scene() -> None:
    name = 'drives.motor.angle'
    scene = overrides.with_changes(load_scene('wiper'), {name: '-pi/2 + 3*t'})
    assert overrides.section(scene, name) == 'drives'
    simulation = Simulation(scene)
    simulation.step(100)
    shaft = simulation.sample().joints['motor_shaft']
    assert shaft.position == pytest.approx(-np.pi / 2 + 3 * simulation.t, abs=1e-12)
    assert shaft.velocity == pytest.approx(3.0, abs=1e-12)


def test_numbers_of_a_drive_vary_and_have_tangents() -> None:
    scene = overrides.with_changes(load_scene('wiper'), {'drives.motor': TABLE})
    name = 'drives.motor.angle.table.1.1'
    found = alf_ros.ensemble(
        scene,
        {name: [0.0, 0.1], 'gravity.acceleration.1': [-9.0, -8.0]},
        sampling='table',
        workers=0,
        duration=0.5,
        outputs={'shaft': 'final(motor_shaft.position)'},
    )
    first, second = found.shaft.values
    simulation = Simulation(scene, tangents=[name])
    simulation.step(round(0.5 / simulation.h))
    tangent = simulation.sample().tangents[name].joints['motor_shaft'].position
    assert tangent == pytest.approx(10 * (second - first), rel=1e-9)  # the motion is linear in it


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        (('coupler.mass', 'mechanism.bodies.coupler.mass'), 'given twice, also by coupler.mass'),
        (('gravity.acceleration', 'gravity.acceleration.1'), 'also by gravity.acceleration'),
        (('effects.gravity.acceleration.1', 'gravity'), 'not one value.*known: gravity.acc'),
        (('gravity.acceleration.1', 'effects.gravity'), 'also by gravity.acceleration.1'),
        (('solver.accuracy', 'solver.integrator'), 'has no meaning beside solver.accuracy'),
        (('gravity.acceleration.01',), "no such place in a list, got '01'"),
        (('gravity.acceleration.²',), 'no such place in a list'),
    ],
)
def test_a_number_has_one_value(changes: tuple[str, ...], said: str) -> None:
    """Also under two names, or as a part of another one: the last one would count."""
    with pytest.raises(InputError, match=said):
        overrides.with_changes(load_scene('slider_crank'), dict.fromkeys(changes, '1'))


def test_a_change_is_given_once() -> None:
    assert overrides.read(['a = 1', 'b=2']) == {'a': '1', 'b': '2'}
    with pytest.raises(InputError, match="--set: given twice, got 'a'"):
        overrides.read(['a=1', 'a =2'])


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('joints.crank_pin.effort', 'joint_effort: {push: {joint: crank_pin, effort: 0}}'),
        ('crank_pin.effort', 'expected joints.crank_pin.effort'),
        ('wrenches.B.force.x', 'constant_wrench: {push: {on: B, force'),
    ],
)
def test_an_input_from_outside_is_an_effect_or_none(name: str, said: str) -> None:
    """It said that the scene has nothing of this name, and not how to have it."""
    scene = load_scene('slider_crank')
    with pytest.raises(InputError, match='is no number|nothing of this name') as caught:
        overrides.number(scene, name)
    assert said in str(caught.value)
    motor = {'crank_pin': {'joint': 'crank_pin', 'effort': 0.5}}
    named = load_scene({'mechanism': 'slider_crank', 'effects': {'motor': motor}})
    if name == 'crank_pin.effort':  # the effect has the name of the joint
        assert overrides.number(named, name) == 0.5


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('effects.gravity', '{acceleration: [0, -9.81]}'),
        ('effects.gravity.acceleration', '[0, -9.81]'),
        ('effects.damper.rope', '{between: [A, ground], at: [~, [0, 1]], damping: 2}'),
        ('initial.velocities', '{A: [0, 1]}'),
        ('initial.velocities.A', '[0, 1]'),
        ('drives.motor', '{joint: pin, angle: 0.1*t}'),
    ],
)
def test_a_section_that_the_scene_lacks_is_added(name: str, value: str) -> None:
    section, *rest = name.split('.')
    inner = value
    for part in reversed(rest):
        inner = f'{{{part}: {inner}}}'
    written = scene_from_text(f'{PENDULUM}{section}: {inner}\n')
    changed = overrides.with_changes(scene_from_text(PENDULUM), {name: value})
    assert changed.text == written.text


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('initial.speeds.A', "unknown key, got 'speeds'; known: positions, velocities, branch"),
        ('effects.damper.damping', "missing key 'between'"),
        ('effects.dampr.damping', "no such part, got 'dampr'"),
    ],
)
def test_what_cannot_stand_there_is_refused_by_the_name_of_the_change(
    name: str, said: str
) -> None:
    with pytest.raises(InputError, match=f'^--set {name}: {said}'):
        overrides.with_changes(scene_from_text(PENDULUM), {name: '1'})


@pytest.mark.parametrize('name', ['sensors.imu.rate', 'diff_drive.wheel_radius'])
def test_what_only_the_node_has_is_no_change(name: str) -> None:
    with pytest.raises(InputError, match=f'^--set: has no effect: only the node .*{name}'):
        overrides.with_changes(load_scene('wheeled_robot'), {name: '1'})
