"""Along a path of equilibria by pseudo-arclength: Keller 1977; Allgower & Georg 1990, ch. 6.

A step goes along the tangent, then by Newton's method back to the path in the plane across the
tangent. The number of the scene is an unknown as the displacements are, so that the path may turn
back in it. Steps are so short that the direction changes by less than a sixth of a right angle,
and that nothing moves by more than a seventh of a typical length. A step that would end in a
singular position of the mechanism is taken with another length. Past a kink over the number, as in
a table over time, the path may turn by more than a right angle, where no plane across the tangent
meets it: there a step goes by the number alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from alf_ros.errors import InputError
from alf_ros.model.handedness import Handedness
from alf_ros.studies.statics.path_point import PathDirection, PathPoint

_FIRST, _LONGEST, _SHORTEST = 0.01, 0.1, 1e-9
_SHARPEST = 1e-4  # step from which down a bend is a kink
_BENDS, _STRAIGHT = 0.967, 0.992  # cosine between two directions
_FARTHEST = 0.15  # of a typical length, that a point moves in a step
_STRAY = 0.5  # of a step, that Newton's method may move
_LEAP = 10.0  # of a step past a kink, that Newton's method may move
_LEVEL = 1e-3  # of a direction, from which up it leads along the number
_ITERATIONS = 20
_AT_REST, _RESTS = 1e-14, 1e-9  # of the acceleration without rows


class LostPathError(InputError):
    """Newton's method does not come back to the path."""


@dataclass(frozen=True, eq=False)
class PathStep:
    """From one point of the path to the next: both, with the directions of the path there."""

    before: PathPoint
    after: PathPoint
    leaving: PathDirection
    arriving: PathDirection


def corrected(
    before: PathPoint,
    direction: PathDirection,
    step: float,
    strays: float = _STRAY,
    value: float | None = None,
) -> PathPoint:
    """The point of the path in the plane a step along a direction (of length 1) from a point.

    strays: how far from the predicted point, in steps. value: of the number, if the plane holds
    it. Raises LostPathError if there is none, InputError where the scene is refused or cannot be
    closed.
    """
    scales = before.scales
    here = guess = before.beside(direction.times(step), value=value)
    best, idle = here, 0
    for _ in range(_ITERATIONS):
        if here.freedoms != before.freedoms:
            raise LostPathError('a singular position of the mechanism')
        rests = best.left <= _RESTS * max(best.scale, before.scale)
        if here.left <= _AT_REST * here.scale or (idle > 1 and rests):
            break
        if idle > 3:
            raise LostPathError('no position of rest is found beside the last one')
        offset = step - scales.product(direction, here.since(before))
        move = here.step(direction, offset)
        here = here.beside(move, value, follows=True)
        if scales.size(here.since(guess)) > strays * abs(step) + 1e-6:
            raise LostPathError('no position of rest is found beside the last one')
        idle = 0 if here.left < 0.5 * best.left else idle + 1
        best = here if here.left <= best.left else best
    if best.left > _RESTS * max(best.scale, before.scale):
        raise LostPathError('no position of rest is found beside the last one')
    fault = Handedness(best.instant.model).fault(best.instant.q)
    if fault:
        raise LostPathError(f'after a shorter step too {fault}')
    return best.settled()


def steps(
    start: PathPoint, direction: PathDirection, ends: Callable[[float], float | None]
) -> Iterator[PathStep]:
    """Steps along the path from a point. `ends`: the value at which the path ends, if a value is
    past it. Raises InputError where the path cannot be continued."""
    length, here = _FIRST, start
    reach = _FARTHEST * start.instant.loads.tangents.length
    while True:
        far = float(np.abs(direction.q).max(initial=0.0))
        length = min(length, _LONGEST, reach / far if far > 0.0 else np.inf)
        try:
            there = corrected(here, direction, length)
            arriving = there.tangent(direction)
        except InputError:
            last = ends(here.value + length * direction.value)
            if last is not None and length < _SHARPEST:  # no scene is beyond the end
                there = _there(here, last)
                yield PathStep(here, there, direction, there.tangent(direction))
                return
            past = _past_kink(here, direction, ends) if length < _SHARPEST else None
            if past is not None:
                yield past
                if ends(past.after.value) is not None:
                    return
                here, direction, length = past.after, past.arriving, _FIRST
                continue
            if length < _SHORTEST:
                raise
            length *= 0.5 if length > 1e-3 else 0.3
            continue
        bend = there.scales.product(direction, arriving)
        if bend < _BENDS and length > _SHARPEST:
            length *= 0.5
            continue
        if there.are_zero.sum() != here.are_zero.sum() and here is not start:
            length *= 0.8  # an event lies between two points, not at one
            if length > _SHORTEST:
                continue
        last = ends(there.value)
        if last is not None:
            there = _at(here, there, direction, last)
            yield PathStep(here, there, direction, there.tangent(direction))
            return
        yield PathStep(here, there, direction, arriving)
        here, direction = there, arriving
        length *= 1.6 if bend > _STRAIGHT else 1.0


def _past_kink(
    here: PathPoint, direction: PathDirection, ends: Callable[[float], float | None]
) -> PathStep | None:
    """A short step by the number alone; None if it leads nowhere there."""
    scale = here.scales.value
    if abs(direction.value) < _LEVEL * scale:
        return None
    along = PathDirection(np.zeros_like(direction.q), float(np.copysign(scale, direction.value)))
    try:
        there = corrected(here, along, _FIRST, _LEAP)
        last = ends(there.value)
        there = there if last is None else _there(here, last)
        return PathStep(here, there, direction, there.tangent(along))
    except InputError:
        return None


def _at(before: PathPoint, after: PathPoint, direction: PathDirection, value: float) -> PathPoint:
    """The point between two where the number has this value."""
    part = (value - before.value) / (after.value - before.value)
    length = before.scales.product(direction, after.since(before))
    near = corrected(before, direction, part * length) if part > 1e-9 else before
    return _there(near, value)


def _there(near: PathPoint, value: float) -> PathPoint:
    """The point beside another one where the number has this value."""
    along = PathDirection(np.zeros(near.instant.model.n), near.scales.value)
    return corrected(near, along, (value - near.value) / near.scales.value, np.inf, value)
