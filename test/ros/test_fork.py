"""`fork`: without changes it is its parent bit for bit, with changes what Python makes of it."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError, Simulation, load_scene
from alf_ros.__main__ import main
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.logs.rerun import in_order, read_state
from alf_ros.ros.recording.recorder import Split
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.scene import overrides
from alf_ros.scene.effect_values import with_effect_values
from alf_ros.simulation import setup as settings
from support.log_files import Retold, make, push, rewritten
from support.thorough import thinned


def eventful(folder, scene='slider_crank', recorded=None, **solver):
    """A log of pushes, other gravity, another step and another tick."""
    setup = settings.made(load_scene(scene), solver)
    run = LogRun(folder, setup, **({'recorded': recorded} if recorded else {}))
    run.send()
    body = setup.simulation.model.body_names[-1]

    def change(effects, steps, **solver):
        nonlocal setup
        simulation = setup.simulation
        solver = {**dataclasses.asdict(simulation.solver), **solver}
        after = Simulation(with_effect_values(setup.scene, effects), **solver)
        after.restore(settings.on_grid(simulation.state, simulation.h, after.h))
        setup = settings.Setup(with_effect_values(setup.scene, effects), after, steps)
        run.use(setup)
        run.note(
            {'kind': 'settings', 'solver': solver, 'steps_per_tick': steps, 'effects': effects}
        )

    for tick in range(1, 201):
        setup.simulation.step(setup.steps)
        run.send()
        if tick in (30, 31, 90, 150):
            push(run, body, float(np.sin(tick)))
        if tick == 60:
            gravity = [0.1] + [-3.3] * (setup.simulation.model.layout.dimension - 1)
            change({'effects.gravity.acceleration': gravity}, setup.steps)
        if tick == 120:
            change({}, 2 * setup.steps, step=setup.simulation.h / 2)
        if tick == 160:
            change({}, setup.steps // 2)
    run.close()
    return load(run.recorder.folder)


@pytest.fixture(scope='module')
def parent(tmp_path_factory):
    return eventful(tmp_path_factory.mktemp('parent'))


def messages(log, after=0):
    """(topic, stamp, numbers) of all samples from a stamp on."""
    found = []
    for piece in log.pieces():
        for series, row in in_order(piece):
            if series.columns and series.stamp[row] >= after:
                numbers = [c[row].tobytes() for c in series.columns.values()]
                found.append((series.topic, int(series.stamp[row]), series.names, numbers))
    return found


def entries(log, after=0.0):
    """The entries of the journal from a time on, without their seals in the chain."""
    acts = [entry for entry in log.inputs if entry['kind'] != 'start' and entry['t'] >= after]
    return [{k: v for k, v in entry.items() if k != 'seal'} for entry in acts]


def forked(log, folder, *options):
    new = folder / 'fork'
    assert main(['fork', str(log.path), '-o', str(new), *options]) == 0
    return load(new)


@pytest.mark.parametrize(
    'at', thinned([0.0, 0.05, 0.06, 0.12, 0.2405, 0.299, 0.36], keep=[0.0, 0.06, 0.2405, 0.36])
)
def test_without_changes_a_fork_is_its_parent_bit_for_bit(parent, tmp_path, at, capsys):
    child = forked(parent, tmp_path, '--at', str(at))
    start = child.info['parent']['t']
    assert at - 0.002 < start <= at
    stamp = max(1, round(start * 1e9))
    wanted = messages(parent, stamp)
    assert messages(child) == wanted and len(wanted) >= 5
    assert entries(child) == entries(parent, start)
    assert child.scene_text == parent.scene_text or start > 0.12
    assert child.info['parent']['log'] == parent.path.name
    assert child.info['parent']['seal'] == parent.inputs[0]['seal']
    assert compare(child).equal
    assert f'from t = {start:.9g} s of {parent.path.name} to t = {parent.end:.9g} s' in (
        capsys.readouterr().out
    )


@pytest.mark.parametrize(
    ('scene', 'solver'),
    thinned(
        [
            ('slider_crank', {'integrator': 'dop853_adaptive'}),
            ('slider_crank', {'formulation': 'canonical'}),
            ('slider_crank', {'accuracy': 1e-9}),
            ('stewart_platform', {}),
            ('differential_drive_cart', {}),
        ],
        keep=lambda scene, solver: 'accuracy' not in solver and scene != 'stewart_platform',
    ),
)
def test_what_every_kind_of_state_holds_goes_on(tmp_path, scene, solver):
    path, simulation = make(tmp_path, scene, 100, push_at=40, **{})
    if solver:
        setup = settings.made(load_scene(scene), solver)
        run = LogRun(tmp_path / 'other', setup)
        run.send()
        for _ in range(100):
            setup.simulation.step(setup.steps)
            run.send()
        run.close()
        path = run.recorder.path
    log = load(path.parent)
    t = float(log.time(log.read('~/state').stamp)[57])
    child = forked(log, tmp_path, '--at', repr(t))
    assert messages(child) == messages(log, round(t * 1e9)) and compare(child).equal


@pytest.mark.parametrize(
    ('change', 'integrator', 'accuracy'),
    [
        ('solver.accuracy=1e-9', 'dop853', 1e-9),
        ('solver.tolerance=1e-7', 'rk4', None),
        ('coupler.mass=1.1', 'rk4', 1e-6),
    ],
)
def test_an_accuracy_picks_again_only_if_it_is_changed(tmp_path, change, integrator, accuracy):
    setup = settings.made(load_scene('slider_crank'), {'accuracy': 1e-6})
    run = LogRun(tmp_path / 'parent', setup)
    run.send()
    for _ in range(50):
        setup.simulation.step(setup.steps)
        run.send()
    run.close()
    child = forked(load(run.recorder.path.parent), tmp_path, '--at', '0.05', '--set', change)
    solver = child.info['solver']
    assert (solver['integrator'], solver['accuracy']) == (integrator, accuracy)
    assert compare(child).equal


def test_a_log_without_states_is_run_to_the_instant(tmp_path):
    log = eventful(tmp_path, recorded=('joint_states', '~/energy'))
    assert '/simulator/state' not in log.survey.counts
    child = forked(log, tmp_path, '--at', '0.2')
    assert set(child.survey.counts) == set(log.survey.counts)
    assert messages(child) == messages(log, 200_000_000) and compare(child).equal


def test_a_fork_of_a_fork_is_a_fork(parent, tmp_path):
    child = forked(parent, tmp_path, '--at', '0.1')
    (tmp_path / 'deeper').mkdir()
    grandchild = forked(child, tmp_path / 'deeper', '--at', '0.2', '--duration', '0.05')
    wanted = [m for m in messages(parent, 200_000_000) if m[1] <= 250_000_000]
    assert messages(grandchild) == wanted and grandchild.info['parent']['log'] == 'fork'


def ended_early(folder):
    """A log in which requests ended two ticks after one of their two steps: for a push, and for
    nothing that the journal has."""
    setup = settings.made(load_scene('slider_crank'), {})
    run = LogRun(folder, setup)
    run.send()
    for tick in range(1, 31):
        setup.simulation.step(1 if tick in (12, 20) else setup.steps)
        run.send()
        if tick == 12:
            push(run, 'coupler', 30.0)
    run.close()
    return load(run.recorder.folder)


@pytest.mark.parametrize('at', [0.01, 0.023, 0.03])
def test_ticks_end_where_those_of_the_parent_do(tmp_path, at):
    log = ended_early(tmp_path)
    assert {0.023, 0.037, 0.038} <= set(log.states.t.round(9).tolist())
    child = forked(log, tmp_path, '--at', str(at))
    start = child.info['parent']['t']
    assert messages(child) == messages(log, round(start * 1e9)) and compare(child).equal
    assert entries(child) == entries(log, start)


def test_an_input_between_other_steps_is_refused(tmp_path, capsys):
    """It acted half a step late, without a word."""
    log = ended_early(tmp_path)
    long = ['--at', '0.01', '--set', 'solver.step=2e-3']
    assert main(['fork', str(log.path), *long, '-o', str(tmp_path / 'new')]) == 2
    said = '--set solver.step: the log has an input at t = 0.023 s, which lies between such steps'
    assert capsys.readouterr().err == f'alf_ros fork: {said}, got 0.002\n'
    assert not (tmp_path / 'new').exists()
    before = forked(log, tmp_path, *long, '--duration', '0.012')
    assert round(float(before.states.t[-1]), 9) == 0.022 and compare(before).equal
    fine = forked(log, tmp_path / 'fine', '--at', '0.01', '--set', 'solver.step=5e-4')
    assert fine.inputs[1]['t'] == 0.023 and compare(fine).equal


def test_changes_are_those_of_python(tmp_path):
    path, _ = make(tmp_path, 'slider_crank', 300, push_at=50)
    log = load(path.parent)
    changes = ['coupler.mass=1.1', 'gravity.acceleration=[0, -1.62]', 'solver.step=5e-4']
    child = forked(log, tmp_path, '--at', '0.3', '--set', *changes)
    assert child.info['parent']['changes'] == dict(c.split('=') for c in changes)
    scene = child.scene()
    masses = {body.name: body.mass for body in scene.mechanism.bodies}
    assert masses['coupler'] == 1.1 and masses['crank'] == 1.0
    before = Simulation(log.scene())
    before.step(98)
    before.apply_wrench('coupler', [1.0 / 3.0, 0.0])
    before.step(202)
    after = Simulation(scene, step=5e-4)
    after.restore(settings.on_grid(before.state, 1e-3, 5e-4))
    assert child.states.q[0].tolist() == before.sample().q.tolist()
    assert child.states.qd[0].tolist() == before.sample().qd.tolist()
    after.step(4)
    assert child.states.step[:2].tolist() == [600, 604]
    assert child.states.q[1].tolist() == after.sample().q.tolist()
    assert compare(child).equal and child.end == log.end
    at_once = np.abs(child.states.qd[1] - log.states.qd[151]).max()
    assert 1e-3 < at_once < 1.0


def test_another_geometry_is_closed_and_keeps_its_momentum(tmp_path):
    path, _ = make(tmp_path, 'four_bar', 200)
    log = load(path.parent)
    child = forked(log, tmp_path, '--at', '0.15', '--set', 'b=0.31')
    first = Simulation(child.scene())
    first.restore(read_state(child, first))
    found = first.sample().diagnostics
    assert found.position_violation < 1e-12 and found.velocity_violation < 1e-12
    moved = np.abs(child.states.q[0] - log.states.q[75]).max()
    assert 1e-4 < moved < 0.02
    turned = np.abs(child.states.qd[0] - log.states.qd[75]).max()
    assert 0.0 < turned < 0.5 * np.abs(log.states.qd[75]).max()
    assert compare(child).equal


COUPLED = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    C: {at: [0.3, 0], fixed: true}
    E: {at: [0.6, 0], fixed: true}
    A: {at: [0.05, 0.09]}
    B: {at: [0.25, 0.24]}
    F: {at: [0.6, 0.1]}
    P: {at: [0.28, 0.12]}
    Q: {at: [0.4, 0.12]}
  bodies:
    crank: {points: [O, A], mass: 0.1, inertia: rod}
    coupler: {points: [A, B], mass: 0.2, inertia: rod}
    rocker: {points: [C, B], mass: 0.2, inertia: rod}
    arm: {points: [E, F], mass: 0.2, inertia: rod}
    slide: {points: [P, Q], mass: 0.1, inertia: rod}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O}
    knee: {type: revolute, between: [crank, coupler], at: A}
    wrist: {type: revolute, between: [coupler, rocker], at: B}
    foot: {type: revolute, between: [ground, rocker], at: C}
    elbow: {type: revolute, between: [ground, arm], at: E}
    rail: {type: prismatic, between: [rocker, slide], at: P, axis: [0.05, 0.24]}
  couplings:
    belt: {joints: {elbow: 1, pin: 0.5}}
    cam: {joints: {rail: 1, foot: -0.1}}
effects: {gravity: {acceleration: [0, -9.81]}}
initial: {velocities: {A: [-2.7, 1.5]}}
solver: {step: 5.0e-4, integrator: rk4}
"""


@pytest.fixture(scope='module')
def coupled(tmp_path_factory):
    folder = tmp_path_factory.mktemp('coupled')
    (folder / 'scene.yaml').write_text(COUPLED, 'utf-8')
    path, _ = make(folder, folder / 'scene.yaml', 200)
    return load(path.parent)


@pytest.mark.parametrize(
    ('at', 'change', 'lever'),
    [
        ('0.05', 'B.at.0=0.26', -0.1),
        ('0.35', 'B.at.0=0.26', -0.1),  # after turns of the crank
        ('0.35', 'C.at=[0.31, 0.01]', -0.1),
        ('0.35', 'mechanism.couplings.cam.joints.foot=-0.15', -0.15),
    ],
)
def test_couplings_keep_their_drawn_value_where_a_length_changes(
    coupled, tmp_path, at, change, lever
):
    child = forked(coupled, tmp_path, '--at', at, '--set', change, '--duration', '0.04')
    joints = child.read('joint_states')
    x = dict(zip(joints.names, joints.columns['position'].T, strict=True))
    drawn = Simulation(child.scene()).sample().joints
    for one, factor, other in (('elbow', 0.5, 'pin'), ('rail', lever, 'foot')):
        value = drawn[one].position + factor * drawn[other].position
        assert np.abs(x[one] + factor * x[other] - value).max() < 1e-10
    assert np.ptp(x['pin']) > 0.1
    assert compare(child).equal


def test_a_coupling_that_would_have_to_leap_is_refused_in_one_line(coupled, tmp_path, capsys):
    belt = 'mechanism.couplings.belt.joints.pin=1.5'
    options = ['--at', '0.35', '--set', belt, '-o', str(tmp_path / 'fork')]
    assert main(['fork', str(coupled.path), *options]) != 0
    said = capsys.readouterr().err.splitlines()
    assert 'from this instant, ' in said[-1] and 'belt' in said[-1]


def test_initial_velocities_that_contradict_each_other_with_a_change_do_not_matter(
    tmp_path, capsys
):
    """They are of the run from its start. The new log has none, and can be verified and forked."""
    drawn = load_scene('slider_crank')
    start = Simulation(drawn).sample().velocities
    speeds = {name: start[name].tolist() for name in ('A', 'B')}
    changes = {'initial.velocities': json.dumps(speeds)}
    (tmp_path / 'scene.yaml').write_text(overrides.with_changes(drawn, changes).text, 'utf-8')
    path, _ = make(tmp_path, tmp_path / 'scene.yaml', 100)
    length = 'mechanism.points.A.at=[0.5,0.8]'
    with pytest.raises(InputError, match='expected at most 1 of these 4 components: as many'):
        Simulation(
            overrides.with_changes(load_scene(tmp_path / 'scene.yaml'), overrides.read([length]))
        )
    capsys.readouterr()
    child = forked(load(path.parent), tmp_path, '--at', '0.1', '--set', length)
    said = capsys.readouterr().err
    assert said.count('\n') == 1 and 'without initial.velocities in the scene' in said
    assert '(x given) is off by' in said
    assert not child.scene().velocities and np.abs(child.states.qd[0]).max() > 0.1
    assert child.info['parent']['changes'] == {'mechanism.points.A.at': '[0.5,0.8]'}
    assert compare(child).equal
    again = forked(child, tmp_path / 'again', '--at', '0.15', '--set', 'm=1.5')
    assert compare(again).equal
    kept = forked(load(path.parent), tmp_path / 'kept', '--at', '0.1', '--set', 'm=1.5')
    assert kept.scene().velocities


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        (['L=1.2'], 'A (y given) is off by 0.'),
        (['push.force=[0,0]', 'gravity.acceleration=[1,-9.81]'], 'equally on two branches'),
    ],
)
def test_initial_positions_that_a_change_makes_impossible_do_not_matter(
    tmp_path, capsys, changes, reason
):
    """A length contradicts them, or forces leave from there in two ways: the fork begins where
    the push has moved the slider to."""
    effects = {
        'gravity': {'acceleration': [0, -9.81]},
        'constant_wrench': {'push': {'on': 'B', 'force': [5, 0]}},
    }
    upright = {'positions': {'A': [0, 1], 'B': [0, 0]}}
    scene = {'mechanism': 'slider_crank', 'effects': effects, 'initial': upright}
    (tmp_path / 'scene.yaml').write_text(json.dumps(scene), 'utf-8')
    path, _ = make(tmp_path, tmp_path / 'scene.yaml', 60)
    capsys.readouterr()
    log = load(path.parent)
    child = forked(log, tmp_path, '--at', '0.1', '--set', *changes)
    said = capsys.readouterr().err
    assert said.count('\n') == 1 and reason in said
    assert 'without initial.positions in the scene' in said
    assert not child.scene().positions
    before = log.states.q[np.searchsorted(log.states.t, 0.1)]
    assert before[2] > 0.02 and np.abs(child.states.q[0] - before).max() < 0.25
    assert compare(child).equal


def test_an_angle_that_is_moved_over_half_a_turn_goes_on(tmp_path):
    """Another length moves the crank by a little; its angle must not begin a turn away."""
    path, _ = make(tmp_path, 'four_bar', 100)
    log = load(path.parent)
    joints = log.read('joint_states')
    angles, crank = joints.columns['position'], joints.names.index('crank_pin')
    over = int(np.flatnonzero(np.diff(angles[:, crank] > np.pi))[0])
    beyond = set()
    for k in (over, over + 1):
        for b in ('0.28', '0.32'):
            at, own = f'{log.states.t[k]:.9g}', tmp_path / f'{k}_{b}'
            new = forked(log, own, '--at', at, '--set', f'b={b}', '--duration', '0.002')
            begin = new.read('joint_states').columns['position'][0]
            assert 0.0 < np.abs(begin - angles[k]).max() < 0.3
            beyond.add((k > over, bool(begin[crank] > np.pi)))
    assert {(False, True), (True, False)} <= beyond  # both ways over half a turn


def test_settings_to_come_do_not_take_a_change_back(parent, tmp_path):
    child = forked(parent, tmp_path, '--at', '0.1', '--set', 'solver.penalty=3e8', 'm=1.5')
    (gravity, step, tick) = (e for e in child.inputs if e['kind'] == 'settings')
    assert [e['solver']['penalty'] for e in (gravity, step, tick)] == [3e8] * 3
    assert (gravity['solver']['step'], step['solver']['step']) == (1e-3, 5e-4)
    assert compare(child).equal and child.states.t.tolist() == parent.states.t[50:].tolist()
    moon = forked(
        parent, tmp_path / 'moon', '--at', '0.1', '--set', 'gravity.acceleration=[0,-1.62]'
    )
    assert all(not e['effects'] for e in moon.inputs if e['kind'] == 'settings')
    assert compare(moon).equal


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['--at', '9'], 'not within the log.*from 0 to 0.36 s'),
        (['--at', '-1'], 'not within the log'),
        (['--at', 'x'], 'invalid float'),
        (['--at', '0.1', '--duration', '-1'], '--duration: not usable, got -1.*0 or more'),
        (
            ['--at', '0.1', '--duration', '1e300'],
            '--duration: the stamps of ROS end at 2147483647 s, got 1e.300.*at most 2147483647 s',
        ),
        ([], 'required.*--at'),
        (['--at', '0.1', '--set', 'couple.mass=1'], "did you mean 'coupler'"),
        (['--at', '0.1', '--set', 'coupler.mas=1'], "did you mean 'mass'"),
        (['--at', '0.1', '--set', 'coupler.mass'], 'expected NAME=VALUE'),
        (['--at', '0.1', '--set', 'coupler.mass=-1'], 'mass'),
        (
            ['--at', '0.1', '--set', 'solver.step=7e-4'],
            'solver.step: the fork begins at t = 0.1 s, which is not a whole number of such steps',
        ),
        (
            ['--at', '0.1', '--set', 'solver.step=5e-3'],
            'solver.step: the log has ticks of 0.002 s, which are not a whole number of such',
        ),
        (
            ['--at', '0.1', '--set', 'solver.formulation=canonical'],
            'solver.formulation: cannot go on from a state of alf2.*got .*canonical',
        ),
        (['--at', '0.1', '--set', 'effects.gravity.acceleration.7=1'], 'no such place'),
        (['--at', '0.1', '--set', 'L=0'], 'L|points|length'),
        (
            ['--at', '0.1', '--set', 'initial.velocities.A.0=1'],
            'initial.velocities.A.0.*no effect: a fork begins in the state of the log|no effect',
        ),
    ],
)
def test_what_cannot_be_is_one_line(parent, tmp_path, options, said, capsys):
    code = main(['fork', str(parent.path), '-o', str(tmp_path / 'new'), *options])
    error = capsys.readouterr().err
    assert code == 2 and len(error.strip().splitlines()) == 1
    assert re.search(said, error), error
    assert not (tmp_path / 'new').exists()


@pytest.mark.parametrize(
    ('edit', 'said'),
    [
        (lambda k, entry: None if k == 2 else entry, '1 inputs are missing before step'),
        (lambda k, entry: {**entry, 'force': [9.0, 0.0]} if k == 2 else entry, 'changed after it'),
        (lambda k, entry: entry if k < 5 else None, 'its inputs give another motion'),
    ],
    ids=['missing', 'changed', 'the last ones are missing'],
)
def test_inputs_that_are_not_the_ones_of_the_run_are_refused(parent, tmp_path, edit, said, capsys):
    spoilt = rewritten(parent.files[0], tmp_path, change=Retold(edit))
    assert main(['fork', str(spoilt), '--at', '0.1', '-o', str(tmp_path / 'new')]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count('\n') == 1
    assert not (tmp_path / 'new').exists()


def test_inputs_in_a_file_that_is_not_there_are_not_passed_over(tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank', 400, push_at=350, split=Split(duration=0.2))
    sorted(path.parent.glob('*.mcap'))[-1].unlink()
    options = ['fork', str(path.parent), '--at', '0.5', '-o', str(tmp_path / 'new'), '--duration']
    assert main([*options, '0.3']) == 2
    said = capsys.readouterr().err
    assert '1 of its 4 files are not there' in said and 'at most 0.1 s' in said
    assert main([*options, '0.1']) == 0


@pytest.mark.parametrize('which', [1, -1])
def test_a_file_that_is_not_there_is_said(which, tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank', 400, push_at=50, split=Split(duration=0.2))
    files = sorted(path.parent.glob('*.mcap'))
    files[which].unlink()
    assert main(['fork', str(path.parent), '--at', '0.1', '-o', str(tmp_path / 'new')]) == 0
    end = 0.8 if which == 1 else 0.6
    said = f'it is the run until t = {end:g} s (1 of its 4 files are not there)'
    assert capsys.readouterr().err == f'alf_ros fork: the log is not whole: {said}\n'


def test_what_is_there_is_not_written_over(parent, tmp_path, capsys):
    (tmp_path / 'new').mkdir()
    assert main(['fork', str(parent.path), '--at', '0.1', '-o', str(tmp_path / 'new')]) == 2
    assert list((tmp_path / 'new').iterdir()) == []
    said = f"--output: exists already, and is left as it is, got '{tmp_path / 'new'}'"
    assert f'{said}; expected another folder: -o' in capsys.readouterr().err


def test_by_default_it_lies_beside_its_parent(tmp_path):
    path, _ = make(tmp_path, 'slider_crank', 20)
    before = set(tmp_path.iterdir())
    assert main(['fork', str(path), '--at', '0.01']) == 0
    (new,) = set(tmp_path.iterdir()) - before
    assert isinstance(new, Path) and json.dumps(load(new).info['parent']['changes']) == '{}'


@pytest.mark.parametrize('step, told', [(0.01, False), (0.05, True)])
def test_steps_that_are_too_long_are_told_on_stderr(step, told, tmp_path, capsys):
    setup = settings.made(load_scene('slider_crank'), {'step': step, 'integrator': 'rk4'})
    run = LogRun(tmp_path, setup)
    run.send()
    for _ in range(200):
        setup.simulation.step(setup.steps)
        run.send()
    run.close()
    made = str(run.recorder.folder)
    for command in (['verify', made], ['fork', made, '--at', f'{step}', '-o', f'{tmp_path}/new']):
        assert main(command) == 0
        text = f'alf_ros {command[0]}: steps of {step:g} s are too long'
        assert (text in capsys.readouterr().err) == told
