"""The outline of a plate through points: their convex hull in the plane they lie in."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats


def outline(corners: Floats) -> Floats:
    """(k, D) the convex hull of points in a plane, in order; two ends of points in a line.

    Of points that fill space, the hull as seen along the direction of their least extent.
    """
    middle = corners.mean(axis=0)
    _, spread, axes = np.linalg.svd(corners - middle, full_matrices=False)
    flat = (corners - middle) @ axes[:2].T
    if corners.shape[0] == 1 or spread[0] == 0.0:
        return corners[:1]
    if corners.shape[0] == 2 or spread[1] < 1e-6 * spread[0]:
        return corners[[int(np.argmin(flat[:, 0])), int(np.argmax(flat[:, 0]))]]
    order = sorted(range(len(flat)), key=lambda n: tuple(flat[n]))
    sides: list[list[int]] = []
    for turn in (order, order[::-1]):  # Andrew's monotone chain
        side: list[int] = []
        for n in turn:
            while len(side) > 1 and _cross(flat[side[-2]], flat[side[-1]], flat[n]) <= 0.0:
                side.pop()
            side.append(n)
        sides.append(side[:-1])
    return corners[sides[0] + sides[1]]


def _cross(a: Floats, b: Floats, c: Floats) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
