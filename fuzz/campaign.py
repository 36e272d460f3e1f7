"""Cases by the million: each kind in a worker of its own, and each finding with its case."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from signal import SIGALRM, SIGPROF

from spoiling import scratch
from worker import Found, case, harness, serve

BATCH = {'expressions': 2000, 'tables': 500, 'states': 200, 'scenes': 50, 'commands': 50}


@dataclass
class Tally:
    """The outcomes of the cases of one harness."""

    name: str
    cases: int = 0
    ran: int = 0
    refused: int = 0
    seconds: float = 0.0
    found: list[Found] = field(default_factory=list)

    def of(self, kind: str) -> int:
        """How many were of a kind."""
        return sum(each.kind == kind for each in self.found)


def campaign(
    name: str,
    first: int,
    seconds: float = 0.0,
    count: int = 0,
    report: Callable[[Tally], None] = lambda _: None,
) -> Tally:
    """Try the cases of a harness from `first` on, for so many seconds, or so many cases."""
    tally, worker, number = Tally(name), _Worker(name), first
    begin = time.monotonic()
    try:
        while (tally.cases < count) if count else (time.monotonic() - begin < seconds):
            size = min(BATCH.get(name, 10), count - tally.cases if count else 10**9)
            number += _batch(worker, tally, number, number + size)
            tally.cases = number - first
            tally.seconds = time.monotonic() - begin
            report(tally)
    finally:
        worker.close()
    return tally


def _batch(worker: _Worker, tally: Tally, first: int, end: int, again: bool = False) -> int:
    """Try some cases; returns how many were tried. One that ends its worker ends the batch.

    A case that hangs is tried `again` alone: it may have had to compile what no case before it
    used, which a later process finds compiled.
    """
    try:
        worker.connection.send((first, end))
        ends, found = worker.connection.recv()
        tally.ran += ends['ran']
        tally.refused += ends['refused']
        tally.found += found
        return end - first
    except (EOFError, ConnectionError):
        number, code = worker.progress.value, worker.ended()
        worker.start()
        # those of the batch before it are tried again, for what they say
        tried = _batch(worker, tally, first, number) if number > first else 0
        kind = 'hang' if code in (-SIGPROF, -SIGALRM) else 'crash'
        if kind == 'hang' and not again:
            return tried + _batch(worker, tally, number, number + 1, again=True)
        data = case(harness(tally.name), tally.name, number)
        tally.found.append(Found(number, kind, f'ended with {code}', data))
        return tried + 1


class _Worker:
    def __init__(self, name: str) -> None:
        self._context = multiprocessing.get_context('spawn')
        self.progress = self._context.Value('q', 0)
        self._name = name
        self._folder = scratch(name)
        self.start()

    def start(self) -> None:
        self.connection, theirs = self._context.Pipe()
        arguments = theirs, self._name, self.progress
        self._process = self._context.Process(target=serve, args=arguments, daemon=True)
        os.environ['FUZZ_FOLDER'] = str(self._folder)
        self._process.start()
        del os.environ['FUZZ_FOLDER']
        theirs.close()
        self.connection.recv()

    def ended(self) -> int | None:
        self._process.join()
        return self._process.exitcode

    def close(self) -> None:
        self._process.kill()
        self._process.join()
        self.connection.close()
        shutil.rmtree(self._folder, ignore_errors=True)
