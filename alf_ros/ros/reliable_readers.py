"""Reliable readers of a publisher that publishes as fast as possible: they lose nothing.

A middleware keeps the last messages for readers that lack them, and gives up the oldest one for a
new one. So a publisher in a hurry waits before it gives up a message that readers may lack. Before
that it does not wait: readers have a message long before they tell so. They are asked only where
the history is full; otherwise they tell every few seconds. The history is empty then, so whoever
counts its messages has to look from time to time. They are also asked after as many bytes as the
buffer of a socket holds. A history of more bytes is then empty in part, and not full when the
count says so: `depth_within` keeps a history short.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Any

from rclpy.duration import Duration

PATIENCE = 3.0  # s, with readers that do not follow, and at the end
# s between two messages in which readers may have told: of slow ticks, which are held, and of any
# messages; much less than the few seconds of their turn, and so long that ticks in real time do
# not look
_SLOW, _GAP = 2e-3, 0.1
_BYTES = 1 << 16  # of a history, a third of the buffer of a socket
_HEAD = 128  # bytes of a message beside its data


def depth_within(most: int, largest: int) -> int:
    """How many messages, `most` at most, a history may keep; largest: bytes of one of them."""
    return min(most, max(1, _BYTES // (_HEAD + largest)))


class ReliableReaders:
    """The reliable readers of `publisher`, which keeps the last `depth` messages."""

    def __init__(self, publisher: Any, depth: int) -> None:
        self.lagging = False  # one of them did not follow
        self._publisher, self._depth = publisher, max(1, depth)
        self._unacknowledged = False  # whether they may lack messages
        # of the messages in the history that they may lack, whether they must not
        self._kept: deque[bool] = deque(maxlen=self._depth)
        self._last = 0.0  # s, when the last message was published

    def await_room(self, hold: bool) -> None:
        """Before each message, whether they must not lack it (`hold`) or may: if it removes one
        from the history which they must not lack, wait until they have all; after a reader that
        did not follow, only look whether it has them now."""
        passed = time.monotonic() - self._last
        if self._kept and passed > (_SLOW if hold else _GAP) and self._have_all(0.0):
            self._clear()
        if hold and len(self._kept) == self._depth and self._kept[0]:
            self.lagging = not self._have_all(0.0 if self.lagging else PATIENCE)
            self._clear()

    def _have_all(self, seconds: float) -> bool:
        """Whether they tell within this time that they have all messages."""
        try:
            return bool(self._publisher.wait_for_all_acked(Duration(seconds=seconds)))
        except RuntimeError:  # a middleware that cannot tell
            return not self.lagging

    def _clear(self) -> None:
        self._unacknowledged = False
        self._kept.clear()

    def note(self, hold: bool) -> None:
        """After a message; `hold`: they must not lack it."""
        self._unacknowledged = True
        self._kept.append(hold)
        self._last = time.monotonic()

    def deliver(self, end: float) -> None:
        """Wait until they have all messages, up to `end` (s, of the monotonic clock); not for one
        that did not follow before."""
        if self._unacknowledged and not self.lagging:
            self._have_all(max(0.0, end - time.monotonic()))
