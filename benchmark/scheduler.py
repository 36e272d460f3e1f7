"""How many chunks a Dask scheduler and the client of an ensemble keep up with:

    .venv/bin/python benchmark/scheduler.py [--workers N ...] [--threads N ...] [--wait S ...]

The client is the one of `alf_ros ensemble --scheduler`, and the scheduler the one of
distributed, each in a process of its own. Workers of distributed are in other processes, with one
or several threads each: their chunks wait instead of computing, and have the arrays of a real
chunk. Each thread has one chunk at a time, so a thousand threads are a thousand simulated workers.
A thousand objects of distributed ask for more than one processor themselves, so they are measured
without chunks (`--wait 0`): what their heartbeats cost the scheduler.
Each row is without and with a store, whose files are written one after another by the client.

A round is one chunk of each thread. The first two rounds, which have the start, and the last one,
in which threads end at different times, are not counted. Prints chunks per second beside the
number that is possible, the processor time of a chunk in each process, the share of a processor
that the scheduler takes before the first chunk, and how many threads with chunks of 1 s and 5 s
fill one processor, of the scheduler and of the client. Results: benchmark/results/scheduler.csv.
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
_SETTLING = 2.0  # s behind the start of the last worker
_IDLE = 14.0  # s without chunks: two heartbeats of each of a thousand workers
CHUNKS = 1.0, 5.0  # s
MEASURED = (
    'chunks',
    'chunks_per_s',
    'possible',
    'ratio',
    'client_ms',
    'scheduler_ms',
    'workers_ms',
    'scheduler_full_1_s',
    'scheduler_full_5_s',
    'client_full_1_s',
    'client_full_5_s',
)
_TICKS = os.sysconf('SC_CLK_TCK')
Row = dict[str, str]
_lock, _first = threading.Lock(), list[Chunk]()  # a process of workers has one study


def wait(study: Study, number: int) -> Chunk:
    """A chunk that waits for the duration of a member, with the arrays of a real one."""
    until = time.monotonic() + study.duration
    with _lock:
        if not _first:
            _first.append(run_chunk(study, 0))
    time.sleep(max(0.0, until - time.monotonic()))
    return Chunk(number, _first[0].arrays)


def scheduler(pipe: Any) -> None:
    """A process that is a scheduler; says its address."""
    from distributed import Scheduler

    async def run() -> None:
        async with Scheduler(host='127.0.0.1', port=0, dashboard=False) as found:
            pipe.send(found.address)
            await found.finished()

    asyncio.run(run())


def workers(pipe: Any, address: str, count: int, threads: int, study: Study) -> None:
    """A process with `count` workers of `threads` each; says when all have begun."""
    import dask
    from distributed import Worker

    wait(study, 0)

    async def run() -> None:
        with tempfile.TemporaryDirectory() as folder:
            made = [  # each looks through its folder when it begins, so one for all is slow
                Worker(
                    address,
                    nthreads=threads,
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


def row(workers_of: list[int], threads: int, seconds: float, rounds: int, stored: bool) -> Row:
    """With processes of so many workers each, of `threads` each."""
    count = sum(workers_of)
    places = count * threads
    study = study_of(
        'slider_crank',
        {'coupler.mass': {'normal': [1.0, 0.05]}},
        members=MEMBERS * places * (rounds + 3),
        outputs=['final(points.B)', 'max(energy)'],
        duration=seconds or 1.0,
        period=0.1,
        chunk=MEMBERS,
    )
    with ExitStack() as stack:
        first, address = stack.enter_context(process(scheduler))
        its = [
            stack.enter_context(process(workers, address, each, threads, study))[0]
            for each in workers_of
        ]
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        keeper = stack.enter_context(EnsembleStore(f'{folder}/s', study)) if stored else Memory()
        time.sleep(_SETTLING)
        before = processor_time(first)
        time.sleep(_IDLE)
        idle = (processor_time(first) - before) / _IDLE

        named = {
            'workers': f'{count}',
            'threads': f'{places}',
            'processes': f'{len(workers_of)}',
            'idle_percent': f'{100.0 * idle:.2g}',
            'store': 'yes' if stored else 'no',
            'wait_s': f'{seconds:g}',
        }
        if seconds == 0.0:
            return named | dict.fromkeys(MEASURED, '-') | {'store': '-', 'wait_s': '-'}

        def look() -> tuple[float, ...]:
            others = sum(map(processor_time, its))
            return time.monotonic(), time.process_time(), processor_time(first), others

        given = Cluster(address, run=wait).chunks(study, range(study.chunks))
        chunks = stack.enter_context(closing(given))
        looks = []
        for done, chunk in enumerate(chunks, 1):
            keeper.put(chunk)
            if done in (2 * places, places * (rounds + 2)):
                looks.append(look())
                if len(looks) == 2:
                    break
    spent = [after - before for before, after in zip(*looks, strict=True)]
    made = places * rounds
    client, ours, others = (1e3 * each / made for each in spent[1:])
    rate, ideal = made / spent[0], places / seconds
    filled = [f'{float(f"{1e3 * each / ms:.2g}"):g}' for ms in (ours, client) for each in CHUNKS]
    cells = [f'{made}', f'{rate:.4g}', f'{ideal:g}', f'{rate / ideal:.3f}']
    cells += [f'{each:.3g}' for each in (client, ours, others)]
    return named | dict(zip(MEASURED, cells + filled, strict=True))


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--workers', type=int, nargs='+', default=[10, 100, 100, 1000])
    parser.add_argument('--threads', type=int, nargs='+', default=[1, 1, 10, 1])
    parser.add_argument('--processes', type=int, nargs='+', default=[1, 1, 1, 4])
    parser.add_argument('--wait', type=float, nargs='+', default=[2.0, 2.0, 5.0, 0.0])
    parser.add_argument('--rounds', type=int, default=4)
    parser.add_argument('--no-results', action='store_true')
    options = parser.parse_args()
    load, found = os.getloadavg()[0], list[Row]()
    cases = options.workers, options.threads, options.processes, options.wait
    if len(set(map(len, cases))) > 1:
        parser.error('as many threads, processes and waits (s) as numbers of workers')
    for count, threads, processes, seconds in zip(*cases, strict=True):
        share = [count // processes] * processes
        for stored in (False, True) if seconds else (False,):
            found.append(row(share, threads, seconds, options.rounds, stored))
            print('  '.join(f'{key} {value}' for key, value in found[-1].items()), flush=True)
    if not options.no_results:
        with open(RESULTS / 'scheduler.csv', 'w', encoding='utf-8', newline='') as stream:
            stream.write(f'{about()}; load of the machine {load:.1f}\n')
            table = csv.DictWriter(stream, list(found[0]), lineterminator='\n')
            table.writeheader()
            table.writerows(found)


if __name__ == '__main__':
    main()
