"""The command identify: its errors are one line, and an interruption leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from alf_ros.__main__ import main
from alf_ros.ros.recording.run_writer import LogRun
from support.foreign_bags import joints, written
from support.reader import START_LIMIT, environment
from support.recordings import Machine, scene

FIT = ['--fit', 'coupler.mass', 'pin.viscous']


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a scene and a bag of its machine."""
    place = tmp_path_factory.mktemp('identify')
    (place / 'machine.yaml').write_text(scene().text, 'utf-8')
    motion = Machine(scene(coupler__mass=1.3), ('crank_pin', 'guide'), 1.0)
    pairs = zip(motion.t, motion.x, strict=True)
    states = [
        joints('/joint_states', 10**18 + round(t * 1e9), motion.joints, position=x)
        for t, x in pairs
    ]
    written(place / 'bag', states)
    return place


@pytest.mark.parametrize(
    ('arguments', 'expected'),
    [
        (['--fit', 'couple.mass'], "did you mean 'coupler'?"),
        ([*FIT, '--bounds', 'coupler.mass'], "--bounds: not a pair, got 'coupler.mass'"),
        ([*FIT, '--bounds', 'coupler.mass=1'], "--bounds: not two numbers, got '1'"),
        ([*FIT, '--prior', 'coupler.mass=1:x'], '--prior: not a number'),
        ([*FIT, '--noise', 'guid=1e-3'], "did you mean 'guide'?"),
        ([*FIT, '--map', 'pin=crank_pin'], '--map: nothing of this name in the recording'),
        ([*FIT, '--loss', 'hubr'], "invalid choice: 'hubr'"),
        ([*FIT, '--hold-out', '0.5'], 'no windows to keep away, or none to fit'),
        ([*FIT, '--design', 'gravit.acceleration.1=-5'], "did you mean 'gravity'?"),
        ([*FIT, '--design', 'pendulum', '--design-duration', '0'], '--design-duration: out of'),
        (
            [*FIT, '--design-duration', '1'],
            '--design-duration: has no meaning without --design',
        ),
        (
            [*FIT, '--fit', 'mechanism.bodies.coupler.mass'],
            '--fit: given twice, also by coupler.mass',
        ),
        ([], 'required: --fit'),
    ],
)
def test_errors_are_one_line(
    folder: Path, arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ['identify', str(folder / 'machine.yaml'), str(folder / 'bag'), *arguments]
    assert main([*given, '--output', str(folder / 'none')]) == 2
    told = capsys.readouterr().err
    assert expected in told and told.count('\n') == 1
    assert not (folder / 'none').exists()


@pytest.mark.parametrize(
    ('output', 'expected'),
    [('', "machine.yaml'; expected another folder"), ('machine.yaml', 'Not a directory')],
)
def test_what_cannot_be_written_is_told_before_the_fit(
    folder: Path, output: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """There is no such recording, which the fit would say; the scene stays as it is."""
    before = (folder / 'machine.yaml').read_bytes()
    given = ['identify', str(folder / 'machine.yaml'), str(folder / 'no_bag'), *FIT]
    assert main([*given, '--output', str(folder / output)]) == 2
    told = capsys.readouterr().err
    assert told.count('\n') == 1 and '--output: ' in told and expected in told
    assert (folder / 'machine.yaml').read_bytes() == before


def test_a_log_that_finds_the_disk_full_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scene and the report are there."""

    def full(run: LogRun) -> None:
        raise OSError('it_0.mcap: No space left on device')

    monkeypatch.setattr(LogRun, 'close', full)
    given = ['identify', str(folder / 'machine.yaml'), str(folder / 'bag'), *FIT]
    assert main([*given, '--output', str(folder / 'full')]) == 2
    told = capsys.readouterr().err.splitlines()[-1]
    assert told == 'alf_ros identify: --output: it_0.mcap: No space left on device'
    assert {'machine.yaml', 'report.html'} <= {path.name for path in (folder / 'full').iterdir()}


def test_ctrl_c_leaves_nothing(folder: Path) -> None:
    """In the middle of the fit, which the first line of progress marks."""
    command = [sys.executable, '-c', INTERRUPTED, 'identify', 'machine.yaml', 'bag', *FIT]
    process = subprocess.Popen(
        [*command, '--output', 'left'],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == 'a step\n'
        os.kill(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=START_LIMIT)
    finally:
        process.kill()
    assert process.returncode == 130
    assert 'Traceback' not in errors
    assert not (folder / 'left').exists()


# the command, whose windows say that they run, again and again so that the fit does not end
INTERRUPTED = """
import sys
from alf_ros.__main__ import main
from alf_ros.studies.identification.window_runs import WindowRuns

misfit = WindowRuns.misfit

def telling(*arguments):
    print('a step', flush=True)
    while True:
        misfit(*arguments)

WindowRuns.misfit = telling
sys.exit(main(sys.argv[1:]))
"""
