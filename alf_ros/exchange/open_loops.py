"""Positions of joints at which loops close, by Newton's method from several starts.

The joints move within their limits: from the positions drawn first, then from random ones around
them. Of the postures found, the one nearest to the positions drawn holds, with joints that
the loops leave free as near to these as the loops allow.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Protocol, TypeVar

import numpy as np
from scipy.optimize import least_squares

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import Robot

_AS_DRAWN, _CLOSED = 1e-6, 1e-10  # of the size: loops that are closed as drawn, and when found
_STARTS, _ROUNDS, _POLISH = 60, 60, 6
_MORE = 2  # times as many starts as the first posture took, to find nearer ones
_FREE = 1e-8  # of the largest singular value: gaps do not change in such a direction
_ARRIVED, _SHORTEST = 1e-12, 1e-4  # rad, or of the size; part of the way to where joints are drawn
_SPREAD = 0.3  # rad, or of the size: standard deviation of the first random start

LoopT = TypeVar('LoopT')
Unknown = TypeVar('Unknown', bound=Hashable)


class OpenLoops(Protocol):
    """Loops that share joints, as a function of (n,) unknown positions, rad or m.

    size: m, of the robot. drawn: (n,) where the joints are drawn. loops: their names.
    """

    size: float
    drawn: Floats
    loops: str

    def limits(self) -> tuple[Floats, Floats]:
        """Lower and upper limit of each unknown, infinite where there is none."""

    def scales(self) -> Floats:
        """1 rad, or the size of the robot, of each unknown."""

    def gaps(self, x: Floats) -> tuple[Floats, Floats]:
        """By how much the loops are open (rows,), m, and the derivative (rows, n)."""


def groups(
    loops: Iterable[tuple[LoopT, set[Unknown]]],
) -> list[tuple[list[LoopT], set[Unknown]]]:
    """Loops that share unknowns, together."""
    found: list[tuple[list[LoopT], set[Unknown]]] = []
    for loop, unknowns in loops:
        together = [group for group in found if group[1] & unknowns]
        found = [group for group in found if not group[1] & unknowns]
        joined = [each for group in together for each in group[0]]
        found.append(([*joined, loop], unknowns.union(*(group[1] for group in together))))
    return found


def closed(posture: OpenLoops, robot: Robot) -> Floats | None:
    """(n,) where the loops are closed; None if they are closed as drawn.

    The robot's report gets the number of starts. Raises InputError if no start closes them.
    """
    drawn, size = posture.drawn, posture.size
    open_by = float(np.abs(posture.gaps(drawn)[0]).max())
    if open_by <= _AS_DRAWN * size:
        return None
    if not drawn.size:
        raise robot.error(
            'loops',
            f'{posture.loops} cannot be closed: all joints are held, and {open_by:.3g} m stay '
            'open',
            expected='a joint of the loop that can move and is not in --set, nor in `positions` '
            'of a side file',
        )
    low, high = posture.limits()
    begin = np.clip(drawn, low, high)
    scales, random = posture.scales(), np.random.default_rng(0)
    found: list[tuple[float, int, Floats]] = []
    least, starts = np.inf, 0
    while starts < _STARTS and not (found and starts > _MORE * found[0][1]):
        spread = _SPREAD * min(1.0, 0.1 * starts) * (1.0 + starts / 15.0)
        x = begin + spread * scales * random.standard_normal(begin.size)
        x, gap = _settled(posture, np.clip(x, low, high), low, high)
        least = min(least, gap)
        if gap <= _CLOSED * size:
            away = float(np.abs((x - begin) / scales).max(initial=0.0))
            found.append((away, starts, x))
        starts += 1
    if not found:
        free = np.full(drawn.size, np.inf)
        closes = _settled(posture, drawn, -free, free)[1] <= _CLOSED * size
        beyond = '; beyond the limits of the joints they close' if closes else ''
        raise robot.error(
            'loops',
            f'{posture.loops} cannot be closed: {least:.3g} m stay open, from {starts} starts'
            f'{beyond}',
            expected='other limits'
            if closes
            else 'positions near a posture, by --set JOINT=NUMBER',
        )
    count = f'{len(found)} of {starts} starts close them'
    robot.leave('posture', f'{posture.loops} ({count}; the nearest posture is taken)')
    _, _, x = min(found, key=lambda each: each[:2])
    return _drawn_back(posture, x, begin, (low, high))


def _drawn_back(
    posture: OpenLoops, x: Floats, begin: Floats, limits: tuple[Floats, Floats]
) -> Floats:
    """From a closed posture towards `begin`, along what the loops leave free, as far as they stay
    closed and the way to `begin` becomes shorter."""
    scales, most = posture.scales(), _CLOSED * posture.size
    part, away = 1.0, np.linalg.norm((x - begin) / scales)
    for _ in range(_ROUNDS):
        _, size, Vt = np.linalg.svd(posture.gaps(x)[1] * scales)
        free = Vt[int((size > _FREE * size.max(initial=0.0)).sum()) :]
        back = free.T @ (free @ ((begin - x) / scales))
        if np.abs(back).max(initial=0.0) <= _ARRIVED:
            break
        y, gap = _settled(posture, np.clip(x + part * scales * back, *limits), *limits)
        left = np.linalg.norm((y - begin) / scales)
        if gap <= most and left < away:
            x, away, part = y, left, min(1.0, 2.0 * part)
        else:
            part *= 0.25
        if part < _SHORTEST:
            break
    return x


def _settled(posture: OpenLoops, x: Floats, low: Floats, high: Floats) -> tuple[Floats, float]:
    """Where Newton's method leads from x within limits, and the largest gap there, m."""
    inside = np.nextafter(low, high), np.nextafter(high, low)
    with np.errstate(all='ignore'):  # where it has arrived, scipy divides zero by zero
        solved = least_squares(
            lambda y: posture.gaps(y)[0],
            np.clip(x, *inside),
            lambda y: posture.gaps(y)[1],
            bounds=(low, high),
            x_scale=posture.scales(),
            xtol=1e-8,
            ftol=1e-8,
            gtol=None,
            max_nfev=_ROUNDS,
        )
    x = np.asarray(solved.x)
    best = float(np.abs(posture.gaps(x)[0]).max())
    for _ in range(_POLISH):
        value, slope = posture.gaps(x)
        step, *_ = np.linalg.lstsq(slope, -value, rcond=1e-10)
        y = np.clip(x + step, low, high)
        gap = float(np.abs(posture.gaps(y)[0]).max())
        if not gap < best:
            break
        x, best = y, gap
    return x, best
