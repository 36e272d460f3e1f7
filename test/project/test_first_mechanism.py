"""doc/first_mechanism.md done as a reader does it."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from support.paths import ROOT

TEXT = (ROOT / 'doc' / 'first_mechanism.md').read_text(encoding='utf-8')
BLOCKS = re.findall(r'^```(\w+)\n(.*?)^```$', TEXT, re.MULTILINE | re.DOTALL)
KINDS = [kind for kind, _ in BLOCKS]


@pytest.fixture
def reader(tmp_path: Path) -> Path:
    """A folder with the file that the page says to save."""
    (tmp_path / 'lambda.yaml').write_text(BLOCKS[KINDS.index('yaml')][1])
    return tmp_path


def run(*command: str, cwd: Path) -> str:
    done = subprocess.run(
        [sys.executable, *command],
        cwd=cwd,
        env={'PYTHONPATH': str(ROOT), 'PATH': '', 'HOME': str(cwd)} | cache(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def cache() -> dict[str, str]:
    """The cache of the tests: the reader's commands use the code that the tests have compiled."""
    import numba

    return {'NUMBA_CACHE_DIR': numba.config.CACHE_DIR} if numba.config.CACHE_DIR else {}


def shown_after(kind: str) -> str:
    """The output that stands behind the block of a kind."""
    at = KINDS.index(kind) + 1
    assert KINDS[at] == 'text'
    return BLOCKS[at][1]


def test_the_file_is_short() -> None:
    assert len(BLOCKS[KINDS.index('yaml')][1].splitlines()) < 25


def test_check_says_what_the_page_says(reader: Path) -> None:
    start, *command = shlex.split(BLOCKS[KINDS.index('sh')][1])
    assert start == 'python'
    assert run(*command, cwd=reader) == shown_after('sh')
    assert (reader / 'check' / 'lambda.png').is_file()


def test_run_says_what_the_page_says(reader: Path) -> None:
    assert run('-c', BLOCKS[KINDS.index('python')][1], cwd=reader) == shown_after('python')


def test_the_line_is_straight(reader: Path) -> None:
    """While the crank is in its left half the end stays within 1 % of its way of the line."""
    sim = Simulation(load_scene(reader / 'lambda.yaml'))
    left = [s.points['F'] for s in sim.run(1.0, every=5) if s.points['A'][0] <= 0.0]
    x, y = np.array(left).T
    assert np.ptp(y) < 0.01 * np.ptp(x)
    assert np.ptp(x) == pytest.approx(0.4, abs=0.02)


def test_links_lead_somewhere() -> None:
    links = re.findall(r'\]\(([^)#]+)\)', TEXT)
    assert links and all((ROOT / 'doc' / link).exists() for link in links)
