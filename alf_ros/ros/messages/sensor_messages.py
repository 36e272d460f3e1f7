"""Measurement -> the bytes of a ROS message, for each kind of sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from geometry_msgs.msg import (
    Accel,
    AccelStamped,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Twist,
    TwistStamped,
    Vector3,
    Wrench,
    WrenchStamped,
)
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState, Range
from std_msgs.msg import Header

from alf_ros.errors import InputError
from alf_ros.ros.messages.templates import STAMP, WORLD, template, to_time
from alf_ros.scene.sensors_section import Sensor
from alf_ros.simulation.sensors import Measurement

Fill = Callable[[Measurement, int], bytes]
Make = Callable[[Sensor, Header, Sequence[float]], Any]


def message_type(kind: str) -> type:
    """The type of the messages of a kind of sensor.

    Raises InputError if its package is not installed.
    """
    if kind == 'odometry':
        return _odometry_type()
    return _TYPES[kind]


def frame_name(sensor: Sensor, prefix: str) -> str:
    """The frame of a sensor that has one of its own."""
    return prefix + sensor.label


def writer(sensor: Sensor, prefix: str) -> Fill:
    """The function that makes the message of a measurement with a stamp (ns).

    `prefix` precedes the names of bodies and sensors as frames.
    """
    if sensor.kind == 'range':
        return lambda found, ns: _range(sensor, prefix, found, ns)
    made, quantities = _MADE[sensor.kind]
    header = Header(stamp=STAMP, frame_id=_frame(sensor, prefix))

    def make(marks: list[float]) -> Any:
        message = made(sensor, header, marks)
        if sensor.kind == 'odometry':
            message.child_frame_id = prefix + sensor.parameters.body
        return message

    filled = template(make, list(quantities.values()))

    def write(found: Measurement, ns: int) -> bytes:
        filled.stamp(ns)
        for block, name in zip(filled.blocks, quantities, strict=True):
            block[:] = found[name]
        return filled.bytes()

    return write


def _frame(sensor: Sensor, prefix: str) -> str:
    """The frame of the numbers of a message."""
    if sensor.kind in _OWN_FRAME:
        return frame_name(sensor, prefix)
    if getattr(sensor.parameters, 'axes', WORLD) == 'body':
        return prefix + str(sensor.parameters.body)
    return WORLD


def _vector(mark: float) -> Vector3:
    return Vector3(x=mark, y=mark, z=mark)


def _pose(place: float, turn: float) -> Pose:
    orientation = Quaternion(x=turn, y=turn, z=turn, w=turn)
    return Pose(position=Point(x=place, y=place, z=place), orientation=orientation)


def _variances(sensor: Sensor, quantity: str) -> list[float]:
    """Covariance matrix of a quantity, row by row, from noise and bias."""
    said = sensor.parameters
    noise, bias = (getattr(said, f'{quantity}_{of}') for of in ('noise', 'bias'))
    return [float(x) for x in (np.eye(3) * (noise**2 + bias**2)).ravel()]


def _imu(sensor: Sensor, header: Header, marks: Sequence[float]) -> Imu:
    orientation, omega, acceleration = marks
    return Imu(
        header=header,
        orientation=_pose(0.0, orientation).orientation,
        angular_velocity=_vector(omega),
        angular_velocity_covariance=_variances(sensor, 'angular_velocity'),
        linear_acceleration=_vector(acceleration),
        linear_acceleration_covariance=_variances(sensor, 'linear_acceleration'),
    )


def _wrench(sensor: Sensor, header: Header, marks: Sequence[float]) -> WrenchStamped:
    force, torque = map(_vector, marks)
    return WrenchStamped(header=header, wrench=Wrench(force=force, torque=torque))


def _odometry_type() -> type:
    try:
        from nav_msgs.msg import Odometry  # not loaded for anybody else
    except ModuleNotFoundError:
        raise InputError(
            'needs the package nav_msgs',
            key='sensors.odometry',
            expected='pip install ros-nav-msgs, or a ROS 2 installation',
        ) from None
    return cast(type, Odometry)


def _odometry(sensor: Sensor, header: Header, marks: Sequence[float]) -> Any:
    place, turn, velocity, omega = marks
    message = _odometry_type()(header=header)
    message.pose.pose = _pose(place, turn)
    message.twist.twist = Twist(linear=_vector(velocity), angular=_vector(omega))
    return message


def _pose_stamped(sensor: Sensor, header: Header, marks: Sequence[float]) -> PoseStamped:
    return PoseStamped(header=header, pose=_pose(*marks))


def _twist(sensor: Sensor, header: Header, marks: Sequence[float]) -> TwistStamped:
    linear, angular = map(_vector, marks)
    return TwistStamped(header=header, twist=Twist(linear=linear, angular=angular))


def _acceleration(sensor: Sensor, header: Header, marks: Sequence[float]) -> AccelStamped:
    linear, angular = map(_vector, marks)
    return AccelStamped(header=header, accel=Accel(linear=linear, angular=angular))


def _encoder(sensor: Sensor, header: Header, marks: Sequence[float]) -> JointState:
    position, velocity = marks
    return JointState(
        header=header,
        name=[sensor.parameters.joint],
        position=[position],
        velocity=[velocity],
        effort=[math.nan],  # not known; rosbags cannot read a last array that is empty
    )


def _range(sensor: Sensor, prefix: str, found: Measurement, ns: int) -> bytes:
    """Its numbers have 32 bits, which no template fills."""
    said = sensor.parameters
    header = Header(stamp=to_time(ns), frame_id=_frame(sensor, prefix))
    message = Range(header=header, radiation_type=Range.INFRARED, range=float(found['range'][0]))
    message.min_range, message.max_range = said.min_range, said.max_range
    return bytes(serialize_message(message))


_OWN_FRAME = ('force_torque', 'imu', 'range')
_TYPES: dict[str, type] = {
    'force_torque': WrenchStamped,
    'imu': Imu,
    'pose': PoseStamped,
    'twist': TwistStamped,
    'acceleration': AccelStamped,
    'encoder': JointState,
    'range': Range,
}
_VELOCITIES = {'linear_velocity': 3, 'angular_velocity': 3}
# how a message is made, and the quantities that fill its blocks, in their order
_MADE: dict[str, tuple[Make, dict[str, int]]] = {
    'force_torque': (_wrench, {'force': 3, 'torque': 3}),
    'imu': (_imu, {'orientation': 4, 'angular_velocity': 3, 'linear_acceleration': 3}),
    'odometry': (_odometry, {'position': 3, 'orientation': 4, **_VELOCITIES}),
    'pose': (_pose_stamped, {'position': 3, 'orientation': 4}),
    'twist': (_twist, _VELOCITIES),
    'acceleration': (_acceleration, {'linear_acceleration': 3, 'angular_acceleration': 3}),
    'encoder': (_encoder, {'position': 1, 'velocity': 1}),
}
