"""Ensembles whose processes are killed: the command on a study of many small chunks."""

from __future__ import annotations

import os
import random
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from alf_ros.studies.ensemble.crews import ThisProcess
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import load_study
from support.forked import started
from support.paths import ROOT

STUDY = """
scene: slider_crank
vary:
  coupler.mass: {normal: [1.0, 0.05]}
  m: [1.0, 1.1, -1.0]
members: 23
seed: 11
duration: 0.5
period: 0.1
chunk: 2
outputs: [max(norm(knee.force)), energy, points.B]
"""
PATIENCE = 120.0  # s for what takes a second alone
CLUSTER = """
import sys
from distributed import LocalCluster
cluster = LocalCluster(
    n_workers=int(sys.argv[1]), threads_per_worker=1, dashboard_address=None, host='127.0.0.1'
)
print(cluster.scheduler_address, flush=True)
sys.stdin.read()
"""


def study_in(folder: Path) -> tuple[Path, Study]:
    """The file of the study, and the study."""
    file = folder / 'study.yaml'
    file.write_text(STUDY, 'utf-8')
    return file, load_study(file)


def undisturbed(folder: Path, study: Study) -> dict[str, bytes]:
    """The bytes of the store that this process alone makes, by path."""
    conduct(study, folder / 'undisturbed.zarr', ThisProcess())
    return contents(folder / 'undisturbed.zarr')


def contents(store: Path) -> dict[str, bytes]:
    """The bytes of all files, by path."""
    files = (path for path in sorted(store.rglob('*')) if path.is_file())
    return {path.relative_to(store).as_posix(): path.read_bytes() for path in files}


def environment() -> dict[str, str]:
    """The environment of a process that can import the package."""
    return {**os.environ, 'PYTHONPATH': str(ROOT)}


class EnsembleCommand:
    """The command, which runs, with methods of `subprocess.Popen`."""

    def __init__(self, file: Path, store: Path, *options: str) -> None:
        command = ['-m', 'alf_ros', 'ensemble', str(file), '--store', str(store), *options]
        self._files = tempfile.TemporaryFile('w+'), tempfile.TemporaryFile('w+')
        self._process = started(command, store.parent, environment(), *self._files)
        self.pid, self.poll = self._process.pid, self._process.poll
        self.kill, self.send_signal = self._process.kill, self._process.send_signal
        self.returncode: int | None = None

    def communicate(self, timeout: float) -> list[str]:
        """Its output on both streams, when it has ended."""
        self.returncode = self._process.wait(timeout)
        said = []
        for file in self._files:
            with file:
                file.seek(0)
                said.append(file.read())
        return said


def begun(file: Path, store: Path, *options: str) -> EnsembleCommand:
    """The command, which runs."""
    return EnsembleCommand(file, store, *options)


def ended(process: EnsembleCommand) -> tuple[int, str]:
    """Exit code and all it said, of a process that ends."""
    out, err = process.communicate(PATIENCE)
    assert process.returncode is not None
    return process.returncode, out + err


def seals(store: Path) -> dict[str, tuple[int, int]]:
    """The chunks that are finished: when each was sealed (ns), and its inode."""
    found = {}
    for path in (store / '.alf_ros' / 'chunks').glob('*.json'):
        state = path.stat()
        found[path.name] = state.st_mtime_ns, state.st_ino
    return found


def wait(until: Callable[[], bool]) -> None:
    """Until something is so."""
    end = time.monotonic() + PATIENCE
    while not until():
        assert time.monotonic() < end, 'it takes too long'
        time.sleep(0.002)


def wait_for_instant(chance: random.Random, store: Path, process: EnsembleCommand) -> None:
    """Until some more chunks are finished, and some milliseconds more."""
    count = len(seals(store)) + chance.randrange(0, 6)
    wait(lambda: len(seals(store)) >= count or process.poll() is not None)
    time.sleep(chance.uniform(0.0, 0.05))


def children(pid: int) -> list[int]:
    """The processes that a process has begun: those that name it, as the lists of its threads go
    with a thread that ends."""
    found = []
    for name in filter(str.isdecimal, os.listdir('/proc')):
        try:
            _, parent, *_ = Path('/proc', name, 'stat').read_text().rpartition(')')[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(parent) == pid:
            found.append(int(name))
    return sorted(found)


def kill(pid: int) -> None:
    """SIGKILL, if it is still there."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass


def is_gone(pid: int) -> bool:
    """Whether a process has ended, reaped or not."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] == 'Z'
    except (FileNotFoundError, ProcessLookupError):
        return True
