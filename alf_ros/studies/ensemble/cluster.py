"""The workers of a Dask cluster that somebody else has begun: `distributed` is imported here only.

Where its workers run, and who begins them (a shell, SLURM, Kubernetes), is no concern of this
package: it is given the address of the scheduler.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import pickle
import textwrap
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from typing import Any

from alf_ros.errors import AlfError, InputError
from alf_ros.studies.ensemble.chunk import Chunk, run_chunk
from alf_ros.studies.ensemble.crews import MOST_DEATHS
from alf_ros.studies.ensemble.store import versions
from alf_ros.studies.ensemble.study import Study

_LOG = logging.getLogger(__name__)
AHEAD = 2  # chunks given out for each thread of the cluster
_CONNECTING = 10.0  # s
_UNHEARD = 5.0  # s without a worker before it is told
_LONGEST_SAID = 200  # characters of what a worker said
_LOOKING = 0.05  # s between two looks for finished chunks
_COUNTING = 1.0  # s between two counts of the threads of the cluster
# of a chunk that went with its worker before it was fetched: the scheduler runs it once more
_AGAIN = ('lost', 'pending', 'finished')
_last = threading.local()  # what a thread of a worker has read
_FETCHED = 32  # chunks in one answer: some have histories of thousands of members


def run_on_worker(pickled: bytes, wanted: dict[str, str], number: int) -> Chunk:
    """A chunk, in the process of a worker. Raises InputError for other code or libraries."""
    here = versions()
    for name, version in wanted.items():
        if here[name] != version:
            raise InputError(
                f'the worker {_own_address()} has another version',
                key=name,
                value=here[name],
                expected=version,
            )
    run, study = _read(pickled)
    found: Chunk = run(study, number)
    return found


def _read(pickled: bytes) -> tuple[Callable[[Study, int], Chunk], Study]:
    """A function and a study, which each thread of a worker reads once: what its chunks have
    learned of the structure of their members took longer than small chunks themselves."""
    if getattr(_last, 'pickled', None) != pickled:
        _last.work = pickle.loads(pickled)
        _last.pickled = pickled
    work: tuple[Callable[[Study, int], Chunk], Study] = _last.work
    return work


def _own_address() -> str:
    """Of the worker that this process is."""
    from distributed import get_worker

    return str(get_worker().address)


class Cluster:
    """The workers of the scheduler at `address`, such as tcp://host:8786. `tell` hears a line
    where there are none: they may still come, as workers of a queue do.

    Raises InputError without `distributed`, and if no scheduler answers there.
    """

    def __init__(
        self,
        address: str,
        tell: Callable[[str], None] = _LOG.warning,
        run: Callable[[Study, int], Chunk] = run_chunk,
    ) -> None:
        try:
            import distributed
        except ImportError:
            raise InputError(
                "a cluster needs distributed: pip install 'alf_ros[ensemble]'", key='scheduler'
            ) from None
        self._distributed: Any = distributed
        self._address, self._run = address, run
        self._tell, self._is_told_empty = tell, False
        self._threads_then, self._counted = 0, -math.inf
        self._client: Any = None
        if _is_scheduler(distributed, address):
            with contextlib.suppress(OSError, TimeoutError, ValueError, TypeError):
                self._client = distributed.Client(
                    address, timeout=_CONNECTING, set_as_default=False, name='alf_ros'
                )
        if self._client is None:
            raise InputError(
                'no scheduler answers', key='scheduler', value=address, expected='tcp://host:port'
            )

    def chunks(self, study: Study, numbers: Sequence[int]) -> Generator[Chunk, None, None]:
        """The chunks of these numbers as they are done.

        All finished chunks are fetched together, and new ones are given out together: with
        hundreds of workers, a question to the scheduler for each chunk took longer than they do.
        """
        pickled, wanted = pickle.dumps((self._run, study), protocol=4), versions()
        waiting, deaths = list(reversed(numbers)), dict.fromkeys(numbers, 0)
        running: dict[Any, int] = {}
        done = self._distributed.as_completed(loop=self._client.loop, raise_errors=False)

        def give() -> None:
            if not waiting:
                return
            count = AHEAD * max(1, self._threads_lately()) - len(running)
            given = [waiting.pop() for _ in range(min(count, len(waiting)))]
            if given:
                each = [pickled] * len(given), [wanted] * len(given), given
                futures = self._client.map(run_on_worker, *each, pure=False)
                running.update(zip(futures, given, strict=True))
                done.update(futures)

        try:
            while running or waiting:
                give()
                self._wait(done)
                ready = {future: running.pop(future) for future in done.next_batch(block=False)}
                give()  # workers go on while these are fetched and stored
                failed = []
                for some in _pieces(list(ready), _FETCHED):
                    fetched = self._fetched(some)
                    while some:
                        future = some.pop(0)  # no reference is left: its worker forgets the chunk
                        number = ready.pop(future)
                        found = fetched.pop(future.key, None)
                        if found is None:
                            failed.append((future, number))
                        else:
                            del future
                            yield found
                for future, number in failed:
                    if future.status in _AGAIN:
                        running[future] = number
                        done.add(future)
                    else:
                        self._count_death(future, study, number, deaths)
                        waiting.append(number)
        finally:
            self._client.cancel(list(running), force=True)
            self._client.close(timeout=1.0)

    def _wait(self, done: Any) -> None:
        """Until a chunk is done; tells once that there is no worker."""
        last = time.monotonic()
        while not done.has_ready():
            time.sleep(_LOOKING)
            if time.monotonic() < last + _UNHEARD:
                continue
            last = time.monotonic()
            if self._is_told_empty == (self._threads() == 0):
                continue
            self._is_told_empty = not self._is_told_empty
            if self._is_told_empty:
                self._tell(f'the scheduler at {self._address} has no worker; waiting for one')

    def _threads_lately(self) -> int:
        """Of all workers, at most a second ago."""
        if time.monotonic() > self._counted + _COUNTING:
            self._threads_then, self._counted = self._threads(), time.monotonic()
        return self._threads_then

    def _threads(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError, RuntimeError):
            raise self._gone() from None

    def _gone(self) -> AlfError:
        return AlfError(
            f'the scheduler at {self._address} has gone; what is finished is kept, and the same '
            'command goes on from there'
        )

    def _fetched(self, futures: Sequence[Any]) -> dict[Any, Chunk | None]:
        """The chunks of these futures by key, without the unfinished ones."""
        finished = {each.key: each for each in futures if each.status == 'finished'}
        if not finished:
            return {}
        try:
            found: dict[Any, Chunk | None] = self._client.gather(finished, errors='skip')
            return found
        except (OSError, TimeoutError, CancelledError):  # it went while they were fetched
            raise self._gone() from None

    def _count_death(self, future: Any, study: Study, number: int, deaths: dict[int, int]) -> None:
        """Count a death of the worker that ran a chunk. Raises AlfError for any other end of
        the chunk, and for too many deaths."""
        if future.status == 'cancelled':
            raise self._gone()
        error = future.exception()
        if isinstance(error, AlfError):
            raise error
        members = study.indices(number)
        which = f'members {members[0]} to {members[-1]}'
        if not isinstance(error, self._distributed.KilledWorker):
            said = textwrap.shorten(f'{type(error).__name__}: {error}', _LONGEST_SAID)
            raise AlfError(f'a worker cannot run {which}: {said}; what is finished is kept')
        deaths[number] += 1
        if deaths[number] >= MOST_DEATHS:
            raise AlfError(
                f'workers have died again and again with {which}; what is finished is kept'
            )


def _pieces(all_: list[Any], length: int) -> Iterator[list[Any]]:
    """Of a list, each of at most this length."""
    for begin in range(0, len(all_), length):
        yield all_[begin : begin + length]


def _is_scheduler(distributed: Any, address: str) -> bool:
    """Whether a scheduler answers there. A client that meets another program, or nobody, waits
    for it also when it is closed, without end."""

    async def kind() -> Any:
        async with distributed.rpc(address, timeout=_CONNECTING) as there:
            return (await there.identity()).get('type')

    found: list[bool] = []

    def ask() -> None:
        with contextlib.suppress(Exception):  # whatever a program that is none makes of it
            found.append(asyncio.run(asyncio.wait_for(kind(), _CONNECTING)) == 'Scheduler')

    asking = threading.Thread(target=ask, daemon=True)  # the caller may have a loop of its own
    asking.start()
    asking.join(2.0 * _CONNECTING)
    return found == [True]
