"""Newton's method for the loads at which friction and reactions agree, N = |R(N)|, R linear in N.

A balance differs from others in its sense, the sign of det(1 - d|R|/dN), and by the directions of
R: Newton's method begins with the directions that R had last.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Bearings
from alf_ros.kernel.numba_ext.block import block, dot, put
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, largest

_ITERATIONS = 60
_SHORTEST = 1e-4  # part of a step of Newton's method; and of friction, while it is increased
_ROUNDED = 1e-10  # part of the largest load to which rounding lets both sides agree
_EXACT = 1e-14  # part of it at which no further step is needed
_CLOSE = 0.2  # part of the loads by which a balance may be off without a search for others
_POWERS = 10  # of two, of the lengths at which the search begins


@inner
def balance(unit: Unit, cut: Bearings, share: float) -> int:
    """Newton's method for N = |R(N)| from `point`, with a share of friction. Returns the sense of
    the balance it ends at, 0 for none."""
    gap, size = _gap(unit, cut, share, cut.point)
    for _ in range(_ITERATIONS):
        sign = _newton(unit, cut, share, False)
        if sign == 0 or gap <= _EXACT * size:
            return sign
        part, before, better = 1.0, gap, False
        while part > _SHORTEST and not better:
            for n in range(cut.point.size):
                cut.next[n] = cut.point[n] + part * cut.change[n]
            gap, size = _gap(unit, cut, share, cut.next)
            better = gap < (1.0 - 0.1 * part) * before
            part *= 0.5
        if not better:
            return sign if before <= _ROUNDED * size else 0
        copy(cut.next, cut.point)
    return 0


@inner
def continuation(unit: Unit, cut: Bearings) -> int:
    """The balance by continuation from the one without friction, with a share of friction that
    grows from 0 to 1, into `point`.

    Returns its sense, 0 if the continuation ends before.
    """
    for n in range(cut.point.size):
        cut.point[n] = 0.0
    share, more = 0.0, 1.0
    while share < 1.0:
        copy(cut.point, cut.best)
        further = min(1.0, share + more)
        if balance(unit, cut, further) > 0:
            share, more = further, 2.0 * more
        else:
            more *= 0.5
            if more < _SHORTEST:
                return 0
            copy(cut.best, cut.point)
    return 1


@inner
def nearest_balance(unit: Unit, cut: Bearings, wanted: int) -> int:
    """The balance of the sense `wanted` (0: any) nearest to the last one, into `best`.

    Returns its sense, 0 if none is found. If the first one is not near, Newton's method begins
    at other points too, along the line on which R moves under the load that moves it most.
    """
    loads = np.int64(cut.point.size)
    copy(cut.force, cut.heading)
    near, found = _balance_from_heading(unit, cut, wanted, np.inf)
    if found != 0 and near <= _CLOSE * largest(cut.loads, cut.loads.size):
        return found
    strongest, most = 0, 0.0
    size = max(largest(cut.loads, cut.loads.size), largest(cut.reaction, cut.reaction.size))
    for m in range(loads):
        total = 0.0
        for n in range(loads):
            R = block(unit, cut.response, m * loads + n)
            total += np.sqrt(dot(R, R))
        if total > most:
            strongest, most = m, total
    if not most > 0.0:
        return found
    for k in range(-_POWERS, _POWERS + 1):
        for way in range(2):
            along = (size / most) * 2.0**k * (1.0 if way == 0 else -1.0)
            for n in range(loads):
                R = block(unit, cut.force, n)
                put(cut.heading, n, R + along * block(unit, cut.response, strongest * loads + n))
            near, other = _balance_from_heading(unit, cut, wanted, near)
            if other != 0:
                found = other
    return found


@inner
def _balance_from_heading(
    unit: Unit, cut: Bearings, wanted: int, nearest: float
) -> tuple[float, int]:
    """Newton's method from the directions in `heading`. The balance it finds goes into `best` if
    it has the sense `wanted` (0: any) and its R is nearer to the last one than `nearest` (N).

    Returns how near the best is, and the sense of a new one, else 0.
    """
    loads = np.int64(cut.point.size)
    copy(cut.loads, cut.point)
    if _newton(unit, cut, 1.0, True) != 0:
        for n in range(loads):
            cut.point[n] += cut.change[n]
    sense = balance(unit, cut, 1.0)
    if sense == 0 or (wanted != 0 and sense != wanted):
        return nearest, 0
    away = 0.0
    for n in range(loads):
        R = block(unit, cut.reaction, n) - block(unit, cut.force, n)
        for m in range(loads):
            R = R + cut.point[m] * block(unit, cut.response, m * loads + n)
        away = max(away, np.sqrt(dot(R, R)))
    if not away < nearest:
        return nearest, 0
    copy(cut.point, cut.best)
    return away, sense


@inner
def _gap(unit: Unit, cut: Bearings, share: float, at: Floats) -> tuple[float, float]:
    """The largest of | |R| - N | at the loads `at`, with a share of friction, and of N."""
    loads, gap, size = np.int64(at.size), 0.0, 0.0
    for n in range(loads):
        R = block(unit, cut.reaction, n)
        for m in range(loads):
            R = R + (share * at[m]) * block(unit, cut.response, m * loads + n)
        gap, size = max(gap, abs(np.sqrt(dot(R, R)) - at[n])), max(size, abs(at[n]))
    return gap, size


@inner
def _newton(unit: Unit, cut: Bearings, share: float, given: bool) -> int:
    """change = the step of Newton's method at `point`; returns the sign of its determinant.

    `given`: as if R had the direction of `heading`. Where gains are large, a small error of a load
    turns R round, and Newton's method would go to another balance.
    """
    loads, slope, change, sign = np.int64(cut.point.size), cut.slope, cut.change, 1
    for n in range(loads):
        R = block(unit, cut.reaction, n)
        for m in range(loads):
            R = R + (share * cut.point[m]) * block(unit, cut.response, m * loads + n)
        along = block(unit, cut.heading, n) if given else R
        N = np.sqrt(dot(along, along))
        along = (1.0 / N if N > 0.0 else 0.0) * along
        change[n] = dot(along, R) - cut.point[n]
        for m in range(loads):
            each = share * dot(along, block(unit, cut.response, m * loads + n))
            slope[n * loads + m] = (1.0 if n == m else 0.0) - each
    for k in range(loads):  # elimination with row pivots
        most = k
        for n in range(k + 1, loads):
            if abs(slope[n * loads + k]) > abs(slope[most * loads + k]):
                most = n
        pivot = slope[most * loads + k]
        if not abs(pivot) > 0.0:
            return 0
        if most != k:
            sign = -sign
            for m in range(loads):
                i, j = k * loads + m, most * loads + m
                slope[i], slope[j] = slope[j], slope[i]
            change[k], change[most] = change[most], change[k]
        sign = sign if pivot > 0.0 else -sign
        for n in range(k + 1, loads):
            part = slope[n * loads + k] / pivot
            for m in range(k + 1, loads):
                slope[n * loads + m] -= part * slope[k * loads + m]
            change[n] -= part * change[k]
    for back in range(loads):
        n = loads - 1 - back
        for m in range(n + 1, loads):
            change[n] -= slope[n * loads + m] * change[m]
        change[n] /= slope[n * loads + n]
    return sign
