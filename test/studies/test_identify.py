"""identify against machines with known numbers: estimates, intervals, combinations."""

from __future__ import annotations

import os
import signal
import threading
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from alf_ros import Identification, Recording, Simulation, identify, load_scene, recorded
from alf_ros.arrays import Floats
from alf_ros.commands.identify import main
from alf_ros.errors import InputError
from alf_ros.scene.overrides import number, with_changes
from alf_ros.studies.identification import identification, posture_track, window_runs
from alf_ros.studies.identification.dated_forces import check_delay
from alf_ros.studies.identification.recording import MeasuredChannel
from support.gripper import GRIPPER
from support.log_files import make
from support.recordings import SLIDER_CRANK, Machine, changed, pushes, scene
from support.thorough import LONG, thinned

FIT = ['coupler.mass', 'pin.viscous']
TRUE = np.array([1.3, 0.4])


@cache
def machine() -> Machine:
    return Machine(scene(coupler__mass=1.3, pin__viscous=0.4), ('crank_pin', 'guide'), 2.0)


@cache
def fitted() -> Identification:
    return identify(scene(), machine().recording(2e-3, seed=1), FIT, window=0.5, hold_out=0.25)


def test_without_noise_the_numbers_are_exact() -> None:
    """From numbers 30 % off, also with positions alone and with efforts within the windows."""
    of = scene(coupler__mass=1.3, pin__viscous=0.4)
    pushed = Machine(of, ('crank_pin', 'guide'), 1.0, inputs=pushes('crank_pin', 2.0, 1.0))
    for each, velocities in ((machine(), True), (pushed, False)):
        found = identify(scene(), each.recording(velocities=velocities), FIT, window=0.5)
        assert found.settled
        assert np.allclose(found.values, TRUE, rtol=1e-7)


IMPLICIT: dict[str, Any] = {'solver.integrator': 'esdirk43_adaptive', 'solver.tolerance': 1e-8}


@pytest.mark.parametrize(
    'settings, seal',
    thinned(
        [({}, 1.3), (IMPLICIT, 1.3), (IMPLICIT, 130.0)],
        keep=lambda settings, seal: (settings == {}) == (seal == 1.3),
    ),
)
def test_a_gripper_with_two_loops(settings: dict[str, Any], seal: float) -> None:
    """Without noise its finger, spring, damper and friction are exact, from numbers 10 % off; also
    with an implicit integrator, and a seal so stiff that explicit ones would be slow."""
    true = {'finger': 0.09, 'return.stiffness': 165.0, 'oil.damping': 1.8, 'seal.viscous': seal}
    of = changed(load_scene(GRIPPER), {**settings, 'seal.viscous': 0.9 * seal})
    inputs = pushes('drive', 2.0, 1.0, 0.2)
    moved = Machine(changed(of, true), ('drive', 'pivot0', 'pivot1'), 1.0, inputs=inputs)
    found = identify(of, moved.recording(), list(true), window=0.5)
    assert np.allclose(found.values, list(true.values()), rtol=1e-6)


def test_starts_that_measurements_hardly_see_stay_slow() -> None:
    """With a delay, the first 0.1 s of a window is not measured, and the damper has stopped the
    gripper by then. With these noises a start ran away, and the fit with it."""
    true = {'finger': 0.09, 'return.stiffness': 165.0, 'oil.damping': 1.8, 'seal.viscous': 1.3}
    of, joints = load_scene(GRIPPER), ('drive', 'pivot0', 'pivot1')
    inputs = [push for k, j in enumerate(joints) for push in pushes(j, 2.0 + 0.4 * k, 2.0, 0.2)]
    inputs.sort(key=lambda push: push.t)
    moved = Machine(changed(of, true), joints, 2.0, inputs=inputs)
    for seed in (20, 218, 624) if LONG else (20,):
        recording = moved.recording(1e-4, seed, delay=0.0078)
        found = identify(of, recording, list(true), window=1.0, delay=True)
        off = (found.values - [*true.values(), 0.0078]) / found.deviations
        assert found.settled and (np.abs(off) < 4.0).all()
        for window, start in zip(found.windows, found.starts, strict=True):
            assert window.chart is not None
            assert np.abs(window.chart.known @ start).max() < 1.0


@pytest.mark.thorough
@pytest.mark.parametrize('begin', thinned([0.9, 1.2], keep=[0.9]))
def test_messages_missing_over_a_singular_position(begin: float) -> None:
    """The knee turns by more than half a turn without a measurement, once also where a window
    begins: the recording was refused, as one with another sense or zero."""
    joints = ('crank_pin', 'knee', 'guide')
    true = Machine(scene(pin__viscous=0.4, rail__viscous=0.25), joints, 3.0)
    kept = (true.t < begin) | (true.t > begin + 0.7)
    recording = recorded(true.t[kept], dict(zip(joints, true.x[kept].T, strict=True)))
    found = identify(scene(), recording, ['pin.viscous', 'rail.viscous'], window=1.0)
    assert np.allclose(found.values, [0.4, 0.25], rtol=1e-6)


@pytest.mark.parametrize('joints', [('knee',), ('crank_pin', 'knee', 'guide')])
def test_turns_that_a_gap_hides_are_counted(joints: tuple[str, ...]) -> None:
    """The knee counts turns and turns by more than half a turn in the gap, by little more than a
    turn in all: its way over the gap was taken for a jump, and the friction was far off."""
    true = Machine(scene(pin__viscous=0.4, rail__viscous=0.25), joints, 1.6)
    kept = (true.t < 0.65) | (true.t > 1.3)
    assert np.ptp(true.x[kept, joints.index('knee')]) < 2.5 * np.pi
    recording = recorded(true.t[kept], dict(zip(joints, true.x[kept].T, strict=True)))
    found = identify(scene(), recording, ['pin.viscous', 'rail.viscous'], window=0.8)
    assert np.allclose(found.values, [0.4, 0.25], rtol=1e-6)


@pytest.mark.parametrize(
    ('first', 'begin', 'gap', 'jumps'),
    [
        (-np.pi, 0.2, 0.0, True),
        (0.0, 0.2, 0.0, True),
        (-3.5, 0.2, 0.0, True),
        (-np.pi, 2.0, 2.5, True),
        (0.0, 5.0, 2.5, True),
        (-20.0, 2.0, 2.5, False),
        (-20.0, 5.0, 3.5, False),
    ],
)
def test_recorded_angles_wrap_or_count_turns(
    first: float, begin: float, gap: float, jumps: bool
) -> None:
    """An angle that turns by 1 rad/s, in a range of a turn or counted, with a gap or without."""
    t = np.linspace(0.0, 2.0 * np.pi - 0.5 * gap, 300)
    t = t[(t < 1.0) | (t > 1.0 + gap)]
    turned = begin + (2.0 if gap else 1.0) * t
    angle = first + (turned - first) % (2.0 * np.pi) if first > -20.0 else turned
    times, values = np.asarray(t, np.float64), np.asarray(angle, np.float64)
    assert posture_track._wraps(MeasuredChannel('pin', 'position', times, values)) == jumps


def test_runs_that_are_not_resolved_are_told() -> None:
    """As of any run with steps that are too long; the fit of the others says nothing."""
    assert fitted().trouble == ''
    long = changed(scene(), {'solver.step': 1e-2, 'initial.velocities.B.0': -12.0})
    recording = Machine(long, ('crank_pin', 'guide'), 2.0).recording(1e-3)
    found = identify(long, recording, ['pin.viscous'], window=1.0)
    assert 'steps of 0.01 s are too long' in found.trouble
    assert f'the runs are not resolved: {found.trouble}' in str(found)


def test_many_windows_begin_with_a_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fit is the same as of all windows from the start, on any number of cores."""
    recording, found = machine().recording(2e-3, seed=3), []
    for many, cores in ((15, 1), (15, 4), (1000, 1)):
        monkeypatch.setattr(identification, '_MANY', many)
        monkeypatch.setattr(window_runs, '_cores', lambda n=cores: n)
        told: list[str] = []
        found.append(identify(scene(), recording, FIT, window=0.1, report=told.append))
        assert ('4 windows first' in told) == (many == 15)
    one, other, whole = found
    assert one.values.tobytes() == other.values.tobytes()
    assert one.deviations.tobytes() == other.deviations.tobytes()
    assert np.abs(one.values - whole.values).max() < 1e-2 * whole.deviations.min()
    # a jacobian serves again within a deviation, where it changes by so much
    assert np.allclose(one.deviations, whole.deviations, rtol=5e-2)


@pytest.mark.skipif(os.name != 'posix', reason='signals of POSIX')
def test_ctrl_c_ends_a_fit_on_all_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the same fit is found afterwards."""
    monkeypatch.setattr(window_runs, '_cores', lambda: 4)
    recording = machine().recording(2e-3, seed=3)

    def interrupt(text: str) -> None:
        if 'evaluations' in text:
            threading.Timer(0.01, signal.raise_signal, [signal.SIGINT]).start()

    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            identify(scene(), recording, FIT, window=0.2, report=interrupt)
    again = identify(scene(), recording, FIT, window=0.2)
    assert (np.abs(again.values - TRUE) < 5.0 * again.deviations).all()


def test_refits_have_no_bias_and_their_intervals_hold() -> None:
    """Six recordings with other noise: z = (estimate - truth) / deviation is a normal number."""
    z = []
    for seed in range(6):
        found = identify(machine().scene, machine().recording(2e-3, seed), FIT, window=1.0)
        z.append((found.values - TRUE) / found.deviations)
    each = np.array(z)
    assert (np.abs(each.mean(axis=0)) < 1.0).all()  # below one sigma
    low, high = stats.chi2.ppf([1e-3, 1.0 - 1e-3], each.shape[0])
    squares = (each**2).sum(axis=0)
    assert ((low < squares) & (squares < high)).all()
    inside = int((np.abs(each) < 1.96).sum())
    assert inside >= stats.binom.ppf(1e-3, each.size, 0.95)


def test_delay_and_quantised_encoders() -> None:
    quantum, delay = 2.0 * np.pi / 4096.0, 0.0123
    of = scene(pin__viscous=0.4)
    driven = Machine(of, ('crank_pin', 'guide'), 2.0, inputs=pushes('crank_pin', 8.0, 2.0))
    recording = driven.recording(quantum=quantum, delay=delay)
    found = identify(scene(), recording, FIT, window=1.0, delay=True)
    assert found.names == (*FIT, 'delay')
    off = (found.values - [1.0, 0.4, delay]) / found.deviations
    assert (np.abs(off) < 4.0).all(), off
    assert found.deviations[2] < 5e-4
    for channel in found.channels:
        assert channel.after == pytest.approx(quantum / np.sqrt(12.0), rel=0.15)


def test_a_window_that_only_just_passes_a_dead_point_is_found() -> None:
    """The crank comes to 0.7 rad/s beside an upright rest, after 20 rad/s: a window that begins a
    little slower turns back there, and no start near its own brings it over."""
    spring = {'between': ['B', 'ground'], 'at': [None, [0.3, 0.6]], 'free_length': 0.2}
    of = load_scene(
        {
            'mechanism': 'four_bar',
            'effects': {
                'gravity': {'acceleration': [0, -9.81]},
                'spring': {'bal': {**spring, 'stiffness': 2}},
                'joint_friction': {'pin': {'joint': 'crank_pin', 'viscous': 1e-3}},
            },
            'initial': {'velocities': {'A': ['-20*a*sin(theta)', '20*a*cos(theta)']}},
            'solver': {'step': 2e-3, 'integrator': 'rk4'},
        }
    )
    moved = Machine(changed(of, {'bal.stiffness': 2.01}), ('crank_pin',), 1.2)
    found = identify(of, moved.recording(1e-4), ['bal.stiffness'], window=0.6)
    assert found.settled
    assert abs(found.values[0] - 2.01) < 4.0 * found.deviations[0] < 4e-3
    assert found.channels[0].after == pytest.approx(1e-4, rel=0.2)


def test_a_delay_needs_what_acts_at_a_known_time() -> None:
    moved, pushed = machine().recording(), pushes('crank_pin', 8.0, 2.0)
    held = [replace(pushed[0], t=t) for t in (0.0, 0.5, 1.0)]  # the same effort again and again
    for inputs in ((), tuple(held)):
        with pytest.raises(InputError, match='^delay: no input, drive or table acts at a known'):
            identify(scene(), replace(moved, inputs=inputs), FIT, delay=True)
    motor = '{push: {joint: crank_pin, effort: [[0, 0], [1, 2]]}}'
    table = '{push: {on: B, table: [[0, 0, 0], [1, 2, 0]]}}'
    drive = '{joint: crank_pin, angle: 0.2*t}'
    check_delay(scene(), [replace(moved, inputs=(*held, replace(pushed[1], t=1.5)))])
    for name, value in (
        ('effects.motor', motor),
        ('effects.user_table', table),
        ('drives.turn', drive),
    ):
        check_delay(with_changes(scene(), {name: value}), [moved])
    constant = with_changes(scene(), {'effects.motor': '{push: {joint: crank_pin, effort: 2}}'})
    with pytest.raises(InputError, match='^delay: '):
        check_delay(constant, [moved])


def test_inputs_between_steps_are_told() -> None:
    """A delay is wrong by the 0.3 ms by which all inputs are off the steps of 2 ms, which neither
    residuals nor intervals show. With steps of 0.1 ms it is not."""
    driven = Machine(
        scene(pin__viscous=0.4), ('crank_pin', 'guide'), 1.0, inputs=pushes('crank_pin', 8.0, 1.0)
    )
    inputs = tuple(replace(each, t=each.t + 3e-4) for each in driven.inputs)
    given = dict(zip(driven.joints, driven.x.T, strict=True))
    recording = recorded(driven.t + 0.0123, given, inputs=inputs, name='run')
    for step, delay in ((2e-3, 0.0123), (1e-4, 0.012)):
        of = changed(scene(), {'solver.step': step})
        found = identify(of, recording, FIT, window=0.5, delay=True)
        assert found['delay'] == pytest.approx(delay, abs=1e-6)
        told = 'inputs of run act at steps of 0.002 s, up to 0.0003 s from their times, which the'
        assert (told in str(found)) == (step == 2e-3)


def test_undetermined_numbers_are_named() -> None:
    """Without a known force, masses and friction have a common factor."""
    names = ['coupler.mass', 'crank.mass', 'pin.viscous', 'rail.viscous']
    found = identify(scene(), machine().recording(2e-3), names, window=1.0)
    (one,) = (each for each in found.undetermined if np.isinf(each.deviation))
    assert {name for name, part in one.parts.items() if abs(part) > 0.02} == set(names)
    assert np.isinf(found.deviations).all()
    assert all(name in one.text for name in names)
    text = str(found)
    assert 'not determined by this recording' in text and 'not determined at all' in text
    # of the numbers that fit as well, those near the scene: nothing has drifted
    assert (found.values > 0.2 * found.before).all() and (found.values < 5.0 * found.before).all()


def test_a_mass_that_never_moves_is_named() -> None:
    pendulum = {'mass': 1.0, 'inertia': 'rod'}
    two = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'name': 'two',
                'space': 'planar',
                'points': {
                    'O': {'at': [0, 0], 'fixed': True},
                    'A': {'at': [1, 0]},
                    'P': {'at': [3, 0], 'fixed': True},
                    'B': {'at': [3, -1]},
                },
                'bodies': {
                    'swings': {'points': ['O', 'A'], **pendulum},
                    'hangs': {'points': ['P', 'B'], **pendulum},
                },
                'joints': {
                    'o': {'type': 'revolute', 'between': ['ground', 'swings'], 'at': 'O'},
                    'p': {'type': 'revolute', 'between': ['ground', 'hangs'], 'at': 'P'},
                },
            },
            'effects': {
                'gravity': {'acceleration': [0, -9.81]},
                'joint_friction': {'oil': {'joint': 'o', 'viscous': 0.3}},
            },
            'solver': {'step': 2e-3, 'integrator': 'rk4'},
        }
    )
    recording = Machine(two, ('o', 'p'), 1.0).recording(1e-3, quantum=1e-4)
    found = identify(two, recording, ['oil.viscous', 'hangs.mass'], window=1.0)
    assert found['oil.viscous'] == pytest.approx(0.3, abs=4 * found.deviations[0])
    (one,) = found.undetermined
    assert one.text == '1.00 hangs.mass'


def test_windows_kept_away() -> None:
    found = fitted()
    assert len(found.windows) == 3 and len(found.kept_away) == 1
    for channel in found.channels:
        assert channel.after == pytest.approx(2e-3, rel=0.2)
        assert channel.held_out == pytest.approx(2e-3, rel=0.3)
        assert channel.before > 1.1 * channel.after
        assert channel.whiteness.white


def test_the_new_scene_is_the_old_one_with_the_numbers() -> None:
    found = fitted()
    expected = changed(scene(), dict(zip(FIT, found.values.tolist(), strict=True)))
    assert found.fitted_scene.text == expected.text


def test_prior_and_bounds() -> None:
    recording = machine().recording(2e-3)
    prior = identify(scene(), recording, FIT, window=1.0, priors={'pin.viscous': (0.25, 1e-6)})
    assert prior['pin.viscous'] == pytest.approx(0.25, abs=1e-5)
    assert prior.deviations[1] == pytest.approx(1e-6, rel=1e-3)
    bound = identify(scene(), recording, FIT, window=1.0, bounds={'coupler.mass': (0.5, 1.1)})
    assert bound.at_bounds == ('coupler.mass',)
    assert bound['coupler.mass'] == pytest.approx(1.1, rel=1e-5)
    low, high = bound.intervals[0]
    assert high == 1.1 and low == pytest.approx(1.1 - 1.96 * bound.deviations[0], rel=1e-4)
    assert bound.bounds.tolist() == [[0.5, 1.1], [0.0, np.inf]]


def test_a_number_that_ends_at_zero_is_at_its_bound() -> None:
    """The crank of the scene is too heavy already, without the armature that is fitted."""
    motor = {'drive': {'joint': 'crank_pin', 'armature': 0.05}}
    geared = load_scene({**SLIDER_CRANK, 'effects': {**SLIDER_CRANK['effects'], 'motor': motor}})
    numbers = {'crank.mass': 1.2, 'coupler.mass': 1.3, 'pin.viscous': 0.4}
    geared = changed(geared, numbers)
    found = identify(geared, machine().recording(2e-3), ['drive.armature'], window=0.5)
    assert found['drive.armature'] < 1e-6 and found.at_bounds == ('drive.armature',)
    assert found.settled
    low, high = found.intervals[0]
    assert low == 0.0 and high == pytest.approx(1.96 * found.deviations[0], rel=1e-3)
    assert '95 %: 0 to ' in str(found) and ', at its bound' in str(found)


def test_outliers_with_a_robust_loss() -> None:
    """One measurement of twenty is off by 0.1: huber does not follow."""
    clean = machine().recording(2e-3)
    rng = np.random.default_rng(8)
    values: dict[str, Floats] = {}
    for channel in clean.channels:
        wild = rng.random(channel.values.size) < 0.05
        values[channel.joint] = channel.values + 0.1 * wild * rng.choice([-1.0, 1.0], wild.size)
    recording = recorded(machine().t, values)
    plain, robust = (
        identify(scene(), recording, FIT, window=1.0, loss=loss) for loss in ('linear', 'huber')
    )
    assert (np.abs(robust.values - TRUE) < 4.0 * robust.deviations).all()
    assert (robust.deviations < 0.4 * plain.deviations).all()


def test_noise_that_the_residuals_exceed_is_told() -> None:
    recording = machine().recording(2e-3)
    for level, told in ((2e-3, False), (2e-4, True)):
        noise = {'crank_pin': level, 'guide': level}
        found = identify(scene(), recording, FIT, window=1.0, noise=noise)
        assert ('times the given noise: the intervals are too narrow' in str(found)) == told


def test_channels_of_several_recordings_are_told_apart() -> None:
    """And a recording cannot begin before the scene does."""
    first, second = (
        replace(machine().recording(2e-3, seed=n), name=name)
        for n, name in enumerate(('monday', 'tuesday'))
    )
    text = str(identify(scene(), [first, second], FIT, window=1.0))
    assert 'guide of monday: ' in text and 'guide of tuesday: ' in text
    early = recorded(np.arange(100) * 0.01 - 0.5, {'guide': np.full(100, 1.414)})
    with pytest.raises(InputError, match='begins before the scene does, got'):
        identify(scene(), early, FIT)


def test_a_number_stays_possible() -> None:
    """A machine without friction: less than none is no scene, and the fit stops before it."""
    smooth = Machine(scene(rail__viscous=1e-9), ('crank_pin', 'guide'), 1.0)
    found = identify(scene(), smooth.recording(5e-3, seed=3), ['rail.viscous'], window=1.0)
    assert 0.0 <= found['rail.viscous'] < 5.0 * found.deviations[0] + 1e-3


def _recording(**joints: Any) -> Recording:
    t = np.arange(100) * 0.01
    return recorded(t, {name: np.full(100, value) for name, value in joints.items()})


GOOD = {'crank_pin': 0.785, 'guide': 1.414}


@pytest.mark.parametrize(
    ('fit', 'keywords', 'expected'),
    [
        (['couple.mass'], {}, "fit: nothing of this name, got 'couple'; did you mean 'coupler'?"),
        ([], {}, 'fit: nothing to fit'),
        ('coupler.mass', {}, 'fit: no list of names'),
        (['coupler.mass', 'coupler.mass'], {}, 'fit.1: named twice'),
        (['solver.step'], {}, 'fit: no tangent by a number of the solver'),
        (['coupler.points'], {}, 'fit.coupler.points: not one number'),
        (FIT, {'window': -1.0}, 'window'),
        (FIT, {'window': 1e-300}, 'window: shorter than a step, got 1e-300'),
        (FIT, {'window': 0.02}, 'too few measurements in a window'),
        (FIT, {'hold_out': 1.5}, 'hold_out: out of range'),
        (FIT, {'hold_out': 0.9, 'window': 1.0}, 'no windows to keep away, or none to fit'),
        (FIT, {'loss': 'hubber'}, "did you mean 'huber'?"),
        (FIT, {'loss': None}, 'loss: nothing given; known: linear, huber'),
        (FIT, {'noise': {'crankpin': 1.0}}, "did you mean 'crank_pin'?"),
        (FIT, {'noise': {'crank_pin': 0.0}}, 'no standard deviation'),
        (FIT, {'bounds': {'crank.mass': (0, 1)}}, 'bounds: is not fitted'),
        (
            FIT,
            {'delay': True, 'bounds': {'delay': (-5, 5)}},
            'window: delays of up to 5 s leave too few measurements of a window',
        ),
        (FIT, {'bounds': {'coupler.mass': (2, 3)}}, 'the scene begins outside the bounds'),
        (FIT, {'bounds': {'coupler.mass': (3, 2)}}, 'bounds.coupler.mass: not usable'),
        (FIT, {'priors': {'coupler.mass': 3}}, 'priors.coupler.mass: not two numbers'),
    ],
)
def test_refused_in_one_line(fit: Any, keywords: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError) as caught:
        identify(scene(), _recording(**GOOD), fit, **keywords)
    assert expected in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_window_may_begin_in_a_gap() -> None:
    """The mechanism cannot go the straight way over a gap of nine tenths of a second: the message
    named a wrong joint."""
    inputs = pushes('crank_pin', 6.0, 2.0)
    machine = Machine(scene(coupler__mass=1.3), ('crank_pin', 'guide'), 2.0, inputs=inputs)
    there = (machine.t < 0.545) | (machine.t > 1.455)
    measured = dict(zip(machine.joints, machine.x[there].T, strict=True))
    recording = recorded(machine.t[there], measured, inputs=inputs)
    found = identify(scene(), recording, ['coupler.mass'], window=1.0)
    assert found['coupler.mass'] == pytest.approx(1.3, rel=1e-6)


def test_recordings_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'crank_pin'"):
        identify(scene(), _recording(crankpin=0.7), FIT)
    with pytest.raises(
        InputError, match='guide: the mechanism cannot be where this joint was recorded'
    ):
        identify(scene(), _recording(guide=9.0), FIT)
    with pytest.raises(InputError, match='no recording'):
        identify(scene(), [], FIT)
    with pytest.raises(InputError, match='times do not ascend'):
        recorded([0.0, 0.0], {'guide': [1.0, 1.0]})
    with pytest.raises(InputError, match='as many values as times'):
        recorded([0.0, 1.0], {'guide': [1.0]})


def test_numbers_without_a_tangent_are_refused_by_name() -> None:
    rubs = {'joint_friction': {'pin': {'joint': 'crank_pin', 'dynamic': 0.1}}}
    rubbing = load_scene({**SLIDER_CRANK, 'effects': rubs})
    with pytest.raises(InputError, match='no tangents: its friction depends on reactions'):
        identify(rubbing, _recording(**GOOD), ['coupler.mass'])


def test_the_program_names_the_option(tmp_path: Path) -> None:
    path, output = str(tmp_path / 'scene.yaml'), str(tmp_path / 'out')
    Path(path).write_text(load_scene('slider_crank').text, 'utf-8')
    log, _ = make(tmp_path / 'log', tmp_path / 'scene.yaml', ticks=30)
    for given, expected in (
        (['--fit', 'solver.step'], '--fit: no tangent by a number of the solver'),
        (['--fit', 'm', '--prior', 'x=1:2'], '--prior: is not fitted'),
    ):
        with pytest.raises(InputError, match=expected):
            main([path, str(log), *given, '-o', output])


def driven() -> dict[str, Any]:
    """A pendulum with friction on a bar that a drive swings."""
    return {
        'mechanism': {
            'alf': 1,
            'name': 'driven',
            'space': 'planar',
            'points': {
                'O': {'at': [0, 0], 'fixed': True},
                'A': {'at': [0.5, 0]},
                'B': {'at': [0.5, -0.6]},
            },
            'bodies': {
                'bar': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'},
                'bob': {'points': ['A', 'B'], 'mass': 0.7, 'inertia': 'rod'},
            },
            'joints': {
                'o': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'},
                'a': {'type': 'revolute', 'between': ['bar', 'bob'], 'at': 'A'},
            },
        },
        'drives': {'swing': {'joint': 'o', 'angle': '0.4*sin(3*t)'}},
        'effects': {
            'gravity': {'acceleration': [0, -9.81]},
            'joint_friction': {'hinge': {'joint': 'a', 'viscous': 0.05}},
        },
        'solver': {'step': 2e-3, 'integrator': 'rk4'},
    }


def test_beside_a_drive() -> None:
    """The drive moves on its own; friction and a length are found."""
    of = load_scene(driven())
    recording = Machine(changed(of, {'hinge.viscous': 0.08}), ('o', 'a'), 1.0).recording()
    found = identify(of, recording, ['hinge.viscous'], window=0.5)
    assert found['hinge.viscous'] == pytest.approx(0.08, rel=1e-6)
    name = 'mechanism.points.B.at.1'
    value = number(of, name)
    recording = Machine(of, ('o', 'a'), 1.0).recording()
    found = identify(changed(of, {name: 1.02 * value}), recording, [name], window=0.5)
    assert found[name] == pytest.approx(value, rel=1e-6)


def test_numbers_of_a_drive_and_a_length_beside_it(tmp_path: Path) -> None:
    """A driven shoulder, of which nothing is recorded, and a free elbow, which is."""
    path = tmp_path / 'driven.yaml'
    path.write_text(DRIVEN, 'utf-8')
    driven = load_scene(path)
    motion = list(Simulation(driven).run(3.0, every=2))
    angles = np.array([sample.joints['elbow'].position for sample in motion])
    recording = recorded(np.array([sample.t for sample in motion]), {'elbow': angles})
    guess = with_changes(driven, {'k': '0.47', 'w': '2.9', 'a': '0.95'})
    found = identify(guess, recording, ['k', 'w', 'a'], window=1.0)
    assert found.values == pytest.approx([0.5, 3.0, 1.0], rel=1e-8)


DRIVEN = """
mechanism:
  alf: 1
  space: planar
  parameters: {a: 1.0, w: 3.0, k: 0.5}
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [a, 0]}
    B: {at: [a, 0.8]}
  bodies:
    upper: {points: [O, A], mass: 1, inertia: rod}
    lower: {points: [A, B], mass: 1, inertia: {about_com: 0.1}, com: [0.3, 0.1]}
  joints:
    shoulder: {type: revolute, between: [ground, upper], at: O}
    elbow: {type: revolute, between: [upper, lower], at: A}
  drives:
    swing: {joint: shoulder, angle: k*sin(w*t)}
effects:
  gravity: {acceleration: [0, -9.81]}
  joint_friction: {joint: elbow, viscous: 0.2}
solver: {step: 5.0e-3, integrator: dop853}
"""


DOUBLE_PENDULUM = """
mechanism:
  alf: 1
  space: planar
  parameters: {heavy: 0.7}
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [0.9, -0.4]}
    B: {at: [1.5, -1.0]}
  bodies:
    upper: {points: [O, A], mass: 1, inertia: rod}
    lower: {points: [A, B], mass: heavy, inertia: rod}
  joints:
    shoulder: {type: revolute, between: [ground, upper], at: O}
    elbow: {type: revolute, between: [upper, lower], at: A}
effects:
  gravity: {acceleration: [0, -9.81]}
  joint_friction: {f: {joint: elbow, viscous: 0.15}, g: {joint: shoulder, viscous: 0.1}}
solver: {step: 5.0e-3, integrator: dop853}
"""


@pytest.mark.thorough
@pytest.mark.parametrize(
    ('begin', 'joint'), thinned([(0.0, 'elbow'), (3.3, 'shoulder')], keep=[(0.0, 'elbow')])
)
def test_a_joint_that_does_not_tell_the_posture(begin: float, joint: str, tmp_path: Path) -> None:
    """One angle of a double pendulum, from where the scene begins on or from the midst of the
    motion on."""
    path = tmp_path / 'pendulum.yaml'
    path.write_text(DOUBLE_PENDULUM, 'utf-8')
    of = load_scene(path)
    motion = [s for s in Simulation(of).run(begin + 4.0) if s.t >= begin - 1e-9]
    angles = np.array([sample.joints[joint].position for sample in motion])
    noise = 1e-3 * np.random.default_rng(0).standard_normal(angles.size)
    recording = recorded(np.array([s.t - begin for s in motion]), {joint: angles + noise})
    guess = changed(of, {'heavy': 0.75, 'f.viscous': 0.1, 'g.viscous': 0.15})
    found = identify(guess, recording, ['heavy', 'f.viscous', 'g.viscous'], window=1.0)
    assert found.settled
    assert (np.abs(found.values - [0.7, 0.15, 0.1]) < 4.0 * found.deviations).all()
    assert (found.deviations < 0.01).all()
