"""The comparison of the paper, redrawn: the numbers behind the pictures, and the command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from alf_ros import figures
from alf_ros.errors import InputError

DATA = Path(__file__).parent / 'data'


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the command has written."""
    where = tmp_path_factory.mktemp('figures')
    assert figures.main(['--folder', str(where / 'new')]) == 0
    return where / 'new'


def table(path: Path) -> dict[str, dict[str, np.ndarray]]:
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
def test_exact_curves_are_the_reference(folder: Path, mechanism: str, data: str) -> None:
    wanted = json.loads((DATA / f'{data}.json').read_text(encoding='utf-8'))['samples']
    curves = table(folder / f'{mechanism}.csv')
    assert list(curves) == ['exact', 'alf1', 'alf2_literal', 'alf2']
    exact = {name: column[::5] for name, column in curves['exact'].items()}
    assert exact['t_s'] == pytest.approx([sample['t'] for sample in wanted], abs=1e-12)
    if mechanism == 'slider_crank':
        place, names = 2, ['lambda_crank_length', 'lambda_coupler_length']
        x, v = ([sample[key][place] for sample in wanted] for key in ('q', 'qd'))
        far = [abs(np.cos(sample['theta'])) > 0.1 for sample in wanted]
        lam = [sample['lambda'] for sample in wanted]
        shown = exact['x_of_B_m'], exact['x_of_B_m/s']
    else:
        names = ['lambda_crank0_length', 'lambda_crank1_length']
        x, v = ([sample[key][0] for sample in wanted] for key in ('B0', 'B0d'))
        far = [abs(np.sin(sample['theta'])) > 0.1 for sample in wanted]
        lam = [sample['lambda_crank'][:2] for sample in wanted]
        shown = exact['x_of_B0_m'], exact['x_of_B0_m/s']
    assert shown[0] == pytest.approx(x, abs=1e-10)
    assert shown[1] == pytest.approx(v, abs=1e-9)
    assert sum(far) > 80
    for n, name in enumerate(names):
        assert exact[name][far] == pytest.approx(np.array(lam)[far, n], abs=1e-6)


def test_alf2_is_nearest(folder: Path) -> None:
    for mechanism in ('slider_crank', 'double_four_bar'):
        curves = table(folder / f'{mechanism}.csv')
        for column in ('position_error_m', 'energy_error_J', 'constraint_error_m'):
            worst = {name: curves[name][column].max() for name in figures.FORMULATIONS}
            assert min(worst, key=worst.__getitem__) == 'alf2', (mechanism, column)
        assert curves['alf2']['position_error_m'].max() < 1e-8


def test_pictures_are_drawn(folder: Path) -> None:
    pytest.importorskip('matplotlib')
    for mechanism in ('slider_crank', 'double_four_bar'):
        picture = (folder / f'{mechanism}.png').read_bytes()
        assert picture.startswith(b'\x89PNG') and len(picture) > 50_000


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['--step', '0'], '--step: no whole number of steps, got 0.0; expected 0.02 s / k'),
        (['--step', '0.003'], '--step: no whole number'),
        (['--step', 'nan'], '--step: no whole number'),
        (['--penalty', '-1'], 'penalty: not usable, got -1.0'),
        (['--folder', '/dev/null/here'], '--folder'),
        (['--scene', 'x'], 'unrecognized arguments'),
    ],
)
def test_what_cannot_be_drawn(arguments: list[str], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        figures.main(['--folder', str(tmp_path), *arguments])
    assert said in str(caught.value)
