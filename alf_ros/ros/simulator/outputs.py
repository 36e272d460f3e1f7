"""Publishers: only what somebody asked for is computed; the same bytes are sent and logged."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from alf_ros.exchange.urdf_export import urdf
from alf_ros.ros.messages.instant_messages import InstantMessages
from alf_ros.ros.messages.shape_markers import nothing
from alf_ros.ros.messages.topics import LATCHED, RELIABLE, TOPICS
from alf_ros.ros.recording.recorder import Recorder
from alf_ros.ros.reliable_readers import PATIENCE
from alf_ros.ros.simulator.output_costs import TopicCost
from alf_ros.ros.simulator.parameters import ALL
from alf_ros.ros.simulator.sensor_outputs import SensorOutputs
from alf_ros.ros.simulator.topic_output import Output
from alf_ros.scene.scene import Scene
from alf_ros.simulation.display_geometry import Display
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation

if TYPE_CHECKING:
    from rclpy.node import Node

_LOOK_PERIOD = 5e-3  # s between two looks at who subscribes


class Outputs:
    """All topics of the simulator.

    `optional`: topics that parameters switch, by name; `journal` and `scene` are in every log,
    because a run cannot be repeated without them. Topics that are only shown are sent at every
    `shown_every`th tick. `rates` (Hz, by key): of messages in the log. `display`: settings of the
    display. `sensors_recorded`: logs have what the sensors of a scene measure.
    """

    def __init__(
        self,
        node: Node,
        recorded: Collection[str],
        rates: Mapping[str, float],
        display: Display,
        sensors_recorded: bool = True,
    ) -> None:
        self.display, self.shown_every = display, 1
        self._node, self._sensors_recorded = node, sensors_recorded
        self._sensors: SensorOutputs | None = None
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
        self._prepared = 0  # scenes
        self._outdated = False  # viewers may have markers of another scene

    @property
    def topics(self) -> dict[str, str]:
        """Where each topic is after remapping, by the name a user writes."""
        sensors = self._sensors.outputs if self._sensors is not None else {}
        texts = {'~/inputs': self.journal, '~/scene': self.scene}
        outputs = {**self.optional, **texts, **sensors}
        return {name: output.topic for name, output in outputs.items()}

    def prepare(self, simulation: Simulation) -> None:
        """Make the messages for a simulation, with all that is compiled for them, and the topics
        of its sensors. Raises InputError for a sensor whose messages are not installed."""
        if self._sensors is not None:
            self._sensors.close()
            self._sensors = None
        if simulation.scene.sensors:
            prefix = self.display.frame_prefix
            self._sensors = SensorOutputs(self._node, simulation.scene, prefix)
        writers = {topic.name: topic.make(simulation, self.display) for topic in TOPICS}
        self._write = {name: write for name, write in writers.items() if write is not None}
        self._messages = InstantMessages(simulation, self._write)
        self._made.clear()  # costs of topics that this scene may not have
        self._outdated, self._prepared = self._prepared > 0, self._prepared + 1

    def switched(self) -> dict[str, list[str]]:
        """Topics with content: `on` (recorded, or always published), waiting until they are
        `subscribed`, and `off`."""
        said: dict[str, list[str]] = {'on': [], 'subscribed': [], 'off': []}
        sensors = self._sensors.outputs if self._sensors is not None else {}
        for name, output in {**self.optional, **sensors}.items():
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
        if self._outdated:
            self.samples['~/markers'].send(serialize_message(nothing()), ns, record=False)
            self._outdated = False
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
        if self._sensors is not None and self._sensors_recorded:
            self._sensors.record(recorder)

    def begin(self) -> None:
        """A run begins: its sensors forget the one before."""
        if self._sensors is not None:
            self._sensors.begin()

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
        if self._sensors is not None:
            self._sensors.send(simulation, ns, record, hold)
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

    def deliver(self) -> None:
        """Wait until reliable readers have the last messages, for three seconds at most."""
        end = time.monotonic() + PATIENCE
        sensors = self._sensors.outputs if self._sensors is not None else {}
        for output in (*self.samples.values(), *sensors.values()):
            output.readers.deliver(end)

    @property
    def lagging(self) -> list[str]:
        """Topics with a reliable reader that did not follow ticks as fast as possible."""
        sensors = self._sensors.outputs if self._sensors is not None else {}
        every = {**self.samples, **sensors}
        return [name for name, output in every.items() if output.readers.lagging]

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
        return found | self._sensors.costs() if self._sensors is not None else found

    def sensor_prices(self, simulation: Simulation) -> dict[str, float]:
        """Microseconds of the measurement and message of each sensor, here and now."""
        return self._sensors.prices(simulation) if self._sensors is not None else {}

    def _look(self, now: bool) -> None:
        """See who subscribes, `now` or from time to time: to ask costs as much as a reading."""
        clock = time.monotonic()
        if now or clock >= self._next_look:
            self._next_look = clock + _LOOK_PERIOD
            for output in self.samples.values():
                output.look()
            if self._sensors is not None:
                self._sensors.look()
