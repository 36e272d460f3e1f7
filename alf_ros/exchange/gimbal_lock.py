"""Three revolutes in a row through links without mass, drawn where first and third axis align.

Such a row stands for a ball. There the links between turn about the axis that both ends share, and
without mass nothing determines how. Near it they turn faster than a step follows.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.exchange.robot import Connection, Robot

_SAME = 1e-9  # of the size of the place: joints at one place
_LOCKED, _NEAR = 1e-4, 0.1  # sine between the axes


def checked(robot: Robot) -> None:
    """Note rows of joints, and those near that position. Raises InputError for rows in it."""
    for row in rows(robot):
        sine = float(np.linalg.norm(np.cross(row[0].axes[0], row[2].axes[0])))
        names = ', '.join(each.name for each in row)
        if sine < _LOCKED:
            raise robot.error(
                row[1].name,
                f'the first and the last axis of {names} are parallel, and the links between have '
                'no mass: how they move is not determined',
                expected=f'a ball in their place: --balls; or --set {row[1].name}=NUMBER',
            )
        near = sine < _NEAR
        robot.leave('joints near gimbal lock' if near else 'rows of joints for balls', names)


def rows(robot: Robot) -> Iterator[tuple[Connection, Connection, Connection]]:
    """Three revolutes at one place, held by two links that have no mass and no other joint."""
    at: dict[str, list[Connection]] = {}
    for each in robot.connections:
        for side in (each.parent, each.child):
            at.setdefault(side, []).append(each)
    held = {
        part.name for part in robot.parts if part.mass == 0.0 and len(at.get(part.name, [])) == 2
    }
    for middle in robot.connections:
        if {middle.parent, middle.child} <= held:
            first, last = (
                next(each for each in at[side] if each is not middle)
                for side in (middle.parent, middle.child)
            )
            row = (first, middle, last)
            if all(each.kind == 'revolute' for each in row) and _together(row):
                yield row


def _together(row: tuple[Connection, ...]) -> bool:
    away = max(float(np.linalg.norm(each.place - row[1].place)) for each in row)
    return away <= _SAME * max(1.0, float(np.abs(row[1].place).max()))
