"""The stored outputs of a member, against motions with exact solutions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy import stats

import alf_ros
from alf_ros import InputError
from alf_ros.commands.ensemble import main
from alf_ros.studies.ensemble.chunk import Chunk, run_chunk
from alf_ros.studies.ensemble.ensemble import Progress
from alf_ros.studies.ensemble.kept_outputs import integral, outputs
from alf_ros.studies.ensemble.statistics import Statistics
from alf_ros.studies.ensemble.study_reading import study_of
from alf_ros.studies.ensemble.summary_page import page
from support.parallel_cranks import THREE_CRANKS

# A crank of length L and mass m that turns at w (rad/s), from 1 rad; nothing else acts.
TURNING: dict[str, Any] = {
    'mechanism': {
        'alf': 1,
        'space': 'planar',
        'parameters': {'L': 0.5, 'm': 2.0, 'w': 3.0},
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': ['L*cos(1)', 'L*sin(1)']},
        },
        'bodies': {'crank': {'points': ['O', 'A'], 'mass': 'm', 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'}},
    },
    'initial': {'velocities': {'A': ['-L*w*sin(1)', 'L*w*cos(1)']}},
    'solver': {'step': 1e-2, 'integrator': 'dop853'},
}
KEPT = {
    'height': {'max': 'points.A.y'},
    'low': {'min': 'points.A.y'},
    'force': {'max': 'norm(pin.force)'},
    'mean_x': {'mean': 'points.A.x'},
    'area': {'integral': 'points.A.y'},
    'end': {'final': 'points.A'},
    'seen': {'at': [0.123, 1.5], 'of': 'points.A'},
    'up': {'crossing': 'points.A.x', 'value': 0.1, 'direction': 'up', 'count': 2},
    'path': 'points.A',
    'fastest': {
        'function': lambda run: np.abs(run['velocities.A']).max(),
        'reads': ['velocities.A'],
    },
}


FIRST_FORCE = {
    'function': lambda run: run['foot0.force.y'][0],
    'reads': ['energy', 'foot0.force'],
}


def test_outputs_of_a_crank_that_turns():
    found = alf_ros.ensemble(
        TURNING,
        {'L': [0.5, 0.8], 'w': [3.0, 2.0]},
        sampling='table',
        outputs=KEPT,
        duration=3.0,
        period=0.02,
        workers=0,
    )
    assert found.reason.values.tolist() == ['', '']
    t = found.t.values
    for k, (L, w) in enumerate([(0.5, 3.0), (0.8, 2.0)]):
        member = found.isel(member=k)
        angle = 1.0 + w * t
        close: dict[str, Any] = {'rel': 1e-9, 'abs': 1e-9}
        assert float(member.height) == pytest.approx(L * np.sin(angle).max(), **close)
        assert float(member.height_t) == pytest.approx(t[np.sin(angle).argmax()], **close)
        assert float(member.low) == pytest.approx(L * np.sin(angle).min(), **close)
        assert float(member.force) == pytest.approx(2.0 * 0.5 * L * w**2, rel=1e-8)
        exact = L / w * (math.sin(1 + 3 * w) - math.sin(1))
        assert float(member.mean_x) == pytest.approx(exact / 3.0, rel=1e-6)
        exact = L / w * (math.cos(1) - math.cos(1 + 3 * w))
        assert float(member.area) == pytest.approx(exact, rel=1e-6)
        assert member.end.values == pytest.approx(member.path.values[-1], abs=0)
        for row, instant in zip(member.seen.values, (0.123, 1.5), strict=True):
            place = L * np.array([math.cos(1 + w * instant), math.sin(1 + w * instant)])
            assert row == pytest.approx(place, **close)
        turns = [(2 * math.pi * n - math.acos(0.1 / L) - 1.0) / w for n in range(1, 4)]
        turns = [at for at in turns if 0 < at < 3.0][:2]
        assert member.up_t.values[: len(turns)] == pytest.approx(turns, abs=1e-7)
        assert np.isnan(member.up_t.values[len(turns) :]).all()
        assert float(member.fastest) == pytest.approx(
            L * w * np.abs([np.sin(angle), np.cos(angle)]).max(), rel=1e-8
        )


@pytest.mark.parametrize(
    ('duration', 'period'), [(0.75, None), (1.51, None), (0.755, None), (3.0, 0.07), (0.1, 0.07)]
)
def test_the_last_sample_is_at_the_end(duration: float, period: float | None) -> None:
    """Whether or not periods fill the duration."""
    found = alf_ros.ensemble(
        TURNING,
        {'w': [3.0]},
        sampling='table',
        outputs={name: KEPT[name] for name in ('end', 'path', 'mean_x', 'area', 'low')},
        duration=duration,
        period=period,
        workers=0,
    )
    member, L, w = found.isel(member=0), 0.5, 3.0
    last = 1.0 + w * duration
    assert found.t.values[-1] == duration
    end = [L * math.cos(last), L * math.sin(last)]
    assert member.end.values == pytest.approx(end, abs=1e-9)
    assert member.path.values[-1] == pytest.approx(end, abs=1e-9)
    x, y = L / w * (math.sin(last) - math.sin(1)), L / w * (math.cos(1) - math.cos(last))
    rough = 1e-3 if period else 1e-7
    assert float(member.mean_x) == pytest.approx(x / duration, abs=rough)
    assert float(member.area) == pytest.approx(y, abs=rough)
    lowest = L * np.sin(1.0 + w * found.t.values).min()
    assert float(member.low) == pytest.approx(lowest, abs=1e-9)


@pytest.mark.parametrize('t', [(0.0, 0.6, 1.0), (0.0, 0.4, 1.0), (0.0, 0.4, 0.8, 1.0)])
def test_a_parabola_has_its_integral_exactly(t: tuple[float, ...]) -> None:
    """Also where two intervals have different lengths: their three samples have one parabola."""
    at = np.array(t)
    assert float(integral(at, 3.0 * at**2 + 1.0)) == pytest.approx(2.0, abs=1e-14)


def test_an_output_does_not_depend_on_the_others():
    """A crossing has the samples of the study, whatever instants another output adds."""
    alone = {'up': KEPT['up']}
    found = [
        alf_ros.ensemble(
            TURNING,
            {'w': [3.0]},
            sampling='table',
            outputs=kept,
            duration=3.0,
            period=0.2,
            workers=0,
        )
        for kept in (alone, {**alone, 'seen': {'at': [1.20001, 2.1], 'of': 'energy'}})
    ]
    assert np.array_equal(found[0].up_t, found[1].up_t, equal_nan=True)


def test_numbers_of_any_label_are_in_the_statistics():
    """Also those whose label begins as the dimension of values at instants does."""
    kept = {'t_up': KEPT['up'], 'seen': KEPT['seen'], 'path': 'energy', 'end': 'final(energy)'}
    study = study_of(TURNING, {'w': [3.0]}, sampling='table', outputs=kept, duration=3.0)
    statistics = Statistics(study)
    assert list(statistics.numbers) == ['t_up_t.1', 't_up_t.2', 'end']


def test_the_extremes_are_of_the_members_that_are_counted():
    study = study_of(
        TURNING, {'w': [1.0] * 4}, sampling='table', outputs=['final(energy)'], duration=0.1
    )
    statistics = Statistics(study)
    statistics.numbers['final_energy'][:] = math.inf, 2.0, 3.0, math.nan
    told = statistics.summary('final_energy')
    assert told is not None and told.count == 2
    assert (told.least, told.largest) == ((2.0, 1), (3.0, 2))


@pytest.mark.filterwarnings('error')
def test_numbers_that_are_far_apart_have_a_report():
    """Their differences, and the squares of them, are beyond 64 bits."""
    kept = {'end': 'final(energy)', 'path': 'energy'}
    vary = {'w': [1.0, 2.0, 3.0]}
    study = study_of(TURNING, vary, sampling='table', outputs=kept, duration=0.1, chunk=3)
    chunk = run_chunk(study, 0)
    wide = np.array([-1.7e308, 0.0, 1.7e308])
    chunk.arrays['end'][:] = wide
    chunk.arrays['path'][:] = wide[:, None]
    statistics = Statistics(study)
    statistics.add(chunk)
    text = page(Progress(3, 3, 1, 0, 1.0, statistics), iter([chunk]))
    assert '0 ± 1.7e+308 of 3 members' in text and 'nan' not in text and 'inf' not in text
    told = statistics.summary('end')
    assert told is not None and told.quantiles[1:4] == pytest.approx([-0.85e308, 0.0, 0.85e308])
    statistics.numbers['end'][:] = 1e200, 2e200, 3e200
    told = statistics.summary('end')
    assert told is not None and told.deviation == pytest.approx(1e200)


def test_the_report_says_of_how_many_points_and_members_it_is():
    """Each point of Sobol' indices has four members here; one of point 3 has failed."""
    study = study_of(
        TURNING,
        {'m': stats.uniform(1.0, 2.0), 'w': stats.uniform(1.0, 2.0)},
        sampling='saltelli',
        members=64,
        outputs={'end': 'final(energy)', 'path': 'energy'},
        duration=0.05,
        chunk=64,
    )
    chunk = run_chunk(study, 0)
    chunk.arrays['end'][12] = math.nan
    chunk.arrays['path'][12] = math.nan
    statistics = Statistics(study)
    statistics.add(chunk)
    text = page(Progress(64, 64, 1, 0, 1.0, statistics), iter([chunk]))
    assert 'total Sobol index (first order), of 8 points' in text
    assert 'path, J: 63 members' in text


def test_the_report_says_how_many_numbers_it_leaves_out():
    kept = {f'n{k}': 'final(energy)' for k in range(43)}
    vary = {'w': [1.0, 2.0]}
    study = study_of(TURNING, vary, sampling='table', outputs=kept, duration=0.1, chunk=2)
    chunk = run_chunk(study, 0)
    statistics = Statistics(study)
    statistics.add(chunk)
    text = page(Progress(2, 2, 1, 0, 1.0, statistics), iter([chunk]))
    assert '3 more numbers are in the store.' in text and 'n39' in text and 'n40' not in text


def test_a_share_of_a_load_is_marked(tmp_path, monkeypatch, capsys):
    """In the store, in the Dataset, in the report, and by the command."""
    monkeypatch.chdir(tmp_path)
    told = 'one of many that balance: constraints are redundant'
    kept = {'share': 'max(norm(head1.force))', 'energy': 'final(energy)', 'first': FIRST_FORCE}
    scene = tmp_path / 'cranks.yaml'
    scene.write_text(THREE_CRANKS)
    vary = {'platform.mass': [2.0, 3.0]}
    for store in (None, 'runs.zarr'):
        found = alf_ros.ensemble(
            scene, vary, sampling='grid', outputs=kept, duration=0.1, store=store, workers=0
        )
        assert found.share.attrs == {'units': 'N', 'indeterminate': told}
        assert found.share_t.attrs == {'units': 's', 'indeterminate': told}
        assert found.first.attrs == {'indeterminate': told}
        assert found.energy.attrs == {'units': 'J'}
    study = {'scene': 'cranks.yaml', 'vary': vary, 'sampling': 'grid', 'duration': 0.1}
    study['outputs'] = {'share': kept['share'], 'energy': kept['energy']}
    Path('study.yaml').write_text(yaml.safe_dump(study))
    assert main(['study.yaml', '--workers', '0']) == 0
    assert f'\nshare: {told}\n' in capsys.readouterr().err
    assert f'share: {told}' in Path('study.html').read_text()


def test_passes_are_those_of_a_simulation_that_watches():
    study = study_of(
        'slider_crank', {'m': [1.0]}, sampling='table', duration=1.5, outputs=[{'passes': 3}]
    )
    simulation = alf_ros.Simulation(alf_ros.load_scene('slider_crank'), watch=True)
    simulation.step(1500)
    chunk = run_chunk(study, 0)
    times = [each.t for each in simulation.passes]
    assert chunk.arrays['passes_number'].tolist() == [2.0] == [float(len(times))]
    assert chunk.arrays['passes_t'][0, :2].tolist() == times
    assert np.isnan(chunk.arrays['passes_t'][0, 2])


def test_statistics_and_indices_of_a_law_that_is_known():
    """The energy of the crank is m L² w² / 6: a product, whose Sobol' indices are known."""
    vary = {'m': stats.uniform(1.0, 2.0), 'L': stats.uniform(0.5, 0.5)}
    study = study_of(
        TURNING,
        vary,
        sampling='saltelli',
        members=4 * 1024,
        outputs=['final(energy)'],
        duration=0.01,
        chunk=2,
    )
    statistics = Statistics(study)
    ran: dict[str, Any] = dict(run_chunk(study, 3).arrays)
    assert ran['final_energy'] == pytest.approx(ran['m'] * ran['L'] ** 2 * 1.5, rel=1e-9)
    for number in range(study.chunks):
        given = [study.samples.values(k) for k in study.indices(number)]
        arrays = {name: np.array([float(each[name]) for each in given]) for name in vary}
        arrays['final_energy'] = arrays['m'] * arrays['L'] ** 2 * 1.5
        statistics.add(Chunk(number, arrays))
    values = statistics.numbers['final_energy']
    told = statistics.summary('final_energy')
    assert told is not None and told.count == study.members
    assert (told.mean, told.deviation) == pytest.approx((values.mean(), values.std(ddof=1)))
    assert told.least == (values.min(), int(values.argmin()))
    assert told.quantiles[2] == pytest.approx(np.median(values))

    def moment(of: int, power: int) -> float:  # of m, and of L²
        return (
            (3 ** (power + 1) - 1) / (2 * (power + 1))
            if of == 0
            else (1 - 0.5 ** (2 * power + 1)) / (0.5 * (2 * power + 1))
        )

    spread = [moment(of, 2) - moment(of, 1) ** 2 for of in (0, 1)]
    whole = moment(0, 2) * moment(1, 2) - (moment(0, 1) * moment(1, 1)) ** 2
    first = [spread[0] * moment(1, 1) ** 2 / whole, spread[1] * moment(0, 1) ** 2 / whole]
    total = [1 - first[1], 1 - first[0]]
    found = {each.name: each for each in statistics.influences('final_energy')}
    for name, one, all_of_it in zip(('m', 'L'), first, total, strict=True):
        assert found[name].first == pytest.approx(one, abs=0.01)
        assert found[name].total == pytest.approx(all_of_it, abs=0.01)
    assert found['m'].correlation > 0.2 and found['L'].correlation > 0.2


def test_a_single_number_has_all_of_the_influence(tmp_path: Path) -> None:
    """scipy takes no single number: the command ended with a traceback behind its last member."""
    vary = {'m': {'uniform': [1, 3]}}
    kept = ['final(energy)']
    study = study_of(
        'slider_crank', vary, members=48, sampling='saltelli', outputs=kept, duration=0.01
    )
    statistics = Statistics(study)
    for number in range(study.chunks):
        statistics.add(run_chunk(study, number))
    (found,) = statistics.influences('final_energy')
    assert found.points == 16
    assert (found.first, found.total) == pytest.approx((1.0, 1.0), abs=0.05)


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        ('energy', "outputs: not a list, got 'energy'"),
        ([], 'outputs: nothing to keep'),
        ([3], 'outputs: not an output, got 3; expected max(NAME)'),
        ([{'at': [0.2, 0.1], 'of': 'energy'}], 'at: not instants'),
        ([{'passes': 0}], 'outputs.passes: not a count, got 0'),
        ([{'pases': 3}], "outputs: unknown key, got 'pases'; did you mean 'passes'?"),
        ({'a': {'att': [0.1], 'of': 'energy'}}, "a: unknown key, got 'att'; did you mean 'at'?"),
        ([{'crossing': 'energy', 'direction': 'left'}], "direction: no direction, got 'left'"),
        ([{'crossing': 'energy', 'direction': None}], 'direction: nothing given; known: both'),
        ([{'crossing': 'energy', 'valeu': 1}], "crossing: unknown key, got 'valeu'; did you mean"),
        ({'1st': 'energy'}, "outputs: not a label, got '1st'"),
        (
            ['max(energy'],
            "outputs: nothing closes the '(' behind 'max', got 'max(energy'; expected",
        ),
        (['max(norm(a.b)'], "outputs: nothing closes the '(' behind 'max', got 'max(norm(a.b)'; "),
        ({'a': 'max(e))'}, "outputs: the ')' behind 'max(e)' closes nothing, got 'max(e))'; exp"),
        ([{'at': [0.1], 'of': 'norm(a'}], "outputs.of: nothing closes the '(' behind 'norm', g"),
        ({'t': 'energy'}, "outputs: a label that each store has, got 't'; expected another"),
        ([{'function': 'nowhere'}], "function: not a function, got 'nowhere'"),
        ([{'function': abs, 'reads': 1}], 'reads: not a list of names, got 1'),
    ],
)
def test_an_output_that_cannot_be_is_said(given, said):
    with pytest.raises(InputError) as caught:
        outputs(given)
    assert str(caught.value).startswith(said)


def test_instants_in_an_array():
    assert outputs([{'at': np.array([0.1, 0.2]), 'of': 'energy'}])[0].times == (0.1, 0.2)
    assert outputs([{'norm': 'knee.force'}])[0].norm


@pytest.mark.parametrize(
    ('given', 'said'),
    [
        (
            {'x': 'max(energy)', 'x_t': 'final(energy)'},
            "outputs: a label that another output has too, got 'x_t'; expected another label",
        ),
        ({'L': 'final(energy)'}, "outputs: a label that a number that varies has too, got 'L'"),
        (
            {'axis': 'final(energy)', 'end': 'final(points.A)'},
            "outputs: a label that a dimension of an output has too, got 'axis'",
        ),
        (
            {'x': {'at': [0.05], 'of': 'energy'}, 't_x': 'final(energy)'},
            "outputs: a label that a dimension of an output has too, got 't_x'",
        ),
        (
            {'B': 'final(points.A)', 'B.x': 'final(energy)'},
            "outputs: two numbers of one name, got 'B.x'; expected another label",
        ),
        (
            {'x': 'max(norm(body_poses.crank))'},
            'outputs.x: a pose has no norm: its components have other units',
        ),
        (
            {'x': {'at': [0.2], 'of': 'energy'}},
            'outputs.x: after the end, got 0.2; expected up to the duration, 0.1 s',
        ),
    ],
)
def test_outputs_that_a_study_cannot_have_are_said_before_anything_runs(given, said):
    with pytest.raises(InputError) as caught:
        study_of(TURNING, {'L': [0.5, 0.8]}, sampling='table', outputs=given, duration=0.1)
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('member', "vary: the number of a member has this name too, got 'member'"),
        ('reason', "vary: the reason of a failure has this name too, got 'reason'"),
        ('a b.stiffness', "vary: not usable, got 'a b.stiffness'; expected a name without spaces"),
        ('a/b.stiffness', "vary: not usable, got 'a/b.stiffness'; expected a name without spaces"),
    ],
)
def test_a_number_that_varies_needs_the_name_of_an_array(name, said):
    scene = {
        **TURNING,
        'mechanism': {
            **TURNING['mechanism'],
            'parameters': {'L': 0.5, 'm': 2.0, 'w': 3.0, 'member': 1.0, 'reason': 1.0},
        },
        'effects': {
            'torsion_spring': {
                'a b': {'joint': 'pin', 'stiffness': 1.0},
                'a/b': {'joint': 'pin', 'stiffness': 1.0},
            }
        },
    }
    with pytest.raises(InputError) as caught:
        study_of(scene, {name: [1.0, 2.0]}, sampling='table', duration=0.1)
    assert str(caught.value).startswith(said)
