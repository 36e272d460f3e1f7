"""`alf_ros.ensemble`: run a study, here or on a cluster, and return its Dataset."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.scene import SceneSource
from alf_ros.simulation import input_checks as check
from alf_ros.studies.ensemble.chunk import REASON, Arrays
from alf_ros.studies.ensemble.cluster import Cluster
from alf_ros.studies.ensemble.crews import Crew, Processes, ThisProcess
from alf_ros.studies.ensemble.member import trouble_of
from alf_ros.studies.ensemble.statistics import Statistics
from alf_ros.studies.ensemble.store import EnsembleStore, Memory, joined
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of

if TYPE_CHECKING:
    import xarray

_LOG = logging.getLogger(__name__)
_BEGIN = 1.0  # s of work, which this process does sooner than worker processes begin
Watching = Callable[['Progress'], None]


@dataclass(frozen=True)
class Progress:
    """How far an ensemble is. `done` members of `members`, of which `failed`; `kept` of them were
    finished before. `rate` (1/s) and `left` (s) are NaN before the first chunk."""

    members: int
    done: int
    failed: int
    kept: int
    seconds: float
    statistics: Statistics

    @property
    def rate(self) -> float:
        """Members per second, of those that were run now."""
        return (self.done - self.kept) / self.seconds if self.done > self.kept else float('nan')

    @property
    def left(self) -> float:
        """About how long the rest takes, s."""
        return (self.members - self.done) / self.rate


def ensemble(
    scene: SceneSource,
    vary: Mapping[str, Any] | str | Path,
    members: int | None = None,
    seed: int = 0,
    outputs: Any = ('energy',),
    store: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    *,
    sampling: str | None = None,
    duration: float = 10.0,
    period: float | None = None,
    chunk: int | None = None,
    watching: Watching = lambda _: None,
) -> xarray.Dataset:
    """Run a scene many times, each time with other numbers; returns all that was kept.

    `vary`: by the names of `fork --set` a distribution
    (`alf_ros.studies.ensemble.distributions`, or a frozen one of scipy.stats) or a list of
    values; or the path of a CSV file, whose first line has the names and each other one a member.
    `sampling`: 'random', 'lhs', 'sobol', 'saltelli', 'grid' or 'table'; the last two say
    themselves how many `members` there are. By default 'random', and 'table' for a file. A member
    is defined by `seed` and its index. `outputs`: the kept values, see
    `alf_ros.studies.ensemble.kept_outputs`. Each member runs for `duration` (s)
    and is looked at every `period` (s; about a hundredth of it) and at the end. `store`: a folder
    in which finished chunks of `chunk` members (by default about two seconds of work, or what an
    earlier store has) survive whatever happens; the same call continues there. `workers`:
    processes of this machine (0: none, this one; if not given, as many as it has processors, or
    none for what takes no longer than they to begin). `scheduler`: the address of a Dask cluster
    to use instead. `watching` is called after each chunk.

    The Dataset lies along `member`, with the varied names as coordinates and `reason`, which is
    empty unless a member failed. Its attribute `trouble` says if fixed steps of member 0 are too
    long, or if its steps leap over what they do not resolve, else it is empty. An array of
    reactions that are one of many that balance has the attribute `indeterminate`. Raises
    InputError for a study that cannot be run, AlfError if workers or the scheduler die: the store
    then holds the finished chunks.
    """
    _needs('xarray')
    if store is not None:
        store = paths.named(store, 'store')
        _needs('zarr')
    study = study_of(
        scene,
        vary,
        members=members,
        seed=seed,
        outputs=outputs,
        sampling=sampling,
        duration=duration,
        period=period,
        chunk=chunk,
        store=store,
    )
    arrays = conduct(study, store, crew(study, workers, scheduler), watching)
    if store is not None:
        import xarray

        found = xarray.open_zarr(store, chunks=None)
    else:
        found = dataset(study, arrays)
    return found.assign_attrs(trouble=trouble_of(study, 0))


def crew(
    study: Study,
    workers: int | None,
    scheduler: str | None,
    tell: Callable[[str], None] = _LOG.warning,
) -> Crew:
    """The crew that runs the chunks of a study; `tell` hears that a cluster has no workers. Raises
    InputError if both are given, or none answers."""
    if scheduler is not None:
        if workers is not None:
            raise InputError('a cluster has its own', key='workers', value=workers)
        return Cluster(check.text(scheduler, 'scheduler'), tell)
    count = len(os.sched_getaffinity(0)) if workers is None else check.whole(workers, 'workers', 0)
    if workers is None and study.members * study.cost <= _BEGIN:
        count = 0
    return Processes(count) if count else ThisProcess()


def conduct(
    study: Study,
    store: str | Path | None,
    crew: Crew,
    watching: Watching = lambda _: None,
) -> Arrays:
    """Run what the store has not; returns the arrays of all members where there is no store.

    Raises as `ensemble` does.
    """
    with ExitStack() as stack:
        keeper = Memory() if store is None else stack.enter_context(EnsembleStore(store, study))
        statistics = Statistics(study)
        failed, finished = 0, set()
        for chunk in keeper.finished():
            statistics.add(chunk)
            failed += chunk.failed
            finished.add(chunk.number)
        kept = done = sum(len(study.indices(number)) for number in finished)
        missing = [number for number in range(study.chunks) if number not in finished]
        if missing:
            keeper.begin()
        start = time.monotonic()
        watching(Progress(study.members, done, failed, kept, 0.0, statistics))
        for chunk in crew.chunks(study, missing) if missing else ():
            keeper.put(chunk)
            statistics.add(chunk)
            failed += chunk.failed
            done += len(chunk.arrays[REASON.name])
            seconds = time.monotonic() - start
            watching(Progress(study.members, done, failed, kept, seconds, statistics))
        return joined(study, keeper.finished()) if store is None else {}


def dataset(study: Study, arrays: Arrays) -> xarray.Dataset:
    """The arrays of all members as a Dataset, as `xarray.open_zarr` reads it from a store."""
    import numpy as np
    import xarray

    coordinates: dict[str, Any] = {'member': np.arange(study.members)}
    for parameter in study.parameters:
        coordinates[parameter.name] = 'member', arrays[parameter.name]
    found: dict[str, Any] = {}
    for variable in study.variables:
        dims = 'member', *variable.dims
        found[variable.name] = dims, arrays[variable.name], variable.attributes
        for name, values in variable.along.items():
            of_time = {'units': 's'} if name == 't' or name.startswith('t_') else {}
            coordinates[name] = name, np.array(list(values)), of_time
    found[REASON.name] = 'member', arrays[REASON.name]
    about = {'title': study.name, 'study': study.digest}
    return xarray.Dataset(found, coordinates, about)


def _needs(package: str) -> None:
    import importlib

    try:
        importlib.import_module(package)
    except ImportError:
        raise InputError(
            f"an ensemble as a Dataset needs {package}: pip install 'alf_ros[ensemble]'"
        ) from None
