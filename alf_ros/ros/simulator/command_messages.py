"""Commands as they come: ROS messages to what the simulation takes, or refused with a reason."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from alf_ros.ros.messages.templates import WORLD
from alf_ros.scene.diff_drive_section import DiffDrive

if TYPE_CHECKING:
    from geometry_msgs.msg import Twist, WrenchStamped
    from sensor_msgs.msg import JointState

REASONS = (
    'unknown_name',
    'unknown_frame',
    'not_finite',
    'out_of_plane',
    'no_orientation',
    'wrong_length',
    'repeated_name',
    'no_value',
    'not_controlled',
    'wrong_time',
    'moving_end',
    'wrong_type',
)


# By joint, or tendon: whether its position is controlled, and its velocity.
Controlled = Mapping[str, tuple[bool, bool]]


class Refused(Exception):
    """A command cannot be taken: `reason` is one of REASONS, the text says it to a human."""

    def __init__(self, reason: str, text: str) -> None:
        self.reason = reason
        super().__init__(text)


def read_wrench(
    message: WrenchStamped,
    name: str,
    bodies: Collection[str],
    points: Collection[str],
    frame_prefix: str = '',
    dimension: int = 2,
) -> dict[str, Any]:
    """Wrench for body or movable point `name`: keywords of `Simulation.apply_wrench`.

    Force (N) at the body's centre of mass or at the point, torque (N m; in the plane about +z).
    `frame_id` '' or
    'world': world axes; the body's own name, also behind `frame_prefix`: its axes, turning with
    it. Raises Refused.
    """
    force, torque, frame = message.wrench.force, message.wrench.torque, message.header.frame_id
    is_body = name in bodies
    if not is_body and name not in points:
        hint = _hint(name, (*bodies, *points))
        raise Refused('unknown_name', f'unknown body or movable point {hint}')
    of_body = is_body and frame in (name, frame_prefix + name)
    if frame not in ('', WORLD) and not of_body:
        own = f' or {name!r}' if is_body else ''
        raise Refused('unknown_frame', f'{name}: frame {frame!r} is not {WORLD!r}{own}')
    if not all(map(math.isfinite, (force.x, force.y, force.z, torque.x, torque.y, torque.z))):
        raise Refused('not_finite', f'{name}: a wrench must be finite')
    if dimension == 2 and (force.z or torque.x or torque.y):
        raise Refused('out_of_plane', f'{name}: force.z, torque.x and torque.y must be 0')
    planar = dimension == 2
    return {
        'name': name,
        'force': (force.x, force.y) if planar else (force.x, force.y, force.z),
        'torque': torque.z if planar else (torque.x, torque.y, torque.z),
        'frame': 'body' if of_body else 'world',
    }


def read_twist(
    message: Twist, drive: DiffDrive, controlled: Controlled
) -> dict[str, dict[str, float]]:
    """Velocities (rad/s) of the wheels by joint, for `linear.x` (m/s) and `angular.z` (rad/s).

    Raises Refused, also for another component than these, which wheels cannot follow.
    """
    linear, angular = message.linear, message.angular
    numbers = [getattr(vector, axis) for vector in (linear, angular) for axis in 'xyz']
    if not all(map(math.isfinite, numbers)):
        raise Refused('not_finite', 'cmd_vel must be finite')
    if linear.y or linear.z or angular.x or angular.y:
        raise Refused('out_of_plane', 'cmd_vel: only linear.x and angular.z can be followed')
    for name in (drive.left, drive.right):
        if not controlled[name][1]:
            raise Refused('not_controlled', f'cmd_vel: no motor controls the velocity of {name!r}')
    speeds = drive.wheel_speeds(linear.x, angular.z)
    if not all(map(math.isfinite, speeds)):  # of numbers too large for them
        raise Refused('not_finite', 'cmd_vel: the velocities of the wheels must be finite')
    return {
        name: {'velocity': speed}
        for name, speed in zip((drive.left, drive.right), speeds, strict=True)
    }


def check_names(topic: str, names: Sequence[str], joints: Collection[str]) -> None:
    """Raises Refused if one is unknown or stands there twice."""
    if names and not joints:
        raise Refused('unknown_name', f'{topic}: the mechanism has no joint coordinates')
    for name in names:
        if name not in joints:
            raise Refused('unknown_name', f'unknown joint {_hint(name, tuple(joints))}')
    if len(set(names)) != len(names):
        raise Refused('repeated_name', f'{topic} names a joint twice')


def read_joints(
    message: JointState, joints: Collection[str], controlled: Controlled
) -> dict[str, dict[str, float]]:
    """Commands by joint: `effort` (N m or N), `position` (rad or m), `velocity`. `controlled` may
    have tendons besides the joints.

    NaN is no command, as ros2_control has it, and a message with NaN only has no effect. A
    position or velocity that no motor controls is refused, unless the joint has an effort: a
    sender of complete joint states intends this. Raises Refused.
    """
    given = {'effort': message.effort, 'position': message.position, 'velocity': message.velocity}
    given = {field: values for field, values in given.items() if values}
    if not given:
        raise Refused('no_value', 'joint_commands without effort, position and velocity')
    for field, values in given.items():
        if any(map(math.isinf, values)):
            raise Refused('not_finite', f'joint_commands: {field} must be finite')
    check_names('joint_commands', message.name, controlled)
    commands: dict[str, dict[str, float]] = {name: {} for name in message.name}
    for field, names in _places(message, controlled).items():
        for name, value in zip(names, given[field], strict=True):
            if not math.isnan(value):
                commands[name][field] = value
    for name, command in commands.items():
        if 'effort' in command and name not in joints:
            raise Refused('not_controlled', f'no effort on {name!r}, which is a tendon')
        for field, followed in zip(('position', 'velocity'), controlled[name], strict=True):
            if field in command and not followed:
                if 'effort' not in command:
                    raise Refused('not_controlled', f'no motor controls the {field} of {name!r}')
                del command[field]
    return {name: command for name, command in commands.items() if command}


def _places(message: JointState, controlled: Controlled) -> dict[str, list[str]]:
    """The joints to which the values of each field belong, in order.

    The plugins of ros2_control for topics leave out the values of joints without that command
    interface, but still name the joints. If the number of values equals the number of their motors
    among the named joints, they belong to these motors; or to the joints that have no other value,
    if that number fits. Raises Refused if none fits, or both and they differ.
    """
    places: dict[str, list[str]] = {}
    for n, field in enumerate(('position', 'velocity', 'effort')):
        count = len(getattr(message, field))
        if not count:
            continue
        taken = {name for names in places.values() for name in names}
        can = [x for x in message.name if (any(controlled[x]) if n == 2 else controlled[x][n])]
        choices = [can, [x for x in (message.name if n == 2 else can) if x not in taken]]
        if count == len(message.name):
            choices = [list(message.name)]
        fitting = [names for names in choices if len(names) == count]
        if not fitting or fitting[0] != fitting[-1]:
            text = f'{len(message.name)} names, {count} values of {field}, {len(can)} motors'
            raise Refused('wrong_length', f'joint_commands: {text}; NaN means: no command')
        places[field] = fitting[0]
    return places


@lru_cache(maxsize=64)
def _hint(name: str, known: tuple[str, ...]) -> str:
    """The name and the nearest one known; kept, for a wrong publisher repeats itself."""
    near = get_close_matches(name, known, 1, 0.5)
    return f'{name!r}, did you mean {near[0]!r}' if near else repr(name)
