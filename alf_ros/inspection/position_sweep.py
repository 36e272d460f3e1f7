"""A walk through the positions of a mechanism, along its free directions, to find singular ones.

Drives and forces are absent: each step continues in the direction of the last one, as far as the
constraints leave it free, and is projected onto Φ = 0. With one freedom the walk returns to its
start, unless the mechanism moves without end; with several it is a sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.dense_linearisation import DEPENDENT, Linearised
from alf_ros.model.golden_section import lowest

_STEP = 0.03  # of the shortest bar
_MOST, _SAMPLE = 1200, 480  # positions: of one way, of several together
_LABOUR = 3e8  # n³ times positions, of all ways
_BOTTOM = 40  # positions for finding the minimum of a dip
_LEAST = 20  # positions: with fewer there is no walk
_SUSPECT = 0.3  # singular value, of its usual one, below which a dip is looked at
_APPROACHES, _CLOSE = 60, 1e-7  # steps up to a singular position, and the value at their end
_STRAIGHT = 0.97  # least product of the directions of two of them
_SINGULAR = 1e-5  # and below which its bottom counts as singular


@dataclass
class Sweep:
    """Where the walk went: positions (blocks D,), the singular ones, whether it came round."""

    positions: list[Floats] = field(default_factory=list)
    singular: list[Floats] = field(default_factory=list)
    whole: bool = False
    left: float = 0.0  # positions that may still be looked at


def sweep(start: Linearised, beside: Linearised | None = None) -> Sweep:
    """Walk from an ordinary position along each free direction, forth and back. `beside`: the
    singular position that it was taken near."""
    found = Sweep([start.q], left=_LABOUR / start.model.n**3)
    if beside is not None:
        found.singular.append(beside.q)
    freedoms = start.free.shape[1]
    if not freedoms:
        return found
    most = int(min(_MOST, found.left))
    if freedoms > 1:
        most = min(most, _SAMPLE) // (2 * freedoms)
    if most < _LEAST:
        return found
    for direction in start.free.T:
        for sense in (1.0, -1.0):
            if not found.whole:
                _walk(start, sense * direction, most, found)
    return found


def _walk(start: Linearised, direction: Floats, most: int, found: Sweep) -> None:
    """One walk. `found` is added to."""
    model, rank = start.model, start.rank
    D = model.layout.dimension
    step = _STEP * shortest(start)
    usual = start.singular_values[rank - 1] if rank else 1.0
    at, before, back = start, math.inf, start  # back: the position before
    weak = usual
    for count in range(most):
        direction = direction / np.linalg.norm(direction.reshape(-1, D), axis=1).max()
        ahead = at.closed(step * direction, rank)
        found.left -= 1
        if ahead is None or found.left < 0:
            return
        value = float(ahead.singular_values[rank - 1]) if rank else 1.0
        usual = max(usual, value)  # the start may be near a singular position
        if weak <= min(before, value) and weak < _SUSPECT * usual:
            found.left -= _BOTTOM
            lowest = bottom(back, ahead, rank)
            if lowest is not None and lowest.singular_values[rank - 1] < _SINGULAR * usual:
                gone = at.q[: model.n] - back.q[: model.n]
                t = gone / (float(np.linalg.norm(gone)) or 1.0)
                near = approached(back, t, rank, 0.02 * step, usual) or lowest
                same = 1e-3 * model.size
                if all(np.abs(near.q - other).max() > same for other in found.singular):
                    found.singular.append(near.q)
        gone = ahead.q[: model.n] - at.q[: model.n]
        back, before, at, weak = at, weak, ahead, value
        found.positions.append(at.q)
        home = at.q[: model.n] - start.q[: model.n]
        alone = start.free.shape[1] == 1
        if alone and count > 2 and np.abs(home).max() <= 1.01 * step and home @ gone > -1e-9:
            found.whole = True
            return
        free = at.free if at.rank == rank else np.eye(model.n)
        onward = free @ (free.T @ gone)
        # beside a singular position the tangent may turn away in no time: go straight through
        straight = np.linalg.norm(onward) > 0.5 * np.linalg.norm(gone)
        direction = onward if straight else gone


def bottom(back: Linearised, ahead: Linearised, rank: int) -> Linearised | None:
    """The position between two at which the rank-th singular value is least."""
    n = back.model.n
    span = ahead.q[:n] - back.q[:n]
    tried: dict[float, Linearised | None] = {}

    def height(s: float) -> float:
        at = tried[s] = back.closed(s * span, rank)
        return math.inf if at is None else float(at.singular_values[rank - 1])

    return tried[lowest(height, 0.0, 1.0, 0.1 * DEPENDENT)]


def approached(at: Linearised, t: Floats, rank: int, h: float, usual: float) -> Linearised | None:
    """The position just before a singular one ahead, by the secant of its singular value; None if
    that does not fall to zero on the way.

    Behind it the mechanism may have more freedoms: then there is no single minimum. t (n,): the
    tangent, of length 1; h (m): first step; usual: the singular value at ordinary positions.
    """
    n = at.model.n
    for _ in range(_APPROACHES):
        value = float(at.singular_values[rank - 1])
        if value < _CLOSE * usual:
            return at
        ahead = at.closed(h * t, rank)
        if ahead is None or not 0.0 < ahead.singular_values[rank - 1] < value:
            h *= 0.25
            continue
        gone = ahead.q[:n] - at.q[:n]
        size = float(np.linalg.norm(gone))
        if gone @ t < _STRAIGHT * size:
            return None
        left = float(ahead.singular_values[rank - 1])
        at, t, h = ahead, gone / size, 0.7 * left * size / (value - left)
    return None


def shortest(at: Linearised) -> float:
    """Length of the shortest body, m; of the drawing if none has a length."""
    spans = [np.linalg.norm(body.local[1]) for body in at.model.mechanism.bodies if body.local[1:]]
    return float(min(spans, default=at.model.size))
