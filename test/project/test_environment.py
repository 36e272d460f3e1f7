"""`make setup` does nothing when nothing changed, and leaves no stamp on an unfinished setup."""

import json
import os
import runpy
import shutil
import subprocess
import sys

import pytest

from support.paths import ROOT


@pytest.fixture
def clone(tmp_path):
    """A folder with the files that `make setup` reads."""
    for name in ('Makefile', 'scripts', 'requirements'):
        source = ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    return tmp_path


def setup(clone):
    """Run `make setup` with a pip that can reach nothing."""
    offline = {'PIP_NO_INDEX': '1', 'PIP_CONFIG_FILE': os.devnull}
    left_out = ('PIP_FIND_LINKS', 'AMENT_PREFIX_PATH', 'ROS_DISTRO')
    kept = {key: value for key, value in os.environ.items() if key not in left_out}
    command = ['make', '--no-print-directory', 'setup', f'PYTHON={sys.executable}']
    return subprocess.run(command, cwd=clone, env=kept | offline, capture_output=True, text=True)


def stamp_as_finished(clone):
    """Leave .venv as a finished setup would, with an interpreter that cannot run."""
    script = runpy.run_path(str(clone / 'scripts' / 'environment.py'))
    script['PYTHON'].parent.mkdir(parents=True)
    script['PYTHON'].write_text('#!/bin/sh\necho no such interpreter >&2\nexit 1\n')
    script['PYTHON'].chmod(0o755)
    script['STAMP'].write_text(json.dumps(script['wanted'](script['base_python'](), None)))
    return script['STAMP']


def test_nothing_to_do_is_silent(clone):
    stamp = stamp_as_finished(clone)
    done = setup(clone)
    assert (done.returncode, done.stdout, done.stderr) == (0, '', '')
    assert stamp.exists()


def test_a_changed_requirement_is_installed_and_a_failure_takes_the_stamp(clone):
    stamp = stamp_as_finished(clone)
    with open(clone / 'requirements' / 'test.txt', 'a') as file:
        file.write('# changed\n')
    done = setup(clone)
    assert done.returncode != 0
    assert 'setup: failed (1/4 solver)' in done.stderr
    assert not stamp.exists()


def test_a_setup_that_fails_leaves_no_stamp_and_starts_again(clone):
    for _ in range(2):
        done = setup(clone)
        assert done.returncode != 0
        assert 'setup: .venv with Python' in done.stdout
        assert 'setup: failed (1/4 solver)' in done.stderr
        assert not list((clone / '.venv').glob('*.json'))


def test_every_requirement_is_pinned():
    for path in (ROOT / 'requirements').glob('*.txt'):
        for line in path.read_text().splitlines():
            assert line.startswith('#') or line.count('==') == 1, f'{path.name}: {line}'
