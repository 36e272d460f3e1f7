"""The parameter services of a node, which answer a value of an unknown type with a refusal.

The services of rclpy convert each message with `Parameter.from_parameter_msg` outside any `try`.
The type of a value is a byte of the message. A byte that does not stand for one of the ten types
raises ValueError there, which ends the node.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from alf_ros.errors import InputError
from alf_ros.ros.simulator import parameters

if TYPE_CHECKING:
    from rclpy.node import Node

Change = Callable[[list[Parameter[Any]]], Awaitable[SetParametersResult]]


class ParameterServices(ParameterService):
    """`~/set_parameters`, `~/get_parameters` and the others, for a node that is made with
    `start_parameter_services=False`. `change` sets parameters atomically, for a node whose changes
    may take long; its `default_callback_group` then lets requests overtake each other."""

    def __init__(self, node: Node, change: Change | None = None) -> None:
        self._change = change or _at_once(node)
        super().__init__(node)

    async def _set_parameters_callback(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        for asked in request.parameters:  # each is set, or refused, for itself
            response.results.append(await self._answer([asked]))
        return response

    async def _set_parameters_atomically_callback(
        self,
        request: SetParametersAtomically.Request,
        response: SetParametersAtomically.Response,
    ) -> SetParametersAtomically.Response:
        response.result = await self._answer(request.parameters)
        return response

    async def _answer(self, asked: Sequence[ParameterMessage]) -> SetParametersResult:
        refused = _refused(asked)
        if refused is not None:
            return refused
        try:
            return await self._change([Parameter.from_parameter_msg(each) for each in asked])
        except ParameterNotDeclaredException as error:
            return SetParametersResult(successful=False, reason=str(error))


def _at_once(node: Node) -> Change:
    async def change(asked: list[Parameter[Any]]) -> SetParametersResult:
        fitted, reason = parameters.fitted(node, asked)
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        return node.set_parameters_atomically(fitted)

    return change


def _refused(asked: Sequence[ParameterMessage]) -> SetParametersResult | None:
    """The refusal of values that are none; None if all are values."""
    for each in asked:
        try:
            Parameter.from_parameter_msg(each)
        except (TypeError, ValueError):
            error = InputError(
                'not a value of a parameter',
                key=each.name,
                value=each.value.type,
                expected='a type of rcl_interfaces/msg/ParameterType, 0 to 9',
            )
            return SetParametersResult(successful=False, reason=str(error))
    return None
