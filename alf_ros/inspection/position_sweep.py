"""A walk through the positions of a mechanism, along its free directions, to find singular ones.

Drives and forces are absent: each step continues in the direction of the last one, as far as the
constraints leave it free, and stays on its curve (`sure_step`). With one freedom the walk returns
to its start, unless the mechanism moves without end; with several it is a sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.model.sure_step import BESIDE, SINGULAR, sure_step

_STEP = 0.03  # of the shortest bar
_MOST, _SAMPLE = 1200, 480  # steps of this length: of one way, of several together
_SHORT = 4  # times as many positions: steps are shorter near singular positions
_LABOUR = 3e8  # n³ times positions, of all ways
_LEAST = 20  # steps: with fewer there is no walk
_SAME = 1e-3  # of the size: two singular positions that are one


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
    n, rank, D = start.model.n, start.rank, start.model.layout.dimension
    usual = start.singular_values[rank - 1] if rank else 1.0
    step = _STEP * shortest(start)
    at, last, left = start, start, float(most)  # last: the last position that is not beside one
    for count in range(_SHORT * most):
        t = direction / np.linalg.norm(direction)
        longest = step / np.linalg.norm(t.reshape(-1, D), axis=1).max()
        crosses = at is not last and _is_below(SINGULAR, at, rank, usual)
        if crosses:
            if all(np.abs(at.q - q).max() > _SAME * start.model.size for q in found.singular):
                found.singular.append(at.q)
            # straight on, as far behind as it was before: the tangent is of no use here
            ahead = at.closed(at.q[:n] - last.q[:n], rank)
        else:
            ahead = sure_step(at, t, longest, rank)
        found.left -= 1
        if ahead is None or found.left < 0:
            return
        gone = ahead.q[:n] - at.q[:n]
        if crosses or not _is_below(BESIDE, ahead, rank, usual):
            last = ahead
        at = ahead
        if rank:
            # the start may be near a singular position
            usual = max(usual, float(at.singular_values[rank - 1]))
        found.positions.append(at.q)
        home = at.q[:n] - start.q[:n]
        far = np.linalg.norm(gone)
        alone = n - rank == 1
        near = np.linalg.norm(home) <= 1.01 * far and home @ gone > -1e-9 * far**2
        if alone and count > 2 and near:
            found.whole = True
            return
        left -= far / longest
        if left < 0.0:
            return
        free = at.free if at.rank == rank else np.eye(n)
        direction = free @ (free.T @ gone)


def _is_below(part: float, at: Linearised, rank: int, usual: float) -> bool:
    """Whether the rank-th singular value is below a part of its usual one."""
    return bool(rank) and (at.rank < rank or at.singular_values[rank - 1] < part * usual)


def shortest(at: Linearised) -> float:
    """Length of the shortest body, m; of the drawing if none has a length."""
    spans = [np.linalg.norm(body.local[1]) for body in at.model.mechanism.bodies if body.local[1:]]
    return float(min(spans, default=at.model.size))
