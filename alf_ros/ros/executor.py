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


class Finite(Protocol):
    """A node that ends by itself."""

    finished: Future[None]


_GIVE_WAY = 1e-4  # s after which the thread that writes a log hands the interpreter to a tick


def spin(node: Finite) -> None:
    """Call the callbacks of a node until its `finished` is done."""
    executor = Executor()
    executor.add_node(node)
    # Objects from the start stay: the collector need not examine them again and again. The
    # second collection tells it that nothing is left; it waits for a quarter of what it counted.
    gc.collect()
    gc.freeze()
    gc.collect()
    sys.setswitchinterval(_GIVE_WAY)
    while not node.finished.done():
        # spin() of the events executor hangs when it is to end; this does not.
        executor.spin_until_future_complete(node.finished, timeout_sec=1.0)
