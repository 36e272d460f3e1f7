"""doc/closing_loops.md done as a reader does it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.paths import ROOT
from support.reader import programs, shown_by

TEXT = (ROOT / 'doc' / 'closing_loops.md').read_text('utf-8')
PROGRAMS = programs(TEXT)


@pytest.mark.parametrize(
    ('program', 'name', 'shown'), PROGRAMS, ids=[name for _, name, _ in PROGRAMS]
)
def test_a_program_of_the_page_prints_what_it_says(
    program: str, name: str, shown: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(program, 'utf-8')
    assert shown_by([name], tmp_path) == (shown, '')


def test_all_programs_of_the_page_are_tried() -> None:
    names = re.findall(r'^# (\w+\.py)$', TEXT, re.M)
    assert [name for _, name, _ in PROGRAMS] == names and len(names) == TEXT.count('```python')
