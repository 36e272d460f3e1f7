"""Requests of the live view to a simulator, as service calls and messages."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as TooLate
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from alf_ros.errors import AlfError, shortened
from alf_ros.resources import library
from alf_ros.ros.view.view_node import ViewNode
from alf_ros.scene.text.yaml_document import LARGEST

if TYPE_CHECKING:
    from rclpy.client import Client

# How long (s) an answer may take: another scene may have to be compiled.
PATIENCE, SCENE_PATIENCE = 10.0, 180.0
MOST_STEPS = 10**6


class NotDone(AlfError):
    """The simulator did not do it, or it is nothing that can be asked for."""


class Operator:
    """Takes commands in any thread; `work`, in the thread of the node, passes them on."""

    def __init__(self, node: ViewNode, simulator: str) -> None:
        self._node = node
        self._todo: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._turn = threading.Lock()  # of a page that steps: a step takes its count from before
        self._pause = node.create_client(SetBool, f'{simulator}/pause')
        self._step = node.create_client(Trigger, f'{simulator}/step')
        self._reset = node.create_client(Trigger, f'{simulator}/reset')
        self._set = node.create_client(SetParameters, f'{simulator}/set_parameters')
        self._efforts = node.create_publisher(JointState, 'joint_commands', 10)
        self._acts: dict[str, Callable[[Any], str]] = {
            'pause': lambda _: self._pausing(True),
            'play': lambda _: self._pausing(False),
            'step': self._stepping,
            'reset': lambda _: self._ask(self._reset, Trigger.Request()),
            'effort': self._pushing,
            'speed': lambda factor: self._setting('real_time_factor', _number(factor)),
            'scene': self._loading,
        }

    def obey(self, command: object) -> str:
        """Do `{'do': one of the above, 'value': its argument}`; returns the result.

        Raises NotDone.
        """
        act = command.get('do') if isinstance(command, dict) else None
        if not isinstance(command, dict) or not isinstance(act, str) or act not in self._acts:
            raise NotDone(f'not a command: {_short(command)}')
        return self._acts[act](command.get('value'))

    def work(self) -> None:
        """Pass on the requests; to be called in the thread that spins the node."""
        while True:
            try:
                self._todo.get_nowait()()
            except Empty:
                return

    def _pausing(self, pause: bool) -> str:
        answer = self._ask(self._pause, SetBool.Request(data=pause))
        self._todo.put(lambda: self._node.show_state('paused' if pause else 'playing'))
        return answer

    def _stepping(self, count: object) -> str:
        if type(count) is not int or not 0 < count <= MOST_STEPS:
            raise NotDone(f'not a number of ticks: {_short(count)}')
        with self._turn:
            self._setting('step_count', count)
            return self._ask(self._step, Trigger.Request())

    def _pushing(self, efforts: object) -> str:
        if not isinstance(efforts, dict) or not efforts:
            raise NotDone('expected an effort by joint')
        for name in efforts:
            if not name.isprintable():  # not every text of JSON can be sent
                raise NotDone(f'not the name of a joint: {_short(name)}')
        message = JointState(
            name=list(efforts), effort=[_number(value) for value in efforts.values()]
        )
        self._todo.put(lambda: self._efforts.publish(message))
        return ''

    def _loading(self, name: object) -> str:
        if not isinstance(name, str) or name not in library('scenes'):  # a page opens no file
            raise NotDone(f'no such scene: {_short(name)}')
        return self._setting('scene', name, SCENE_PATIENCE)

    def _setting(self, name: str, value: object, patience: float = PATIENCE) -> str:
        parameter = Parameter(name, value=value).to_parameter_msg()
        return self._ask(self._set, SetParameters.Request(parameters=[parameter]), patience)

    def _ask(self, client: Client, request: Any, patience: float = PATIENCE) -> str:
        """Call a service from another thread than the node's and wait for the answer."""
        answer: Future[Any] = Future()

        def call() -> None:
            if client.service_is_ready():
                asked = client.call_async(request)
                asked.add_done_callback(lambda done: answer.set_result(done.result()))
            else:
                answer.set_exception(NotDone(f'there is no {client.srv_name}'))

        self._todo.put(call)
        try:
            found = answer.result(patience)
        except TooLate:
            raise NotDone(f'no answer of {client.srv_name} within {patience:g} s') from None
        result = found.results[0] if isinstance(found, SetParameters.Response) else found
        said = result.reason if hasattr(result, 'reason') else result.message
        succeeded = result.successful if hasattr(result, 'successful') else result.success
        if not succeeded:
            raise NotDone(said)
        return str(said)


def _number(value: object) -> float:
    if type(value) not in (int, float) or not abs(value) < LARGEST:  # type: ignore[arg-type]
        raise NotDone(f'not a number: {_short(value)}')
    return float(value)  # type: ignore[arg-type]


def _short(value: object) -> str:
    return shortened(repr(value))
