"""One topic of the simulator: its publisher, and its place in the log."""

from __future__ import annotations

import copy
import time
from typing import TYPE_CHECKING

from rclpy.qos_overriding_options import QoSOverridingOptions

from alf_ros.errors import InputError
from alf_ros.logs.stamps import period_of
from alf_ros.ros.recording.recorder import Recorder
from alf_ros.ros.reliable_readers import ReliableReaders

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile


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
        self.readers = ReliableReaders(self._publisher, self.qos.depth)
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
        """Publish a message, and write it to the log; `hold`: reliable readers must not lack it.

        Others do not count: readers have them, but tell so every few seconds only.
        """
        if publish:
            self.readers.await_room(hold)
            begun = time.thread_time()
            self._publisher.publish(data)
            self.sent += time.thread_time() - begun
            self.readers.note(hold)
        if record and self.recorder is not None:
            self._recorded = self._period(ns)
            self.logged += len(data)
            self.recorder.write(self.topic, self.type, self.qos, ns, data, self.essential)
