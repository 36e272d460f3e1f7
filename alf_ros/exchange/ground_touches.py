"""Balls, wheels and points of a robot that touch fixed planes, as `ground_contact` knows them.

A ball touches as it is, a capsule as the balls at its ends, a box as its eight corners, a cylinder
as the two circles at its ends: a plane touches no other place of them first. Of an ellipsoid or a
mesh no few points are the first to touch, so those are listed.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import GROUND, FixedPlane, GroundTouch, Robot
from alf_ros.mechanism import VisualShape


def _touching(shape: VisualShape) -> tuple[list[tuple[Floats, float]], Floats | None]:
    """Centre (3,) and radius of each ball, m, 0 of a corner; for wheels their axle (3,), unit.

    Raises ValueError for a shape that is not made of a few.
    """
    at, turn = np.array(shape.at), shape.turn
    if shape.kind == 'sphere':
        return [(at, shape.size[0])], None
    if shape.kind in ('capsule', 'cylinder'):
        radius, length = shape.size
        axle = turn[:, 2]
        ends = [(at + end * length * axle, radius) for end in (-0.5, 0.5)]
        return ends, axle if shape.kind == 'cylinder' else None
    if shape.kind == 'box':
        half = 0.5 * np.array(shape.size)
        signs = np.array(np.meshgrid(*(3 * [[-1.0, 1.0]]), indexing='ij')).reshape(3, -1).T
        return [(at + turn @ (sign * half), 0.0) for sign in signs], None
    raise ValueError(shape.kind)


def touch(
    robot: Robot,
    part: str,
    name: str,
    shape: VisualShape,
    plane: FixedPlane,
    friction: float,
    turning: bool = False,
) -> None:
    """Let a shape of a part, placed as drawn, touch a plane, see `GroundTouch`; list a shape that
    cannot."""
    try:
        found, axle = _touching(shape)
    except ValueError:
        robot.leave('contact of other shapes', f'{shape.kind} {name}')
        return
    for n, (centre, radius) in enumerate(found):
        of = name if len(found) == 1 else f'{name}_{n}'
        robot.touches.append(GroundTouch(of, part, centre, radius, plane, friction, turning, axle))


def of_colliders(robot: Robot, ground: float | None) -> None:
    """Let every collision shape of a robot touch every plane of its file, and a horizontal one at
    the height `ground` (m) if that is given. The smaller coefficient of friction counts."""
    planes = list(robot.planes)
    if ground is not None:
        up = np.array([0.0, 0.0, 1.0])
        planes.append((FixedPlane(ground * up, up), None))
    moving = [each for each in robot.colliders if each.part != GROUND]
    if not planes:
        for each in moving:
            robot.leave('contact', each.part)
        return
    for each in moving:
        robot.leave('contact between bodies', each.part)
        if each.across is not None:
            robot.leave('friction in two directions', each.name)
        for kind in each.left_out:
            robot.leave(kind, each.name)
        for plane, friction in planes:
            if each.shape is None:  # unusable, a mesh that cannot be named, or another kind
                text = f'{each.name} ({each.element})' if each.element else each.name
                robot.leave('contact of other shapes', text)
                continue
            given = [mu for mu in (each.friction, each.across, friction) if mu is not None]
            before = len(robot.touches)
            touch(robot, each.part, each.name, each.shape, plane, min(given, default=1.0))
            for note in each.noted if len(robot.touches) > before else ():
                robot.left_out.remove('gazebo', note)
