"""The suite of hard cases: its exact motions, its verdicts, its command."""

from __future__ import annotations

import contextlib
import csv
import json
import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from alf_ros.__main__ import main
from alf_ros.studies.exact import motions, one_freedom
from alf_ros.studies.hard_cases.cases import CASES
from alf_ros.studies.hard_cases.trial import RunResult, RunSpec, TableRow, execute, observed_order
from support.forked import ended
from support.paths import DATA, ROOT
from support.reader import START_LIMIT, environment
from support.thorough import LONG


@pytest.mark.parametrize(
    ('alone', 'data'),
    [
        (one_freedom.slider_crank(), 'slider_crank_6_2'),
        (one_freedom.four_bars(2), 'n_fourbar_N2'),
        (one_freedom.four_bars(10), 'n_fourbar_N10'),
    ],
)
def test_one_freedom_follows_the_exact_solution(alone: one_freedom.OneFreedom, data: str) -> None:
    samples = json.loads((DATA / f'{data}.json').read_text())['samples']
    first = samples[0]
    times = [sample['t'] for sample in samples]
    angles = alone.angles(first['theta'], first['thetad'], times)
    assert angles == pytest.approx([sample['theta'] for sample in samples], abs=1e-11)


def test_four_bars_are_the_pendulum_of_jacobi() -> None:
    """N = 1000: 3π/2 - θ = 2 am(ω t/2 + K(m), m)."""
    n, speed = 1000, 1.0
    frequency = math.sqrt(9.81 * 3 * (3 * n + 1) / (2 * (4 * n + 1)))
    fastest = math.hypot(speed, 2 * frequency)
    m = (2 * frequency / fastest) ** 2
    times = np.linspace(0.0, 1.5, 16)
    *_, amplitude = ellipj(fastest * times / 2 + ellipk(m), m)
    angles = one_freedom.four_bars(n).angles(math.pi / 2, -speed, times)
    assert angles == pytest.approx(1.5 * math.pi - 2 * amplitude, abs=1e-11)


@pytest.mark.parametrize('alone', [one_freedom.slider_crank(), one_freedom.four_bars(3)])
def test_tangent_is_the_derivative_of_the_position(alone: one_freedom.OneFreedom) -> None:
    for theta in (0.0, 0.7, math.pi / 2, 4.0):
        slope = (alone.position(theta + 1e-5) - alone.position(theta - 1e-5)) / 2e-5
        assert alone.tangent(theta) == pytest.approx(slope, abs=1e-9)


def test_change_point_keeps_its_lengths_and_its_energy() -> None:
    times = np.linspace(0.0, 4.0, 4001)
    A, B = np.split(one_freedom.change_point(times), 2, axis=1)
    assert np.hypot(*A.T) == pytest.approx(1.0, abs=1e-14)
    assert np.hypot(*(B - A).T) == pytest.approx(2.0, abs=1e-14)
    assert np.hypot(*(B - [4.0, 0.0]).T) == pytest.approx(3.0, abs=1e-14)
    # it goes on straight: through the line of the bars from one side to the other, 4 times
    cross = A[:, 0] * B[:, 1] - A[:, 1] * B[:, 0]
    assert np.count_nonzero(np.diff(np.sign(B[:, 1]))) >= 4
    assert np.abs(np.diff(cross, 3)).max() < 1e-4  # smooth: a kink would leave some 1e-2
    va, vb = (np.gradient(P, times, axis=0, edge_order=2) for P in (A, B))
    squares = [(u * v).sum(axis=1) for u, v in ((va, va), (va, vb), (vb, vb))]
    kinetic = (2 * squares[0] + squares[1] + 3 * squares[2]) / 6
    energy = kinetic + 9.81 * (A[:, 1] + 1.5 * B[:, 1])
    assert energy == pytest.approx(energy[0], rel=1e-3)  # differences of 1 ms


# the campaign has a test of its own, test_campaign.py
HERE = [name for name in CASES if LONG or name != 'campaign']
Quick = tuple[subprocess.CompletedProcess[str], Path]


@pytest.fixture(scope='module')
def quick(
    tmp_path_factory: pytest.TempPathFactory,
) -> Quick:
    folder = tmp_path_factory.mktemp('cases') / 'new'
    command = ['-m', 'alf_ros', 'hard_cases', '--quick', '--folder', str(folder)]
    if not LONG:
        command += ['--case', *HERE]
    return ended(command, ROOT, environment(), START_LIMIT), folder


def test_all_hard_cases_pass(quick: Quick) -> None:
    done, _ = quick
    assert done.returncode == 0, done.stdout + done.stderr
    assert '\r' not in done.stderr  # lines of progress, but no bar where there is no terminal
    lines = done.stdout.splitlines()[2:-1]
    assert {line.split()[0] for line in lines} == set(HERE)
    assert all(line.endswith('  passed') for line in lines)


def test_results_are_written(quick: Quick) -> None:
    _, folder = quick
    comment, *rows = (folder / 'hard_cases.csv').read_text().splitlines()
    assert comment.startswith('# ') and f'Python {sys.version.split()[0]}' in comment
    found = list(csv.DictReader(rows))
    assert len(found) == sum(len(row.runs) for name in HERE for row in CASES[name](True))
    for row in found:
        assert 0.0 <= float(row['position_error_m']) < float(row['position_bound_m'])
        assert 0.0 <= float(row['energy_error_J']) < float(row['energy_bound_J'])
    assert (folder / 'hard_cases.png').read_bytes()[:4] == b'\x89PNG'


def test_the_full_suite_has_every_promised_run() -> None:
    rows = list(CASES['survival'](False))
    assert [len(row.runs) for row in rows] == [56, 60, 56, 60]
    assert max(run.h for run in rows[0].runs) == 2e-3
    assert all(run.bound == 1e-9 for run in rows[1].runs if run.h <= 4e-3)


def failing(bound: float, integrator: str, h: float) -> TableRow:
    run = RunSpec(motions.change_point(), integrator, h, bound)
    return TableRow('change_point', 'change_point', (run,))


@pytest.mark.parametrize(
    ('row', 'told'),
    [
        (failing(1e-15, 'rk4', 2e-3), 'position and energy error above the bound'),
        (failing(1.0, 'rk4', 1.0), 't = 0 s: '),
    ],
)
def test_a_case_that_fails_is_told(
    row: TableRow,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(CASES, 'change_point', lambda quick: iter([row]))
    assert main(['hard_cases', '--case', 'change_point', '--folder', str(tmp_path)]) == 1
    assert 'FAILED: 1 of 1' in capsys.readouterr().out
    assert told in (tmp_path / 'hard_cases.csv').read_text()
    assert (tmp_path / 'hard_cases.png').exists()


def test_order_below_that_of_the_method_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motion = motions.paper('slider_crank')
    runs = tuple(RunSpec(motion, 'rk4', h, 0.1) for h in (1e-2, 8e-3, 6e-3, 4e-3))
    monkeypatch.setitem(CASES, 'order', lambda quick: iter([TableRow('order', 'x', runs, 7.5)]))
    assert main(['hard_cases', '--case', 'order', '--folder', str(tmp_path)]) == 1
    assert 'FAILED: order below 7.5' in capsys.readouterr().out


def test_observed_order() -> None:
    def results(errors: list[float]) -> list[RunResult]:
        motion = motions.change_point()
        steps = [0.01 / 2**k for k in range(len(errors))]
        return [
            RunResult(RunSpec(motion, 'rk4', h, 1.0), error, 0.0, 0.0, 1.0, '')
            for h, error in zip(steps, errors, strict=True)
        ]

    fourth = [1e-3 / 16**k for k in range(5)]
    assert observed_order(results(fourth)) == pytest.approx(4.0)
    assert observed_order(results([0.5, *fourth[1:], 1e-13])) == pytest.approx(4.0)
    assert math.isnan(observed_order(results(fourth[:3])))
    assert math.isnan(observed_order(results([1e-9, 3e-9, 1e-9, 2e-9, 1e-9])))


def test_a_run_is_judged_by_the_worst_of_its_samples() -> None:
    result = execute(RunSpec(motions.paper('slider_crank'), 'rk4', 2e-3, 1e-6))
    assert result.verdict == 'passed'
    assert 1e-9 < result.position < 1e-6
    assert result.energy_bound == pytest.approx(2 * 9.81 * 1e-6)


def test_an_error_that_is_no_number_fails() -> None:
    motion = motions.paper('slider_crank')
    exact = motion.exact()[:3].copy()
    exact[1, 0] = np.nan
    run = replace(motion, times=motion.times[:3], exact=lambda: exact)
    result = execute(RunSpec(run, 'rk4', 2e-3, 1e-6))
    assert math.isnan(result.position) and result.verdict == 'position error above the bound'


@pytest.mark.parametrize(
    ('arguments', 'told'),
    [
        (['--case', 'survivel'], "did you mean 'survival'?"),
        (['--case'], '--case'),
        (['--slow'], '--slow'),
    ],
)
def test_usage_errors(arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['hard_cases', *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1 and told in err


def test_a_folder_that_cannot_be_is_an_input_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'file').write_text('')
    assert main(['hard_cases', '--quick', '--folder', str(tmp_path / 'file/below')]) == 2
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1 and '--folder' in err


def test_a_table_that_was_interrupted_leaves_the_one_before(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupted(quick: bool) -> Iterator[TableRow]:
        yield failing(1.0, 'rk4', 1.0)

    def execute(run: object) -> object:
        raise KeyboardInterrupt

    (tmp_path / 'hard_cases.csv').write_text('before')
    monkeypatch.setitem(CASES, 'change_point', interrupted)
    monkeypatch.setattr('alf_ros.studies.hard_cases.table.execute', execute)
    with contextlib.suppress(KeyboardInterrupt):
        main(['hard_cases', '--case', 'change_point', '--folder', str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ['hard_cases.csv']
    assert (tmp_path / 'hard_cases.csv').read_text() == 'before'


@pytest.mark.thorough
def test_without_matplotlib_there_are_results_but_no_picture(tmp_path: Path) -> None:
    code = (
        'import sys; sys.modules["matplotlib"] = None\n'
        'from alf_ros.__main__ import main; sys.exit(main())'
    )
    command = ['hard_cases', '--quick', '--case', 'many_bars', '--folder', str(tmp_path)]
    done = subprocess.run(
        [sys.executable, '-c', code, *command], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'no picture' in done.stderr and done.stderr.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['hard_cases.csv']
