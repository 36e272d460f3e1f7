"""`kill -9` of every process of an ensemble, at any instant: finished chunks are kept.

`pytest test/studies/test_ensemble_kills.py --kills 30` is the campaign.
"""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

from support.ensemble_kills import (
    CLUSTER,
    EnsembleCommand,
    begun,
    children,
    contents,
    ended,
    environment,
    is_gone,
    kill,
    seals,
    study_in,
    undisturbed,
    wait,
    wait_for_instant,
)


class Whole(NamedTuple):
    file: Path
    bytes: dict[str, bytes]


@pytest.fixture(scope='module')
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    """A study, and the bytes of its undisturbed store."""
    folder = tmp_path_factory.mktemp('ensemble')
    file, study = study_in(folder)
    return Whole(file, undisturbed(folder, study))


@pytest.fixture
def kills(request: pytest.FixtureRequest) -> Iterator[random.Random]:
    """A chance for each kill."""
    count = request.config.getoption('--kills')
    return (random.Random(f'{request.node.name} {n}') for n in range(count))


def _are_gone(pids: list[int]) -> bool:
    return all(map(is_gone, pids))


def test_the_client(whole: Whole, tmp_path: Path, kills: Iterator[random.Random]) -> None:
    store = tmp_path / 'killed.zarr'
    for chance in kills:
        process = begun(whole.file, store, '--workers', '1')
        wait_for_instant(chance, store, process)
        workers = children(process.pid)
        kill(process.pid)
        ended(process)
        wait(partial(_are_gone, workers))
        before = seals(store)
    code, said = ended(begun(whole.file, store, '--workers', '1'))
    assert code == 0, said
    assert before.items() <= seals(store).items()  # no finished chunk was made again
    assert contents(store) == whole.bytes


def test_a_worker(whole: Whole, tmp_path: Path, kills: Iterator[random.Random]) -> None:
    """Three of them that die with one chunk end the study; the same command continues."""
    store = tmp_path / 'killed.zarr'
    process = begun(whole.file, store, '--workers', '2')
    for chance in kills:
        wait(lambda: len(children(process.pid)) == 2 or process.poll() is not None)  # noqa: B023
        wait_for_instant(chance, store, process)
        for pid in children(process.pid)[-1:]:
            kill(pid)
        if process.poll() is not None:
            process = _again(process, whole, store)
    if not _is_done(*ended(process)):
        process = begun(whole.file, store, '--workers', '2')
        code, said = ended(process)
        assert code == 0, said
    assert contents(store) == whole.bytes


def _is_done(code: int, said: str) -> bool:
    """Whether a study with killed workers has come to its end, not to the third death."""
    assert code == 0 or 'workers have died' in said.splitlines()[-1], said
    return code == 0


def _again(process: EnsembleCommand, whole: Whole, store: Path) -> EnsembleCommand:
    """The same command behind the end of the last one; no finished chunk is made again. A study
    that is done begins again."""
    before = seals(store)
    if _is_done(*ended(process)):
        assert contents(store) == whole.bytes
        shutil.rmtree(store)
        before = {}
    process = begun(whole.file, store, '--workers', '2')
    wait(lambda: len(children(process.pid)) == 2 or process.poll() is not None)
    assert before.items() <= seals(store).items()
    return process


class Cluster:
    """A LocalCluster in a process of its own."""

    def __init__(self, workers: int = 1) -> None:
        self.process = subprocess.Popen(
            [sys.executable, '-c', CLUSTER, str(workers)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment(),
            text=True,
        )
        self.address = self.process.stdout.readline().strip()
        self.workers = [
            pid
            for pid in children(self.process.pid)
            if b'spawn_main' in Path(f'/proc/{pid}/cmdline').read_bytes()
        ]
        assert len(self.workers) == workers

    def end(self) -> None:
        """Kill all of it."""
        below = children(self.process.pid)
        kill(self.process.pid)
        self.process.communicate()
        for pid in below:
            kill(pid)


def test_each_process_of_a_cluster(
    whole: Whole, tmp_path: Path, kills: Iterator[random.Random]
) -> None:
    """A worker, then the client, then the scheduler; as often as there are kills."""
    store, cluster = tmp_path / 'cluster.zarr', Cluster(workers=2)
    before: dict[str, tuple[int, int]] = {}
    try:
        for chance in kills:
            process = begun(whole.file, store, '--scheduler', cluster.address)
            wait_for_instant(chance, store, process)
            kill(chance.choice(cluster.workers))
            wait_for_instant(chance, store, process)
            kill(process.pid)
            ended(process)
            assert before.items() <= seals(store).items()
            process = begun(whole.file, store, '--scheduler', cluster.address)
            wait_for_instant(chance, store, process)
            cluster.end()
            code, said = ended(process)
            last = said.splitlines()[-1]
            ends = 'has gone; what is finished is kept', 'no scheduler answers'  # yet, or any more
            assert code == 0 or any(end in last for end in ends), said
            assert 'Traceback' not in said, said
            before = seals(store)
            cluster = Cluster()
        code, said = ended(begun(whole.file, store, '--scheduler', cluster.address))
    finally:
        cluster.end()
    assert code == 0, said
    assert before.items() <= seals(store).items()
    assert contents(store) == whole.bytes
