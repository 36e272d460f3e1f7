"""Calls say no in one line, and leave what they are called on as it was.

Public methods and their parameters are found by looking: one without its case here fails.
"""

from __future__ import annotations

import copy
import inspect
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import alf_ros
from alf_ros import AlfError, InputError, Simulation, State, StepError, load_scene
from alf_ros.simulation.input_values import NO_INPUTS, Target, Wrench
from support.runs import bits
from support.thorough import LONG

SCENE: dict[str, Any] = {
    'mechanism': 'slider_crank',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'motor': {
            'joint': 'crank_pin',
            'position': 0.0,
            'position_gain': 5.0,
            'velocity_gain': 1.0,
        },
    },
    'initial': {'velocities': {'B': [-4.0, 0]}},
    'solver': {'step': 1e-3, 'integrator': 'rk4'},
}
NAN, INF = math.nan, math.inf
# of each public method: arguments that it takes
TAKEN: dict[str, dict[str, Any]] = {
    'step': {'n': 2},
    'stop': {},
    'run': {'duration': 0.004, 'every': 2, 'at': None},
    'restore': {'state': None},  # its own one
    'reset': {},
    'with_solver': {'integrator': 'esdirk43_adaptive', 'tolerance': 1e-6},
    'place': {'body': 'crank', 'pose': None, 'twist': [0.0, 0.0, 1.0], 'branch': None},
    'apply_wrench': {
        'name': 'coupler',
        'force': [0.0, 5.0],
        'torque': 0.1,
        'at': 'A',
        'frame': 'world',
    },
    'apply_effort': {'joint': 'crank_pin', 'effort': 1.0},
    'apply_target': {'joint': 'crank_pin', 'position': 1.0, 'velocity': 0.0},
    'clear_inputs': {},
    'sample': {},
}
# of each parameter: values that are refused, and a word of the line that says so
REFUSED: dict[tuple[str, str], list[tuple[Any, str]]] = {
    ('step', 'n'): [
        *((n, 'whole number') for n in (-5, 1.5, NAN, INF, '3', True, None, [1], 2**60)),
    ],
    ('run', 'duration'): [
        *((x, 'finite number, 0 or more') for x in (NAN, INF, -0.1, '1', None, True)),
        (1e300, 'too many steps'),
    ],
    ('run', 'every'): [(n, 'whole number from 1') for n in (0, -1, 1.5, NAN, '2', None)],
    ('run', 'at'): [
        ([0.5, 0.2], 'ascend'),
        ([-1.0], 'past'),
        ([NAN], 'finite'),
        ([INF], 'finite'),
        (['0.1'], 'finite'),
        ('0.1', 'finite'),
        (0.1, 'finite'),
        ([1e300], 'finite'),
        (np.zeros((2, 2)), 'finite'),
    ],
    ('restore', 'state'): [(None, 'not a state'), ({}, 'not a state'), (1, 'not a state')],
    ('with_solver', 'integrator'): [
        ('rk5', "did you mean 'rk4'"),
        *((x, 'unknown integrator') for x in ('', 4, [1])),
    ],
    ('with_solver', 'tolerance'): [(x, 'expected') for x in (NAN, INF, -1.0, '1', True, 10**400)],
    ('place', 'body'): [('crnk', "did you mean 'crank'"), (None, 'not a name'), (3, 'not a name')],
    ('place', 'pose'): [
        ([0.0, 0.0], '3 finite numbers'),
        ([0.0, 0.0, NAN], '3 finite numbers'),
        ('abc', '3 finite numbers'),
        (1.0, '3 finite numbers'),
        ([1e50, 0.0, 0.0], '3 finite numbers'),
        ([9.0, 9.0, 0.0], 'cannot be there'),
    ],
    ('place', 'twist'): [
        ([0.0], '3 finite numbers'),
        ([0.0, INF, 0.0], '3 finite numbers'),
        ({}, '3 finite numbers'),
        ([7.0, 7.0, 0.0], 'cannot move like that'),
    ],
    ('place', 'branch'): [
        *((n, 'whole number from 1') for n in (0, 1.5, NAN, '2', [1])),
        (1, 'not in a singular position'),
    ],
    ('apply_wrench', 'name'): [('copler', "did you mean 'coupler'"), (None, 'not a name')],
    ('apply_wrench', 'force'): [
        ([0.0, NAN], 'finite'),
        ([0.0, INF], 'finite'),
        ([0.0, 1.0, 2.0], '2 finite forces'),
        (5.0, 'finite'),
        ('xy', 'finite'),
        ([True, 0.0], 'finite'),
        (np.zeros((2, 1)), 'finite'),
    ],
    ('apply_wrench', 'torque'): [
        (NAN, 'finite'),
        ('1', 'finite'),
        (None, 'finite'),
        ([1.0, 2.0], 'finite torque'),
    ],
    ('apply_wrench', 'at'): [('O', 'not a point'), (3, 'not a name')],
    ('apply_wrench', 'frame'): [('bod', "did you mean 'body'"), (None, 'not a name')],
    ('apply_effort', 'joint'): [('crankpin', "did you mean 'crank_pin'"), (None, 'not a name')],
    ('apply_effort', 'effort'): [(x, 'finite number') for x in (NAN, INF, '1', None, [1.0], True)],
    ('apply_target', 'joint'): [('crank', "did you mean 'crank_pin'"), ('guide', 'no motor')],
    ('apply_target', 'position'): [(x, 'finite number') for x in (NAN, 'x', [1.0], True)],
    ('apply_target', 'velocity'): [(x, 'finite number') for x in (INF, 'x', [1.0], False)],
}


def methods() -> Iterator[tuple[str, Any]]:
    for name, member in inspect.getmembers(Simulation, inspect.isroutine):
        if not name.startswith('_'):
            yield name, inspect.signature(member).parameters


def properties() -> list[str]:
    found = inspect.getmembers(Simulation, lambda member: isinstance(member, property))
    return [name for name, _ in found if not name.startswith('_')]


def simulation() -> Simulation:
    return copy.copy(_first())


@cache
def _first() -> Simulation:
    sim = Simulation(load_scene(SCENE), ledger=True)
    sim.apply_effort('knee', 0.25)
    sim.step(7)
    return sim


def told(sim: Simulation) -> tuple[Any, ...]:
    """All that a call may change."""
    sample = sim.sample()
    counts = sim.evaluations, sim.rounded_steps, repr(sim.resolution), sim.step_index, sim.t
    return bits(sim.state), sample.energy, sample.works, sample.inputs, counts


def called(sim: Simulation, name: str, arguments: dict[str, Any]) -> None:
    """Call a method; of a run the first three samples are taken."""
    given = dict(arguments)
    if name == 'restore' and given['state'] is None:
        given['state'] = sim.state
    done = getattr(sim, name)(**given)
    if name == 'run':
        list(itertools.islice(done, 3))


def test_every_public_method_and_parameter_has_its_case() -> None:
    assert {name for name, _ in methods()} == set(TAKEN)
    parameters = {(name, p) for name, given in methods() for p in given if p != 'self'}
    assert {(name, p) for name, taken in TAKEN.items() for p in taken} == parameters
    assert set(REFUSED) == parameters


@pytest.mark.parametrize(
    ('name', 'parameter', 'value', 'word'),
    [(*key, *case) for key, cases in REFUSED.items() for case in cases],
)
def test_a_call_says_no_and_changes_nothing(
    name: str, parameter: str, value: Any, word: str
) -> None:
    sim = simulation()
    before = told(sim)
    with pytest.raises(InputError) as refused:
        getattr(sim, name)(**{**TAKEN[name], parameter: value})
    assert word in str(refused.value) and '\n' not in str(refused.value)
    assert told(sim) == before
    sim.step(3)
    other = simulation()
    other.step(3)
    assert bits(sim.state) == bits(other.state)


NUMBERS = st.sampled_from([NAN, INF, -INF, -1, 0, 1, 2, 1.5, -0.5, 1e300, -(2**70), 10**400, True])
WORDS = st.sampled_from(['', 'A', 'crank', 'coupler', 'crank_pin', 'world', 'x' * 500, 'é\n\x00'])
THINGS = st.sampled_from(
    [
        None,
        b'A',
        1j,
        object(),
        np.float32(1.0),
        np.int64(2),
        np.array(1.0),
        np.zeros(3),
        np.full(3, NAN),
        np.zeros((2, 2)),
        np.array(['a', 'b']),
        {},
        {1.0},
        iter(()),
        Wrench((0.0, 1.0)),
        Target(1.0),
        State(
            0, np.zeros(2), np.zeros(2), np.zeros(0, dtype=np.int64), 1.0, np.zeros(0), NO_INPUTS
        ),
    ]
)
JUNK = st.one_of(NUMBERS, WORDS, THINGS, st.lists(st.one_of(NUMBERS, WORDS), max_size=4))


@pytest.mark.parametrize('name', TAKEN)
def test_whatever_a_call_is_given_it_works_or_changes_nothing(name: str) -> None:
    sim = simulation()
    start = sim.state

    @settings(
        max_examples=60 if LONG else 25, deadline=None, suppress_health_check=list(HealthCheck)
    )
    @given(st.data())
    def whatever(data: st.DataObject) -> None:
        arguments = dict(TAKEN[name])
        for parameter in data.draw(st.sets(st.sampled_from(sorted(arguments)), max_size=2)):
            arguments[parameter] = data.draw(JUNK)
        sim.restore(start)
        before = told(sim)
        try:
            called(sim, name, arguments)
        except StepError:
            assert sim.t == sim.step_index * sim.h
        except AlfError as error:
            assert '\n' not in str(error)
            if name != 'run':
                assert told(sim) == before
        assert np.isfinite(sim.sample().q).all()

    if TAKEN[name]:
        whatever()


def holding(state: State, **held: Any) -> State:
    return replace(state, inputs=replace(state.inputs, **held))


# states that are none of the simulation, one way each
NONE: dict[str, Callable[[State], Any]] = {
    'another scene': lambda _: Simulation(load_scene('four_bar')).state,
    'nan': lambda s: replace(s, q=np.full_like(s.q, NAN)),
    'infinite': lambda s: replace(s, qd=np.full_like(s.qd, INF)),
    'shape': lambda s: replace(s, qd=s.qd[:-1]),
    'kind': lambda s: replace(s, q=s.q.astype(np.float32)),
    'list': lambda s: replace(s, q=s.q.tolist()),
    'before zero': lambda s: replace(s, step=-1),
    'part of a step': lambda s: replace(s, step=1.5),  # type: ignore[arg-type]
    'late': lambda s: replace(s, step=2**60),
    'of longer steps': lambda s: replace(s, h=0.3 * s.h),
    'between two steps': lambda s: replace(s, h=NAN),
    'length of steps': lambda s: replace(s, h='1'),  # type: ignore[arg-type]
    'pace': lambda s: replace(s, pace=NAN),
    'turns': lambda s: replace(s, turns=s.turns.astype(float)),
    'carried': lambda s: replace(s, carried=np.zeros(3)),
    'loads': lambda s: replace(s, loads=np.array([NAN])),
    'works': lambda s: replace(s, works={'gravity': NAN}),
    'no works': lambda s: replace(s, works=None),
    'wrench': lambda s: holding(s, wrenches={'nobody': Wrench((0.0, 1.0))}),
    'force': lambda s: holding(s, wrenches={'coupler': Wrench((NAN, 0.0))}),
    'no wrench': lambda s: holding(s, wrenches={'coupler': 3.0}),
    'effort': lambda s: holding(s, efforts={'crank_pin': NAN}),
    'joint': lambda s: holding(s, efforts={'nobody': 1.0}),
    'target': lambda s: holding(s, targets={'guide': Target(1.0)}),
    'inputs': lambda s: replace(s, inputs=None),
}


@pytest.mark.parametrize('which', NONE)
def test_a_state_that_is_none_is_refused_and_changes_nothing(which: str) -> None:
    sim = simulation()
    before = told(sim)
    with pytest.raises(InputError):
        sim.restore(NONE[which](sim.state))
    assert told(sim) == before


def test_a_run_is_checked_when_it_is_called() -> None:
    sim = simulation()
    with pytest.raises(InputError, match='every'):
        sim.run(1.0, every=0)  # not even begun
    run = sim.run(0.01, every=3)
    assert [sample.step for sample in run] == [7, 10, 13, 16]
    assert sim.step_index == 17
    times = [sim.t, sim.t + 0.0005]
    assert [sample.t for sample in sim.run(0.002, at=times)] == pytest.approx(times)
    assert sim.step_index == 19  # a duration is counted from now, as without `at`


@pytest.mark.parametrize(
    ('mapping', 'wrong', 'right'),
    [
        ('tangents', 'coupler.mas', 'coupler.mass'),
        ('points', 'AA', 'A'),
        ('joints', 'crank_pn', 'crank_pin'),
        ('reactions', 'kne', 'knee'),
    ],
)
def test_an_unknown_name_of_a_sample_has_the_nearest_one(
    mapping: str, wrong: str, right: str
) -> None:
    found = getattr(Simulation(load_scene(SCENE), tangents=['coupler.mass']).sample(), mapping)
    with pytest.raises(KeyError) as raised:
        found[wrong]
    assert str(raised.value) == f'nothing of this name, got {wrong!r}; did you mean {right!r}?'
    assert isinstance(raised.value, InputError)
    assert wrong not in found
    assert found.get(wrong) is None
    assert right in found


def test_properties_change_nothing() -> None:
    sim = simulation()
    before = told(sim)
    assert properties()
    for name in properties():
        try:
            getattr(sim, name)
        except InputError as error:
            assert name == 'passes' and 'watch=True' in str(error)
    assert told(sim) == before


@settings(max_examples=60 if LONG else 25, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_a_simulation_is_made_or_refused_in_a_line(data: st.DataObject) -> None:
    names = [p for p in inspect.signature(Simulation).parameters if p not in ('scene', 'accuracy')]
    chosen = data.draw(st.sets(st.sampled_from(names)))
    given: dict[str, Any] = {name: data.draw(JUNK) for name in chosen}
    try:
        scene: Any = data.draw(st.sampled_from([MADE, MADE, None, 'four_bar', 3]))
        Simulation(scene, **given)
    except AlfError as error:
        assert '\n' not in str(error)


MADE = load_scene(SCENE)


@pytest.mark.parametrize('value', [NAN, INF, -1.0, 0.0, 'fine', [1e-3], True])
def test_an_accuracy_that_is_none_is_refused(value: Any) -> None:
    with pytest.raises(InputError, match='accuracy'):
        Simulation(MADE, accuracy=value)


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(source=JUNK, parameters=st.one_of(JUNK, st.dictionaries(WORDS, JUNK, max_size=2)))
def test_a_scene_is_loaded_or_refused_in_a_line(source: Any, parameters: Any) -> None:
    for each in (source, 'slider_crank', {'mechanism': source}):
        try:
            load_scene(each, parameters)
        except AlfError as error:
            assert '\n' not in str(error)


# none that is right and takes hours
RECORDED = {
    'simulation': st.one_of(WORDS, THINGS),
    'duration': st.one_of(WORDS, THINGS, st.sampled_from([NAN, INF, -1.0, True])),
    'every': JUNK,
    'period': st.one_of(WORDS, THINGS, st.sampled_from([NAN, INF, -1.0, 0.0, 1e-300, 1.0, True])),
    'only': JUNK,
}


@settings(max_examples=60 if LONG else 25, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_a_run_is_recorded_or_refused_in_a_line(data: st.DataObject) -> None:
    given: dict[str, Any] = {'simulation': Simulation(MADE), 'duration': 0.01}
    for name in data.draw(st.sets(st.sampled_from(sorted(RECORDED)), max_size=2)):
        given[name] = data.draw(RECORDED[name])
    try:
        alf_ros.record(**given)
    except AlfError as error:
        assert '\n' not in str(error)


STUDIES: dict[Callable[..., Any], dict[str, Any]] = {
    alf_ros.equilibrium: {'scene': JUNK, 't': JUNK, 'nearest': JUNK},
    alf_ros.equilibria: {'scene': JUNK, 'seed': JUNK, 't': JUNK},
    alf_ros.equilibrium_path: dict.fromkeys(
        ('scene', 'over', 'end', 'start', 'back', 't', 'nearest', 'most'), JUNK
    ),
    alf_ros.floquet: {'about': JUNK, 'period': JUNK},
    alf_ros.linearise: {'about': JUNK, 'inputs': JUNK, 'outputs': JUNK},
    alf_ros.modes: {'about': JUNK, 'count': JUNK},
    alf_ros.loads: dict.fromkeys(('motion', 'actuators', 'times', 'weights', 'without'), JUNK),
    alf_ros.fastest: dict.fromkeys(('path', 'limits', 'length', 'pieces', 'without'), JUNK),
    alf_ros.branches: {'at': JUNK},
    alf_ros.assemblies: dict.fromkeys(('mechanism', 'values', 'seed'), JUNK),
    alf_ros.atlas: dict.fromkeys(('mechanism', 'over', 'hold', 'output', 'bar', 'seed'), JUNK),
    alf_ros.ensemble: dict.fromkeys(('scene', 'vary', 'outputs', 'period', 'sampling'), JUNK),
    alf_ros.Ensemble: dict.fromkeys(
        ('scene', 'vary', 'seed', 'sampling', 'efforts', 'observations', 'steps'), JUNK
    ),
    alf_ros.Closure: dict.fromkeys(('mechanism', 'active', 'noise'), JUNK),
    alf_ros.recorded: dict.fromkeys(('t', 'positions', 'velocities', 'inputs', 'name'), JUNK),
    alf_ros.gradient: dict.fromkeys(('source', 'of', 'by', 'duration', 'every'), JUNK),
    alf_ros.identify: dict.fromkeys(
        (
            'scene',
            'recordings',
            'fit',
            'window',
            'hold_out',
            'bounds',
            'priors',
            'noise',
            'loss',
            'delay',
            'topics',
        ),
        JUNK,
    ),
    alf_ros.optimise: dict.fromkeys(
        ('scene', 'vary', 'minimise', 'subject_to', 'seed', 'sampling', 'period'), JUNK
    ),
}
SHORT: dict[str, Any] = {'t': [0.0, 0.01, 0.02], 'positions': {'crank_pin': [0.8, 0.8, 0.8]}}
DRIVEN = load_scene(
    {
        'mechanism': 'slider_crank',
        'drives': {'motor': {'joint': 'crank_pin', 'angle': 'pi/4 + t'}},
    }
)
RIGHT: dict[Any, dict[str, Any]] = {
    alf_ros.loads: {'motion': DRIVEN, 'times': [0.0, 0.1]},
    alf_ros.fastest: {'path': DRIVEN, 'limits': {'crank_pin': 9.0}, 'length': 0.1, 'pieces': 8},
    alf_ros.equilibria: {'starts': 1},
    alf_ros.equilibrium_path: {'over': 'gravity.acceleration.1', 'end': -9.0, 'most': 3},
    alf_ros.floquet: {'period': 0.02},
    alf_ros.ensemble: {'vary': {}, 'members': 1, 'duration': 0.01, 'workers': 0},
    alf_ros.Ensemble: {'members': 2},
    alf_ros.Closure: {'active': ['crank_pin']},
    alf_ros.atlas: {'starts': 1},
    alf_ros.assemblies: {'starts': 1, 'values': {'crank_pin': 0.8}},
    alf_ros.recorded: SHORT,
    alf_ros.gradient: {'of': 'final(points.B.x)', 'by': ['m'], 'duration': 0.01},
    alf_ros.identify: {'recordings': alf_ros.recorded(**SHORT), 'fit': ['m']},
    alf_ros.optimise: {
        'vary': {'m': [0.5, 2.0]},
        'minimise': 'final(energy)',
        'duration': 0.01,
        'designs': 2,
    },
}


@pytest.mark.parametrize('study', STUDIES, ids=lambda study: study.__name__)
@settings(max_examples=12 if LONG else 6, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_a_study_is_made_or_refused_in_a_line(study: Any, data: st.DataObject) -> None:
    first = next(iter(STUDIES[study]))
    given = {first: MADE, **RIGHT.get(study, {})}
    for name in data.draw(st.sets(st.sampled_from(sorted(STUDIES[study])), max_size=2)):
        given[name] = data.draw(STUDIES[study][name])
    try:
        study(**given)
    except AlfError as error:
        assert '\n' not in str(error)


def _type(value: Any) -> str:
    return type(value).__name__


@pytest.mark.parametrize('store', [3, 1.5, b'A', {}, np.zeros(3), 'a\0b'], ids=_type)
def test_a_store_is_a_path(store: Any) -> None:
    with pytest.raises(InputError, match='not a path'):
        alf_ros.ensemble(MADE, {}, 1, store=store, duration=0.01, workers=0)


@pytest.mark.parametrize('every', [0, 1.5, np.zeros(3), 10**400], ids=_type)
def test_a_gradient_is_of_whole_steps(every: Any) -> None:
    with pytest.raises(InputError, match='a whole number from 1'):
        alf_ros.gradient(MADE, **RIGHT[alf_ros.gradient], every=every)


@settings(max_examples=60 if LONG else 25, deadline=None, suppress_health_check=list(HealthCheck))
@given(positions=JUNK, rates=JUNK, t=JUNK, table=JUNK)
def test_loops_are_closed_or_the_call_is_refused_in_a_line(
    positions: Any, rates: Any, t: Any, table: Any
) -> None:
    closure = alf_ros.Closure('slider_crank', active=['crank_pin'])
    good = {'crank_pin': 0.8}
    for call in (
        lambda: closure.close(positions),
        lambda: closure.close({'crank_pin': positions}),
        lambda: closure.close(good, rates=rates),
        lambda: closure.close(good, t=t),
        lambda: closure.follow(table),
        lambda: closure.close(good).travel(table),
    ):
        try:
            call()
        except AlfError as error:
            assert '\n' not in str(error)
    assert closure.close(good).joints['crank_pin'] == pytest.approx(0.8, abs=1e-12)


def test_everything_public_is_told_of_here() -> None:
    """Every public name is in the lists here: a new name needs a test of its refusals."""
    called: list[Callable[..., Any]] = [load_scene, Simulation, alf_ros.record, *STUDIES]
    made_by_calls = [alf_ros.Run, alf_ros.Sample, alf_ros.Scene, State]
    made_by_calls += [alf_ros.Gradient, alf_ros.LoadHistory, alf_ros.FastestRun]
    made_by_calls += [alf_ros.Branches, alf_ros.Atlas, alf_ros.Assemblies]
    made_by_calls += [alf_ros.Equilibrium, alf_ros.EquilibriumPath]
    made_by_calls += [alf_ros.FloquetModel, alf_ros.LinearModel, alf_ros.VibrationModes]
    made_by_calls += [alf_ros.Posture, alf_ros.Identification, alf_ros.Recording, alf_ros.Optimum]
    for name in alf_ros.__all__:
        each = getattr(alf_ros, name)
        assert each in called or each in made_by_calls or issubclass(each, AlfError), name
