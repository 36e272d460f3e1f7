"""Clusters that cannot work: a line reports each, and no command waits for one in silence."""

from __future__ import annotations

import os
import pickle
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from alf_ros.digest import digest_now
from alf_ros.errors import AlfError, InputError
from alf_ros.studies.ensemble import cluster, store
from alf_ros.studies.ensemble.chunk import Chunk, run_chunk
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import load_study
from support.paths import ROOT

dask = pytest.importorskip('dask')
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


def _too_large(study: Study, number: int) -> Chunk:
    raise MemoryError('two\nlines')


def _killed(study: Study, number: int) -> Chunk:
    raise distributed.KilledWorker('run_on_worker', SimpleNamespace(address='tcp://gone'), 3)


def _first_fails(study: Study, number: int) -> Chunk:
    if number == 0:
        raise MemoryError
    return Chunk(number, {})


_seen = list[Study]()


def _remembered(study: Study, number: int) -> Chunk:
    _seen.append(study)
    return Chunk(number, {})


def _nothing(study: Study, number: int) -> Chunk:
    return Chunk(number, {})


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


def test_dask_knows_all_settings_of_the_file() -> None:
    settings = yaml.safe_load((ROOT / 'config' / 'dask.yaml').read_text('utf-8'))
    unknown = list[str]()
    pending = [('', settings, dask.config.merge(*dask.config.defaults))]
    while pending:
        path, given, known = pending.pop()
        for key, value in given.items():
            if key not in known:
                unknown.append(f'{path}.{key}')
            elif isinstance(value, dict):
                pending.append((f'{path}.{key}', value, known[key]))
    assert unknown == []


def test_a_process_of_dask_takes_the_settings_of_the_file() -> None:
    code = 'import distributed, dask; print(dask.config.get("distributed.worker.profile.enabled"))'
    for settings, enabled in (({}, 'True'), ({'DASK_CONFIG': 'config/dask.yaml'}, 'False')):
        command = [sys.executable, '-c', code]
        run = subprocess.run(command, env=os.environ | settings, cwd=ROOT, capture_output=True)
        assert run.stdout.decode().strip() == enabled, run.stderr.decode()


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


def test_what_a_worker_cannot_do_is_one_line(study: Study, here: Any) -> None:
    here.scale(1)
    with pytest.raises(AlfError) as caught:
        list(cluster.Cluster(here.scheduler_address, run=_too_large).chunks(study, [1]))
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


def test_threads_that_ask_at_once_read_the_code_once(monkeypatch: pytest.MonkeyPatch) -> None:
    digest = cache(digest_now)
    monkeypatch.setattr(store, 'digest', digest)
    together, found = threading.Barrier(16), []

    def ask() -> None:
        together.wait()
        found.append(store.versions())

    threads = [threading.Thread(target=ask) for _ in range(together.parties)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert found == [store.versions()] * together.parties
    assert digest.cache_info().misses == 1


def test_the_chunks_of_a_thread_share_what_they_learn(study: Study) -> None:
    """With small chunks, members on a cluster took twice as long as in processes."""
    pickled, other = (
        pickle.dumps((_remembered, each)) for each in (study, replace(study, seed=7))
    )
    _seen.clear()
    for sent in (pickled, pickled, other):
        cluster.run_on_worker(sent, store.versions(), 0)
    thread = threading.Thread(target=cluster.run_on_worker, args=(other, store.versions(), 0))
    thread.start()
    thread.join()
    first, again, second, of_thread = _seen
    assert again is first
    assert [each.seed for each in _seen] == [study.seed, study.seed, 7, 7]
    assert of_thread is not second


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


def test_members_that_kill_their_workers_are_named(study: Study, here: Any) -> None:
    here.scale(1)
    with pytest.raises(AlfError, match=r'died again and again with members 0 to 0; what is fin'):
        list(cluster.Cluster(here.scheduler_address, run=_killed).chunks(study, [0]))


def test_what_is_finished_beside_a_failing_chunk_is_kept(
    study: Study, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of chunks that are fetched together, the failing one ends the study last."""
    here.scale(1)
    crew = cluster.Cluster(here.scheduler_address, run=_first_fails)
    monkeypatch.setattr(crew, '_wait', lambda done: _until(lambda: done.queue.qsize() == 2))
    given = crew.chunks(study, [0, 1])
    assert next(given).number == 1
    with pytest.raises(AlfError, match='a worker cannot run members 0 to 0'):
        next(given)


def test_a_result_that_goes_with_its_worker_is_made_again(
    tmp_path: Path, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was finished, and not fetched yet: the command said that the scheduler had gone."""
    monkeypatch.setattr(cluster, '_FETCHED', 1)
    study = _study(tmp_path, members=6)
    here.scale(1)
    address = next(iter(_workers(here, 1)))
    crew = cluster.Cluster(here.scheduler_address, lambda _: here.scale(2))
    given = crew.chunks(study, range(6))
    found = [next(given).number]
    tasks = here.scheduler.tasks
    _until(lambda: bool(tasks) and all(each.state == 'memory' for each in list(tasks.values())))
    here.sync(here.scheduler.remove_worker, address, stimulus_id='test')
    _until(lambda: any(each.status == 'lost' for each in list(crew._client.futures.values())))
    found += [each.number for each in given]
    assert sorted(found) == list(range(6))


def test_all_chunks_of_a_large_study_come_once(tmp_path: Path, here: Any) -> None:
    """Several fetches, and several times new chunks, by workers with several threads."""
    study = _study(tmp_path, members=150)
    here.scale(2)
    given = cluster.Cluster(here.scheduler_address, run=_nothing).chunks(study, range(150))
    assert sorted(each.number for each in given) == list(range(150))
    _until(lambda: not here.scheduler.tasks)  # workers keep no result


def _study(folder: Path, members: int) -> Study:
    file = folder / 'many.yaml'
    masses = ', '.join(f'{1.0 + 0.01 * k}' for k in range(members))
    file.write_text(STUDY.replace('1.0, 1.1', masses), 'utf-8')
    return load_study(file)


def _workers(here: Any, count: int) -> Any:
    _until(lambda: len(here.scheduler.workers) == count)
    return here.scheduler.workers


def _until(holds: Callable[[], bool]) -> None:
    last = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < last
        time.sleep(0.01)
