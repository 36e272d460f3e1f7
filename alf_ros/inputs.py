"""Commands from ROS: wrenches on bodies and points, efforts in joints.

A command is taken whole or refused whole. It acts from the next tick on, the last one of several,
and is held until replaced, or becomes zero when it was not renewed for the timeout. What acts goes
to the journal with the number of steps made before it; a refusal changes nothing and is counted.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from geometry_msgs.msg import WrenchStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from alf_ros.command_messages import REASONS, Refused, read_efforts, read_wrench
from alf_ros.errors import InputError

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.subscription import Subscription

    from alf_ros.applied import Inputs as HeldInputs
    from alf_ros.simulation import Simulation

# Up to this many bodies and points are subscribed to at start; a larger mechanism when somebody
# publishes. As many unknown names are listened to, to say that they are unknown.
SUBSCRIBED_AT_START = 32
# How long (s) a refusal or a timeout keeps the diagnostics at WARN.
WARNING_TIME = 5.0
_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')
_WRENCH = 'geometry_msgs/msg/WrenchStamped'
_QUEUE = QoSProfile(depth=10)

Journal = Callable[[dict[str, Any]], None]


class Inputs:
    """Subscribes, applies to `simulation`, and counts.

    `journal` gets a mapping for every change of what is applied; `alarm` is called on the first
    trouble after a quiet time.
    """

    def __init__(
        self, node: Node, simulation: Simulation, journal: Journal, alarm: Callable[[], None]
    ) -> None:
        self.timeout = 0.0
        self.frame_prefix = ''
        self.accepted = 0
        self.timed_out = 0
        self.refused = dict.fromkeys(REASONS, 0)
        self.last_trouble = ''
        self._trouble_time = -math.inf
        self._held: dict[tuple[str, str], float] = {}  # (kind, name) -> renewed at, s
        self._waiting: dict[tuple[str, tuple[str, ...]], dict[str, Any]] = {}
        self._node, self._journal, self._alarm = node, journal, alarm
        self._prefix = f'{node.get_fully_qualified_name()}/wrench/'
        self._subscriptions: list[Subscription] = []
        node.create_subscription(JointState, 'joint_commands', self._on_efforts, _QUEUE)
        self.load(simulation)

    def load(self, simulation: Simulation) -> None:
        """Take commands for this mechanism from now on, and for no other."""
        self.clear()
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
        self._seen: set[tuple[str, str]] = set()
        self._unknown = 0
        self.use(simulation)
        mechanism = simulation.model.mechanism
        # Dictionaries for their order and their quick look-up.
        self._bodies = dict.fromkeys(simulation.model.body_names)
        self._points = dict.fromkeys(point.name for point in mechanism.points if not point.fixed)
        self._joints = dict.fromkeys(simulation.model.coordinate_names)
        names = self._bodies | self._points
        unfit = [name for name in names if not _TOKEN.fullmatch(name)]
        if unfit:
            text = f'no wrench topic for names that ROS topics cannot have: {", ".join(unfit[:8])}'
            self._node.get_logger().warning(text)
        if len(names) <= SUBSCRIBED_AT_START:
            for name in names:
                if name not in unfit:
                    self._subscribe(name)

    def use(self, simulation: Simulation) -> None:
        """Apply commands to this simulation of the same mechanism from now on."""
        self._simulation = simulation

    def hold(self, inputs: HeldInputs) -> None:
        """What a restored state holds counts as commanded now."""
        self.clear()
        now = time.monotonic()
        self._held = {('wrench', name): now for name in inputs.wrenches}
        self._held.update({('effort', name): now for name in inputs.efforts})

    @property
    def held(self) -> int:
        """Number of commands in force."""
        return len(self._held)

    @property
    def troubled(self) -> bool:
        """Whether a command was refused or timed out lately."""
        return time.monotonic() - self._trouble_time < WARNING_TIME

    def watch(self) -> None:
        """Subscribe to wrench topics that got a publisher; note those that can never be right."""
        for topic, types in self._node.get_topic_names_and_types():
            if not topic.startswith(self._prefix):
                continue
            name = topic[len(self._prefix) :]
            for kind in types:
                if (name, kind) in self._seen or not self._node.count_publishers(topic):
                    continue
                if kind == _WRENCH:
                    self._subscribe(name)
                else:
                    self._seen.add((name, kind))
                    self._refuse(Refused('wrong_type', f'{topic} is a {kind}, not a {_WRENCH}'))

    def expire(self, now: float) -> None:
        """Zero what was not renewed within the timeout (s of the steady clock)."""
        if self.timeout <= 0.0 or not self._held:
            return
        for (kind, name), renewed in list(self._held.items()):
            if now - renewed > self.timeout:
                del self._held[kind, name]
                if kind == 'wrench':
                    force = (0.0,) * self._simulation.model.layout.dimension
                    zero = {'name': name, 'force': force, 'torque': 0.0, 'frame': 'world'}
                    self._apply_wrench(zero, cause='timeout')
                else:
                    self._apply_efforts({name: 0.0}, cause='timeout')
                self.timed_out += 1
                self._trouble(f'{kind} of {name} not renewed for {self.timeout:g} s: now zero')

    def clear(self) -> None:
        """Forget what is held, and what came for it: the simulation was reset."""
        self._held.clear()
        self._waiting.clear()

    def _subscribe(self, name: str) -> None:
        self._seen.add((name, _WRENCH))
        if name not in self._bodies and name not in self._points:
            self._unknown += 1
            if self._unknown > SUBSCRIBED_AT_START:
                return
        self._subscriptions.append(
            self._node.create_subscription(
                WrenchStamped,
                f'~/wrench/{name}',
                lambda message: self._on_wrench(message, name),
                _QUEUE,
            )
        )

    def _on_wrench(self, message: WrenchStamped, name: str) -> None:
        try:
            wrench = read_wrench(
                message,
                name,
                self._bodies,
                self._points,
                self.frame_prefix,
                self._simulation.model.layout.dimension,
            )
        except Refused as refused:
            self._refuse(refused)
        else:
            self._take('wrench', (name,), wrench)

    def _on_efforts(self, message: JointState) -> None:
        try:
            efforts = read_efforts(message, self._joints)
        except Refused as refused:
            self._refuse(refused)
        else:
            self._take('effort', tuple(efforts), efforts)

    def _take(self, kind: str, names: tuple[str, ...], command: dict[str, Any]) -> None:
        """Keep it for the next tick, in place of one for the same names that still waits."""
        self._waiting.pop((kind, names), None)
        self._waiting[kind, names] = command
        self.accepted += 1

    def apply(self) -> None:
        """To be called before every tick, and while there are none: what came acts from now on."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, {}
        now = time.monotonic()
        for (kind, names), command in waiting.items():
            try:
                if kind == 'wrench':
                    self._apply_wrench(command)
                else:
                    self._apply_efforts(command)
            except Refused as refused:
                self.accepted -= 1
                self._refuse(refused)
            else:
                self._held.update({(kind, name): now for name in names})

    def _apply_wrench(self, wrench: dict[str, Any], cause: str = 'command') -> None:
        with self._whole():
            self._simulation.apply_wrench(**wrench)
        self._journal({'kind': 'wrench', 'cause': cause, **wrench})

    def _apply_efforts(self, efforts: dict[str, float], cause: str = 'command') -> None:
        with self._whole():
            for joint, effort in efforts.items():
                self._simulation.apply_effort(joint, effort)
        for joint, effort in efforts.items():
            self._journal({'kind': 'effort', 'cause': cause, 'name': joint, 'effort': effort})

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """Take back what was applied if a part of it cannot act."""
        before = self._simulation.state
        try:
            yield
            # Packs what is held now, so that what cannot act shows here and not in a tick.
            self._simulation.step(0)
        except InputError as error:
            self._simulation.restore(before)
            # All else was checked: this is a torque on a point, or on a body of one point.
            raise Refused('no_orientation', str(error)) from None

    def _refuse(self, refused: Refused) -> None:
        self.refused[refused.reason] += 1
        self._trouble(f'refused: {refused}')

    def _trouble(self, text: str) -> None:
        quiet = not self.troubled
        self.last_trouble, self._trouble_time = text, time.monotonic()
        self._node.get_logger().warning(text, throttle_duration_sec=1.0)
        if quiet:
            self._alarm()
