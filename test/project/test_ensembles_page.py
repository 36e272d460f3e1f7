"""The tutorial of doc/ensembles.md done as a reader does it, and its tables."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from alf_ros.studies.ensemble.distributions import LAWS
from alf_ros.studies.ensemble.sampling import SAMPLINGS
from alf_ros.studies.ensemble.study_reading import KEYS
from support.paths import ROOT
from support.reader import START_LIMIT, environment

TEXT = (ROOT / 'doc' / 'ensembles.md').read_text('utf-8')


def typed(line: str, folder: Path) -> str:
    """The output of a shell for one line."""
    done = subprocess.run(
        ['bash', '-ec', line.replace('.venv/bin/python', sys.executable)],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=START_LIMIT,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_tutorial_prints_what_the_page_says(tmp_path: Path) -> None:
    for name in ('clearance.yaml', 'clearance.py'):
        (text,) = re.findall(rf'^```\w+\n(# {re.escape(name)}\n.*?)^```$', TEXT, re.M | re.S)
        (tmp_path / name).write_text(text, 'utf-8')
    run, log = re.findall(r'^```sh\n(.*?)^```$', TEXT, re.M | re.S)
    (shown,) = re.findall(r'^```text\n(.*?)^```$', TEXT, re.M | re.S)
    assert typed(run, tmp_path).endswith(
        'clearance.zarr and clearance.html: 40 members, 0 failed\n'
    )
    assert typed('.venv/bin/python clearance.py', tmp_path) == shown
    assert 'member 3, a = ' in typed(log, tmp_path)
    assert 'EQUAL' in typed('.venv/bin/python -m alf_ros verify logs/*', tmp_path)


def test_the_page_names_all_keys_samplings_and_laws() -> None:
    for name in (*KEYS, *SAMPLINGS):
        assert f'`{name}`' in TEXT, name
    for law in LAWS:
        assert f'`{{{law}: [' in TEXT, law
