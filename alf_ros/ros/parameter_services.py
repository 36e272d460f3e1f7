"""The parameter services of a node, which answer a value of an unknown type with a refusal.

The services of rclpy convert each message with `Parameter.from_parameter_msg` outside any `try`.
The type of a value is a byte of the message. A byte that does not stand for one of the ten types
raises ValueError there, which ends the node.
"""

from __future__ import annotations

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from alf_ros.errors import InputError


class ParameterServices(ParameterService):
    """`~/set_parameters`, `~/get_parameters` and the others, for a node that is made with
    `start_parameter_services=False`."""

    def _set_parameters_callback(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        for asked in request.parameters:  # each is set, or refused, for itself
            refused = _refused([asked])
            if refused is None:
                one = SetParameters.Request(parameters=[asked])
                super()._set_parameters_callback(one, response)
            else:
                response.results.append(refused)
        return response

    def _set_parameters_atomically_callback(
        self,
        request: SetParametersAtomically.Request,
        response: SetParametersAtomically.Response,
    ) -> SetParametersAtomically.Response:
        refused = _refused(request.parameters)
        if refused is None:
            return super()._set_parameters_atomically_callback(request, response)
        response.result = refused
        return response


def _refused(asked: list[ParameterMessage]) -> SetParametersResult | None:
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
