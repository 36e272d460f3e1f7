"""The checklist of a new user: benchmark/new_user.py does its steps, and the page lists them."""

from __future__ import annotations

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest

from support.paths import ROOT
from support.reader import environment


@pytest.mark.thorough
def test_an_own_mechanism_from_the_pages(tmp_path: Path) -> None:
    """Checked, run and plotted, with what the pages say; test_tutorial.py pushes the node."""
    output = tmp_path / 'new_user.csv'
    command = [sys.executable, 'benchmark/new_user.py', '--only', 'own', '--warm']
    done = subprocess.run(
        [*command, '--output', str(output)],
        cwd=ROOT,
        env=environment(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    about, *lines = output.read_text('utf-8').splitlines()
    assert about.startswith('# ') and 'ready to run' in about
    rows = list(csv.DictReader(lines))
    assert [row['command'] for row in rows] == ['check lambda.yaml', 'own.py', 'plot.py']
    for row in rows:
        assert float(row['seconds']) > 0.0 and float(row['processor_seconds']) > 0.0
        assert (ROOT / row['page']).is_file()


def test_every_step_of_the_page_is_timed() -> None:
    stored = (ROOT / 'benchmark/results/new_user.csv').read_text('utf-8').splitlines()[1:]
    timed = {row['command'] for row in csv.DictReader(stored)}
    page = (ROOT / 'doc/new_user.md').read_text('utf-8')
    steps = re.findall(r'^\| \[ \] \| (.*?) \|', page, re.MULTILINE)
    assert len(steps) == 8 and len(timed) >= len(steps)
    for name in (
        'make setup',
        'make run',
        'push.py',
        'look.py',
        'pin_force.py',
        'check lambda.yaml',
    ):
        assert name in timed and any(name in step for step in steps)
