"""SIGTERM and Ctrl-C: real processes of commands end with their code, and leave no workers."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import yaml

from alf_ros.__main__ import main
from alf_ros.studies.ensemble.worker_process import COMMAND
from support.design_scenes import sprung_block
from support.ensemble_kills import (
    PATIENCE,
    begun,
    children,
    environment,
    is_gone,
    study_in,
    wait,
)
from support.ensemble_kills import STUDY as STUDY_OF_MEMBERS
from support.thorough import thinned

STUDY = """scene: block.yaml
vary: {main.stiffness: [10, 100]}
minimise: {crossing: rail.position, value: 0.2}
duration: 0.6
"""
BOTH = pytest.mark.parametrize(('number', 'code'), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])


@pytest.mark.parametrize(
    ('number', 'code'),
    thinned([(signal.SIGINT, 130), (signal.SIGTERM, 143)], keep=[(signal.SIGTERM, 143)]),
)
def test_workers_end_before_their_command(number: int, code: int, tmp_path: Path) -> None:
    """They still import, and do not read their pipes yet."""
    (tmp_path / 'block.yaml').write_text(yaml.safe_dump(sprung_block()), 'utf-8')
    (tmp_path / 'study.yaml').write_text(STUDY, 'utf-8')
    command = [sys.executable, '-m', 'alf_ros', 'optimise', 'study.yaml', '--starts', '2']
    process = subprocess.Popen(
        [*command, '--workers', '2'],
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        wait(lambda: len(children(process.pid)) == 2 or process.poll() is not None)
        workers = children(process.pid)
        process.send_signal(number)
        out, said = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert len(workers) == 2 and all(map(is_gone, workers))
    assert (process.returncode, out) == (code, '')
    assert said == _said('optimise', number)
    assert not (tmp_path / 'optimised').exists()


def test_an_ensemble_that_is_stopped_tells_what_it_knows(tmp_path: Path) -> None:
    """The statistics of the members that have finished; only the first mean was to be seen."""
    file, _ = study_in(tmp_path)
    file.write_text(STUDY_OF_MEMBERS.replace('members: 23', 'members: 100000'), 'utf-8')
    store = tmp_path / 'it.zarr'
    process = begun(file, store, '--workers', '1')
    try:
        wait(lambda: len(list(store.glob('.*/chunks/*.json'))) > 2 or process.poll() is not None)
        process.send_signal(signal.SIGINT)
        out, said = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 130
    assert 'the same command continues' in said
    lines = out.splitlines()
    assert lines[0].startswith('max_norm_knee.force: ')
    assert all(' ± ' in line and 'median' in line and '(member ' in line for line in lines)


def test_a_worker_ends_with_its_client_while_it_imports(tmp_path: Path) -> None:
    """Of a package whose import never ends; the message before the end is not read."""
    (tmp_path / 'alf_ros').mkdir()
    stuck = 'import time\nprint("importing", flush=True)\ntime.sleep(1e6)\n'
    (tmp_path / 'alf_ros' / '__init__.py').write_text(stuck, 'utf-8')
    worker = subprocess.Popen(
        [sys.executable, '-c', COMMAND, str(tmp_path), *filter(None, sys.path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert worker.stdin is not None and worker.stdout is not None
    try:
        assert worker.stdout.readline() == b'importing\n'
        worker.send_signal(signal.SIGINT)  # of a terminal, which reaches workers too
        worker.stdin.write(b'a message')
        worker.stdin.close()
        assert worker.wait(PATIENCE) == 0
    finally:
        worker.kill()
        worker.stdout.close()


IN_A_TEXT = """
import sys
from alf_ros import __main__
__main__.run = lambda name, given: exec(f'import signal; signal.raise_signal({given[0]})')
sys.exit(__main__.main(['check', sys.argv[1]]))
"""


@BOTH
def test_a_signal_in_a_text_that_python_executes_ends_with_the_code(
    number: int, code: int
) -> None:
    """As in the standard library, which makes classes so while modules are imported."""
    done = subprocess.run(
        [sys.executable, '-c', IN_A_TEXT, str(int(number))],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (code, '')
    assert done.stderr == _said('check', number)


def test_handlers_of_a_program_stay_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    """Which calls a command in its own process, perhaps in a thread."""

    def own(number: int, frame: object) -> None:
        raise AssertionError

    before = signal.getsignal(signal.SIGTERM)
    try:
        for handler in (signal.SIG_DFL, signal.SIG_IGN, own):
            signal.signal(signal.SIGTERM, handler)
            assert main(['--version']) == 0
            assert signal.getsignal(signal.SIGTERM) is handler
    finally:
        signal.signal(signal.SIGTERM, before)
    codes: list[int] = []
    thread = threading.Thread(target=lambda: codes.append(main(['--version'])))
    thread.start()
    thread.join()
    assert codes == [0]


def _said(command: str, number: int) -> str:
    return f'alf_ros {command}: stopped by SIGTERM\n' if number == signal.SIGTERM else ''
