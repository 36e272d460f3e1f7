"""One topic of the simulator: its publisher, and its place in the log."""

from __future__ import annotations

import copy
import time
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING

from rclpy.duration import Duration
from rclpy.qos_overriding_options import QoSOverridingOptions

from alf_ros.errors import InputError
from alf_ros.logs.stamps import period_of
from alf_ros.ros.recording.recorder import Recorder

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile

PATIENCE = 3.0  # s, with reliable readers of ticks as fast as possible, and at the end


class Output:
    """One topic. `mode` is 'auto' (published while somebody subscribes), 'on' or 'off'; messages
    also go to `recorder` if it exists. Raises InputError for a bad QoS override.
    """

    def __init__(self, node: Node, name: str, message_type: type, qos: QoSProfile) -> None:
        self.mode = 'auto'
        self.recorder: Recorder | None = None
        self.essential = False  # to repeat the run
        self.rate = 0.0  # of messages in the log, Hz; 0: all
        self._recorded = -1  # period of the last message in the log
        self.type = message_type
        # rclpy writes overrides into the profile it is given.
        self.qos = copy.copy(qos)
        options = QoSOverridingOptions.with_default_policies()
        try:
            self._publisher = node.create_publisher(
                message_type, name, self.qos, qos_overriding_options=options
            )
        except RuntimeError as error:
            raise InputError(str(error), key=f'qos_overrides.{name}') from None
        self._node = node
        self.topic = self._publisher.topic_name
        self._subscribed = False
        self.lagging = False  # a reliable reader did not follow ticks as fast as possible
        self._unacknowledged = False  # whether readers may lack messages
        # Of the messages in the history that readers may lack, whether they must not.
        self._kept: deque[bool] = deque(maxlen=max(1, self.qos.depth))
        self.sent = 0.0  # s spent to publish
        self.logged = 0  # bytes given to the log

    def close(self) -> None:
        """Remove the publisher."""
        self._node.destroy_publisher(self._publisher)

    def look(self) -> None:
        """See whether somebody subscribes."""
        self._subscribed = bool(self._publisher.get_subscription_count())

    @property
    def published(self) -> bool:
        """Whether a message now would be published, as far as was seen at the last `look`."""
        return self._subscribed if self.mode == 'auto' else self.mode == 'on'

    @property
    def wanted(self) -> bool:
        """Whether a message now would go anywhere."""
        self.look()
        return self.recorder is not None or self.published

    def record(self, recorder: Recorder | None) -> None:
        """From now on log to `recorder`."""
        self.recorder, self._recorded = recorder, -1

    def _due(self, ns: int) -> bool:
        """Whether the log wants a message of this stamp: the first of each period of `rate`."""
        return not self.rate or self._period(ns) != self._recorded

    def _period(self, ns: int) -> int:
        return period_of(ns, self.rate)

    def due(self, ns: int) -> bool:
        """Whether the log wants a message of this stamp."""
        return self.recorder is not None and self._due(ns)

    def send(self, data: bytes, ns: int, record: bool = True) -> None:
        """The same bytes go to the subscribers and, at stamp `ns`, to the log."""
        self.look()
        self.hand_on(data, ns, self.published, record and self.due(ns))

    def hand_on(
        self, data: bytes, ns: int, publish: bool, record: bool, hold: bool = False
    ) -> None:
        """Publish a message, and write it to the log; `hold`: wait for reliable readers first, if
        the history of the publisher is full, and gives up a held message that they may not have.

        Others do not count: readers have them, but tell so every few seconds only.
        """
        if publish:
            if hold and len(self._kept) == self._kept.maxlen and self._kept[0]:
                self._await_readers()
            begun = time.thread_time()
            self._publisher.publish(data)
            self.sent += time.thread_time() - begun
            self._unacknowledged = True
            self._kept.append(hold)
        if record and self.recorder is not None:
            self._recorded = self._period(ns)
            self.logged += len(data)
            self.recorder.write(self.topic, self.type, self.qos, ns, data, self.essential)

    def deliver(self, end: float) -> None:
        """Wait until reliable readers have all messages, up to `end` (s, of the monotonic clock);
        not for one that did not follow before."""
        if self._unacknowledged and not self.lagging:
            left = Duration(seconds=max(0.0, end - time.monotonic()))
            with suppress(RuntimeError):  # a middleware that cannot tell
                self._publisher.wait_for_all_acked(left)

    def _await_readers(self) -> None:
        """Wait until reliable readers have all messages; after a reader that did not follow, only
        look whether it has them now."""
        wait = Duration(seconds=0.0 if self.lagging else PATIENCE)
        with suppress(RuntimeError):  # a middleware that cannot tell
            self.lagging = not self._publisher.wait_for_all_acked(wait)
        self._unacknowledged = False
        self._kept.clear()
