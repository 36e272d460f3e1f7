"""Where the stops of a scene end the travel of an active joint."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from alf_ros.arrays import Floats, Integers
from alf_ros.scene.scene import Scene

Node = TypeVar('Node')
_TOUCHED = 1e-9  # rad or m beyond a stop, up to which a joint rests at it
_EXACT = 1e-13  # rad or m, of the place where a joint reaches its stop
_THREE = 3  # places in a row, between which a joint may reach a stop and come back
_NEAR = 0.1  # of the bend: the parabola through three places is off by less
_FOUND = 1e-6  # of the way between them: where the room is least


@dataclass(frozen=True, eq=False)
class Stops:
    """which (stops,): numbers of joint coordinates; lower, upper (stops,): rad, m or infinite."""

    which: Integers
    lower: Floats
    upper: Floats

    def __bool__(self) -> bool:
        return bool(self.which.size)

    def room(self, values: Floats) -> float:
        """The least distance of joint coordinates (rad or m) to their stops, negative beyond."""
        at = values[self.which]
        return float(np.minimum(at - self.lower, self.upper - at).min())

    def holds(self, values: Floats, is_angle: Sequence[bool]) -> bool:
        """Whether joint coordinates (rad or m) are within their stops; angles after some turns."""
        for n, lower, upper in zip(self.which, self.lower, self.upper, strict=True):
            at, turn = float(values[n]), 2.0 * math.pi
            if is_angle[n] and math.isfinite(lower):
                at += turn * math.ceil((lower - _TOUCHED - at) / turn)  # the first behind `lower`
            elif is_angle[n] and math.isfinite(upper):
                at -= turn * math.ceil((at - upper - _TOUCHED) / turn)
            if at < lower - _TOUCHED or at > upper + _TOUCHED:
                return False
        return True


def stopped(scene: Scene) -> str:
    """The joint coordinates of a scene that have stops, in words; '' without any."""
    return ', '.join(each.parameters.joint for each in scene.effects if each.kind == 'joint_stop')


def stops_of(scene: Scene, names: Sequence[str]) -> Stops:
    """The stops of a scene, for joint coordinates with these names."""
    found = [each.parameters for each in scene.effects if each.kind == 'joint_stop']
    return Stops(
        np.array([names.index(p.joint) for p in found], dtype=np.int64),
        np.array([-math.inf if p.lower is None else p.lower for p in found]),
        np.array([math.inf if p.upper is None else p.upper for p in found]),
    )


@dataclass(frozen=True)
class _Place(Generic[Node]):
    x: float
    node: Node
    room: float


@dataclass(frozen=True)
class StoppedTravel(Generic[Node]):
    """The way of an active joint coordinate x to the first stop that a joint reaches.

    move(posture, x): the posture and all joint coordinates at x, from a posture beside it on the
    same branch; None beyond the end of the travel.
    """

    stops: Stops
    move: Callable[[Node, float], tuple[Node, Floats] | None]

    def end(self, x: float, posture: Node, values: Floats, steps: Iterable[float]) -> float | None:
        """The x at which a joint reaches a stop, from a posture on; None if none does along the
        equally spaced `steps`. Beyond a stop already: where it is."""
        seen = [_Place(x, posture, self.stops.room(values))]
        if seen[0].room < -_TOUCHED:
            return x
        for ahead in steps:
            moved = self.move(seen[-1].node, ahead)
            if moved is None:
                return None
            seen = [*seen[-2:], _Place(ahead, moved[0], self.stops.room(moved[1]))]
            if seen[-1].room < 0.0:
                return self._crossing(seen[-2], seen[-1].x)
            lowest = self._lowest(seen) if len(seen) == _THREE else None
            if lowest is not None:
                return self._crossing(seen[0], lowest)
        return None

    def _room(self, node: Node, x: float) -> float:
        moved = self.move(node, x)
        return -math.inf if moved is None else self.stops.room(moved[1])

    def _lowest(self, seen: Sequence[_Place[Node]]) -> float | None:
        """Where a joint is beyond a stop between three places at which none is, if it is."""
        first, middle, last = seen
        bend = first.room - 2.0 * middle.room + last.room
        if middle.room > min(first.room, last.room) or bend <= 0.0:
            return None
        if middle.room - (first.room - last.room) ** 2 / (8.0 * bend) > _NEAR * bend:
            return None  # the parabola stays clear of the stop
        found = minimize_scalar(
            lambda x: self._room(first.node, x),
            bounds=sorted((first.x, last.x)),
            method='bounded',
            options={'xatol': _FOUND * abs(last.x - first.x)},
        )
        return float(found.x) if found.fun < 0.0 else None

    def _crossing(self, clear: _Place[Node], beyond: float) -> float:
        if clear.room <= 0.0:
            return clear.x
        low, high = sorted((clear.x, beyond))
        return float(brentq(lambda x: self._room(clear.node, x), low, high, xtol=_EXACT))
