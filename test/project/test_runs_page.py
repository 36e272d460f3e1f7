"""doc/runs.md done as a reader does it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from alf_ros import Simulation, load_scene, record
from support.paths import ROOT
from support.reader import programs, shown_by

TEXT = (ROOT / 'doc' / 'runs.md').read_text('utf-8')
BLOCKS = programs(TEXT)


@pytest.mark.parametrize(('program', 'name', 'shown'), BLOCKS, ids=[name for _, name, _ in BLOCKS])
def test_a_program_prints_what_the_page_says(
    program: str, name: str, shown: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(program, 'utf-8')
    assert shown_by([name], tmp_path, MPLBACKEND='Agg') == (shown, '')
    if name == 'record.py':
        assert (tmp_path / 'pin.png').stat().st_size > 10_000
        assert len((tmp_path / 'run.csv').read_text('utf-8').splitlines()) == 402


def test_both_programs_are_there() -> None:
    assert [name for _, name, _ in BLOCKS] == ['record.py', 'pushed.py']


def test_every_kind_of_quantity_is_in_the_table() -> None:
    table = TEXT.partition('## Names')[2].partition('## ')[0]
    listed = {name.partition('.')[0] for name in re.findall(r'`([\w.]+)`', table)}
    for scene in ('slider_crank', 'wiper'):
        run = record(Simulation(load_scene(scene), ledger=True), 0.0)
        assert {name.partition('.')[0] for name in run.names} <= listed
