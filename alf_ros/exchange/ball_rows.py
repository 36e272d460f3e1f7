"""Three revolutes in a row through links without mass, joined into the ball that they stand for.

Each axis is at a right angle to the next. Such a row cannot turn in every way: where its first and
third axis align (gimbal lock) it loses a direction, and near that its links turn faster than a
step follows. A ball does neither. Its three angles are no joint coordinates.
"""

from __future__ import annotations

from alf_ros.exchange.gimbal_lock import rows, stands_for_ball
from alf_ros.exchange.robot import Connection, Robot


def joined(robot: Robot, stops: bool) -> None:
    """Put a ball in place of each such row, of the name of its first joint.

    A row stays if something acts on its angles: damping, friction, springs, a rotor, an actuator,
    a tendon, a coupling, or limits that have `stops`; or on a link between, as a touch does.
    """
    used = {each.joint for each in robot.actuators if not each.on_tendon}
    used |= {name for each in robot.tendons for name in each.joints}
    used |= {name for each in robot.couplings for name in each.of}
    held = {touch.part for touch in robot.touches}
    held |= {part for each in robot.tendons for part, _ in each.path}
    for row in list(rows(robot)):  # of four revolutes two rows, of which one becomes a ball
        if any(each.name in used or _acts(each, stops) for each in row):
            continue
        if not stands_for_ball(row) or not held.isdisjoint((row[1].parent, row[1].child)):
            continue
        used |= {each.name for each in row}
        first, middle, last = row
        parent, child = _end(first, middle), _end(last, middle)
        inner = {middle.parent, middle.child}
        ball = Connection(first.name, 'spherical', parent, child, middle.place)
        for name in inner:
            robot.left_out.remove('mass: there is none', name)
            robot.velocities.pop(name, None)
        robot.parts = [part for part in robot.parts if part.name not in inner]
        robot.connections = [
            ball if each is first else each
            for each in robot.connections
            if each is not middle and each is not last
        ]
        robot.leave('angles of balls', ', '.join(each.name for each in row))
        for each in row:
            if each.limits is not None:
                robot.leave('limits (see --stops)', each.name)


def _acts(joint: Connection, stops: bool) -> bool:
    """Whether forces or a rotor act on the angle of a joint."""
    stopped = stops and joint.limits is not None
    return stopped or any((joint.damping, joint.stiffness, joint.friction, joint.armature))


def _end(joint: Connection, middle: Connection) -> str:
    """The side of a joint that is not between the joints of the row."""
    between = {middle.parent, middle.child}
    return joint.parent if joint.parent not in between else joint.child
