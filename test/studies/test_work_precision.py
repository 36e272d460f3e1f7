"""The work-precision command: its errors, its report, and its continuation after an interrupt."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from alf_ros import load_scene
from alf_ros.__main__ import main
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.exact import motions
from alf_ros.studies.work_precision import sweep
from alf_ros.studies.work_precision.measurement import Measurement, Setting, measure, settings
from alf_ros.studies.work_precision.reference import reference
from alf_ros.studies.work_precision.report import Summary, best, cost_to_reach, curves, sentence

FEW = ['--duration', '1', '--formulation', 'alf2', 'independent', '--integrator', 'rk4']
FEW += ['--iterations', '10', '--step', '5e-3', '2.5e-3']


def read(folder: Path) -> list[dict[str, str]]:
    with open(folder / 'work_precision.csv', encoding='utf-8') as stream:
        assert next(stream).startswith('# ')
        return list(csv.DictReader(stream))


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('work')
    assert main(['work_precision', 'slider_crank', '--folder', str(folder), *FEW]) == 0
    return folder


def test_what_it_writes(folder: Path) -> None:
    rows = read(folder)
    assert [(r['formulation'], r['step_s']) for r in rows] == [
        ('alf2', '0.005'),
        ('alf2', '0.0025'),
        ('independent', '0.005'),
        ('independent', '0.0025'),
    ]
    assert {row['reference'] for row in rows} == {'exact motion'}
    coarse, fine = (float(row['position_error_m']) for row in rows[:2])
    assert 8.0 < coarse / fine < 32.0  # order 4
    for row in rows[2:]:  # a point, with what it cost and why, not a gap
        assert 'independent coordinates' in row['failure'] and float(row['cpu_ms_per_s']) > 0.0
    for kind, head in (('png', b'\x89PNG'), ('svg', b'<?xml')):
        assert (folder / f'slider_crank.{kind}').read_bytes().startswith(head)
    report = (folder / 'work_precision.md').read_text(encoding='utf-8')
    assert '| independent, rk4 | 10 | - | - | - | - | - | - | - | 2 of 2 |' in report


def test_goes_on_where_it_was_stopped(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'matplotlib', None)  # pictures take most of the time
    path = folder / 'work_precision.csv'
    lines = path.read_text(encoding='utf-8').splitlines()
    kept = dict(zip(sweep.COLUMNS, lines[2].split(','), strict=True))
    lines[2] = lines[2].replace(f',{kept["cpu_ms_per_s"]},', ',12345,')  # known when seen again
    lines[3] = lines[3].replace(kept['version'], '0.0.0')
    path.write_text('\n'.join([*lines[:5], lines[5][:70]]), encoding='utf-8')
    assert main(['work_precision', 'slider_crank', '--folder', str(folder), *FEW]) == 0
    assert '(2 of 4 settings measured now)' in capsys.readouterr().out
    rows = read(folder)
    assert len(rows) == 4 and sum(row['cpu_ms_per_s'] == '12345' for row in rows) == 1
    assert {row['version'] for row in rows} == {sweep.identity()}
    # another duration is another measurement; the other rows stay
    shorter = ['0.5' if word == '1' else word for word in FEW]
    assert main(['work_precision', 'slider_crank', '--folder', str(folder), *shorter]) == 0
    assert '(4 of 4 settings measured now)' in capsys.readouterr().out
    assert len(read(folder)) == 8
    # and so is what was measured on another machine
    path.write_text('# another' + path.read_text(encoding='utf-8')[1:], encoding='utf-8')
    assert main(['work_precision', 'slider_crank', '--folder', str(folder), *FEW]) == 0
    assert '(4 of 4 settings measured now)' in capsys.readouterr().out
    assert len(read(folder)) == 4


def test_errors_are_those_against_the_exact_motion() -> None:
    scene, motion = load_scene('double_four_bar'), motions.paper('double_four_bar')
    against = reference(scene, 2.0)
    point = measure(scene, Setting('alf2', 'rk4', 10, 4e-3), against)
    sim = Simulation(scene, step=4e-3)
    samples = list(sim.run(2.0, at=motion.times[:21]))
    wanted = np.abs(np.array([sample.q for sample in samples]) - motion.exact()[:21]).max()
    assert point.position == pytest.approx(wanted, rel=1e-12)
    energies = [abs(sample.energy - samples[0].energy) for sample in samples]
    assert point.energy == pytest.approx(max(energies), rel=1e-9)
    assert point.gap < 1e-14 and point.repetitions >= 3


def test_constraint_forces_are_those_of_the_exact_motion() -> None:
    """M q̈ + Φ_qᵀ λ = Q at the exact state; forces of the reference agree, at passes too."""
    scene = load_scene('slider_crank')
    against = reference(scene, 1.0)
    sample = Simulation(scene).sample()
    A, B = slice(0, 2), slice(2, 4)
    M = np.kron(np.array([[4.0, 1.0], [1.0, 2.0]]) / 6.0, np.eye(2))
    Q = -9.81 * np.array([0.0, 1.0, 0.0, 0.5])
    assert sample.constraint_forces == pytest.approx(Q - M @ sample.qdd, abs=1e-11)
    assert against.course.force[0] == pytest.approx(sample.constraint_forces, abs=1e-11)
    assert sample.q[A][1] > 0.0 and sample.q[B][1] == 0.0
    assert against.force_error < 1e-6


def test_a_scene_without_an_exact_motion_is_compared_with_one_that_converged() -> None:
    found = reference(load_scene('four_bar'), 2.0)
    assert found.kind.startswith('self-converged') and 0.0 < found.error < 1e-8
    # the exact motion is that of this scene alone: another start has another motion
    other = load_scene({'mechanism': 'slider_crank', 'initial': {'velocities': {'B': [-1, 0]}}})
    assert reference(other, 0.5).kind.startswith('self-converged')


def test_n_four_bars_have_an_exact_motion() -> None:
    found = reference(load_scene('n_four_bar', {'N': 3}))
    assert found.kind == 'exact motion' and found.times[-1] == pytest.approx(1.5)


def test_every_combination_once() -> None:
    plan = list(settings(('alf2', 'alf1'), ('rk4', 'dop853_adaptive'), (1, 10), [1e-3], [1e-6]))
    assert len(plan) == len(set(plan)) == 2 + 2 + 1
    assert {s.tolerance for s in plan if s.integrator == 'rk4'} == {None}


def points(*found: tuple[float, float, float], failed: float | None = None) -> list[Measurement]:
    """(tolerance, ms, error) of one curve."""
    made = [
        Measurement(Setting('alf2', 'dop853_adaptive', 10, 0.1, r), cpu, 3, 0, 0, e, 0, 0, 0)
        for r, cpu, e in found
    ]
    if failed is not None:
        setting, nan = Setting('alf2', 'dop853_adaptive', 10, 0.1, failed), math.nan
        made.append(Measurement(setting, 0.01, 3, 0, 0, nan, nan, nan, nan, 'stopped'))
    return made


def test_what_an_error_costs() -> None:
    some = points((1e-4, 1.0, 1e-4), (1e-6, 2.0, 1e-6), (1e-8, 4.0, 1e-8), failed=1e-2)
    (curve,) = curves(some).values()
    for error, cost in ((1e-4, 1.0), (1e-6, 2.0), (1e-5, 2.0**0.5), (1e-7, 8.0**0.5), (1.0, 1.0)):
        found = cost_to_reach(curve, error)
        assert found is not None and found.cpu == pytest.approx(cost)
    assert cost_to_reach(curve, 1e-9) is None
    # a lucky run does not count: finer ones are above
    lucky = points((1e-4, 1.0, 1e-9), (1e-6, 2.0, 1e-5), (1e-8, 4.0, 1e-8))
    found = best(lucky, 1e-7)
    assert found is not None and found.point.setting.tolerance == 1e-8
    summary = Summary('scene', 10.0, 'exact motion', 1e-12, 1e-9, some)
    assert sentence(summary) == (
        'scene: 1e-06 m costs 2 ms per second (500x real time) with alf2, dop853_adaptive, '
        'tolerance 1e-06; ten times tighter costs +41 %.'
    )
    assert sentence(summary, 1e-10) == 'scene: no setting reaches 1e-10 m.'


@pytest.mark.parametrize(
    'arguments',
    [['nosuch'], ['slider_crank', '--formulation', 'alf3'], ['slider_crank', '--step', '0']],
)
def test_wrong_arguments(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['work_precision', *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
