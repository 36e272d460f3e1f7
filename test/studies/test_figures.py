"""The comparison of the paper, redrawn: the numbers behind the pictures, and the command."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from alf_ros.arrays import Floats
from alf_ros.commands import figures
from alf_ros.errors import InputError, StepError
from alf_ros.scene.scene import load_scene
from alf_ros.simulation.formulations.adams import Adams
from alf_ros.studies.exact import one_freedom
from alf_ros.studies.paper import figure_plot, scan, table_one
from alf_ros.studies.paper.figures import FORMULATIONS
from alf_ros.studies.paper.formulations import EXAMPLES, FormulationComparison
from alf_ros.studies.paper.published import PublishedRun, PublishedSetting
from support.paths import DATA


@pytest.fixture(scope='module')
def fixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the command has written its runs with fixed steps."""
    where = tmp_path_factory.mktemp('figures')
    assert figures.main(['--folder', str(where / 'new'), '--setting', 'fixed']) == 0
    return where / 'new'


@pytest.fixture(scope='module')
def published(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Where the command has written its runs in the setting of the paper, and what it said."""
    where, said = tmp_path_factory.mktemp('published'), io.StringIO()
    with contextlib.redirect_stdout(said):
        assert figures.main(['--folder', str(where), '--setting', 'paper']) == 0
    return where, said.getvalue()


@pytest.fixture(scope='module')
def four_bars() -> FormulationComparison:
    return FormulationComparison(EXAMPLES[1])


def table(path: Path) -> dict[str, dict[str, Floats]]:
    """Columns of each formulation."""
    with open(path, encoding='utf-8') as stream:
        lines = list(csv.DictReader(stream))
    names = list(dict.fromkeys(line['formulation'] for line in lines))
    columns = [column for column in lines[0] if column != 'formulation']
    return {
        name: {
            column: np.array(
                [float(line[column]) for line in lines if line['formulation'] == name]
            )
            for column in columns
        }
        for name in names
    }


@pytest.mark.parametrize(
    ('mechanism', 'data'),
    [('slider_crank', 'slider_crank_6_2'), ('double_four_bar', 'n_fourbar_N2')],
)
def test_exact_curves_are_the_reference(fixed: Path, mechanism: str, data: str) -> None:
    wanted = json.loads((DATA / f'{data}.json').read_text(encoding='utf-8'))['samples']
    curves = table(fixed / f'{mechanism}.csv')
    assert list(curves) == ['exact', 'alf1', 'alf2_as_printed', 'alf2']
    found = {name: column[::5] for name, column in curves['exact'].items()}
    assert found['t_s'] == pytest.approx([sample['t'] for sample in wanted], abs=1e-12)
    if mechanism == 'slider_crank':
        point, place, keys = 'B', 2, ('q', 'qd', 'qdd')
        names = ['lambda_crank_length', 'lambda_coupler_length']
        far = [abs(np.cos(sample['theta'])) > 0.1 for sample in wanted]
        lam = [sample['lambda'] for sample in wanted]
    else:
        point, place, keys = 'B0', 0, ('B0', 'B0d', 'B0dd')
        names = ['lambda_crank0_length', 'lambda_crank1_length']
        far = [abs(np.sin(sample['theta'])) > 0.1 for sample in wanted]
        lam = [sample['lambda_crank'][:2] for sample in wanted]
    for key, unit, bound in zip(keys, ('m', 'm/s', 'm/s2'), (1e-10, 1e-9, 1e-7), strict=True):
        shown = [sample[key][place] for sample in wanted]
        assert found[f'x_of_{point}_{unit}'] == pytest.approx(shown, abs=bound)
    assert found['energy_J'] == pytest.approx([sample['energy'] for sample in wanted], abs=1e-9)
    assert sum(far) > 80
    for n, name in enumerate(names):
        assert found[name][far] == pytest.approx(np.array(lam)[far, n], abs=1e-6)


def test_alf2_is_nearest(fixed: Path) -> None:
    for mechanism in ('slider_crank', 'double_four_bar'):
        curves = table(fixed / f'{mechanism}.csv')
        for column in ('position_error_m', 'energy_error_J', 'constraint_error_m'):
            worst = {name: curves[name][column].max() for name in FORMULATIONS}
            assert min(worst, key=worst.__getitem__) == 'alf2', (mechanism, column)
        assert curves['alf2']['position_error_m'].max() < 1e-8


def test_pictures_are_drawn(fixed: Path) -> None:
    pytest.importorskip('matplotlib')
    for mechanism in ('slider_crank', 'double_four_bar'):
        picture = (fixed / f'{mechanism}.png').read_bytes()
        assert picture.startswith(b'\x89PNG') and len(picture) > 50_000


def test_panels_carry_the_figures_of_the_paper(four_bars: FormulationComparison) -> None:
    left, right = figure_plot._panels(four_bars, [four_bars.truth])
    shown = [panel.title for panel in [*left, *right] if panel.margin]
    assert [title.startswith('after figs. 10-13: ') for title in shown] == 6 * [True]
    assert ' '.join(shown).count('acceleration') == ' '.join(shown).count('energy') == 1
    assert EXAMPLES[0].figures == '3-8'


# ------------------------------------------------------------------------- setting of the paper


@pytest.mark.thorough
def test_finding_of_the_paper_is_told(published: tuple[Path, str]) -> None:
    folder, said = published
    for mechanism in ('slider_crank', 'double_four_bar'):
        picture = (folder / f'{mechanism}_published.png').read_bytes()
        assert picture.startswith(b'\x89PNG') and len(picture) > 50_000
    verdicts = dict(
        re.findall(r'^double_four_bar +(\w+) +(fails at [\d.]+|gets through)', said, re.M)
    )
    assert list(verdicts) == ['alf1', 'alf2_as_printed', 'alf2']
    assert verdicts['alf2'] == 'gets through'
    # which of the others is lost is chance, on another processor too; but it must be told
    agrees = verdicts['alf1'] != 'gets through' and verdicts['alf2_as_printed'] == 'gets through'
    assert ('the finding reproduces' in said) == agrees
    assert ('the finding does not reproduce' in said) == (not agrees)
    for name in ('slider_crank', 'double_four_bar'):
        curves = table(folder / f'{name}_published.csv')
        assert list(curves) == ['exact', 'alf1', 'alf2_as_printed', 'alf2']
        assert curves['alf2']['position_error_m'].max() < 1e-3


@pytest.mark.thorough
def test_finding_reproduces_around_its_tolerance(four_bars: FormulationComparison) -> None:
    """Not of one run, which chance decides, but of most."""
    lost = {}
    for name in ('alf1', 'alf2_as_printed'):
        said = scan.neighbours(four_bars, name, PublishedSetting(), (0.8, 0.87, 0.95, 1.05, 1.25))
        lost[name] = int(re.search(r'failed in (\d) of 5', said).group(1))
    assert lost['alf1'] >= 3 and lost['alf2_as_printed'] <= 1, lost


def test_scan_has_a_line_for_each_penalty(four_bars: FormulationComparison) -> None:
    lines = scan.table(
        four_bars, 'alf1', PublishedSetting(), (1e-4, 1e-5), (1e7, 1e9)
    ).splitlines()
    assert lines[0] == 'double_four_bar, alf1: time of failure, s'
    assert lines[1].split() == ['α', '\\', 'tolerance', '1e-04', '1e-05']
    assert [line.split()[0] for line in lines[2:]] == ['1e+07', '1e+09']
    for line in lines[2:]:
        for at in line.split()[1:]:
            assert at == '-' or 0.7 < float(at) <= 10.0  # no pass before


@pytest.mark.parametrize('integrator', ['adams', 'vode'])
@pytest.mark.parametrize('formulation', ['alf1', 'alf2_as_printed'])
def test_published_runs_follow_the_motion(
    four_bars: FormulationComparison, formulation: str, integrator: str
) -> None:
    """Up to the first pass, with an error that follows the tolerance."""
    times = four_bars.times[:30]
    wanted = one_freedom.four_bars(2).motion(math.pi / 2, -1.0, times)[-1]
    errors = []
    for tolerance in (1e-5, 1e-8):
        run = PublishedRun(
            load_scene('double_four_bar'),
            formulation,
            PublishedSetting(tolerance, 1e7, integrator),
        )
        *_, (q, _) = run.states(times)
        reached = q.reshape(-1, 2)[run.model.coordinate_block].ravel()
        errors.append(np.abs(reached - wanted).max())
    assert errors[0] < 1e-3 and errors[1] < 1e-6


def test_a_run_that_takes_too_long_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    for integrator in ('adams', 'vode'):
        run = PublishedRun(
            load_scene('slider_crank'), 'alf1', PublishedSetting(integrator=integrator)
        )
        monkeypatch.setattr('alf_ros.studies.paper.published.MOST', 50)
        with pytest.raises(StepError, match='more than 50 evaluations'):
            list(run.states(np.linspace(0.0, 1.0, 11).astype(np.float64)))


def test_adams_follows_its_tolerance() -> None:
    """ÿ = -y over ten seconds; between the steps too."""
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        motion = Adams(lambda t, y: np.array([y[1], -y[0]]), np.array([1.0, 0.0]), tolerance)
        worst = 0.0
        while motion.t < 10.0:
            before = motion.t
            motion.step()
            for t in (motion.t, 0.5 * (before + motion.t)):
                wanted = np.array([math.cos(t), -math.sin(t)])
                worst = max(worst, np.abs(motion.at(t) - wanted).max())
        assert worst < 100.0 * tolerance


def test_adams_takes_few_evaluations() -> None:
    """Its order rises with the tolerance: three more digits cost less than half as much again."""
    counts = []
    for tolerance in (1e-4, 1e-7, 1e-10):
        calls: list[float] = []

        def rates(t: float, y: Floats, calls: list[float] = calls) -> Floats:
            calls.append(t)
            return np.array([y[1], -y[0]])

        motion = Adams(rates, np.array([1.0, 0.0]), tolerance)
        while motion.t < 20.0:
            motion.step()
        counts.append(len(calls))
    assert counts[2] < 4 * counts[0] and counts[2] < 600, counts


def test_adams_ends_at_a_pole() -> None:
    motion = Adams(lambda t, y: 1.0 / (1.0 - t + 0.0 * y) ** 3, np.array([0.0]), 1e-6)
    with pytest.raises(StepError, match='no step is short enough'):
        for _ in range(10_000):
            motion.step()
    assert motion.t < 1.0


# -------------------------------------------------------------------------------------- Table I


def test_table_one_is_the_printed_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert figures.main(['--table']) == 0
    said = capsys.readouterr().out
    assert 'Misprints' in said
    rows = [line.split() for line in said.splitlines() if re.match(r'[1-4] ', line)]
    assert len(rows) == 8
    for (_, printed, literal, here), wanted in zip(rows[:3], table_one.PRINTED, strict=True):
        assert float(printed) == wanted
        assert float(here) == pytest.approx(wanted, rel=1e-3)
        assert float(literal) == pytest.approx(wanted, rel=1e-3, abs=1e-10)
    assert float(rows[3][3]) < 1e-14
    _, printed, third, two_thirds, here = rows[4]
    assert float(third) == pytest.approx(float(printed), abs=1e-12)
    assert float(two_thirds) == pytest.approx(-20009.81 / (20000.0 + 2.0 / 3.0), abs=1e-12)
    assert float(here) == pytest.approx(float(two_thirds), abs=1e-12)
    for values in rows[6:]:
        assert [float(x) for x in values[2:]] == pytest.approx([-1.0] * 3, abs=1e-12)


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['--step', '0'], '--step: not a whole number of steps, got 0.0; expected 0.02 s / k'),
        (['--step', '0.003'], '--step: not a whole number'),
        (['--step', 'nan'], '--step: not a finite number'),
        (['--penalty', '-1'], 'penalty: not usable, got -1.0'),
        (['--tolerance', '0'], '--tolerance: not usable, got 0.0; expected 1e-12 to 0.1'),
        (['--integrator', 'vod'], "--integrator: no such integrator, got 'vod'; did you mean"),
        (['--setting', 'papers'], "--setting: no such setting, got 'papers'; did you mean 'paper"),
        (['--scan', '--table'], 'not allowed with'),
        (['--folder', '/dev/null/here'], '--folder'),
        (['--scene', 'x'], 'unrecognized arguments'),
    ],
)
def test_what_cannot_be_drawn(arguments: list[str], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        figures.main(['--folder', str(tmp_path), *arguments])
    assert said in str(caught.value)
