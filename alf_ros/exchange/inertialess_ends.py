"""Links at the ends of a robot that turn without inertia: all their mass is on the axis.

The angle of such a joint moves no mass, so how it turns is not determined. The joint is fixed as
drawn, and the link becomes a part of the one that it hangs from: all else moves as before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import GROUND, Connection, Robot, RobotPart, lumped

_NONE = 1e-12  # of the mass times the square of the robot's size: an inertia that is none
_TURNS = ('revolute', 'spherical')


def fixed(robot: Robot) -> None:
    """Fix the joints of such ends; a rotor, a coupling or a tendon keeps a joint."""
    size = robot.size
    kept = {each.name for each in robot.connections if each.armature}
    kept |= {name for each in robot.couplings for name in each.of}
    kept |= {name for each in robot.tendons for name in each.joints}
    while (found := _end(robot, kept, size)) is not None:
        _join(robot, *found)


def _end(robot: Robot, kept: set[str], size: float) -> tuple[Connection, RobotPart] | None:
    """A joint, and the part at its end, which turns about it without inertia."""
    at: dict[str, list[Connection]] = {}
    for each in robot.connections:
        for side in (each.parent, each.child):
            at.setdefault(side, []).append(each)
    for part in robot.parts:
        joints = at.get(part.name, [])
        if part.mass == 0.0 or len(joints) != 1 or part.name in robot.lifts:
            continue
        if joints[0].kind in _TURNS and joints[0].name not in kept:
            least = _NONE * part.mass * size**2
            if float(np.abs(_about(joints[0], part)).max()) <= least:
                return joints[0], part
    return None


def _about(joint: Connection, part: RobotPart) -> Floats:
    """The inertia of a part about the axes of a joint, kg m^2."""
    r = part.com - joint.place
    J = part.inertia + part.mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    if joint.kind == 'spherical':
        return J
    return np.asarray(joint.axes[0] @ J @ joint.axes[0])


def _join(robot: Robot, joint: Connection, part: RobotPart) -> None:
    """Make a part one with the other side of its joint."""
    other = joint.parent if joint.child == part.name else joint.child
    robot.parts = [
        lumped(each.name, each.origin, (each, part)) if each.name == other else each
        for each in robot.parts
        if each is not part
    ]
    robot.connections = [each for each in robot.connections if each is not joint]
    robot.actuators = [
        each for each in robot.actuators if each.on_tendon or each.joint != joint.name
    ]
    robot.shapes = [(other if of == part.name else of, shape) for of, shape in robot.shapes]
    robot.touches = [
        replace(each, part=other) if each.part == part.name else each
        for each in robot.touches
        if other != GROUND or each.part != part.name
    ]
    for tendon in robot.tendons:
        path = [(other if of == part.name else of, place) for of, place in tendon.path]
        robot.tendons[robot.tendons.index(tendon)] = replace(tendon, path=path)
    robot.velocities.pop(part.name, None)
    robot.leave('joints without inertia', joint.name)
