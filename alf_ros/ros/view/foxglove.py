"""The simulator's topics for Foxglove, on this machine only: the messages as they are.

A topic is subscribed to while somebody in Foxglove looks at it. Times are simulated ones.
"""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from alf_ros.errors import InputError
from alf_ros.ros.messages.topics import BEST_EFFORT, LATCHED, TOPICS
from alf_ros.ros.recording import rosbag2_metadata

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

HOST = '127.0.0.1'
# Between two looks at who subscribes, s; longest wait for a message.
LOOK_PERIOD = 0.2
_QUEUE = QoSProfile(depth=100)


class FoxgloveBridge:
    """A Foxglove server at `url`, in a thread of its own, while entered.

    Raises InputError if foxglove-sdk is not there or the port is taken.
    """

    def __init__(self, simulator: str, port: int) -> None:
        try:
            import foxglove
            from foxglove.websocket import Capability
        except ImportError:
            message = 'needs foxglove-sdk: pip install -r requirements/view.txt'
            raise InputError(message, key='--foxglove') from None
        # Kept: channels end with the context they were made in.
        self._context = context = foxglove.Context()
        try:
            self._server = foxglove.start_server(
                name=simulator,
                host=HOST,
                port=port,
                capabilities=[Capability.Time],
                context=context,
            )
        except RuntimeError as error:
            raise InputError(
                str(error), key='--foxglove', value=port, expected='a free port'
            ) from None
        self.url = f'ws://{HOST}:{self._server.port}'
        self._now = 0  # ns, of the simulator's clock
        self._node = Node('view_foxglove')
        self._channels: dict[str, tuple[Any, type]] = {}
        self._heard: dict[str, Subscription] = {}
        passed_on = {t.name: t.type for t in TOPICS if t.type is not Clock}
        for name, kind in {**passed_on, '/diagnostics': DiagnosticArray}.items():
            topic = self._node.resolve_topic_name(name.replace('~', simulator))
            ros_name = rosbag2_metadata.type_name(kind)
            schema = foxglove.Schema(
                name=ros_name,
                encoding='ros2msg',
                data=rosbag2_metadata.definition(ros_name).encode(),
            )
            channel = foxglove.Channel(
                topic, schema=schema, message_encoding='cdr', context=context
            )
            self._channels[topic] = channel, kind
        self._clock: Subscription | None = None
        self._node.create_subscription(String, f'{simulator}/scene', self._on_run, LATCHED)
        self._closing = False
        self._thread = threading.Thread(target=self._run, name='foxglove', daemon=True)

    def __enter__(self) -> FoxgloveBridge:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing = True
        self._thread.join()
        self._server.stop()

    def _run(self) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        looked = -LOOK_PERIOD
        while not self._closing:
            if time.monotonic() - looked > LOOK_PERIOD:
                self._look()
                looked = time.monotonic()
            executor.spin_once(timeout_sec=LOOK_PERIOD)
        executor.shutdown()
        self._node.destroy_node()

    def _look(self) -> None:
        """Subscribe only to topics that are shown in Foxglove."""
        for topic, (channel, kind) in self._channels.items():
            if channel.has_sinks() and topic not in self._heard:
                self._heard[topic] = self._node.create_subscription(
                    kind, topic, self._passing(channel), _QUEUE, raw=True
                )
            elif not channel.has_sinks() and topic in self._heard:
                self._node.destroy_subscription(self._heard.pop(topic))
        if self._heard and self._clock is None:
            self._clock = self._node.create_subscription(
                Clock, 'clock', self._on_clock, BEST_EFFORT
            )
        elif not self._heard and self._clock is not None:
            self._node.destroy_subscription(self._clock)
            self._clock, self._now = None, 0

    def _passing(self, channel: Any) -> Any:
        def passed(data: bytes) -> None:
            if self._now:
                channel.log(data, log_time=self._now)

        return passed

    def _on_clock(self, message: Clock) -> None:
        self._now = message.clock.sec * 1_000_000_000 + message.clock.nanosec
        self._server.broadcast_time(self._now)

    def _on_run(self, _: String) -> None:
        """Another run: time may start again, so Foxglove must forget its data."""
        self._server.clear_session()
