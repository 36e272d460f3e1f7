"""The real node with its log in this process, and a second node that calls it.

Both turn in one executor, so that what a callback of the simulator raises is raised here, where it
would have ended the node.
"""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import time
from pathlib import Path
from random import Random
from typing import Any

# A domain of this process, away from the default one and on this machine only, so that campaigns
# beside each other do not meet. Warnings of refusals are not printed.
os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces import srv
from rcl_interfaces.msg import Parameter as Asked
from rcl_interfaces.msg import ParameterValue
from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from spoiling import damaged
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from alf_ros.logs import load
from alf_ros.logs.comparison import compare, told
from alf_ros.ros.simulator.node import Simulator, Stop
from alf_ros.ros.terminal import StatusLine

PATIENCE = 20.0  # s in which a call is answered, and a message arrives
STEPPING = 0.3  # s after which somebody who waits for many steps ends them
LONGEST = 2000  # steps of a tick: more is right, and takes long
_TYPES = {bool: 1, int: 2, float: 3, str: 4}
_FIELDS = {1: 'bool_value', 2: 'integer_value', 3: 'double_value', 4: 'string_value'}


class Graph:
    """The simulator, and the node that calls it; `folder` is the present folder."""

    def __init__(self, folder: Path) -> None:
        if not rclpy.ok():
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        if not Path('circle').is_symlink():
            Path('circle').symlink_to('circle')
            os.mkfifo('pipe')
        given: dict[str, Any] = {
            'start_paused': True,
            'real_time_factor': 0.0,
            'status_line': False,
            'ledger': True,
            'record.folder': str(folder / 'logs'),
            'state.folder': str(folder / 'states'),
        }
        overrides = [Parameter(key, value=given[key]) for key in given]
        self._folder = folder
        self.node = Simulator(StatusLine(stream=io.StringIO()), Stop(), overrides)
        set_logger_level(self.node.get_logger().name, LoggingSeverity.FATAL)
        self.node.begin()
        self._peer = rclpy.create_node('peer')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._executor.add_node(self._peer)
        self._clients: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._first = self._parameters()
        self._late = False  # a message may still be on its way

    def close(self) -> None:
        """End both nodes."""
        self._executor.shutdown()
        self.node.close()
        self._peer.destroy_node()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def begin(self) -> None:
        """The scene and the parameters of the first case, at the start, paused."""
        self._late = False
        self._call('pause', SetBool, data=True)
        Path('scene.yaml').write_text('mechanism: slider_crank\n')
        if self._texts().keys() != self._names or self._changed('scene'):
            self._put('scene')
        for name in sorted(self._names):
            if self._changed(name):
                self._put(name)
        answer = self._call('reset', Trigger)
        assert answer.success, answer.message
        for each in Path('logs').iterdir():
            if each != self._log:
                shutil.rmtree(each)

    def verify(self) -> None:
        """The log, ended by a reset, comes out again."""
        path = self._log
        assert self._call('reset', Trigger).success
        log = load(path)
        result = compare(log)
        assert result.equal, f'silent: {told(log, result)}'

    def do(self, kind: str, *what: Any) -> str:
        """One act: 'ran', or 'refused'."""
        before = self._state()
        end: str = getattr(self, f'_{kind}')(*what)
        after = self._state()
        assert np.isfinite(after[0]).all(), 'silent: not finite'
        if end == 'refused' and self.node._control.paused and not self._late:
            assert before[1:] == after[1:], (
                f'silent: refused, and changed {before[1]} to {after[1]}'
            )
        assert not self.node.finished.done(), 'the node ended'
        return end

    # --------------------------------------------------------------------------------- services

    def _trigger(self, name: str) -> str:
        client = self._client(name, Trigger)
        asked = client.call_async(Trigger.Request())
        if name == 'step':
            self._spin(asked, STEPPING)
            if not asked.done():
                self._call('pause', SetBool, data=True)
        return self._answered(self._wait(asked, name))

    def _pause(self, wanted: bool) -> str:
        return self._answered(self._call('pause', SetBool, data=wanted))

    def _set(self, service: str, asked: list[list[Any]]) -> str:
        parameters, before = [self._message(*each) for each in asked], self._texts()
        if service == 'set_parameters':
            results = self._call(service, srv.SetParameters, parameters=parameters).results
            assert len(results) == len(parameters)
        else:
            kind = srv.SetParametersAtomically
            results = [self._call(service, kind, parameters=parameters).result]
        for result in results:
            assert result.successful or _clear(result.reason)
        if any(result.successful for result in results):
            return 'ran'
        assert self._texts() == before, 'silent: parameters were refused, and changed'
        return 'refused'

    def _scene(self, scene: str) -> str:
        if '\n' in scene:
            Path('other.yaml').write_text(scene)
            scene = 'other.yaml'
        return self._set('set_parameters', [['scene', 4, scene]])

    def _about(self, service: str, names: list[str]) -> str:
        kind = {
            'get_parameters': srv.GetParameters,
            'get_parameter_types': srv.GetParameterTypes,
            'describe_parameters': srv.DescribeParameters,
        }[service]
        self._call(service, kind, names=[_text(name) for name in names])
        return 'ran'

    def _list(self, prefixes: list[str], depth: int) -> str:
        prefixes = [_text(prefix) for prefix in prefixes]
        self._call('list_parameters', srv.ListParameters, prefixes=prefixes, depth=depth % 2**64)
        return 'ran'

    def _message(self, name: str | int, kind: int, given: Any) -> Asked:
        """A parameter as a message; a number stands for one of the node's names."""
        if isinstance(name, int):
            name = sorted(self._names)[name % len(self._names)]
        present = self._parameters().get(name)
        if kind == -1:
            kind = 4 if present is None else present.type_.value
        made = ParameterValue(type=kind, bool_value=bool(given), string_value=_text(str(given)))
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            made.double_value = float(given)
            made.integer_value = max(-(2**63), min(2**63 - 1, int(given)))
        if self._is_long(name, made.double_value):
            made.double_value = -1.0
        made.string_array_value = [made.string_value]
        return Asked(name=_text(name), value=made)

    def _is_long(self, name: str, x: float) -> bool:
        """Whether it is right, and a tick or a search for an accuracy would take minutes."""
        if name == 'solver.step':
            return 0.0 < x < self.node._control.run.setup.tick / LONGEST
        if name == 'rate':
            return 0.0 < x < 1.0 / (LONGEST * self._simulation.h)
        return name == 'accuracy' and 0.0 < x < 1e-3

    # --------------------------------------------------------------------------------- messages

    def _wrench(self, name: str, frame: str, numbers: list[float]) -> str:
        message = WrenchStamped()
        message.header.frame_id = _text(frame)
        force, torque = message.wrench.force, message.wrench.torque
        force.x, force.y, force.z, torque.x, torque.y, torque.z = numbers
        return self._sent(name, message)

    def _joints(self, names: list[str], *values: list[float]) -> str:
        position, velocity, effort = values
        names = [_text(name) for name in names]
        message = JointState(name=names, position=position, velocity=velocity, effort=effort)
        return self._sent('joints', message)

    def _path(self, names: list[str], start: int, points: list[list[Any]]) -> str:
        message = JointTrajectory(joint_names=[_text(name) for name in names])
        message.header.stamp.sec = start
        for *values, seconds, nanoseconds in points:
            point = JointTrajectoryPoint()
            point.positions, point.velocities, point.accelerations, point.effort = values
            point.time_from_start.sec, point.time_from_start.nanosec = seconds, nanoseconds
            message.points.append(point)
        return self._sent('path', message)

    def _bytes(self, topic: str, seed: int) -> str:
        """Publish a damaged serialised message: it may be dropped, and then it is no command."""
        random = Random(seed)
        kind = {'joints': JointState, 'path': JointTrajectory}.get(topic, WrenchStamped)
        message = kind()
        if topic == 'joints':
            message.name, message.effort = ['crank_pin'], [0.5]
        elif topic == 'path':
            message.joint_names, message.points = ['crank_pin'], [JointTrajectoryPoint()]
        data = serialize_message(message)
        for _ in range(random.choice((1, 1, 3))):
            data = data[:4] + damaged(data[4:], random)
        self._publisher(topic).publish(data)
        self._late = True
        self._spin(Future(), 0.01)
        return 'ran'

    def _sent(self, topic: str, message: Any) -> str:
        """Publish; wait until it was taken or refused; and, paused, until it acts."""
        publisher, inputs = self._publisher(topic), self.node._control.inputs
        before = inputs.accepted, sum(inputs.refused.values())
        publisher.publish(message)
        end = time.monotonic() + PATIENCE
        while (inputs.accepted, sum(inputs.refused.values())) == before or inputs._waiting:
            assert time.monotonic() < end, f'a message on {topic} is neither taken nor refused'
            self._turn(0.01)
        return 'refused' if inputs.accepted == before[0] else 'ran'

    # -------------------------------------------------------------------------------- the nodes

    @property
    def _simulation(self) -> Any:
        return self.node._control.run.simulation

    @property
    def _log(self) -> Path:
        recorder = self.node._control.run.recorder
        assert recorder is not None and not recorder.error, recorder
        return Path('logs') / recorder.folder.name

    def _state(self) -> tuple[Any, Any]:
        """All numbers of the motion, and the held inputs."""
        state = self._simulation.state
        return np.concatenate([state.q, state.qd, [self._simulation.t]]), repr(state.inputs)

    def _parameters(self) -> dict[str, Parameter[Any]]:
        found: dict[str, Parameter[Any]] = self.node.get_parameters_by_prefix('')
        return found

    def _texts(self) -> dict[str, str]:
        return {name: repr(each.value) for name, each in self._parameters().items()}

    @property
    def _names(self) -> Any:
        return self._first.keys()

    def _changed(self, name: str) -> bool:
        return repr(self.node.get_parameter(name).value) != repr(self._first[name].value)

    def _put(self, name: str) -> None:
        (result,) = self.node.set_parameters([self._first[name]])
        assert result.successful, f'{name} cannot be set back: {result.reason}'

    def _client(self, name: str, kind: Any) -> Any:
        if name not in self._clients:
            client = self._clients[name] = self._peer.create_client(kind, f'/simulator/{name}')
            end = time.monotonic() + PATIENCE
            while not client.service_is_ready():
                assert time.monotonic() < end, f'{name} is not offered'
                self._spin(Future(), 0.02)
            self._spin(Future(), 0.3)  # the server may know the client later
        return self._clients[name]

    def _publisher(self, topic: str) -> Any:
        """A publisher that the node has found; a node with another scene subscribes again."""
        if topic not in self._publishers:
            known = {'joints': ('/joint_commands', JointState)}
            known['path'] = ('/simulator/joint_trajectory', JointTrajectory)
            where, kind = known.get(topic, (f'/simulator/wrench/{topic}', WrenchStamped))
            self._publishers[topic] = self._peer.create_publisher(kind, where, 10)
        publisher, end = self._publishers[topic], time.monotonic() + PATIENCE
        while not publisher.get_subscription_count():
            assert time.monotonic() < end, f'nobody subscribes to {topic}'
            self._spin(Future(), 0.02)
        return publisher

    def _call(self, name: str, kind: Any, **request: Any) -> Any:
        asked = self._client(name, kind).call_async(kind.Request(**request))
        return self._wait(asked, name)

    def _wait(self, asked: Any, name: str) -> Any:
        self._spin(asked, PATIENCE)
        assert asked.done(), f'silent: no answer of {name}'
        return asked.result()

    def _answered(self, answer: Any) -> str:
        assert _clear(answer.message)
        return 'ran' if answer.success else 'refused'

    def _spin(self, future: Any, seconds: float) -> None:
        end = time.monotonic() + seconds
        while not future.done() and time.monotonic() < end:
            self._turn(end - time.monotonic())

    def _turn(self, seconds: float) -> None:
        """The ticks that are due, and one callback of both nodes."""
        self._executor.spin_once(timeout_sec=max(0.0, min(seconds, self.node.work())))


def _text(text: str) -> str:
    """As it can be sent."""
    return text.encode('utf-8', 'replace').decode().replace('\0', '')


def _clear(line: str) -> bool:
    """Whether it is one line that says something; raises if not."""
    assert line.isprintable() and 2 < len(line) < 900, f'not one clear line: {line!r}'
    return True
