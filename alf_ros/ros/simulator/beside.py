"""Long work in a thread of its own, while the executor answers requests and makes ticks."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator
from typing import Generic, TypeVar

from alf_ros.simulation import listening

T = TypeVar('T')

# s for which a coroutine that waits keeps the executor: without a pause it would be asked again
# and again, and take the interpreter from the work; a tick comes that much later
_PAUSE = 1e-3


class Beside:
    """One work at a time. `async with` puts changes that may need one into a line: each begins
    when all before it have ended."""

    def __init__(self) -> None:
        self._line: deque[object] = deque()
        self._thread: threading.Thread | None = None

    async def __aenter__(self) -> None:
        mine = object()
        self._line.append(mine)
        while self._line[0] is not mine:
            await _NextCall()

    async def __aexit__(self, *_: object) -> None:
        self._line.popleft()

    async def made(self, work: Callable[[], T]) -> T:
        """The result of `work`, which raises its exceptions here."""
        done = _Done(work)
        self._thread = threading.Thread(target=done.make)
        self._thread.start()
        while self._thread.is_alive():
            await _NextCall()
            self._thread.join(_PAUSE)
        self._thread = None
        return done.result()

    def end(self) -> None:
        """End the work, for a process that ends: steps of compiled code stop at once."""
        if self._thread is not None and self._thread.is_alive():
            listening.stop_all()
            self._thread.join()


class _Done(Generic[T]):
    """A work in a thread, with its result or its exception."""

    def __init__(self, work: Callable[[], T]) -> None:
        self._work = work
        self._results: list[T] = []
        self._error: BaseException | None = None

    def make(self) -> None:
        try:
            self._results.append(self._work())
        except BaseException as error:  # raised again where it is waited for
            self._error = error

    def result(self) -> T:
        if self._error is not None:
            raise self._error
        return self._results[0]


class _NextCall:
    """Until the executor calls the coroutine again, after whatever else is waiting.

    A `Future` would be asked in the same way by the executors of rclpy until Kilted.
    """

    def __await__(self) -> Generator[None, None, None]:
        yield
