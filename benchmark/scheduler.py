"""How many chunks a Dask scheduler and the client of an ensemble keep up with:

    .venv/bin/python benchmark/scheduler.py [--workers 10 100] [--wait 2 2] [--no-results]

The client is the one of `alf_ros ensemble --scheduler`, and the scheduler the one of
distributed, each in a process of its own. Workers of distributed with one thread each are in a
third process: their chunks wait instead of computing, and have the arrays of a real chunk. A
thousand of them ask for more than one processor there, whatever they wait.
Each row is without and with a store, whose files are written one after another by the client.

A round is one chunk of each worker. The first two rounds, which have the start, and the last one,
in which workers end at different times, are not counted. Prints chunks per second beside the
number that is possible, the processor time of a chunk in each process, and the processor time of
client and scheduler in percent of chunks of 1 s and 5 s. Results: benchmark/results/scheduler.csv.
"""

from __future__ import annotations

import argparse
import asyncio
import csv
import multiprocessing
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from results_file import RESULTS

# isort: split
from alf_ros.logs.provenance import about
from alf_ros.studies.ensemble.chunk import Chunk, run_chunk
from alf_ros.studies.ensemble.cluster import Cluster
from alf_ros.studies.ensemble.store import EnsembleStore, Memory
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of

MEMBERS = 32  # of a chunk
_BEGUN_AT_ONCE = 50  # workers
os.environ['DASK_LOGGING__DISTRIBUTED'] = 'critical'  # of the processes begun below
_QUIET = {  # what a thousand workers in one process would do instead of waiting
    'distributed.admin.system-monitor.interval': '60s',
    'distributed.worker.profile.enabled': False,
}
_TICKS = os.sysconf('SC_CLK_TCK')
_lock, _first = threading.Lock(), dict[str, Chunk]()


def wait(study: Study, number: int) -> Chunk:
    """A chunk that waits for the duration of a member, with the arrays of a real one."""
    until = time.monotonic() + study.duration
    with _lock:
        if study.digest not in _first:
            _first[study.digest] = run_chunk(study, 0)
    time.sleep(max(0.0, until - time.monotonic()))
    return Chunk(number, _first[study.digest].arrays)


def scheduler(pipe: Any) -> None:
    """A process that is a scheduler; says its address."""
    from distributed import Scheduler

    async def run() -> None:
        async with Scheduler(host='127.0.0.1', port=0, dashboard=False) as found:
            pipe.send(found.address)
            await found.finished()

    asyncio.run(run())


def workers(pipe: Any, address: str, count: int, study: Study) -> None:
    """A process with `count` workers; says when all have begun."""
    import dask
    from distributed import Worker

    wait(study, 0)

    async def run() -> None:
        with tempfile.TemporaryDirectory() as folder:
            made = [  # each looks through its folder when it begins, so one for all is slow
                Worker(
                    address,
                    nthreads=1,
                    memory_limit=0,
                    local_directory=f'{folder}/{k}',
                    dashboard=False,
                )
                for k in range(count)
            ]
            for begin in range(0, count, _BEGUN_AT_ONCE):
                await asyncio.gather(*made[begin : begin + _BEGUN_AT_ONCE])
            pipe.send(count)
            await asyncio.Event().wait()

    with dask.config.set(_QUIET):
        asyncio.run(run())


@contextmanager
def process(run: Any, *arguments: Any) -> Iterator[tuple[int, Any]]:
    """The number of a process that runs until the end of the block, and what it says first."""
    ours, its = multiprocessing.Pipe()
    context = multiprocessing.get_context('spawn')
    child = context.Process(target=run, args=(its, *arguments), daemon=True)
    child.start()
    its.close()
    try:
        yield child.pid or 0, ours.recv()
    finally:
        child.kill()
        child.join()


def processor_time(pid: int) -> float:
    """Of a process so far, s."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def row(count: int, seconds: float, rounds: int, stored: bool) -> dict[str, str]:
    """With `count` workers."""
    study = study_of(
        'slider_crank',
        {'coupler.mass': {'normal': [1.0, 0.05]}},
        members=MEMBERS * count * (rounds + 3),
        outputs=['final(points.B)', 'max(energy)'],
        duration=seconds,
        period=0.1,
        chunk=MEMBERS,
    )
    with ExitStack() as stack:
        first, address = stack.enter_context(process(scheduler))
        its = stack.enter_context(process(workers, address, count, study))[0]
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        keeper = stack.enter_context(EnsembleStore(f'{folder}/s', study)) if stored else Memory()
        pids = os.getpid(), first, its
        given = Cluster(address, run=wait).chunks(study, range(study.chunks))
        chunks = stack.enter_context(closing(given))
        looks = []
        for done, chunk in enumerate(chunks, 1):
            keeper.put(chunk)
            if done in (2 * count, count * (rounds + 2)):
                looks.append([time.monotonic(), *map(processor_time, pids)])
                if len(looks) == 2:
                    break
    spent = [after - before for before, after in zip(*looks, strict=True)]
    made = count * rounds
    client, ours, others = (1e3 * each / made for each in spent[1:])
    rate, ideal = made / spent[0], count / seconds
    return {
        'workers': f'{count}',
        'store': 'yes' if stored else 'no',
        'wait_s': f'{seconds:g}',
        'chunks': f'{made}',
        'chunks_per_s': f'{rate:.4g}',
        'possible': f'{ideal:g}',
        'ratio': f'{rate / ideal:.3f}',
        'client_ms': f'{client:.3g}',
        'scheduler_ms': f'{ours:.3g}',
        'workers_ms': f'{others:.3g}',
        'of_1_s_percent': f'{(client + ours) / 10.0:.2g}',
        'of_5_s_percent': f'{(client + ours) / 50.0:.2g}',
    }


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--workers', type=int, nargs='+', default=[10, 100])
    parser.add_argument('--wait', type=float, nargs='+', default=[2.0, 2.0])
    parser.add_argument('--rounds', type=int, default=5)
    parser.add_argument('--no-results', action='store_true')
    options = parser.parse_args()
    load, found = os.getloadavg()[0], []
    if len(options.wait) != len(options.workers):
        parser.error('as many waits (s) as numbers of workers')
    for count, seconds in zip(options.workers, options.wait, strict=True):
        for stored in (False, True):
            found.append(row(count, seconds, options.rounds, stored))
            print('  '.join(f'{key} {value}' for key, value in found[-1].items()), flush=True)
    if not options.no_results:
        with open(RESULTS / 'scheduler.csv', 'w', encoding='utf-8', newline='') as stream:
            stream.write(f'# {about()}; load of the machine {load:.1f}\n')
            table = csv.DictWriter(stream, list(found[0]), lineterminator='\n')
            table.writeheader()
            table.writerows(found)


if __name__ == '__main__':
    main()
