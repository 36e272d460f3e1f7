"""Three revolutes in a row through links without mass, drawn where their axes lie in one plane.

Such a row stands for a ball if each axis is at a right angle to the next: in that plane the first
and the third axis then align. There the links between turn while both ends stay, and without mass
nothing determines how. Near it they turn faster than a step follows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from alf_ros.exchange.robot import Connection, Robot

_SAME = 1e-9  # of the size of the place: joints at one place
_LOCKED, _NEAR = 1e-4, 0.1  # sine between the axes
_RIGHT = 1e-3  # cosine between axes that count as perpendicular, as in the rounded files of CAD


def checked(robot: Robot) -> None:
    """Note rows of joints, and those near that position. Raises InputError for rows in it."""
    for row in rows(robot):
        sine = float(np.linalg.norm(np.cross(row[0].axes[0], row[2].axes[0])))
        names = ', '.join(each.name for each in row)
        if not stands_for_ball(row):
            if _in_one_plane(row) and not any(each.armature for each in row):
                raise robot.error(
                    row[1].name,
                    f'the axes of {names} lie in one plane, and the links between have no mass: '
                    'how they move is not determined',
                    expected='another position (--set), mass of these links, or rotors',
                )
            robot.leave('rows of joints with skew axes', names)
            continue
        if sine < _LOCKED:
            raise robot.error(
                row[1].name,
                f'the first and the last axis of {names} are parallel, and the links between have '
                'no mass: how they move is not determined',
                expected=f'--set {row[1].name}=NUMBER, or a ball: nothing that acts on them, and '
                'no --no-balls',
            )
        near = sine < _NEAR
        robot.leave('joints near gimbal lock' if near else 'rows of joints for balls', names)


def stands_for_ball(row: Sequence[Connection]) -> bool:
    """Whether three revolutes at one place turn as a ball does: each axis is at a right angle to
    the next. Of others some directions are out of reach, and two that are parallel turn as one."""
    first, middle, last = (each.axes[0] for each in row)
    return bool(max(abs(first @ middle), abs(middle @ last)) < _RIGHT)


def _in_one_plane(row: Sequence[Connection]) -> bool:
    """Whether the three axes lie in one plane, and no two neighbours are parallel: such a link
    turns alone, which the report of bodies without mass says."""
    first, middle, last = (each.axes[0] for each in row)
    one, other = np.cross(first, middle), np.cross(middle, last)
    sizes = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    sine = float(np.linalg.norm(np.cross(one, other)))
    return min(sizes) > _LOCKED and sine < _LOCKED * sizes[0] * sizes[1]


def rows(robot: Robot) -> Iterator[tuple[Connection, Connection, Connection]]:
    """Three revolutes at one place, held by two links that have no mass, no inertia and no other
    joint."""
    at: dict[str, list[Connection]] = {}
    for each in robot.connections:
        for side in (each.parent, each.child):
            at.setdefault(side, []).append(each)
    light = [part.name for part in robot.parts if part.mass == 0.0 and not part.inertia.any()]
    held = {name for name in light if len(at.get(name, [])) == 2}
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
