"""A process that tries cases: what hangs or crashes takes no more than it with it.

Case n of a harness is what `make` gives for a random generator seeded with both, so a number is
all that has to be known of one. The processor time of a case is limited by a signal that nothing
in the process can hold off, its memory by the system.
"""

from __future__ import annotations

import importlib
import resource
import signal
import sys
import traceback
import warnings
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random
from typing import NamedTuple, Protocol

# Of a case, unless its harness says another: processor time (s), and time by the clock (s), for
# what waits for something uses none.
SECONDS, PATIENCE = 20.0, 600.0
MEMORY = 6 << 30  # bytes of address space
HARNESSES = ('expressions', 'tables', 'scenes', 'robots', 'states', 'logs', 'commands', 'services')


class Harness(Protocol):
    """`make` gives a case; `check` uses it: 'ran' or 'refused'; raises what should not be."""

    SUFFIX: str

    def make(self, random: Random) -> bytes: ...

    def check(self, case: bytes) -> str: ...


class Found(NamedTuple):
    """A fault of a case: 'traceback', 'silent', 'hang' or 'crash', with its place.

    The case itself is kept if it is known.
    """

    number: int
    kind: str
    where: str
    case: bytes = b''


def harness(name: str) -> Harness:
    """The harness of a name: the module in this folder."""
    made: Harness = importlib.import_module(name).Harness()
    return made


def case(tried: Harness, name: str, number: int) -> bytes:
    """Case `number` of a harness."""
    return tried.make(Random(f'{name} {number}'))


def limited(tried: Harness, data: bytes) -> str:
    """Check a case within the limits: a hang ends the process by SIGPROF or SIGALRM."""
    signal.setitimer(signal.ITIMER_PROF, getattr(tried, 'SECONDS', SECONDS))
    signal.setitimer(signal.ITIMER_REAL, getattr(tried, 'PATIENCE', PATIENCE))
    try:
        return tried.check(data)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def where(error: BaseException) -> str:
    """The kind of an error and the place in the package, or the last one, that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if '/alf_ros/' in frame.filename] or list(frames)
    place = f'{Path(own[-1].filename).name}:{own[-1].lineno} {own[-1].name}' if own else ''
    said = str(error).partition('\n')[0]
    return f'{type(error).__name__} in {place}: {said[:120]!r}'


def serve(connection: Connection, name: str, progress: object) -> None:
    """Try the numbers that come, (first, behind the last), until None comes; `progress` is the
    number of the case being tried."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter('ignore')
    tried = harness(name)
    connection.send('ready')
    while (numbers := connection.recv()) is not None:
        ends = {'ran': 0, 'refused': 0}
        found: list[Found] = []
        for number in range(*numbers):
            progress.value = number  # type: ignore[attr-defined]
            data = case(tried, name, number)
            try:
                ends[limited(tried, data)] += 1
            except (Exception, SystemExit, RecursionError) as error:
                kind = 'silent' if str(error).startswith('silent') else 'traceback'
                found.append(Found(number, kind, where(error), data))
        connection.send((ends, found))


sys.path.insert(0, str(Path(__file__).parent))
