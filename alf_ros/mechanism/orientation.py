"""Orientation of a body in space from the natural coordinates."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism.natural_coordinates import Layout


def orientation(layout: Layout, body: str, places: Floats) -> Floats:
    """(4,) quaternion x, y, z, w of the body frame, w >= 0; `places` (blocks, 3).

    A rod is turned the shortest way from the x axis of the world, a point not at all.
    """
    shape, blocks = layout.shape(body), layout.of_body[body]
    if layout.turns(body):
        columns = []
        for axis in np.eye(3):
            f = layout.direction(body, tuple(axis))
            columns.append(sum(C @ places[block] for block, C in f.parts.items()))
        return quaternion(np.array(columns).T)
    if not shape.ends:
        return np.array([0.0, 0.0, 0.0, 1.0])
    d = places[blocks[shape.ends[0]]] - (places[blocks[0]] if shape.is_point[0] else 0.0)
    d = d / np.linalg.norm(d)
    if d[0] < -0.999999:
        return np.array([0.0, 0.0, 1.0, 0.0])
    turn = np.array([0.0, -d[2], d[1], 1.0 + d[0]])
    return turn / np.linalg.norm(turn)


def quaternion(R: Floats) -> Floats:
    """Of a rotation matrix (3, 3), by its largest component (Shepperd 1978)."""
    squares = np.array([*np.diag(R), np.trace(R)])
    k = int(np.argmax(squares))
    if k == 3:
        skew = R - R.T
        turn = np.array([skew[2, 1], skew[0, 2], skew[1, 0], 1.0 + squares[3]])
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = np.zeros(4)
        turn[k] = 1.0 + 2.0 * R[k, k] - squares[3]
        turn[i], turn[j] = R[i, k] + R[k, i], R[j, k] + R[k, j]
        turn[3] = R[j, i] - R[i, j]
    turn = turn / np.linalg.norm(turn)
    return -turn if turn[3] < 0.0 else turn
