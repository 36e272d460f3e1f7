"""Programs and commands of pages in doc/ print what the pages say."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from support.paths import ROOT
from support.reader import programs, shown_by

# whose programs and commands run by themselves, in a folder with the files of the page
PAGES = (
    'atlas',
    'closing_loops',
    'derivatives',
    'identification',
    'loads',
    'optimisation',
    'sensors',
    'side_by_side',
    'statics',
)
# of pages whose commands need more than that; they have a test of their own
OWN_COMMANDS = ('identification',)
TEXTS = {page: (ROOT / 'doc' / f'{page}.md').read_text('utf-8') for page in PAGES}
_FILE = re.compile(r'^```yaml\n(# (\S+\.yaml)\n.*?)^```', re.M | re.S)
_COMMAND = re.compile(
    r'^```bash\n\.venv/bin/python (.*?)\n^```\n\n^```text\n(.*?)^```$', re.M | re.S
)
PROGRAMS = [(page, *each) for page, text in TEXTS.items() for each in programs(text)]
COMMANDS = [
    (page, *each)
    for page, text in TEXTS.items()
    if page not in OWN_COMMANDS
    for each in _COMMAND.findall(text)
]


def prepared(page: str, folder: Path) -> None:
    """Write the files that a page shows."""
    for text, name in _FILE.findall(TEXTS[page]):
        (folder / name).write_text(text, 'utf-8')


@pytest.mark.parametrize(
    ('page', 'program', 'name', 'shown'),
    PROGRAMS,
    ids=[f'{page}-{name}' for page, _, name, _ in PROGRAMS],
)
def test_a_program_prints_what_the_page_says(
    page: str, program: str, name: str, shown: str, tmp_path: Path
) -> None:
    prepared(page, tmp_path)
    (tmp_path / name).write_text(program, 'utf-8')
    assert shown_by([name], tmp_path) == (shown, '')


@pytest.mark.parametrize(
    ('page', 'command', 'shown'),
    COMMANDS,
    ids=[f'{page}-{command.split()[2]}' for page, command, _ in COMMANDS],
)
def test_a_command_prints_what_the_page_says(
    page: str, command: str, shown: str, tmp_path: Path
) -> None:
    prepared(page, tmp_path)
    words = shlex.split(command)
    told, said = shown_by(words, tmp_path)
    assert told == shown
    # a busy machine may be slow enough to show how it gets on
    assert [line for line in said.splitlines() if not line.startswith(f'{words[2]} ')] == []


@pytest.mark.parametrize('page', PAGES)
def test_all_blocks_are_tried(page: str) -> None:
    names = [name for of, _, name, _ in PROGRAMS if of == page]
    assert names and len(names) == TEXTS[page].count('```python\n# ')
    if page not in OWN_COMMANDS:
        assert sum(of == page for of, _, _ in COMMANDS) == TEXTS[page].count('```bash')
