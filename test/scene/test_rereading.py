"""A scene that is read again in parts is the scene that is read as a whole."""

from __future__ import annotations

from typing import Any

import pytest

from alf_ros import AlfError, InputError, Simulation, load_scene, resources
from alf_ros.scene import overrides
from alf_ros.scene.overrides import number, with_changes
from alf_ros.scene.rereading import ReadDocument
from alf_ros.scene.scene import Scene
from support.some_scenes import SOME_SCENES
from support.thorough import thinned

SCENES = sorted(resources.library('scenes'))
OF_BODIES = {'mass': ('0.7', '0', '-1', 'x', '[1]'), 'inertia': ('point', '{about_com: 1}')}
OF_SCENES = {
    'gravity.acceleration': ('[0, 0, -9]', '[0, -9]'),
    'initial.velocities': ('{}', '{nobody: [0, 0]}'),
    'solver.step': ('0.01', '-1', 'a'),
    'solver.accuracy': ('1e-6',),
}


GEOMETRY = {'at': ('0.031', '1e6', 'x'), 'along': ('[0.1, 0.2, 0.7]', '[0, 0, 0]')}


def of_geometry(scene: Scene) -> list[dict[str, str]]:
    """Changes of numbers that lengths and directions depend on."""
    mechanism = scene.document.root.mapping()['mechanism'].mapping()
    found: list[dict[str, str]] = []
    parameters = mechanism['parameters'].mapping() if 'parameters' in mechanism else {}
    for name, entry in list(parameters.items())[:4]:
        found += [{name: f'({entry.value})*1.01'}, {name: '0'}, {name: '-1'}]
    for section, key, end in (('points', 'at', '.0'), ('vectors', 'along', '')):
        for name in list(mechanism[section].mapping())[-2:] if section in mechanism else ():
            place = f'mechanism.{section}.{name}.{key}{end}'
            found += [{place: text} for text in GEOMETRY[key]]
    if 'joints' in mechanism:
        name, entry = list(mechanism['joints'].mapping().items())[-1]
        found += [{f'mechanism.joints.{name}.type': 'weld'}]
        if 'on' in entry.mapping():
            found += [{f'mechanism.joints.{name}.on.through.0': '0.01'}]
    return found


def told(scene: Scene, changes: dict[str, str]) -> Any:
    """All of the changed scene, or its error."""
    try:
        found = with_changes(scene, changes)
    except AlfError as error:
        return str(error)
    return found, repr(found), found.text, found.mechanism.geometry, found.says_solver


@pytest.mark.parametrize('name', thinned(SCENES, keep=SOME_SCENES))
def test_in_parts_as_in_whole(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene(name)
    body = scene.mechanism.bodies[-1].name
    each = [{f'{body}.{field}': t} for field, texts in OF_BODIES.items() for t in texts]
    each += [{key: text} for key, texts in OF_SCENES.items() for text in texts]
    each.append({f'{body}.mass': '0.9', 'solver.integrator': 'dop853', 'solver.step': '0.02'})
    each += of_geometry(scene)
    told(scene, each[0])  # the first one is read as a whole
    read = [0]
    again = ReadDocument.again

    def counted(self: ReadDocument, *given: Any) -> Scene | None:
        found = again(self, *given)
        read[0] += found is not None
        return found

    monkeypatch.setattr(ReadDocument, 'again', counted)
    parts = [told(scene, changes) for changes in each]
    assert read[0] or '<' in scene.text
    monkeypatch.setattr(ReadDocument, 'again', lambda self, *given: None)
    for changes, found in zip(each, parts, strict=True):
        assert found == told(scene, changes), changes


def test_parameters_that_other_sections_name(monkeypatch: pytest.MonkeyPatch) -> None:
    document = {
        'mechanism': {
            'alf': 1,
            'parameters': {'L': 1.0, 'v': 2.0, 'zero': 0.0},
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': ['L', 'zero']}},
            'bodies': {'rod': {'points': ['O', 'A'], 'mass': 'L', 'inertia': 'rod'}},
            'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
        },
        'effects': {'gravity': {'acceleration': [0, '-9.81*L']}},
        'initial': {'velocities': {'A': ['zero', 'v']}},
        'solver': {'step': 'L/1000', 'integrator': 'dop853'},
    }
    scene = load_scene(document)
    changes: list[dict[str, str]] = [{'v': '3'}, {'L': '2'}, {'L': '-1'}, {'zero': '-0.0'}]
    changes += [{'L': '2', 'solver.step': 'v/1000'}, {'v': '5', 'solver.step': 'v/1000'}]
    changes += [{'L': '3', 'gravity.acceleration': '[L, v]'}, {'rod.mass': '3', 'A.at.0': '7'}]
    told(scene, changes[0])
    parts = [told(scene, each) for each in changes]
    monkeypatch.setattr(ReadDocument, 'again', lambda self, *given: None)
    for each, found in zip(changes, parts, strict=True):
        assert found == told(scene, each), each


def test_effects_whose_entries_stand_again_are_not_read_again() -> None:
    arms = [{'joint': 'crank_pin', 'viscous': 0.1}, {'joint': 'guide', 'viscous': 0.2}]
    effects = {'gravity': {'acceleration': [0, -9.81]}, 'joint_friction': arms}
    scene = load_scene({'mechanism': 'slider_crank', 'effects': effects})
    change = {'joint_friction.1.viscous': '0.3'}
    with_changes(scene, change)  # the first one is read as a whole
    first, second = (with_changes(scene, change) for _ in range(2))
    assert [a is b for a, b in zip(first.effects, second.effects, strict=True)] == [1, 1, 0]
    assert [each.parameters.viscous for each in second.effects[1:]] == [0.1, 0.3]
    # a mass may be what an effect needs: then all are read again
    both = with_changes(scene, {**change, 'coupler.mass': '2'})
    assert both.effects == second.effects and both.effects[0] is not second.effects[0]


def test_a_document_decides_and_not_the_scene_that_has_it() -> None:
    scene = load_scene('slider_crank')
    rest = scene.at_rest()
    for _ in range(3):
        assert with_changes(rest, {'coupler.mass': '1.1'}).velocities
    for _ in range(2):
        changed = with_changes(scene, {'coupler.mass': '1.1'})
        assert with_changes(changed, {'crank.mass': '2'}).mechanism.body['coupler'].mass == 1.1


MOTION, ENTRY = 'drives.motor.angle', 'drives.motor.angle.table.1.1'
TABLE = '{table: [[0, -pi/2], [0.5, -1], [1, 0]]}'


def test_motions_of_the_scene_and_of_its_mechanism_have_names() -> None:
    wiper = load_scene('wiper')
    text = '-pi/2 + 2*t'
    driven = with_changes(wiper, {MOTION: text})
    drives = {'motor': {'joint': 'motor_shaft', 'angle': text}}
    fields = {**wiper.document.root.mapping()}
    assert driven.mechanism == load_scene({**fields, 'drives': drives}).mechanism
    assert driven.mechanism != wiper.mechanism
    assert overrides.section(driven, MOTION) == 'drives'
    mechanism = {**fields['mechanism'].mapping(), 'drives': fields.pop('drives')}
    within = load_scene({**fields, 'mechanism': mechanism})
    assert with_changes(within, {MOTION: text}).mechanism == driven.mechanism
    assert overrides.section(within, MOTION) == 'mechanism'


def test_an_entry_of_the_table_of_a_drive_is_a_number() -> None:
    scene = with_changes(load_scene('wiper'), {MOTION: TABLE})
    assert number(scene, ENTRY) == -1.0
    energies = []
    for change in (-1e-4, 1e-4):
        other = Simulation(with_changes(scene, {ENTRY: repr(-1.0 + change)}))
        other.step(100)
        energies.append(other.sample().energy)
    simulation = Simulation(scene, tangents=[ENTRY])
    simulation.step(100)
    slope = simulation.sample().tangents[ENTRY].of('energy')
    assert slope == pytest.approx((energies[1] - energies[0]) / 2e-4, rel=1e-6)
    assert slope


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'drives.moto.angle': 't'}, "--set: no such drive, got 'drives.moto'; did you mean 'dri"),
        ({'motor.angle': 't'}, "--set: nothing of this name, got 'motor'; did you mean 'drives.m"),
        ({MOTION: 'u*t'}, "--set drives.motor.angle: unknown name 'u' in 'u*t'"),
    ],
)
def test_a_motion_that_cannot_be_is_said(changes: dict[str, str], said: str) -> None:
    with pytest.raises(InputError) as caught:
        with_changes(load_scene('wiper'), changes)
    assert str(caught.value).startswith(said)


def test_a_motion_is_no_number() -> None:
    with pytest.raises(InputError, match=r'drives\.motor\.angle: a function of time, got '):
        number(load_scene('wiper'), MOTION)
