"""Three revolutes in a row through links without mass, joined into the ball that they stand for.

Each axis is at a right angle to the next. Such a row cannot turn in every way: where its first and
third axis align (gimbal lock) it loses a direction, and near that its links turn faster than a
step follows. A ball does neither. It keeps the names and angles of the row.
"""

from __future__ import annotations

from collections.abc import Iterator, Set

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange.gimbal_lock import rows, stands_for_ball
from alf_ros.exchange.robot import GROUND, Connection, Robot

Row = tuple[Connection, Connection, Connection]

_NOTHING = 1e-12  # part of the largest moment of inertia that is rounding


def joined(robot: Robot, stops: bool) -> None:
    """Put a ball in place of each such row, of the name of its first joint.

    A row stays if something acts on its angles: damping, friction, springs, a rotor, an actuator,
    a tendon, a coupling, or limits that have `stops`; or on a link between, as a touch does.
    """
    found = list(_free_rows(robot, stops))
    turning = _with_orientation(robot, {each.name for row in found for each in row})
    for row in found:
        first, middle, last = row
        parent, child = _end(first, middle), _end(last, middle)
        angles = _angles(row, parent, child) if {parent, child} <= turning else ()
        ball = Connection(first.name, 'spherical', parent, child, middle.place, angles=angles)
        inner = {middle.parent, middle.child}
        for name in inner:
            robot.left_out.remove('mass: there is none', name)
            robot.velocities.pop(name, None)
        robot.parts = [part for part in robot.parts if part.name not in inner]
        robot.connections = [
            ball if each is first else each
            for each in robot.connections
            if each is not middle and each is not last
        ]
        kind = 'rows of joints that are balls' if angles else 'angles of balls'
        robot.leave(kind, ', '.join(each.name for each in row))
        for each in row:
            if each.limits is not None:
                robot.leave('limits (see --stops)', each.name)


def _free_rows(robot: Robot, stops: bool) -> Iterator[Row]:
    """The rows on which nothing acts; of four revolutes two are rows, of which one counts."""
    used = {each.joint for each in robot.actuators if not each.on_tendon}
    used |= {name for each in robot.tendons for name in each.joints}
    used |= {name for each in robot.couplings for name in each.of}
    held = {touch.part for touch in robot.touches}
    held |= {part for each in robot.tendons for part, _ in each.path}
    for row in rows(robot):
        if any(each.name in used or _acts(each, stops) for each in row):
            continue
        if stands_for_ball(row) and held.isdisjoint((row[1].parent, row[1].child)):
            used |= {each.name for each in row}
            yield row


def _with_orientation(robot: Robot, of_balls: Set[str]) -> set[str]:
    """The parts of which all rotations are determined: the ground, those with inertia about every
    axis, and those held by an axis. A slender rod between balls is none."""
    found = {GROUND}
    for part in robot.parts:
        moments = np.linalg.eigvalsh(part.inertia)
        if moments[0] > _NOTHING * moments[-1]:
            found.add(part.name)
    for each in robot.connections:
        if each.axes and each.name not in of_balls:
            found |= {each.parent, each.child}
    return found


def _acts(joint: Connection, stops: bool) -> bool:
    """Whether forces or a rotor act on the angle of a joint."""
    stopped = stops and joint.limits is not None
    return stopped or any((joint.damping, joint.stiffness, joint.friction, joint.armature))


def _angles(row: Row, parent: str, child: str) -> tuple[tuple[str, Floats], ...]:
    """Names and axes of the row from parent to child. Axes of rounded files are not quite at right
    angles: the middle one counts."""
    first, middle, last = (each.axes[0] for each in row)
    first, last = (each - (each @ middle) * middle for each in (first, last))
    if row[0].parent != parent:  # its angle is that of the parent against the link
        first = -first
    if row[2].child != child:
        last = -last
    axes = first / np.linalg.norm(first), middle, last / np.linalg.norm(last)
    return tuple((each.name, axis) for each, axis in zip(row, axes, strict=True))


def _end(joint: Connection, middle: Connection) -> str:
    """The side of a joint that is not between the joints of the row."""
    between = {middle.parent, middle.child}
    return joint.parent if joint.parent not in between else joint.child
