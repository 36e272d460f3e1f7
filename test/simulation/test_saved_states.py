"""Saved states: what a file holds is a state of the scene, or is refused in one line."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from alf_ros import AlfError, InputError, Simulation, load_scene
from alf_ros.effects.contract.trajectory import through
from alf_ros.simulation.saved_states import SavedStates, as_data, from_data
from support.full_disk import small_files
from support.runs import bits, made
from support.thorough import LONG

NAME = 'there'


@pytest.fixture(scope='module')
def sim() -> Simulation:
    sim = made('explicit')
    sim.apply_effort('crank_pin', through([0.0, 1.0], [(0.0,), (2.0,)]))
    sim.apply_wrench('coupler', [0.0, 1.0], at='A')
    sim.step(12)
    return sim


@pytest.fixture
def folder(tmp_path: Path, sim: Simulation) -> Path:
    SavedStates(tmp_path).save(NAME, sim.scene, sim)
    return tmp_path


def file(folder: Path, sim: Simulation) -> Path:
    return folder / sim.scene.name / f'{NAME}.json'


def test_a_saved_state_is_read_to_the_last_bit(folder: Path, sim: Simulation) -> None:
    state, step, q = SavedStates(folder).find(NAME, sim.scene, sim.state)
    assert bits(state) == bits(sim.state) and step == sim.h
    assert q == sim.sample().q.tolist()


def test_a_state_of_momenta_is_none_of_velocities(tmp_path: Path) -> None:
    """They are as many numbers, and were taken for each other."""
    scene = load_scene('four_bar')
    sim = Simulation(scene, formulation='lagrange_canonical')
    saved = SavedStates(tmp_path)
    saved.save(NAME, scene, sim)
    for states in (saved, SavedStates(tmp_path)):
        assert states.find(NAME, scene, sim.state, 'lagrange_canonical')[1] == sim.h
        with pytest.raises(InputError, match='cannot go on from a state of lagrange_canonical'):
            states.find(NAME, scene, sim.state, 'alf1')


@pytest.mark.parametrize('there', [False, True], ids=['first', 'again'])
def test_a_state_that_finds_the_disk_full_is_whole_or_not_there(
    folder: Path, sim: Simulation, there: bool
) -> None:
    place, saved = file(folder, sim), SavedStates(folder)
    before = place.read_bytes()
    if not there:
        place.unlink()
    with small_files(64), pytest.raises(InputError, match=r'in memory only: .*too large'):
        saved.save(NAME, sim.scene, sim)
    assert list(place.parent.iterdir()) == ([place] if there else [])
    assert not there or place.read_bytes() == before
    assert bits(saved.find(NAME, sim.scene, sim.state)[0]) == bits(sim.state)


Change = Callable[[dict[str, Any]], Any]
CHANGES: dict[str, Change] = {
    'before zero': lambda d: d['state'].update(step=-1),
    'part of a step': lambda d: d['state'].update(step=1.5),
    'step is true': lambda d: d['state'].update(step=True),
    'step beyond numbers': lambda d: d['state'].update(step=10**400),
    'late': lambda d: d['state'].update(step=2**60),
    'no step': lambda d: d['state'].pop('step'),
    'few': lambda d: d['state']['q'].pop(),
    'text': lambda d: d['state'].update(q='0' * 99),
    'text in a list': lambda d: d['state']['q'].__setitem__(0, '0'),
    'nan': lambda d: d['state']['qd'].__setitem__(0, float('nan')),
    'infinite': lambda d: d['state']['qd'].__setitem__(0, float('inf')),
    'beyond numbers': lambda d: d['state']['q'].__setitem__(0, 10**400),
    'a list in a list': lambda d: d['state']['q'].__setitem__(0, [0.0]),
    'parts of turns': lambda d: d['state']['turns'].__setitem__(0, 0.5),
    'very many turns': lambda d: d['state']['turns'].__setitem__(0, 2**70),
    'pace': lambda d: d['state'].update(pace=float('nan')),
    'pace before zero': lambda d: d['state'].update(pace=-1.0),
    'carried': lambda d: d['state'].update(carried=[1.0]),
    'no inputs': lambda d: d['state'].pop('inputs'),
    'inputs': lambda d: d['state'].update(inputs=[]),
    'wrenches': lambda d: d['state']['inputs'].update(wrenches=3),
    'a wrench': lambda d: d['state']['inputs']['wrenches'].update(coupler=[]),
    'a force': lambda d: d['state']['inputs']['wrenches']['coupler'].update(force='12'),
    'no force': lambda d: d['state']['inputs']['wrenches']['coupler'].pop('force'),
    'more of a wrench': lambda d: d['state']['inputs']['wrenches']['coupler'].update(x=1),
    'effort': lambda d: d['state']['inputs']['efforts'].update(crank_pin='a'),
    'curve': lambda d: d['state']['inputs']['efforts'].update(crank_pin=[[1.0, 2.0]]),
    'curve of text': lambda d: d['state']['inputs']['efforts'].update(crank_pin=['1234567']),
    'no curve': lambda d: d['state']['inputs']['efforts'].update(crank_pin=[3]),
    'target': lambda d: d['state']['inputs'].update(targets={'crank_pin': 1.0}),
    'works': lambda d: d['state'].update(works={'gravity': None}),
    'no state': lambda d: d.pop('state'),
    'no mapping': lambda d: d.update(state=[1, 2]),
    'step size': lambda d: d.update(step_s=0.0),
    'no step size': lambda d: d.update(step_s='1'),
    'order': lambda d: d.update(q={}),
    'order beyond numbers': lambda d: d.update(q=[10**400]),
    'format': lambda d: d.update(alf_ros_state=2),
    'mechanism': lambda d: d.update(mechanism_sha256='0' * 64),
}


@pytest.mark.parametrize('change', CHANGES)
def test_what_is_no_state_is_refused_in_one_line(
    folder: Path, sim: Simulation, change: str
) -> None:
    path = file(folder, sim)
    document = json.loads(path.read_text())
    CHANGES[change](document)
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match='not a state of this scene') as refused:
        SavedStates(folder).find(NAME, sim.scene, sim.state)
    assert '\n' not in str(refused.value)


@pytest.mark.parametrize(
    'text',
    [b'', b'\xff\xfe', b'{"a": ', b'[' * 200_000, b'{"a":' * 200_000, b'[1, 2]', b'null', b'3'],
)
def test_a_file_that_is_none_is_refused_in_one_line(
    folder: Path, sim: Simulation, text: bytes
) -> None:
    file(folder, sim).write_bytes(text)
    with pytest.raises(InputError, match='not a s') as refused:
        SavedStates(folder).find(NAME, sim.scene, sim.state)
    assert '\n' not in str(refused.value)


def test_a_file_is_read_no_further_than_a_state_can_go(folder: Path, sim: Simulation) -> None:
    path = file(folder, sim)
    path.unlink()
    with open(path, 'wb') as stream:
        stream.truncate(2**33)  # without taking room
    with pytest.raises(InputError, match=r'more than \d+ bytes'):
        SavedStates(folder).find(NAME, sim.scene, sim.state)


@pytest.mark.parametrize(
    'name', ['', '../there', 'a/b', '\x00', 'x' * 101, '.hidden', 'é', '\ud800', ' ']
)
def test_a_name_that_no_file_can_have_is_refused(folder: Path, sim: Simulation, name: str) -> None:
    saved = SavedStates(folder)
    with pytest.raises(InputError, match='name of a state'):
        saved.save(name, sim.scene, sim)
    with pytest.raises(InputError, match='name of a state'):
        saved.find(name, sim.scene, sim.state)


LEAVES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3), st.just(10**400)
)
TREES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=6,
)


@settings(
    max_examples=60 if LONG else 25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_whatever_stands_in_a_state_it_is_read_or_refused(
    data: st.DataObject, sim: Simulation
) -> None:
    """Any part of one, at any depth, replaced by anything that JSON can say."""
    document = json.loads(json.dumps(as_data(sim.state)))
    at: Any = document
    while True:
        keys = sorted(at) if isinstance(at, dict) else list(range(len(at)))
        key = data.draw(st.sampled_from(keys))
        if not (isinstance(at[key], (dict, list)) and at[key] and data.draw(st.booleans())):
            break
        at = at[key]
    at[key] = data.draw(TREES)
    before, other = bits(sim.state), copy.copy(sim)
    try:
        state = from_data(document, sim.state)
    except ValueError as error:
        assert '\n' not in str(error)
        return
    try:
        other.restore(state)
    except AlfError as error:
        assert '\n' not in str(error) and bits(other.state) == before
        return
    assert other.step_index == state.step
