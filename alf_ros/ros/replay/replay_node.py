"""The node `replay`: what a source gives, published at its time."""

from __future__ import annotations

import time
from collections.abc import Iterator

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock as SteadyClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from alf_ros.errors import AlfError
from alf_ros.logs.log import Log
from alf_ros.ros.messages.templates import to_time
from alf_ros.ros.messages.topics import BEST_EFFORT
from alf_ros.ros.parameter_services import ParameterServices
from alf_ros.ros.reliable_readers import PATIENCE, ReliableReaders
from alf_ros.ros.replay.sources import Source, StampedMessage, stamp_of
from alf_ros.ros.simulator.parameters import Spec, check_names, declare
from alf_ros.ros.terminal import LOOK_PERIOD, StatusLine

_MOST = 1000  # messages in one call, so that services and parameters get their turn
_CLOCK = '/clock'
_SHORTEST = 0.1  # s of a pass of a loop


class Replay(Node):
    """The node `replay`: every message of `source` at its time, and the clock.

    `finished` is done at the end of the log, unless it loops, or when `stop` was called.
    Raises InputError for parameters that it does not have, or that are out of range.
    """

    def __init__(
        self, log: Log, source: Source, given: list[Parameter], status: StatusLine
    ) -> None:
        super().__init__('replay', parameter_overrides=given, start_parameter_services=False)
        ParameterServices(self)
        self.finished: Future[None] = Future()
        self.failure: AlfError | None = None
        self._log, self._source, self._status = log, source, status
        self._spans = float(log.time(source.first)), float(log.time(source.last))
        values = declare(self, _specs(self._spans))
        check_names(self)
        self._rate, self._loop = values['rate'], values['loop']
        self.paused = values['start_paused']
        self._outputs = {
            topic: self.create_publisher(kind, topic, qos)
            for topic, (kind, qos) in source.topics.items()
        }
        own_clock = _CLOCK not in self._outputs
        self._ticker = self.create_publisher(Clock, _CLOCK, BEST_EFFORT) if own_clock else None
        self.published = 0
        self._readers = {
            topic: ReliableReaders(output, source.topics[topic][1].depth)
            for topic, output in self._outputs.items()
        }
        self._stamp = source.first
        self._go_to(values['seek'])
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.add_on_set_parameters_callback(self._judge)
        self.add_post_set_parameters_callback(self._on_parameters)
        steady = SteadyClock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._on_look, clock=steady)

    def stop(self, *_: object) -> None:
        """End now."""
        if not self.finished.done():
            self.finished.set_result(None)

    def deliver(self) -> None:
        """Wait until those who hear reliably have heard all of it, for three seconds at most."""
        end = time.monotonic() + PATIENCE
        for readers in self._readers.values():
            readers.deliver(end)

    @property
    def t(self) -> float:
        """Simulated time of the last message, s."""
        return float(self._log.time(self._stamp))

    def _go_to(self, t: float) -> None:
        """Continue from a simulated time (s)."""
        stamp = stamp_of(self._log, t)
        items = self._source.items(stamp)
        self._next = next(items, None)  # raises where the run cannot be made again: all stays
        self._items: Iterator[StampedMessage] = items
        self._stamp = stamp
        self._told = 0  # the last stamp on the clock
        self._since, self._from = time.monotonic(), stamp
        self._pass: float | None = None  # s, when the pass from here on began

    def _now(self) -> int:
        """The stamp up to which messages are due."""
        if self.paused:
            return self._from
        if not self._rate:
            return self._source.last
        return self._from + round((time.monotonic() - self._since) * self._rate * 1e9)

    def _anchor(self) -> None:
        """To be called before the pace changes: time goes by from here, but from no message that
        is late, so that none come in a burst."""
        now = self._now()
        self._from = now if self._next is None else min(now, self._next.stamp)
        self._since = time.monotonic()

    def work(self) -> float:
        """Publish the messages that are due. Returns the time (s) until the next one is."""
        if self.paused or self.finished.done():
            return LOOK_PERIOD
        if self._pass is None:
            self._pass = time.monotonic()
        now = self._now()
        try:
            for _ in range(_MOST):
                if self._next is None or self._next.stamp > now:
                    break
                self._publish(self._next)
                self._next = next(self._items, None)
        except AlfError as error:
            self.failure = error
            self.stop()
        if self._next is None:
            if self._loop:
                rest = self._pass + _SHORTEST - time.monotonic()
                if rest > 0.0:  # a log of one instant, or of a few ticks
                    return min(LOOK_PERIOD, rest)
                self._go_to(self._spans[0])
            else:
                self.stop()
        elif self._rate:
            return max(0.0, min(LOOK_PERIOD, (self._next.stamp - now) * 1e-9 / self._rate))
        return 0.0

    def _publish(self, item: StampedMessage) -> None:
        self._stamp = item.stamp
        if self._ticker is not None and item.stamp != self._told:
            self._told = item.stamp
            self._ticker.publish(Clock(clock=to_time(item.stamp)))
        readers = self._readers[item.topic]
        self._await_room(item.topic, readers)
        self._outputs[item.topic].publish(item.data)
        readers.note(not self._rate)
        self.published += 1

    def _await_room(self, topic: str, readers: ReliableReaders) -> None:
        before = readers.lagging
        readers.await_room(not self._rate)
        if readers.lagging and not before:
            self._status.say(f'readers lose messages of {topic}: they do not follow')

    def _on_look(self) -> None:
        if self._status.live:
            state = 'paused' if self.paused else f'rate {self._rate:g}'
            self._status.show(f't {self.t:.2f} of {self._spans[1]:.2f} s  {state}')

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._anchor()
        self.paused = request.data
        response.success = True
        response.message = f'{"paused" if self.paused else "playing"} at t = {self.t:.9g} s'
        return response

    def _judge(self, changed: list[Parameter]) -> SetParametersResult:
        """Descriptors define the limits; a log that is run again may fail to begin."""
        for parameter in changed:
            if parameter.name == 'seek':
                try:
                    self._go_to(parameter.value)
                except AlfError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_parameters(self, changed: list[Parameter]) -> None:
        for parameter in changed:
            if parameter.name == 'rate':
                self._anchor()
                self._rate = parameter.value
            elif parameter.name == 'loop':
                self._loop = parameter.value


def _specs(spans: tuple[float, float]) -> list[Spec]:
    first, last = spans
    return [
        Spec('rate', 1.0, 'Logged seconds per second; 0: as fast as it can', (0.0, 1e3), False),
        Spec('loop', False, 'Begin again at the end', fixed=False),
        Spec(
            'seek',
            first,
            'Instant from which the replay continues when set, simulated s',
            (first, last),
            False,
        ),
        Spec('start_paused', False, 'Start paused: ~/pause with false continues'),
    ]
