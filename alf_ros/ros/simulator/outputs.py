"""Publishers: only what somebody asked for is computed; the same bytes are sent and logged."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from alf_ros.errors import InputError
from alf_ros.exchange.urdf_export import urdf
from alf_ros.ros.messages.instant_messages import InstantMessages
from alf_ros.ros.messages.topics import LATCHED, RELIABLE, TOPICS
from alf_ros.ros.recording.recorder import Recorder
from alf_ros.ros.simulator.output_costs import TopicCost
from alf_ros.ros.simulator.parameters import ALL
from alf_ros.scene.scene import Scene
from alf_ros.simulation.display_geometry import Display
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile

_PATIENCE = 1.0  # s, with reliable readers of ticks that are made as fast as possible
_LOOK_PERIOD = 5e-3  # s between two looks at who subscribes


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
        self.topic = self._publisher.topic_name
        self._subscribed = False
        self.lagging = False  # a reliable reader did not follow ticks as fast as possible
        self._unacknowledged = 0  # messages since all readers had all of them, at most
        self.sent = 0.0  # s spent to publish
        self.logged = 0  # bytes given to the log

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
        return math.floor(ns * 1e-9 * self.rate + 1e-6)

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
        the history of the publisher is full of what they may not have."""
        if publish:
            if hold and self._unacknowledged >= self.qos.depth:
                self._await_readers()
            begun = time.thread_time()
            self._publisher.publish(data)
            self.sent += time.thread_time() - begun
            self._unacknowledged += 1
        if record and self.recorder is not None:
            self._recorded = self._period(ns)
            self.logged += len(data)
            self.recorder.write(self.topic, self.type, self.qos, ns, data, self.essential)

    def _await_readers(self) -> None:
        """Wait until reliable readers have all messages; after a reader that did not follow, only
        look whether it has them now."""
        wait = Duration(seconds=0.0 if self.lagging else _PATIENCE)
        with suppress(RuntimeError):  # a middleware that cannot tell
            self.lagging = not self._publisher.wait_for_all_acked(wait)
        self._unacknowledged = 0


class Outputs:
    """All topics of the simulator.

    `optional`: topics that parameters switch, by name; `journal` and `scene` are in every log,
    because a run cannot be repeated without them. Topics that are only shown are sent at every
    `shown_every`th tick. `rates` (Hz, by key): of messages in the log. `display`: settings of the
    display.
    """

    def __init__(
        self,
        node: Node,
        recorded: Collection[str],
        rates: Mapping[str, float],
        display: Display,
    ) -> None:
        self.display, self.shown_every = display, 1
        self.samples = {
            topic.name: Output(node, topic.name, topic.type, topic.qos) for topic in TOPICS
        }
        self.diagnostics = Output(node, '/diagnostics', DiagnosticArray, RELIABLE)
        self.journal = Output(node, '~/inputs', String, RELIABLE)
        self.scene = Output(node, '~/scene', String, LATCHED)
        self.scene.mode = 'on'
        self.description = Output(node, 'robot_description', String, LATCHED)
        self.optional = {
            **self.samples,
            '/diagnostics': self.diagnostics,
            'robot_description': self.description,
        }
        self._recorded = [output for name, output in self.optional.items() if name in recorded]
        self._recorded += [self.journal, self.scene]
        for topic in TOPICS:
            self.samples[topic.name].rate = rates[topic.key] or rates[ALL]
        self.journal.essential = self.scene.essential = True
        self._shown = {topic.name for topic in TOPICS if topic.shown}
        self._ticks = 0
        self._next_look = 0.0
        self._made: dict[tuple[str, ...], float] = {}  # s, by the topics that were due
        self._undescribed: Scene | None = None

    @property
    def topics(self) -> dict[str, str]:
        """Where each topic of samples is after remapping, by the name a user writes."""
        return {name: output.topic for name, output in self.samples.items()}

    def prepare(self, simulation: Simulation) -> None:
        """Make the messages for a simulation, with all that is compiled for them."""
        writers = {topic.name: topic.make(simulation, self.display) for topic in TOPICS}
        self._write = {name: write for name, write in writers.items() if write is not None}
        self._messages = InstantMessages(simulation, self._write)

    def switched(self) -> dict[str, list[str]]:
        """Topics with content: `on` (recorded, or always published), waiting until they are
        `subscribed`, and `off`."""
        said: dict[str, list[str]] = {'on': [], 'subscribed': [], 'off': []}
        for name, output in self.optional.items():
            if name not in self.samples or name in self._write:
                on = output.recorder is not None or output.mode == 'on'
                said['on' if on else 'off' if output.mode == 'off' else 'subscribed'].append(name)
        return said

    def warm_up(self, sample: Sample) -> None:
        """Write every message once, so that no tick has to wait for a compiler."""
        for write in self._write.values():
            write(sample, 1)

    def describe(self, scene: Scene, ns: int) -> None:
        """A run begins, or its effects change: say which scene it is, and its URDF when somebody
        wants it."""
        self._ticks = 0
        self.scene.send(serialize_message(String(data=scene.text)), ns)
        self._undescribed = scene
        self.look(ns)

    def look(self, ns: int) -> None:
        """Publish robot_description again for late subscribers; to be called periodically."""
        scene = self._undescribed
        if scene is not None and self.description.wanted:
            text = urdf(scene.mechanism, self.display.frame_prefix)
            self.description.send(serialize_message(String(data=text)), ns)
            self._undescribed = None

    def record(self, recorder: Recorder | None) -> None:
        """From now on log to `recorder`."""
        for output in self._recorded:
            output.record(recorder)

    def send(
        self,
        simulation: Simulation,
        ns: int,
        record: bool = True,
        whole: bool = False,
        near: bool = False,
        hold: bool = False,
    ) -> float:
        """Publish and log the requested topics of the present state, all with the stamp `ns`.

        `whole`: with topics that are not shown at every tick. Returns the distance to a singular
        position if `near` asks for it and reactions or constraints are requested, else infinity.
        `hold`: reliable readers are waited for, up to a second, so that they lose nothing.
        Raises StepError if the state cannot be evaluated.
        """
        self._ticks += not whole
        shown = whole or self._ticks % self.shown_every == 0
        self._look(whole)
        due = []
        for name in self._write:
            if shown or name not in self._shown:
                output = self.samples[name]
                publish, keep = output.published, record and output.due(ns)
                if publish or keep:
                    due.append((name, output, publish, keep))
        if not due:
            return math.inf
        if simulation is not self._messages.simulation:
            self._messages = InstantMessages(simulation, self._write)
        messages = self._messages
        names, begun = tuple([each[0] for each in due]), time.thread_time()
        made = messages.write(names, ns, near)
        self._made[names] = self._made.get(names, 0.0) + time.thread_time() - begun
        for (_, output, publish, keep), data in zip(due, made, strict=True):
            output.hand_on(data, ns, publish, keep, hold)
        return messages.distance

    @property
    def lagging(self) -> list[str]:
        """Topics with a reliable reader that did not follow ticks as fast as possible."""
        return [name for name, output in self.samples.items() if output.lagging]

    def costs(self) -> dict[str, TopicCost]:
        """The cost of each topic since the last call. A read of several topics counts as the
        reads of each alone would."""
        made = dict.fromkeys(self.samples, 0.0)
        for names, seconds in self._made.items():
            parts = self._messages.parts(names)
            for name, part in zip(names, parts, strict=True):
                made[name] += part * seconds
        self._made.clear()
        found = {}
        for name, output in self.samples.items():
            cost = TopicCost(made[name], output.sent, output.logged, output.published)
            output.sent, output.logged = 0.0, 0
            if cost.made or cost.sent or cost.logged:
                found[name] = cost
        return found

    def _look(self, now: bool) -> None:
        """See who subscribes, `now` or from time to time: to ask costs as much as a reading."""
        clock = time.monotonic()
        if now or clock >= self._next_look:
            self._next_look = clock + _LOOK_PERIOD
            for output in self.samples.values():
                output.look()
