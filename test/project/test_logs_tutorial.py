"""The tutorial of doc/logs.md done as a reader does it, cell by cell."""

import contextlib
import io
import os
import re
import subprocess
import sys
from typing import Any

import pytest

from support.paths import ROOT
from support.reader import START_LIMIT, environment

TUTORIAL = (ROOT / 'doc/logs.md').read_text('utf-8').partition('\n## Tutorial\n')[2]
BLOCKS = re.findall(r'^```(\w+)\n(.*?)^```$', TUTORIAL, re.DOTALL | re.MULTILINE)
STAMP = re.compile(r'\d{8}T\d{6}Z')


def shell(text, folder):
    """The output of a shell for the lines of a block, with this interpreter and package."""
    text = text.replace('.venv/bin/python', sys.executable)
    done = subprocess.run(
        ['bash', '-ec', text],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=START_LIMIT,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_cell_prints_what_stands_behind_it(folder):
    kinds = [kind for kind, _ in BLOCKS]
    assert kinds[0] == 'sh' and kinds.count('python') > 5
    make = BLOCKS[0][1].strip()
    assert re.fullmatch(r'make run DURATION=\d+', make)
    command = subprocess.run(
        ['make', '--dry-run', '--no-print-directory', '-C', str(ROOT), *make.split()[1:]],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()[-1]
    shell(command, folder)
    cells: dict[str, Any] = {}
    for (kind, text), (after, promised) in zip(BLOCKS[1:], BLOCKS[2:], strict=False):
        if kind == 'text':
            continue
        assert after == 'text', text
        if kind == 'sh':
            printed = shell(text, folder)
        else:
            with contextlib.redirect_stdout(io.StringIO()) as stream:
                exec(compile(text, 'doc/logs.md', 'exec'), cells)
            printed = stream.getvalue()
        assert STAMP.sub('TIME', printed) == STAMP.sub('TIME', promised), text
    assert os.path.isdir(folder / 'logs/moon_recovered')
