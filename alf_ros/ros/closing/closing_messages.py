"""Posture -> messages of the node `close`: joint_states, ~/effort_map, ~/travel, ~/diagnostics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from alf_ros.arrays import Floats
from alf_ros.simulation.observables import joint_state_names
from alf_ros.studies.closing.closure import Closure
from alf_ros.studies.closing.posture import Posture

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


def joint_state(posture: Posture, stamp: Time, moving: bool) -> JointState:
    """All joint coordinates, then the angles of balls; velocities if `moving`, the input had them,
    and they exist."""
    angles, rates = posture.angles_of_balls
    message = JointState(name=list(joint_state_names(posture.model)))
    message.header.stamp = stamp
    message.position = [*posture.joint_positions.tolist(), *angles.tolist()]
    if moving and np.isfinite(posture.joint_velocities).all():
        message.velocity = [*posture.joint_velocities.tolist(), *rates.tolist()]
    return message


def effort_map(closure: Closure, posture: Posture) -> Float64MultiArray:
    """Gᵀ by rows, (active, joint coordinates); the labels of the dimensions are the names."""
    return _table(posture.effort_map, closure.active, closure.joint_names)


def travel(closure: Closure, posture: Posture) -> Float64MultiArray:
    """(active, 2) the lowest and the highest value of each active joint while the others rest, rad
    or m, possibly infinite; the labels of the dimensions are the names."""
    limits = np.array([posture.travel(joint) for joint in closure.active])
    return _table(limits, closure.active, ('lower', 'upper'))


def _table(values: Floats, rows: Sequence[str], columns: Sequence[str]) -> Float64MultiArray:
    dimensions = [
        MultiArrayDimension(label=','.join(rows), size=len(rows), stride=values.size),
        MultiArrayDimension(label=','.join(columns), size=len(columns), stride=len(columns)),
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
