"""Spinning a node until it says that it has finished."""

from __future__ import annotations

import gc
import sys
from typing import TYPE_CHECKING, Protocol

try:
    from rclpy.experimental.events_executor import EventsExecutor as Executor
except ImportError:
    from rclpy.executors import SingleThreadedExecutor as Executor

if TYPE_CHECKING:
    from rclpy.task import Future


class Working(Protocol):
    """A node that ends by itself."""

    finished: Future[None]

    def work(self) -> float:
        """Do the work that is due. Returns the time (s) until the next call."""
        ...


_GIVE_WAY = 1e-4  # s after which the thread that writes a log hands the interpreter to a tick


def spin(node: Working) -> None:
    """Call `work` of a node at its times, and the callbacks in between, until it is `finished`.

    A timer of the node would cost more than the ticks of a small mechanism: the executor waits for
    timers in a thread of its own, which wakes this one, and examines the callback at every call.
    """
    executor = Executor()
    executor.add_node(node)
    # Objects from the start stay: the collector need not examine them again and again. The
    # second collection tells it that nothing is left; it waits for a quarter of what it counted.
    gc.collect()
    gc.freeze()
    gc.collect()
    sys.setswitchinterval(_GIVE_WAY)
    while not node.finished.done():
        executor.spin_once(timeout_sec=node.work())
