"""Posture -> messages: joint_states, ~/effort_map and ~/diagnostics of the node `close`."""

from __future__ import annotations

from collections.abc import Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from alf_ros.studies.closing.closure import Closure
from alf_ros.studies.closing.posture import Posture

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


def joint_state(posture: Posture, stamp: Time, moving: bool) -> JointState:
    """All joint coordinates; velocities if `moving`: the input had them."""
    message = JointState(name=list(posture.model.coordinate_names))
    message.header.stamp = stamp
    message.position = posture.joint_positions.tolist()
    if moving:
        message.velocity = posture.joint_velocities.tolist()
    return message


def effort_map(closure: Closure, posture: Posture) -> Float64MultiArray:
    """Gᵀ by rows, (active, joint coordinates); the labels of the dimensions are the names."""
    values = posture.effort_map
    rows, columns = values.shape
    dimensions = [
        MultiArrayDimension(label=','.join(closure.active), size=rows, stride=rows * columns),
        MultiArrayDimension(label=','.join(closure.joint_names), size=columns, stride=columns),
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=dimensions), data=values.ravel().tolist())


def diagnostics(
    node: str,
    hardware: str,
    stamp: Time,
    statuses: Mapping[str, tuple[bytes, str, dict[str, object]]],
) -> DiagnosticArray:
    """One status for each task: its level, message and values."""
    message = DiagnosticArray()
    message.header.stamp = stamp
    for task, (level, text, values) in statuses.items():
        message.status.append(
            DiagnosticStatus(
                name=f'{node}: {task}',
                hardware_id=hardware,
                level=level,
                message=text,
                values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
            )
        )
    return message


def _text(value: object) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
