"""The tables in the documents agree with the stored results."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from alf_ros.studies.work_precision.measurement import Measurement, Setting
from support.paths import ROOT


def loaded(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / 'benchmark' / f'{name}.py')
    assert spec is not None and spec.loader is not None
    sys.path.insert(0, str(ROOT / 'benchmark'))  # as for a program there
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.path.remove(str(ROOT / 'benchmark'))
    return module


tables = loaded('tables')
peer_tables = loaded('peer_tables')
MARKS = {
    'doc/reliability.md': ('<!-- fuzz -->', '| commands |'),
    'doc/derivatives.md': ('<!-- derivatives -->', '| delta_robot |'),
    'doc/closing_loops.md': ('<!-- closure -->', '| stewart_platform |'),
    'doc/identification.md': ('<!-- identification -->', '| gripper |'),
    'doc/import.md': ('<!-- robots -->', '| talos_like |'),
    'doc/method.md': ('<!-- coarse_steps -->', '| esdirk43 |'),
    'doc/new_user.md': ('<!-- new_user -->', '| a moving mechanism |'),
}


@pytest.mark.parametrize('name', tables.DOCUMENTS)
def test_tables_agree_with_the_stored_results(name: str) -> None:
    text = (ROOT / name).read_text(encoding='utf-8')
    mark, row = MARKS.get(name, ('<!-- end of ', '| alf_ros adaptive |'))
    assert mark in text and row in text
    assert tables.filled(text) == text


def test_a_number_that_was_typed_is_found() -> None:
    text = (ROOT / 'doc/performance.md').read_text(encoding='utf-8')
    typed = text.replace('| mujoco |', '| mujoco | 9 ', 1)
    assert typed != text and tables.filled(typed) == text


def test_every_peer_is_there_with_every_mechanism() -> None:
    _, points = peer_tables.peer_points()
    engines = {
        'alf_ros rk4',
        'alf_ros dop853',
        'alf_ros adaptive',
        'alf_ros adaptive, a tenth of the states',
        'mujoco',
        'exudyn',
        'pinocchio',
    }
    # results may be older than the ten four-bars
    assert {'slider_crank', 'double_four_bar'} <= set(points) <= set(peer_tables.MECHANISMS)
    for mechanism, found in points.items():
        assert set(found) == engines
        for engine, curve in found.items():
            runs = 12 if engine == 'pinocchio' else 0 if 'adaptive' in engine else 56
            swept = len(peer_tables.survived(curve))
            # a sweep of ten four-bars ends where a run would take too long
            early = mechanism == 'n_four_bar' and 0 < swept < runs
            assert swept == runs or early, engine


def test_three_mechanisms_and_an_engine_that_lacks_one(monkeypatch: pytest.MonkeyPatch) -> None:
    figure = pytest.importorskip('matplotlib.figure')
    about, stored = peer_tables.rows('peers.csv')
    old = [row for row in stored if row['mechanism'] != 'n_four_bar']
    more = [
        {**row, 'mechanism': 'n_four_bar'}
        for row in old
        if row['mechanism'] == 'double_four_bar' and row['peer'] != 'alf_ros rk4'
    ]
    monkeypatch.setattr(peer_tables, 'rows', lambda name: (about, old + more))

    headings = [line for line in peer_tables.peers().splitlines() if '10 s | lost' in line]
    assert [line.split(',')[0] for line in headings] == [
        f'| {name}' for name in peer_tables.MECHANISMS.values()
    ]

    drawn: list[Any] = []
    monkeypatch.setattr(figure.Figure, 'savefig', lambda made, *_, **__: drawn.append(made))
    peer_tables.draw(Path('peers.png'))
    panels = drawn[0].axes
    assert [panel.get_title() for panel in panels[:3]] == list(peer_tables.MECHANISMS.values())
    two, ten = ([line.get_color() for line in panel.lines] for panel in panels[4:6])
    assert two[1:] == ten  # an engine has one colour


def test_what_is_lost() -> None:
    def point(error: float, failure: str = '') -> Measurement:
        return Measurement(Setting('x', '', 0, 1e-3), 1.0, 1, 0, 0, error, 0, 0, 0, failure)

    assert peer_tables.lost(point(math.nan, 'stopped')) and peer_tables.lost(point(0.5))
    assert peer_tables.lost(point(math.nan)) and not peer_tables.lost(point(1e-3))


def test_ratios_are_of_the_same_settings_and_machine(capsys: pytest.CaptureFixture[str]) -> None:
    run = loaded('run')
    costs = {('1', ''): 2.0, ('2', ''): 6.0, ('3', ''): 9.0}
    run.compare(('# cpu', {'a': {('1', ''): 1.0, ('2', ''): 2.0}}), ('# cpu', {'a': costs}))
    assert capsys.readouterr().out == '  2.50  a\n'
    run.compare(('# other', {'a': costs}), ('# cpu', {'a': costs}))
    assert 'nothing stored from this machine' in capsys.readouterr().out
    _, found = run.stored('work_precision.csv')
    assert 'slider_crank alf2 dop853_adaptive 10' in found
