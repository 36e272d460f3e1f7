"""Drives: constraints that depend on time.

A motion as a function of time is a block of its own, s(t), so that every row stays a quadratic
form: of a length x(q) - s, of an angle w·d with w the direction that d must stay normal to.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Drive, Mechanism, affine
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.auxiliary import turned
from alf_ros.model.constraints.joint_coordinates import angle_axes, length_row
from alf_ros.model.constraints.row import Row, linear, plus, product, scaled, value


def drive_rows(drive: Drive, layout: Layout) -> Iterator[Row]:
    """The rows that keep a coordinate, a distance or a point on its drive."""
    D, name = layout.dimension, drive.name
    s = affine.of_block(layout.of_prescribed[name], D)
    x = np.eye(D)[0]
    if drive.kind == 'angle':
        X, Y, d = angle_axes(layout.mechanism.coordinate[drive.of[0]], layout)
        w, rows = turned(name, X, Y, layout)
        yield from rows
        yield product(name, w, d)
    elif drive.kind == 'length':
        coordinate = layout.mechanism.coordinate[drive.of[0]]
        yield plus(name, length_row(coordinate.joint, layout), linear(name, -x, s))
    elif drive.kind == 'distance':
        first, last = (affine.of_block(layout.of_point[point], D) for point in drive.of)
        gap, length = last - first, s.times(np.outer(x, x))
        squares = product(name, gap, gap), scaled(-1.0, product(name, length, length))
        yield scaled(0.5, plus(name, *squares))
    else:
        gap = affine.of_block(layout.of_point[drive.of[0]], D) - s
        for axis, along, motion in zip('xyz', np.eye(D), drive.motion, strict=False):
            if motion is not None:
                yield linear(f'{name}_{axis}', along, gap)


def motion_names(mechanism: Mechanism) -> tuple[str, ...]:
    """One for each function of time: the name of the drive, of a point with its axis."""
    names = []
    for drive in mechanism.drives:
        axes = [f'_{axis}' for axis in 'xyz'] if drive.kind == 'point' else ['']
        moving = zip(axes, drive.motion, strict=False)
        names += [drive.name + axis for axis, motion in moving if motion is not None]
    return tuple(names)


def effort(drive: Drive, s: Floats, pull: Floats) -> Floats:
    """Effort of a drive along its coordinate (1,), N m or N, or on its point (D,), N.

    s (D,): its block; pull (D,): Φ_q,sᵀ λ there. Its power is the effort times the speed, because
    Φ_q q̇ = -Φ_q,s ṡ.
    """
    if drive.kind == 'angle':
        return np.array([s[0] * pull[1] - s[1] * pull[0]])
    return pull if drive.kind == 'point' else pull[:1]


def offset(drive: Drive, layout: Layout, q: Floats) -> float:
    """Distance of a driven coordinate or point from its drive: rad, or m.

    q (blocks D, m): positions, including the drive's own block.
    """
    places = q.reshape(-1, layout.dimension)
    s = places[layout.of_prescribed[drive.name]]
    if drive.kind == 'angle':
        X, Y, d = (
            axis.value(places)
            for axis in angle_axes(layout.mechanism.coordinate[drive.of[0]], layout)
        )
        along, across = s[0] * X + s[1] * Y, s[0] * Y - s[1] * X
        return abs(float(np.arctan2(across @ d, along @ d)))
    if drive.kind == 'length':
        coordinate = layout.mechanism.coordinate[drive.of[0]]
        return abs(value(length_row(coordinate.joint, layout), places) - float(s[0]))
    points = [places[layout.of_point[point]] for point in drive.of]
    if drive.kind == 'distance':
        return abs(float(np.linalg.norm(points[1] - points[0]) - s[0]))
    driven = [motion is not None for motion in drive.motion]
    return float(np.linalg.norm((points[0] - s)[driven]))


def is_aligned(drive: Drive, layout: Layout, q: Floats) -> bool:
    """Whether an angle is where its drive has it, not half a turn away: the rows allow both.

    q (blocks D, m), closed.
    """
    if drive.kind != 'angle':
        return True
    places = q.reshape(-1, layout.dimension)
    X, Y, d = angle_axes(layout.mechanism.coordinate[drive.of[0]], layout)
    c, s = places[layout.of_prescribed[drive.name]][:2]
    return bool((c * X.value(places) + s * Y.value(places)) @ d.value(places) > 0.0)
