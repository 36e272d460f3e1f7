"""Topics of the sensors of a scene: `~/<kind>/<name>`, of the simulator's namespace."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rclpy.qos import QoSProfile

from alf_ros.errors import StepError
from alf_ros.logs.stamps import period_of
from alf_ros.ros.messages.sensor_messages import Fill, message_type, writer
from alf_ros.ros.recording.recorder import Recorder
from alf_ros.ros.simulator.output_costs import TopicCost
from alf_ros.ros.simulator.topic_output import Output
from alf_ros.scene.scene import Scene
from alf_ros.simulation.sensors import Sensors
from alf_ros.simulation.simulation import Simulation

if TYPE_CHECKING:
    from rclpy.node import Node

_QUEUE = QoSProfile(depth=10)


@dataclass
class _Topic:
    output: Output
    write: Fill
    rate: float  # Hz; 0: one message a tick
    period: int = -1  # of the last instant
    seen: int = -1  # its stamp, ns
    due: bool = False  # whether it is the first one of its period
    made: float = 0.0  # s


def check_types(scene: Scene) -> None:
    """Raise InputError for a sensor of a scene whose messages are not installed."""
    for sensor in scene.sensors:
        message_type(sensor.kind)


class SensorOutputs:
    """Publishes and records what the sensors of `scene` measure.

    A measurement is computed if somebody subscribes, or the log takes it, or the next one depends
    on it. `prefix` precedes the names of frames. Raises InputError for a sensor whose messages are
    not installed.
    """

    def __init__(self, node: Node, scene: Scene, prefix: str) -> None:
        self._scene, self._sensors = scene, Sensors(scene)
        self._topics: dict[str, _Topic] = {}
        for label, sensor in self._sensors.sensors.items():
            output = Output(node, f'~/{label}', message_type(sensor.kind), _QUEUE)
            rate = sensor.parameters.rate or 0.0
            self._topics[label] = _Topic(output, writer(sensor, prefix), rate)

    def close(self) -> None:
        """Remove the topics."""
        for topic in self._topics.values():
            topic.output.close()

    @property
    def outputs(self) -> dict[str, Output]:
        """By the name of the topic as a user writes it."""
        return {f'~/{label}': topic.output for label, topic in self._topics.items()}

    def record(self, recorder: Recorder | None) -> None:
        """From now on log to `recorder`."""
        for topic in self._topics.values():
            topic.output.record(recorder)

    def begin(self) -> None:
        """A run begins, at any time: the one before does not count."""
        self._sensors.forget()
        for topic in self._topics.values():
            topic.period = topic.seen = -1

    def look(self) -> None:
        """See who subscribes."""
        for topic in self._topics.values():
            topic.output.look()

    def send(self, simulation: Simulation, ns: int, record: bool, hold: bool) -> None:
        """Measure with each sensor that is due, publish and log, with the stamp `ns`.

        Raises StepError if the state cannot be evaluated.
        """
        if simulation.scene is not self._scene:  # effects have other numbers
            self._scene = simulation.scene
            self._sensors = self._sensors.in_scene(simulation.scene)
        due = []
        for label, topic in self._topics.items():
            keep = record and topic.output.recorder is not None
            wanted = keep or topic.output.published
            # without a reader too, so that what is sent does not depend on when one came
            is_due = self._is_due(topic, ns)
            if is_due and (wanted or self._sensors.remembers(label)):
                due.append((label, topic, keep, wanted))
        if not due and not self._sensors.follows:
            return
        sample = simulation.sample()
        self._sensors.follow(sample)
        for label, topic, keep, wanted in due:
            begun = time.thread_time()
            measured = self._sensors.read(sample, (label,))[label]
            if not wanted:
                continue
            data = topic.write(measured, ns)
            topic.made += time.thread_time() - begun
            topic.output.hand_on(data, ns, topic.output.published, keep, hold)

    def costs(self) -> dict[str, TopicCost]:
        """The cost of each topic since the last call."""
        found = {}
        for label, topic in self._topics.items():
            output = topic.output
            cost = TopicCost(topic.made, output.sent, output.logged, output.published)
            topic.made = output.sent = 0.0
            output.logged = 0
            if cost.made or cost.sent or cost.logged:
                found[f'~/{label}'] = cost
        return found

    def prices(self, simulation: Simulation) -> dict[str, float]:
        """Microseconds of each measurement and its message, here and now; without those that
        cannot be made here."""
        found: dict[str, float] = {}
        for label, topic in self._topics.items():
            with suppress(StepError):
                for _ in range(2):  # the second time counts
                    sample, begun = simulation.sample(), time.perf_counter()
                    topic.write(self._sensors.read(sample, (label,))[label], 1)
                    found[label] = 1e6 * (time.perf_counter() - begun)
        return found

    @staticmethod
    def _is_due(topic: _Topic, ns: int) -> bool:
        """Whether this is the first instant of a period of the sensor, at every look at it."""
        if not topic.rate:
            return True
        if ns != topic.seen:
            period = period_of(ns, topic.rate)
            topic.due, topic.period, topic.seen = period != topic.period, period, ns
        return topic.due
