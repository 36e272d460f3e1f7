"""Commands from ROS: wrenches on bodies and points; efforts, targets and trajectories of joints;
the velocity of a robot on wheels.

A command is taken whole or refused whole. It acts from the next tick on, the last one of several,
and is held until replaced, or becomes zero when it was not renewed for the timeout. Applied
commands go to the journal with the number of steps made before it; a refusal changes nothing and
is counted.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from geometry_msgs.msg import Twist, WrenchStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from alf_ros import effects
from alf_ros.effects.contract import EFFORT_OVER_TIME
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.ros.simulator.command_messages import (
    REASONS,
    Refused,
    read_joints,
    read_twist,
    read_wrench,
)
from alf_ros.ros.simulator.trajectory_command import Trajectory, read_trajectory
from alf_ros.ros.simulator.trajectory_tracking import Tracking
from alf_ros.simulation.input_checks import controlled
from alf_ros.simulation.input_values import Inputs
from alf_ros.simulation.simulation import Simulation

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.subscription import Subscription

# Up to this many bodies and points are subscribed to at start; a larger mechanism when somebody
# publishes. As many unknown names are listened to, to say that they are unknown.
SUBSCRIBED_AT_START = 32
# How long (s) a refusal or a timeout keeps the diagnostics at WARN.
WARNING_TIME = 5.0
_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')
_WRENCH = 'geometry_msgs/msg/WrenchStamped'
_QUEUE = QoSProfile(depth=10)

Journal = Callable[[dict[str, Any]], None]


class CommandSubscriber:
    """Subscribes, applies to `simulation`, and counts.

    `journal` gets a mapping for every change of the applied inputs; `alarm` is called on the first
    trouble after a quiet time; `ahead` (ns) is the offset of stamps from simulated time.
    """

    def __init__(
        self,
        node: Node,
        simulation: Simulation,
        journal: Journal,
        alarm: Callable[[], None],
        ahead: Callable[[], int],
    ) -> None:
        self.timeout = 0.0
        self.frame_prefix = ''
        self.accepted = 0
        self.timed_out = 0
        self.refused = dict.fromkeys(REASONS, 0)
        self.last_trouble = ''
        self.tracking = Tracking()
        self._trouble_time = -math.inf
        self._held: dict[tuple[str, str], float] = {}  # (kind, name) -> renewed at, s
        self._waiting: dict[tuple[str, tuple[str, ...]], Any] = {}
        self._node, self._journal, self._alarm, self._ahead = node, journal, alarm, ahead
        self._prefix = f'{node.get_fully_qualified_name()}/wrench/'
        self._subscriptions: list[Subscription] = []
        self._ready_for_curves = False
        node.create_subscription(JointState, 'joint_commands', self._on_joints, _QUEUE)
        self._curves = node.create_subscription(
            JointTrajectory, '~/joint_trajectory', self._on_trajectory, _QUEUE
        )
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
        if simulation.scene.diff_drive is not None:
            self._subscriptions.append(
                self._node.create_subscription(Twist, 'cmd_vel', self._on_twist, _QUEUE)
            )
        if len(names) <= SUBSCRIBED_AT_START:
            for name in names:
                if name not in unfit:
                    self._subscribe(name)

    def use(self, simulation: Simulation) -> None:
        """Apply commands to this simulation of the same mechanism from now on."""
        self._simulation = simulation
        self._controlled = controlled(simulation.model, simulation.scene.effects)

    def hold(self, inputs: Inputs) -> None:
        """Count the held inputs of a restored state as commanded now."""
        self.clear()
        now = time.monotonic()
        kinds = {'wrench': inputs.wrenches, 'effort': inputs.efforts, 'target': inputs.targets}
        self._held = {(kind, name): now for kind, held in kinds.items() for name in held}

    @property
    def held(self) -> int:
        """Number of commands in force."""
        return len(self._held)

    @property
    def troubled(self) -> bool:
        """Whether a command was refused or timed out lately."""
        return time.monotonic() - self._trouble_time < WARNING_TIME

    def watch(self) -> None:
        """Subscribe to wrench topics that got a publisher; note those that can never be right.

        And compile what trajectories need when somebody is about to send some: few do, and a start
        should not wait for it.
        """
        if not self._ready_for_curves and self._node.count_publishers(self._curves.topic_name):
            effects.load(effects.ROLES[EFFORT_OVER_TIME])
            self._ready_for_curves = True
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
        """Zero the commands that were not renewed within the timeout (s of the steady clock)."""
        if self.timeout <= 0.0 or not self._held:
            return
        for (kind, name), renewed in list(self._held.items()):
            if now - renewed <= self.timeout:
                continue
            if self._lasts(kind, name):
                self._held[kind, name] = now
                continue
            del self._held[kind, name]
            if kind == 'wrench':
                force = (0.0,) * self._simulation.model.layout.dimension
                zero = {'name': name, 'force': force, 'torque': 0.0, 'frame': 'world'}
                self._apply_wrench(zero, cause='timeout')
            elif kind == 'effort':
                self._apply_joints({name: {'effort': 0.0}}, cause='timeout')
            else:
                position = self._simulation.state.inputs.targets[name].position
                if position is not None:  # it stays; an old velocity would hold it elsewhere
                    self._held[kind, name] = now
                stopped = {'position': position, 'velocity': 0.0}
                self._apply_joints({name: stopped}, cause='timeout')
            self.timed_out += 1
            what = 'velocity' if kind == 'target' else kind
            self._trouble(f'{what} of {name} not renewed for {self.timeout:g} s: now zero')

    def _lasts(self, kind: str, name: str) -> bool:
        """Whether it needs no renewal: a position at rest, or a trajectory that is under way."""
        inputs = self._simulation.state.inputs
        if kind == 'target':
            target = inputs.targets[name]
            return target.position is not None and not target.velocity
        effort = inputs.efforts[name] if kind == 'effort' else None
        return isinstance(effort, Curve) and self._simulation.t < effort.end

    def clear(self) -> None:
        """Forget held and received commands: the simulation was reset."""
        self._held.clear()
        self._waiting.clear()
        self.tracking.clear()

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
        known, prefix = (self._bodies, self._points), self.frame_prefix
        dimension = self._simulation.model.layout.dimension
        with self._refusing():
            wrench = read_wrench(message, name, *known, prefix, dimension)
            self._take('wrench', (name,), wrench)

    def _on_joints(self, message: JointState) -> None:
        with self._refusing():
            commands = read_joints(message, self._joints, self._controlled)
            if commands:
                self._take('joints', tuple(commands), commands)
            else:
                self.accepted += 1

    def _on_twist(self, message: Twist) -> None:
        drive = self._simulation.scene.diff_drive
        assert drive is not None
        with self._refusing():
            commands = read_twist(message, drive, self._controlled)
            self._take('joints', tuple(commands), commands)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        with self._refusing():
            trajectory = read_trajectory(message, self._joints, self._controlled)
            self._take('trajectory', tuple(message.joint_names), trajectory)

    @contextmanager
    def _refusing(self) -> Iterator[None]:
        try:
            yield
        except Refused as refused:
            self._refuse(refused)

    def _take(self, kind: str, names: tuple[str, ...], command: Any) -> None:
        """Keep it for the next tick, in place of one for the same names that still waits."""
        self._waiting.pop((kind, names), None)
        self._waiting[kind, names] = command
        self.accepted += 1

    def apply(self) -> None:
        """Apply received commands. To be called before every tick, and periodically without
        ticks."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, {}
        applies: dict[str, Callable[[Any], None]] = {
            'wrench': self._apply_wrench,
            'joints': self._apply_joints,
            'trajectory': self._apply_trajectory,
        }
        for (kind, _), command in waiting.items():
            try:
                applies[kind](command)
            except Refused as refused:
                self.accepted -= 1
                self._refuse(refused)

    def _apply_wrench(self, wrench: dict[str, Any], cause: str = 'command') -> None:
        with self._whole():
            self._simulation.apply_wrench(**wrench)
        self._note('wrench', wrench, cause)

    def _apply_joints(
        self, commands: Mapping[str, Mapping[str, Any]], cause: str = 'command'
    ) -> None:
        efforts = {name: said['effort'] for name, said in commands.items() if 'effort' in said}
        wanted = ('position', 'velocity')
        targets = {
            name: {key: said.get(key) for key in wanted}
            for name, said in commands.items()
            if said.keys() & set(wanted)
        }
        with self._whole():
            for name, effort in efforts.items():
                self._simulation.apply_effort(name, effort)
            for name, target in targets.items():
                self._simulation.apply_target(name, **target)
        for name, effort in efforts.items():
            self._note('effort', {'name': name, 'effort': effort}, cause)
        for name, target in targets.items():
            self._note('target', {'name': name, **target}, cause)
        self.tracking.leave(targets)

    def _apply_trajectory(self, trajectory: Trajectory) -> None:
        sample = self._simulation.sample()
        positions, efforts = trajectory.curves(sample, self._ahead())
        commands: dict[str, dict[str, Curve]] = {}
        for field, curves in (('position', positions), ('effort', efforts)):
            for name, curve in curves.items():
                commands.setdefault(name, {})[field] = curve
        self._apply_joints(commands, cause='trajectory')
        self.tracking.follow(positions, sample.model.coordinate_names)

    def _note(self, kind: str, what: Mapping[str, Any], cause: str) -> None:
        """It acts from the next step on."""
        told = {k: v.pieces if isinstance(v, Curve) else v for k, v in what.items()}
        self._journal({'kind': kind, 'cause': cause, **told})
        if cause != 'timeout':
            self._held[kind, what['name']] = time.monotonic()

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """Undo the applied part if another part cannot act."""
        before = self._simulation.state
        try:
            yield
            # Packs the held commands now, so that an impossible one fails here and not in a tick.
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
