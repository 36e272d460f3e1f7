"""Commands from ROS: wrenches on bodies and points, efforts in joints.

A command is taken whole or refused whole. It acts from the next step on and is held until
replaced, or becomes zero when it was not renewed for the timeout. What was accepted goes to the
journal with the number of steps made before it; a refusal changes nothing and is counted.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from geometry_msgs.msg import WrenchStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from alf_ros.errors import InputError
from alf_ros.messages import WORLD

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.subscription import Subscription

    from alf_ros.applied import Inputs as HeldInputs
    from alf_ros.simulation import Simulation

REASONS = (
    'unknown_name',
    'unknown_frame',
    'not_finite',
    'out_of_plane',
    'no_orientation',
    'wrong_length',
    'repeated_name',
    'no_effort',
    'wrong_type',
)
# Up to this many bodies and points are subscribed to at start; a larger mechanism when somebody
# publishes. As many unknown names are listened to, to say that they are unknown.
SUBSCRIBED_AT_START = 32
# How long (s) a refusal or a timeout keeps the diagnostics at WARN.
WARNING_TIME = 5.0
_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')
_WRENCH = 'geometry_msgs/msg/WrenchStamped'
_QUEUE = QoSProfile(depth=10)

Journal = Callable[[dict[str, Any]], None]


class Refused(Exception):
    """A command cannot be taken: `reason` is one of REASONS, the text says it to a human."""

    def __init__(self, reason: str, text: str) -> None:
        self.reason = reason
        super().__init__(text)


def read_wrench(
    message: WrenchStamped,
    name: str,
    bodies: Collection[str],
    points: Collection[str],
    frame_prefix: str = '',
) -> dict[str, Any]:
    """Planar wrench for body or movable point `name`: keywords of `Simulation.apply_wrench`.

    Force (N) at the body's centre of mass or at the point, torque (N m) about +z. `frame_id` '' or
    'world': world axes; the body's own name, also behind `frame_prefix`: its axes, turning with
    it. Raises Refused.
    """
    force, torque, frame = message.wrench.force, message.wrench.torque, message.header.frame_id
    is_body = name in bodies
    if not is_body and name not in points:
        hint = _hint(name, (*bodies, *points))
        raise Refused('unknown_name', f'unknown body or movable point {hint}')
    of_body = is_body and frame in (name, frame_prefix + name)
    if frame not in ('', WORLD) and not of_body:
        own = f' or {name!r}' if is_body else ''
        raise Refused('unknown_frame', f'{name}: frame {frame!r} is not {WORLD!r}{own}')
    if not all(map(math.isfinite, (force.x, force.y, force.z, torque.x, torque.y, torque.z))):
        raise Refused('not_finite', f'{name}: a wrench must be finite')
    if force.z or torque.x or torque.y:
        raise Refused('out_of_plane', f'{name}: force.z, torque.x and torque.y must be 0')
    return {
        'name': name,
        'force': (force.x, force.y),
        'torque': torque.z,
        'frame': 'body' if of_body else 'world',
    }


def read_efforts(message: JointState, joints: Collection[str]) -> dict[str, float]:
    """Effort (N m or N) by joint, for those of `joints` that the message names. Raises Refused.

    Positions and velocities beside efforts are not looked at: nothing here follows them.
    """
    names, efforts = message.name, message.effort
    if not efforts:
        raise Refused('no_effort', 'joint_commands without effort: only efforts are followed')
    if len(names) != len(efforts):
        raise Refused('wrong_length', f'joint_commands: {len(names)} names {len(efforts)} efforts')
    for name in names:
        if name not in joints:
            raise Refused('unknown_name', f'unknown joint {_hint(name, tuple(joints))}')
    if len(set(names)) != len(names):
        raise Refused('repeated_name', 'joint_commands names a joint twice')
    if not all(map(math.isfinite, efforts)):
        raise Refused('not_finite', 'joint_commands: an effort must be finite')
    return dict(zip(names, efforts, strict=True))


@lru_cache(maxsize=64)
def _hint(name: str, known: tuple[str, ...]) -> str:
    """The name and the nearest one known; kept, for a wrong publisher repeats itself."""
    near = get_close_matches(name, known, 1, 0.5)
    return f'{name!r}, did you mean {near[0]!r}' if near else repr(name)


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
        self._node, self._journal, self._alarm = node, journal, alarm
        self._prefix = f'{node.get_fully_qualified_name()}/wrench/'
        self._subscriptions: list[Subscription] = []
        node.create_subscription(JointState, 'joint_commands', self._on_efforts, _QUEUE)
        self.load(simulation)

    def load(self, simulation: Simulation) -> None:
        """Take commands for this mechanism from now on, and for no other."""
        self._held.clear()
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
        self._joints = dict.fromkeys(simulation.model.joint_names)
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
                    zero = {'name': name, 'force': (0.0, 0.0), 'torque': 0.0, 'frame': 'world'}
                    self._apply_wrench(zero, cause='timeout')
                else:
                    self._apply_efforts({name: 0.0}, cause='timeout')
                self.timed_out += 1
                self._trouble(f'{kind} of {name} not renewed for {self.timeout:g} s: now zero')

    def clear(self) -> None:
        """Forget what is held: the simulation was reset."""
        self._held.clear()

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
            prefix = self.frame_prefix
            self._apply_wrench(read_wrench(message, name, self._bodies, self._points, prefix))
        except Refused as refused:
            self._refuse(refused)
        else:
            self._held['wrench', name] = time.monotonic()
            self.accepted += 1

    def _on_efforts(self, message: JointState) -> None:
        try:
            efforts = read_efforts(message, self._joints)
            self._apply_efforts(efforts)
        except Refused as refused:
            self._refuse(refused)
        else:
            now = time.monotonic()
            self._held.update({('effort', name): now for name in efforts})
            self.accepted += 1

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
