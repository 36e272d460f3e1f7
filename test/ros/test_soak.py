"""`make soak`, for some seconds: two nodes are commanded, stopped and killed; logs verify."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from support.paths import ROOT


@pytest.mark.thorough
def test_two_nodes_are_commanded_stopped_and_killed() -> None:
    command = [sys.executable, 'benchmark/soak.py', '--acts', '6', '--no-store', '--seed', '3']
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r'(\d+) acts, (\d+) logs verified, 0 faults', done.stdout)
    assert found is not None, done.stdout
    assert int(found[1]) >= 6 and int(found[2]) >= 2
