"""Commands as they come: ROS messages to what the simulation takes, or refused with a reason."""

from __future__ import annotations

import math
from collections.abc import Collection
from difflib import get_close_matches
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from alf_ros.messages import WORLD

if TYPE_CHECKING:
    from geometry_msgs.msg import WrenchStamped
    from sensor_msgs.msg import JointState

REASONS = (
    'unknown_name',
    'unknown_frame',
    'not_finite',
    'out_of_plane',
    'no_orientation',
    'wrong_length',
    'repeated_name',
    'no_effort',
    'wrong_type',
)


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


def read_efforts(message: JointState, joints: Collection[str]) -> dict[str, float]:
    """Effort (N m or N) by joint, for those of `joints` that the message names. Raises Refused.

    Positions and velocities beside efforts are not looked at: nothing here follows them.
    """
    names, efforts = message.name, message.effort
    if not efforts:
        raise Refused('no_effort', 'joint_commands without effort: only efforts are followed')
    if len(names) != len(efforts):
        raise Refused('wrong_length', f'joint_commands: {len(names)} names {len(efforts)} efforts')
    for name in names:
        if name not in joints:
            raise Refused('unknown_name', f'unknown joint {_hint(name, tuple(joints))}')
    if len(set(names)) != len(names):
        raise Refused('repeated_name', 'joint_commands names a joint twice')
    if not all(map(math.isfinite, efforts)):
        raise Refused('not_finite', 'joint_commands: an effort must be finite')
    return dict(zip(names, efforts, strict=True))


@lru_cache(maxsize=64)
def _hint(name: str, known: tuple[str, ...]) -> str:
    """The name and the nearest one known; kept, for a wrong publisher repeats itself."""
    near = get_close_matches(name, known, 1, 0.5)
    return f'{name!r}, did you mean {near[0]!r}' if near else repr(name)
