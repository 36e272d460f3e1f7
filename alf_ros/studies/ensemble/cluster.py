"""The workers of a Dask cluster that somebody else has begun: `distributed` is imported here only.

Where its workers run, and who begins them (a shell, SLURM, Kubernetes), is no concern of this
package: it is given the address of the scheduler.
"""

from __future__ import annotations

import contextlib
import gc
import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from typing import Any

from alf_ros.digest import digest
from alf_ros.errors import AlfError, InputError
from alf_ros.studies.ensemble.chunk import Chunk, run_chunk
from alf_ros.studies.ensemble.crews import MOST_DEATHS
from alf_ros.studies.ensemble.store import versions
from alf_ros.studies.ensemble.study import Study

AHEAD = 2  # chunks given out for each thread of the cluster
_CONNECTING = 10.0  # s
_FOLDERS = ('kernel', 'mechanism', 'model', 'effects', 'scene', 'simulation', 'studies/ensemble')


def _made_of() -> dict[str, str]:
    """The code and the libraries here."""
    return {**versions(), 'sources': digest(*_FOLDERS)}


def run_on_worker(pickled: bytes, wanted: dict[str, str], number: int) -> Chunk:
    """A chunk, in the process of a worker. Raises InputError for other code or libraries.

    Each chunk has a study of its own: a worker may have several threads.
    """
    here = _made_of()
    for name, version in wanted.items():
        if here[name] != version:
            raise InputError(
                'a worker has another version', key=name, value=here[name], expected=version
            )
    return run_chunk(pickle.loads(pickled), number)


class Cluster:
    """The workers of the scheduler at `address`, such as tcp://host:8786.

    Raises InputError without `distributed`, and if nobody answers there.
    """

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError:
            raise InputError(
                "a cluster needs distributed: pip install 'alf_ros[ensemble]'", key='scheduler'
            ) from None
        self._distributed: Any = distributed
        self._address = address
        self._client: Any = None
        with contextlib.suppress(OSError, TimeoutError, ValueError, TypeError):
            self._client = distributed.Client(
                address, timeout=_CONNECTING, set_as_default=False, name='alf_ros'
            )
        if self._client is None:
            gc.collect()  # a client that failed waits for its thread, which ends with the process
            raise InputError(
                'no scheduler answers', key='scheduler', value=address, expected='tcp://host:port'
            )

    def chunks(self, study: Study, numbers: Sequence[int]) -> Iterator[Chunk]:
        """The chunks of these numbers as they are done."""
        pickled, wanted = pickle.dumps(study, protocol=4), _made_of()
        waiting, deaths = list(reversed(numbers)), dict.fromkeys(numbers, 0)
        running: dict[Any, int] = {}
        done = self._distributed.as_completed(loop=self._client.loop, raise_errors=False)

        def give() -> None:
            most = AHEAD * max(1, self._threads) if waiting else 0
            while waiting and len(running) < most:
                number = waiting.pop()
                future = self._client.submit(run_on_worker, pickled, wanted, number, pure=False)
                running[future] = number
                done.add(future)

        try:
            give()
            for future in done:
                number = running.pop(future)
                found = self._outcome(future, number, deaths)
                if found is None:
                    waiting.append(number)
                give()
                if found is not None:
                    yield found
        finally:
            self._client.cancel(list(running), force=True)
            self._client.close(timeout=1.0)

    @property
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

    def _outcome(self, future: Any, number: int, deaths: dict[int, int]) -> Chunk | None:
        """The chunk of a future; None if it is to be given out again."""
        if future.status in ('cancelled', 'lost'):
            raise self._gone()
        try:
            if future.status == 'finished':
                found: Chunk = future.result()
                return found
            error = future.exception()
        except (OSError, TimeoutError, CancelledError):  # it went while the answer was fetched
            raise self._gone() from None
        if not isinstance(error, self._distributed.KilledWorker):
            raise error
        deaths[number] += 1
        if deaths[number] >= MOST_DEATHS:
            raise AlfError(f'chunk {number}: {error}; what is finished is kept')
        return None
