"""doc/atlas.md done as a reader does it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from support.paths import ROOT
from support.reader import programs, shown_by

TEXT = (ROOT / 'doc' / 'atlas.md').read_text('utf-8')
PROGRAMS = programs(TEXT)
COMMANDS = re.findall(
    r'^```bash\n\.venv/bin/python (.*?)\n^```\n\n^```text\n(.*?)^```$', TEXT, re.M | re.S
)


@pytest.mark.parametrize(
    ('program', 'name', 'shown'), PROGRAMS, ids=[name for _, name, _ in PROGRAMS]
)
def test_a_program_prints_what_the_page_says(
    program: str, name: str, shown: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(program, 'utf-8')
    assert shown_by([name], tmp_path) == (shown, '')


@pytest.mark.parametrize(('command', 'shown'), COMMANDS, ids=[c.split()[2] for c, _ in COMMANDS])
def test_a_command_prints_what_the_page_says(command: str, shown: str, tmp_path: Path) -> None:
    assert shown_by(shlex.split(command), tmp_path) == (shown, '')


def test_all_blocks_are_tried() -> None:
    assert [name for _, name, _ in PROGRAMS] == re.findall(r'^# (\w+\.py)$', TEXT, re.M)
    assert len(COMMANDS) == TEXT.count('```bash')
