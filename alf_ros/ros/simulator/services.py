"""The services of the simulator: std_srvs in front of its state machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rclpy.callback_groups import ReentrantCallbackGroup
from std_srvs.srv import SetBool, Trigger

from alf_ros.errors import AlfError
from alf_ros.ros.simulator.control import Control

if TYPE_CHECKING:
    from rclpy.node import Node


class Services:
    """`~/pause`, `~/step`, `~/reset`, `~/reset_state`, `~/save_state`, `~/restore_state`.

    These types carry no numbers and no names: parameters (`step_count`, `state.name`) say them.
    """

    def __init__(self, node: Node, control: Control) -> None:
        self._node, self._control = node, control
        node.create_service(SetBool, '~/pause', self._on_pause)
        # Waits for steps that callbacks of the default group make.
        waiting = ReentrantCallbackGroup()
        node.create_service(Trigger, '~/step', self._on_step, callback_group=waiting)
        self._offer('~/reset', lambda: control.reset(keep_time=False))
        self._offer('~/reset_state', lambda: control.reset(keep_time=True))
        self._offer('~/save_state', lambda: control.save(self._state_name))
        self._offer('~/restore_state', lambda: control.restore(self._state_name))

    @property
    def _state_name(self) -> str:
        return str(self._node.get_parameter('state.name').value)

    def _offer(self, name: str, act: Callable[[], str]) -> None:
        def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.message = act()
                response.success = True
            except AlfError as error:
                self._node.get_logger().error(f'{name}: {error}')
                response.message = str(error)
            return response

        self._node.create_service(Trigger, name, serve)

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        try:
            response.message = self._control.pause() if request.data else self._control.play()
            response.success = True
        except AlfError as error:
            response.message = str(error)
        return response

    async def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        count = self._node.get_parameter('step_count').value
        try:
            response.message = await self._control.step(count)
            response.success = True
        except AlfError as error:
            response.message = str(error)
        return response
