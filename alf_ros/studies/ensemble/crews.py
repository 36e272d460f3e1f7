"""Crews run the chunks: this process, or worker processes of this machine.

A crew takes numbers of chunks and gives chunks, in whatever order they are done. A worker that
dies costs the chunk that it had: another one gets it.
"""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

from alf_ros.errors import AlfError
from alf_ros.kernel.numba_ext.held_signals import held
from alf_ros.studies.ensemble.chunk import Chunk, run_chunk
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.worker_process import COMMAND, receive, send

MOST_DEATHS = 3  # of workers that had the same chunk


class Crew(Protocol):
    """Runs chunks of a study."""

    def chunks(self, study: Study, numbers: Sequence[int]) -> Iterator[Chunk]:
        """The chunks of these numbers as they are done. Raises AlfError if that cannot be."""
        ...


class ThisProcess:
    """One chunk after the other, here."""

    def chunks(self, study: Study, numbers: Sequence[int]) -> Iterator[Chunk]:
        """The chunks of these numbers, in their order."""
        for number in numbers:
            yield run_chunk(study, number)


class Processes:
    """`count` worker processes of this machine, which end with this one.

    run: makes the result of a number from a study; a function of a module, as workers import it.
    A study of another kind has `indices`, the members of a number.
    """

    def __init__(self, count: int, run: Callable[[Any, int], Any] = run_chunk) -> None:
        self._count, self._run = count, run

    def chunks(self, study: Any, numbers: Sequence[int]) -> Iterator[Any]:
        """The chunks of these numbers as they are done."""
        waiting: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        for number in numbers:
            waiting.put(number)
        deaths = dict.fromkeys(numbers, 0)
        foremen = [
            _Foreman((self._run, study), waiting, done, deaths)
            for _ in range(min(self._count, len(numbers)))
        ]
        try:
            with held():  # `start` of a thread does not bear an error of a handler
                for foreman in foremen:
                    foreman.start()
            for _ in numbers:
                found = done.get()
                if isinstance(found, BaseException):
                    raise found
                yield found
        finally:
            for _ in foremen:
                waiting.put(None)
            for foreman in foremen:
                foreman.dismiss()


class _Foreman(threading.Thread):
    """Gives chunks to one worker process, and begins another one when it dies."""

    def __init__(
        self,
        work: tuple[Callable[[Any, int], Any], Any],
        waiting: queue.SimpleQueue[int | None],
        done: queue.SimpleQueue[Any],
        deaths: dict[int, int],
    ) -> None:
        super().__init__(daemon=True)
        self._work, self._waiting, self._done, self._deaths = work, waiting, done, deaths
        self._worker: subprocess.Popen[bytes] | None = None
        self._lock, self._dismissed = threading.Lock(), False

    def run(self) -> None:
        """Until there is nothing to do."""
        try:
            while (number := self._waiting.get()) is not None and not self._dismissed:
                self._done.put(self._chunk(number))
        except BaseException as error:  # it is raised where the chunks are awaited
            self._done.put(error)

    def _chunk(self, number: int) -> Any:
        while True:
            try:
                return self._asked(number)
            except (EOFError, OSError):
                self._deaths[number] += 1
                code = self._end()
            if self._dismissed or self._deaths[number] >= MOST_DEATHS:
                members = self._work[1].indices(number)
                return AlfError(
                    f'{self._deaths[number]} workers have died (exit code {code}) while they ran '
                    f'members {members[0]} to {members[-1]}; what is finished is kept'
                )

    def _asked(self, number: int) -> Any:
        with self._lock:
            if self._worker is None and not self._dismissed:
                self._worker = subprocess.Popen(
                    [sys.executable, '-c', COMMAND, *filter(None, sys.path)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env=os.environ,
                )
                begins = True
            else:
                begins = False
            worker = self._worker
        if worker is None:
            raise EOFError
        assert worker.stdin is not None and worker.stdout is not None
        if begins:
            send(worker.stdin, self._work)
        send(worker.stdin, number)
        return receive(worker.stdout)

    def _end(self) -> int:
        """End the worker; returns its exit code."""
        with self._lock:
            worker, self._worker = self._worker, None
        if worker is None:
            return 0
        worker.kill()
        for stream in (worker.stdin, worker.stdout):
            if stream is not None:
                try:
                    stream.close()
                except OSError:
                    pass
        return worker.wait()

    def dismiss(self) -> None:
        """End the worker, whatever it does, or begin none."""
        with self._lock:  # a worker that begins now is seen here; none begins later
            self._dismissed = True
            if self._worker is not None:
                self._worker.kill()
        if self.is_alive():  # not if a signal came before it was started
            self.join()
        self._end()
