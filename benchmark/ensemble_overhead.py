"""The cost of an ensemble beside its members, with one worker and with two:

    .venv/bin/python benchmark/ensemble_overhead.py [--chunks N] [--chunk N] [--rounds N]

Slider-cranks of ten seconds in chunks of the size that a million of them have by default (another
size: --chunk), with a store: in one process, with processes of this machine, and with workers of a
Dask cluster, whose scheduler is in the process of the client. It has the settings of
config/dask.yaml, or, as `watched cluster`, only the settings of Dask.
The first fifth of the chunks, which has the start, and the last ones, in which one worker may wait
for the other, are not counted. All are measured by turns; numbers are medians.

`members`: of the processor time of all processes together, the part in which members are made,
stepped and read. The rest is the overhead: of the workers outside their members, of writing the
store, and of the client and the scheduler. These parts hold beside other programs too; members per
second do not. Two workers on two processors are `of twice` one by the clock. `by processor time`
is the same without waits: the time of a member with one worker, over that with two. Its part
`members alone` is how much the machine gives two processes that compute at once, as they share a
cache and a clock. `idle`: what the cluster takes of the processors of its workers while it has
nothing to do. Results: benchmark/results/ensemble_overhead.csv.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass, replace
from statistics import median

from measured_chunk import MEASURED, measured_chunk
from results_file import RESULTS

# isort: split
import yaml

from alf_ros import load_scene
from alf_ros.logs.provenance import about
from alf_ros.scene.overrides import with_changes
from alf_ros.studies.ensemble.chunk import Chunk
from alf_ros.studies.ensemble.cluster import Cluster
from alf_ros.studies.ensemble.crews import Crew, Processes
from alf_ros.studies.ensemble.statistics import Statistics
from alf_ros.studies.ensemble.store import EnsembleStore
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of

CASES = (
    ('this process', 1),
    ('processes', 1),
    ('processes', 2),
    ('cluster', 1),
    ('cluster', 2),
    ('watched cluster', 1),
    ('watched cluster', 2),
)
_DASK = RESULTS.parents[1] / 'config' / 'dask.yaml'
_END = 2  # chunks of each worker that are not counted
_SETTLING, _IDLE = 3.0, 5.0  # s behind the start of a cluster, and of looking at it


@dataclass(frozen=True)
class Cost:
    """Processor time of a member in its parts, and of one by the clock, s."""

    members: float
    workers: float
    store: float
    client: float
    clock: float

    @property
    def all(self) -> float:
        """Processor time of all processes."""
        return self.members + self.workers + self.store + self.client


class _Here:
    """One chunk after the other, in this process."""

    def chunks(self, study: Study, numbers: Sequence[int]) -> Iterator[Chunk]:
        """The chunks of these numbers, in their order."""
        return (measured_chunk(study, number) for number in numbers)


@contextmanager
def crew_of(kind: str, workers: int) -> Iterator[Crew]:
    """A crew of this kind, until the end of the block."""
    if kind.endswith('cluster'):
        import dask
        from distributed import LocalCluster

        settings = yaml.safe_load(_DASK.read_text('utf-8')) if kind == 'cluster' else {}
        with (
            dask.config.set(dask.config.merge(dask.config.config, settings)),
            LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=None, host='127.0.0.1'
            ) as found,
        ):
            yield Cluster(found.scheduler_address, run=measured_chunk)
    else:
        yield Processes(workers, run=measured_chunk) if kind == 'processes' else _Here()


def idle() -> float:
    """Processor time of this process and its children, over the time by the clock."""
    import psutil  # distributed needs it too

    here = psutil.Process()
    every = [here, *here.children(recursive=True)]

    def spent() -> float:
        return sum(sum(each.cpu_times()[:2]) for each in every)

    time.sleep(_SETTLING)
    begin = spent()
    time.sleep(_IDLE)
    return (spent() - begin) / _IDLE


def cost(crew: Crew, study: Study, workers: int) -> Cost:
    """Of the members that are counted."""
    statistics, looks, stored, measured = Statistics(study), [], 0.0, []
    with tempfile.TemporaryDirectory() as folder, EnsembleStore(f'{folder}/s', study) as store:
        for chunk in crew.chunks(study, range(study.chunks)):
            begin = time.thread_time()
            store.put(chunk)
            stored += time.thread_time() - begin
            statistics.add(chunk)
            looks.append((time.monotonic(), time.process_time(), stored))
            measured.append(chunk.arrays[MEASURED])
    first, last = study.chunks // 5, study.chunks - _END * workers
    client, storing = (b - a for a, b in zip(looks[first][1:], looks[last][1:], strict=True))
    counted = study.chunk * (last - first)
    of_members = of_workers = 0.0
    of_process: dict[float, list[list[float]]] = {}
    for (pid, own, so_far), look in zip(measured, looks, strict=True):
        if looks[first] <= look <= looks[last]:
            of_process.setdefault(pid, []).append([own, so_far, look[0]])
    chunks_of_workers, rate = 0, 0.0
    for each in of_process.values():
        own = sum(its for its, _, _ in each[1:])
        of_members += own
        of_workers += each[-1][1] - each[0][1] - own
        chunks_of_workers += len(each) - 1
        rate += study.chunk * (len(each) - 1) / (each[-1][2] - each[0][2])
    seen = study.chunk * chunks_of_workers
    client -= storing
    if os.getpid() in of_process:  # where all is in one process
        client, of_workers = client - of_members, 0.0
    return Cost(
        of_members / seen, of_workers / seen, storing / counted, client / counted, 1.0 / rate
    )


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--chunks', type=int, default=20)
    parser.add_argument('--chunk', type=int, help='members in a chunk')
    parser.add_argument('--rounds', type=int, default=5)
    parser.add_argument('--no-results', action='store_true')
    options = parser.parse_args()
    load = os.getloadavg()[0]
    scene = with_changes(
        load_scene('slider_crank'),
        {'solver.integrator': 'dop853', 'solver.step': '0.025'},  # s
    )
    many = study_of(
        scene,
        {'coupler.mass': {'normal': [1.0, 0.05]}},
        members=10**6,
        outputs=['final(energy)', 'max(energy)'],
        duration=10.0,
        period=1.0,
    )
    size = options.chunk or many.chunk
    study = replace(many, chunk=size, members=options.chunks * size)
    costs: dict[tuple[str, int], list[Cost]] = {case: [] for case in CASES}
    idles: dict[tuple[str, int], list[float]] = {case: [] for case in CASES}  # of clusters
    for _ in range(options.rounds):
        for kind, workers in CASES:
            with crew_of(kind, workers) as crew:
                if kind.endswith('cluster'):
                    idles[kind, workers].append(idle() / workers)
                costs[kind, workers].append(cost(crew, study, workers))
    found = []
    for (kind, workers), each in costs.items():
        parts = [[x / one.all for x in astuple(one)[:4]] for one in each]
        cells = {
            'crew': kind,
            'workers': f'{workers}',
            'member_ms': f'{1e3 * median(one.all for one in each):.3g}',
        }
        for n, part in enumerate(('members', 'workers', 'store', 'client')):
            cells[f'{part}_percent'] = f'{100.0 * median(one[n] for one in parts):.2f}'
        seen = idles[kind, workers]
        cells['idle_percent'] = f'{100.0 * median(seen):.2f}' if seen else '-'
        cells['members_per_s'] = f'{1.0 / median(one.clock for one in each):.4g}'
        twice = ['-'] * 3
        if workers == 2:  # each beside the run with one worker of the same round
            pairs = list(zip(costs[kind, 1], each, strict=True))
            ratios = (
                [one.clock / two.clock / 2.0 for one, two in pairs],
                [one.all / two.all for one, two in pairs],
                [one.members / two.members for one, two in pairs],
            )
            twice = [f'{median(some):.3f}' for some in ratios]
        cells |= zip(('of_twice', 'by_processor_time', 'members_alone'), twice, strict=True)
        found.append(cells)
        print('  '.join(f'{key} {value}' for key, value in cells.items()), flush=True)
    if not options.no_results:
        with open(RESULTS / 'ensemble_overhead.csv', 'w', encoding='utf-8', newline='') as stream:
            said = f'chunks of {study.chunk}; medians of {options.rounds}'
            stream.write(f'{about()}; {said}; load of the machine at the start {load:.1f}\n')
            table = csv.DictWriter(stream, list(found[0]), lineterminator='\n')
            table.writeheader()
            table.writerows(found)


if __name__ == '__main__':
    main()
