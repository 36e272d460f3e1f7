"""Reliable readers of a publisher that publishes as fast as possible: they lose nothing.

A middleware keeps the last messages for readers that lack them, and gives up the oldest one for a
new one. So a publisher in a hurry waits before it gives up a message that readers may lack. Before
that it does not wait: readers have a message long before they tell so. They are asked only where
the history is full; otherwise they tell every few seconds.
"""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress
from typing import Any

from rclpy.duration import Duration

PATIENCE = 3.0  # s, with readers that do not follow, and at the end


class ReliableReaders:
    """The reliable readers of `publisher`, which keeps the last `depth` messages."""

    def __init__(self, publisher: Any, depth: int) -> None:
        self.lagging = False  # one of them did not follow
        self._publisher, self._depth = publisher, max(1, depth)
        self._unacknowledged = False  # whether they may lack messages
        # of the messages in the history that they may lack, whether they must not
        self._kept: deque[bool] = deque(maxlen=self._depth)

    def await_room(self) -> None:
        """Before a message that removes one from the history which they must not lack: wait until
        they have all; after a reader that did not follow, only look whether it has them now."""
        if len(self._kept) < self._depth or not self._kept[0]:
            return
        wait = Duration(seconds=0.0 if self.lagging else PATIENCE)
        with suppress(RuntimeError):  # a middleware that cannot tell
            self.lagging = not self._publisher.wait_for_all_acked(wait)
        self._unacknowledged = False
        self._kept.clear()

    def note(self, hold: bool) -> None:
        """After a message; `hold`: they must not lack it."""
        self._unacknowledged = True
        self._kept.append(hold)

    def deliver(self, end: float) -> None:
        """Wait until they have all messages, up to `end` (s, of the monotonic clock); not for one
        that did not follow before."""
        if self._unacknowledged and not self.lagging:
            left = Duration(seconds=max(0.0, end - time.monotonic()))
            with suppress(RuntimeError):  # a middleware that cannot tell
                self._publisher.wait_for_all_acked(left)
