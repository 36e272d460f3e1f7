"""Blocks that belong to no body: of rotors, and such without mass that help rows to stay
quadratic: directions turned over time, and where a disk that leans touches its plane.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.joint_coordinates import angle_axes
from alf_ros.model.constraints.row import Row, linear, plus, product
from alf_ros.model.joints import type_of


def turned(name: str, X: Form, Y: Form, layout: Layout) -> tuple[Form, list[Row]]:
    """-sin(f) X + cos(f) Y with the angle f(t) of a name, and the rows that make it so.

    Where X and Y do not move it is linear in s = (cos f, sin f). Else it has a block of its own,
    without mass, for rows are of second order at most.
    """
    D = layout.dimension
    s = affine.of_block(layout.of_prescribed[name], D).times(1.0 / layout.length)
    if not X.parts and not Y.parts:
        turn = np.zeros((D, D))
        turn[:, 0], turn[:, 1] = Y.constant, -X.constant
        return s.times(turn), []
    w = affine.of_block(layout.of_auxiliary[name], D).times(1.0 / layout.length)
    rows = []
    for axis, e in zip('xyz', np.eye(D), strict=False):
        first, second = np.zeros((D, D)), np.zeros((D, D))
        first[0], second[1] = -e, e
        less = product('', Y.times(first) + X.times(second), s)
        rows.append(plus(f'{name}_turned_{axis}', linear('', e, w), less))
    return w, rows


def place(name: str, layout: Layout, q: Floats) -> Floats:
    """Where an auxiliary block is, at q (blocks D, m), as its rows will have it."""
    places = q.reshape(-1, layout.dimension)
    joints = {joint.name: joint for joint in layout.mechanism.joints}
    owner, dot, what = name.rpartition('.') if '.' in name else (name, '', '')
    if what == 'rotor':
        return np.zeros(layout.dimension)  # only its velocity counts
    if owner in joints:
        block = type_of(joints[owner]).block
        assert block is not None
        return block(joints[owner], dot + what, layout, places)
    drive = next(drive for drive in layout.mechanism.drives if drive.name == name)
    X, Y, _ = angle_axes(layout.mechanism.coordinate[drive.of[0]], layout)
    c, s = places[layout.of_prescribed[name]][:2]
    return np.asarray(c * Y.value(places) - s * X.value(places))
