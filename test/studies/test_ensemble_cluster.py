"""Clusters that cannot work: a line reports each, and no command waits for one in silence."""

from __future__ import annotations

import shutil
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from alf_ros.digest import digest_now
from alf_ros.errors import AlfError, InputError
from alf_ros.studies.ensemble import cluster, store
from alf_ros.studies.ensemble.chunk import run_chunk
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import load_study
from support.paths import ROOT

distributed = pytest.importorskip('distributed')

STUDY = """
scene: slider_crank
vary: {coupler.mass: [1.0, 1.1]}
sampling: table
duration: 0.01
period: 0.01
chunk: 1
outputs: [final(energy)]
"""


@pytest.fixture
def study(tmp_path: Path) -> Study:
    file = tmp_path / 'study.yaml'
    file.write_text(STUDY, 'utf-8')
    return load_study(file)


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A cluster in this process, without workers."""
    monkeypatch.setattr(cluster, '_UNHEARD', 0.1)
    with distributed.LocalCluster(
        n_workers=0,
        threads_per_worker=1,
        processes=False,
        protocol='tcp://',
        host='127.0.0.1',
        dashboard_address=':0',
    ) as found:
        yield found


def test_a_port_of_another_program_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    """It accepts the connection and says nothing; no thread waits for it afterwards."""
    monkeypatch.setattr(cluster, '_CONNECTING', 0.3)
    before = set(threading.enumerate())
    with socket.create_server(('127.0.0.1', 0)) as silent:
        with pytest.raises(InputError, match='no scheduler answers'):
            cluster.Cluster(f'tcp://127.0.0.1:{silent.getsockname()[1]}')
    assert not {each for each in threading.enumerate() if each.is_alive()} - before


def test_a_scheduler_without_workers_is_told_and_waited_for(study: Study, here: Any) -> None:
    said = []

    def tell(text: str) -> None:
        said.append(text)
        here.scale(1)

    found = cluster.Cluster(here.scheduler_address, tell).chunks(study, range(study.chunks))
    energies = {each.number: each.arrays['final_energy'].tobytes() for each in found}
    assert len(said) == 1 and said[0].endswith('has no worker; waiting for one')
    assert energies == {k: run_chunk(study, k).arrays['final_energy'].tobytes() for k in (0, 1)}


def test_what_a_worker_cannot_do_is_one_line(
    study: Study, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(study: Study, number: int) -> None:
        raise MemoryError('two\nlines')

    monkeypatch.setattr(cluster, 'run_chunk', run)
    here.scale(1)
    with pytest.raises(AlfError) as caught:
        list(cluster.Cluster(here.scheduler_address).chunks(study, [1]))
    assert str(caught.value) == (
        'a worker cannot run members 1 to 1: MemoryError: two lines; what is finished is kept'
    )


def test_a_worker_with_other_code_is_named(
    study: Study, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of hundreds of workers, nobody knew which one to mend."""
    made_of = iter([{'numpy': '2.0'}, {'numpy': '1.0'}])  # here, and on the worker
    monkeypatch.setattr(cluster, 'versions', made_of.__next__)
    here.scale(1)
    said = r'the worker tcp://127\.0\.0\.1:\d+ has another version'
    with pytest.raises(InputError, match=said):
        list(cluster.Cluster(here.scheduler_address).chunks(study, [0]))


@pytest.mark.parametrize('file', ['splines.py', 'columns.py', 'inspection/run.py'])
def test_all_code_of_the_package_counts(
    file: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A worker with another one of these modules mixed its members in without a word."""
    package = tmp_path / 'alf_ros'
    shutil.copytree(ROOT / 'alf_ros', package, ignore=shutil.ignore_patterns('__pycache__'))
    monkeypatch.setattr('alf_ros.digest._PACKAGE', package)
    monkeypatch.setattr(store, 'digest', digest_now)
    before = store.versions()
    assert store.versions() == before
    with (package / file).open('a', encoding='utf-8') as text:
        text.write('# changed')
    assert store.versions() != before


def test_members_that_kill_their_workers_are_named(
    study: Study, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = distributed.KilledWorker('run_on_worker', SimpleNamespace(address='tcp://gone'), 3)

    def run(study: Study, number: int) -> None:
        raise killed

    monkeypatch.setattr(cluster, 'run_chunk', run)
    here.scale(1)
    with pytest.raises(AlfError, match=r'died again and again with members 0 to 0; what is fin'):
        list(cluster.Cluster(here.scheduler_address).chunks(study, [0]))
