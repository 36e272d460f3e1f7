"""The node `close`: active joints in, all joints out."""

from __future__ import annotations

import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from alf_ros.errors import AlfError, InputError
from alf_ros.model.softest_modes import near
from alf_ros.ros.closing.active_input import ActiveInput, renamed
from alf_ros.ros.closing.closing_messages import (
    OK,
    WARN,
    diagnostics,
    effort_map,
    joint_state,
    travel,
)
from alf_ros.ros.messages.tf import transforms
from alf_ros.ros.messages.topics import RELIABLE
from alf_ros.ros.namesake import KEY, Namesake
from alf_ros.ros.parameter_services import ParameterServices
from alf_ros.ros.simulator.parameters import Spec, check_names, declare
from alf_ros.ros.terminal import LOOK_PERIOD, StatusLine
from alf_ros.simulation.display_geometry import Display
from alf_ros.studies.closing.closure import Closure
from alf_ros.studies.closing.posture import Posture

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the wheels: only a ROS 2 installation brings it
    TFMessage = None

INPUT = 'active_joint_states'
_INPUT_TYPE = 'sensor_msgs/msg/JointState'
_REPORT_PERIOD = 1.0  # s, between diagnostics
_MISSED = 1e-9  # rad or m: values are not met, if they have no noise
_SELDOM = 20.0  # times the time that travel takes, between two messages of it
_DEVIATIONS = 5.0  # of the noise, likewise

_SPECS = (
    Spec('scene', 'slider_crank', 'Scene or mechanism: a name of the library, or a path'),
    Spec('active', [''], 'Active joint coordinates, as many as the mechanism has freedoms'),
    Spec('names', [''], 'Names in messages, each as name_in_messages=active_joint'),
    Spec('noise', 0.0, 'Standard deviation of the active positions, rad or m', (0.0, 1e3)),
    Spec('timeout', 0.5, 'Age of the input above which diagnostics warn, s', (1e-3, 1e6), False),
    Spec('publish.tf', False, 'Publish the frames of all bodies in the world on tf'),
    Spec('frame_prefix', '', 'Precedes the names of bodies as frames'),
)


class CloseNode(Node):
    """The node `close`: a posture for each message on `active_joint_states`, with its stamp.

    `finished` is done when `stop` was called; `input`: where it listens, after remapping. Raises
    InputError for parameters that cannot be used, AssemblyError for a mechanism that cannot be
    closed.
    """

    def __init__(self, given: list[Parameter], status: StatusLine) -> None:
        super().__init__('close', parameter_overrides=given, start_parameter_services=False)
        ParameterServices(self)
        self.finished: Future[None] = Future()
        self._status = status
        values = declare(self, _SPECS)
        check_names(self)
        self._noise, self._timeout = values['noise'], values['timeout']
        active = [name for name in values['active'] if name]
        self.closure = Closure(values['scene'], active, self._noise)
        names = renamed([pair for pair in values['names'] if pair], active)
        self._input = ActiveInput(names)
        self._posture: Posture | None = None
        self._heard = self._reported = self._followed = -1e9  # s, steady
        self._first, self._last = -1, 0  # ns, instants of the first and of the last posture
        self._stamped: bool | None = None  # whether these are stamps, or times of arrival
        self._failed = 0  # inputs refused
        self._refusal = self._kind = ''
        self._stamp = Time()  # of the last posture
        self._joints = self.create_publisher(JointState, 'joint_states', RELIABLE)
        self._map = self.create_publisher(Float64MultiArray, '~/effort_map', RELIABLE)
        self._travel = self.create_publisher(Float64MultiArray, '~/travel', RELIABLE)
        self._reports = self.create_publisher(DiagnosticArray, '~/diagnostics', RELIABLE)
        self._name = self.get_fully_qualified_name().lstrip('/')
        self._namesake = Namesake(self, self._reports.topic_name, f'{self._name}: ')
        self._warned = False  # of the second node that there is
        self._frames = None
        if values['publish.tf']:
            if TFMessage is None:
                text = 'tf needs tf2_msgs, which comes with a ROS 2 installation: source one'
                raise InputError(text, key='publish.tf')
            self._frames = self.create_publisher(TFMessage, 'tf', RELIABLE)
            display = Display(frame_prefix=values['frame_prefix'])
            self._transforms = transforms(self.closure.model, display)
        self._prepare()
        self.closure.restart()
        heard = self.create_subscription(JointState, INPUT, self._on_input, 10)
        self.input = heard.topic_name
        self.add_post_set_parameters_callback(self._on_parameters)
        self.postures = 0

    def stop(self, *_: object) -> None:
        """End now."""
        if not self.finished.done():
            self.finished.set_result(None)

    def _prepare(self) -> None:
        """Compile all that a message needs, before the first one."""
        start = self.closure.start
        posture = self.closure.close(start, rates=dict.fromkeys(start, 0.0))
        diagnostics('', '', Time(), {'': (OK, '', {'': posture.distance})})
        effort_map(self.closure, posture)

    def work(self) -> float:
        """Report if a report is due. Returns the time (s) until the next look."""
        now = time.monotonic()
        kind, text = self._said(now)
        if now - self._reported >= _REPORT_PERIOD or kind != self._kind:
            self._reported, self._kind = now, kind
            self._report(now, text)
            self._namesake.look()
            self._warn_of_namesake()
        if self._travel.get_subscription_count() and now > self._followed:
            self._follow(now)
        if self._status.live:
            self._status.show(f'{self.postures} postures  {text}')
        return LOOK_PERIOD

    def _warn_of_namesake(self) -> None:
        """Say once, and again if it went and came back, that a second node has this name."""
        other = self._namesake.other
        if other and not self._warned:
            self.get_logger().warning(self._twice(other))
        self._warned = bool(other)

    def _twice(self, other: str) -> str:
        return f'a second node {self._name} answers on {self._joints.topic_name}: process {other}'

    def _follow(self, now: float) -> None:
        """Publish the travel of the active joints from the last posture."""
        if self._posture is None or self._refusal:
            return
        try:
            self._travel.publish(travel(self.closure, self._posture))
        except AlfError as error:
            self._input.trouble = str(error)
        took = time.monotonic() - now
        self._followed = now + max(_REPORT_PERIOD, _SELDOM * took)

    def _on_input(self, message: JointState) -> None:
        if not self._input.take(message) or self._input.missing:
            return
        stamp = message.header.stamp
        ns = stamp.sec * 1_000_000_000 + stamp.nanosec
        stamped = ns != 0  # in ROS zero is no stamp: the time of arrival counts
        instant = ns if stamped else time.monotonic_ns()
        alike = self._stamped in (None, stamped)  # else the times are of two clocks
        later = alike and instant > self._last
        if alike and not later:
            self._input.went_back()
        first = self._first if alike and self._first >= 0 else instant
        t = (instant - first) * 1e-9 if later else None
        rates = self._input.rates
        moving = len(rates) == len(self.closure.active)
        try:
            posture = self.closure.close(self._input.positions, rates if moving else None, t)
        except AlfError as error:  # the state before is kept
            self._failed, self._refusal = self._failed + 1, str(error)
            return
        self._refusal = ''
        self._first, self._last, self._stamped = first, instant, stamped
        self._heard = time.monotonic()
        self._posture, self._stamp = posture, stamp
        self._publish(posture, stamp, ns, moving)

    def _publish(self, posture: Posture, stamp: Time, ns: int, moving: bool) -> None:
        self._joints.publish(joint_state(posture, stamp, moving))
        if self._frames is not None and self._transforms is not None:
            self._frames.publish(self._transforms(posture, ns))
        if self._map.get_subscription_count():
            self._map.publish(effort_map(self.closure, posture))
        self.postures += 1

    def _said(self, now: float) -> tuple[str, str]:
        """The most urgent thing to say: of which kind, and in words; both empty if all is well."""
        posture, other = self._posture, self._namesake.other
        if other:
            return 'twice', self._twice(other)
        if posture is None:
            return ('refused', self._refusal) if self._refusal else ('waiting', self._waiting())
        if now - self._heard > self._timeout:
            return 'old', self._late(now)
        if self._refusal:
            return 'refused', self._refusal
        if posture.missed_by > max(_MISSED, _DEVIATIONS * self._noise):
            return 'missed', f'the loops miss the active values by {posture.missed_by:.3g}'
        if posture.ambiguous:
            return 'ambiguous', 'the branch is a guess: start again where it is known'
        if posture.distance < near(self.closure.model):
            return 'near', f'near a singular position: distance {posture.distance:.3g}'
        return '', ''

    def _waiting(self) -> str:
        return f'waiting for {", ".join(self._input.missing)} on {self.input}{self._unheard()}'

    def _unheard(self) -> str:
        """Publishers of the input that this node cannot hear, as an addition to a text."""
        for each in self.get_publishers_info_by_topic(self.input):
            if each.topic_type != _INPUT_TYPE:
                return f'; one publisher there sends {each.topic_type}, not {_INPUT_TYPE}'
            if each.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
                return '; one publisher there is best effort, and only reliable ones are heard'
        return ''

    def _late(self, now: float) -> str:
        """Since when no input could be used; and why not, if there was some."""
        why = self._refusal or self._input.unusable  # a mistake beside used values is none
        if self._posture is None:
            return why or self._waiting()
        since = f'input for {now - self._heard:.1f} s'
        return f'no usable {since}: {why}' if why else f'no {since}{self._unheard()}'

    def _report(self, now: float, text: str) -> None:
        """Publish diagnostics; text: the most urgent thing, or empty."""
        posture, values = self._posture, dict[str, object]()
        if posture is not None:
            values = {
                'distance_to_singular': posture.distance,
                'missed_by': posture.missed_by,
                'branch': posture.branch,
                'ambiguous': posture.ambiguous,
                'closed_to_m': posture.closed_to,
            }
        loops = (
            WARN if text else OK,
            text or 'closed',
            {'postures': self.postures, **values, KEY: self._namesake.process},
        )
        age = now - self._heard if posture is not None else float('inf')
        counts = {**self._input.counts, 'refused': self._failed}
        wrong = self._input.trouble
        told = {'age_s': age, **counts, 'last_trouble': wrong}
        late = age > self._timeout
        heard = self._late(now) if late else wrong or 'heard'
        statuses = {'loops': loops, 'input': (WARN if late or wrong else OK, heard, told)}
        hardware = self.closure.model.mechanism.name
        self._reports.publish(diagnostics(self._name, hardware, self._stamp, statuses))
        self._input.trouble = ''

    def _on_parameters(self, changed: list[Parameter]) -> None:
        for parameter in changed:
            if parameter.name == 'timeout':
                self._timeout = parameter.value
