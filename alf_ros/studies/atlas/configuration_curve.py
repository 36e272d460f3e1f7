"""Curves of positions, followed by arc length in the space of all coordinates.

The positions of a mechanism with one freedom form curves. A step goes along the tangent t, the
null vector of Φ_q, and is projected onto Φ = 0. t is continuous, whichever coordinate turns back:
only a singular position of the mechanism itself ends a piece of a curve.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.inspection.position_sweep import approached, bottom
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.model.singular_location import located

_TURNED = 0.97  # least product of the tangents before and after a step
_SHORTEST = 1.0 / 512.0  # of the longest step
_SUSPECT = 0.3  # singular value, of its usual one, below which a dip is looked at
_SINGULAR = 1e-5  # and below which its bottom is singular
_ARRIVED = 0.9  # least product of two directions that are one
MOST = 4000  # positions of a piece


@dataclass(frozen=True, eq=False)
class CurveSpace:
    """The space in which curves are followed.

    `model`, of one freedom; `known`: the same with its ordinary σ, without prescribed motions;
    rank: of Φ_q at ordinary positions; weakest: the rank-th singular value at an ordinary
    position; longest: the longest step, m.
    """

    model: Model
    known: Model
    rank: int
    weakest: float
    longest: float

    def at(self, q: Floats) -> Linearised:
        """The position q (blocks D, m)."""
        return Linearised(self.model, q)

    def sigma(self, at: Linearised) -> float:
        """Distance to a singular position of the mechanism, over its ordinary one."""
        return float(at.singular_values[self.rank - 1]) / self.weakest if self.rank else 1.0


@dataclass(eq=False)
class Piece:
    """A piece of a curve: positions in their order, and how it ends.

    q (positions, blocks D, m); tangents (positions, n), of length 1; sigma (positions,); ends: the
    node where it begins and where it ends (its number, or -1); closed: whether it returns to its
    first position; complete: whether it was followed to an end; singular: whether every position
    on it is singular.
    """

    q: list[Floats] = field(default_factory=list)
    tangents: list[Floats] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)
    ends: tuple[int, int] = (-1, -1)
    closed: bool = False
    complete: bool = True
    singular: bool = False

    def add(self, q: Floats, tangent: Floats, sigma: float) -> None:
        """Append a position."""
        self.q.append(q)
        self.tangents.append(tangent)
        self.sigma.append(sigma)

    def reversed(self) -> Piece:
        """The same from its last position to its first."""
        backwards = [-t for t in self.tangents[::-1]]
        return Piece(
            self.q[::-1], backwards, self.sigma[::-1], self.ends[::-1], self.closed, self.complete
        )


@dataclass(frozen=True, eq=False)
class FollowedCurve:
    """The result of `followed`: a piece, and the singular position where it ends, if it does."""

    piece: Piece
    node: Floats | None = None


def tangent_at(space: CurveSpace, at: Linearised, along: Floats) -> Floats:
    """The unit tangent (n,) at a position, in the sense of `along` (n,). On a curve where every
    position is singular: the free direction nearest to it."""
    free = at.free if at.rank == space.rank else at.free[:, -1:]
    t = free @ (free.T @ along)
    size = float(np.linalg.norm(t))
    return t / size if size > 0.0 else np.asarray(free[:, -1])


def followed(space: CurveSpace, q: Floats, direction: Floats, from_node: bool) -> FollowedCurve:
    """Follow a curve from q (blocks D, m) along a direction (n,) to a singular position, back to
    q, or to `MOST` positions."""
    n, usual, piece = space.model.n, space.rank, Piece()
    at, t, h = space.at(q), direction / np.linalg.norm(direction), space.longest
    first, start = t, q[:n]
    piece.add(q, t, 0.0 if from_node else space.sigma(at))
    if from_node:
        space = _beside(space, at, t)
        piece.singular = space.rank < usual
    while len(piece.q) < MOST:
        step = _step(space, at, t, h, from_node and len(piece.q) == 1)
        if step is None:
            piece.complete = False
            return FollowedCurve(piece)
        ahead, onward, h = step
        piece.add(ahead.q, onward, space.sigma(ahead))
        node = _passed(space, piece)
        if node is not None:
            return FollowedCurve(_cut(piece, node, n), node)
        gone, away = ahead.q[:n] - at.q[:n], ahead.q[:n] - start
        near = np.linalg.norm(away) <= 1.01 * np.linalg.norm(gone)
        if len(piece.q) > 3 and near and away @ first >= 0.0 and onward @ first > 0.0:
            if not from_node:
                piece.q[-1], piece.tangents[-1], piece.sigma[-1] = q, first, piece.sigma[0]
                piece.closed = True
                return FollowedCurve(piece)
        at, t, h = ahead, onward, min(2.0 * h, space.longest)
    piece.complete = False
    return FollowedCurve(piece)


def _beside(space: CurveSpace, at: Linearised, t: Floats) -> CurveSpace:
    """The space for a curve that leaves a singular position along t (n,): with a lower rank, where
    a loop stays singular all along it."""
    for h in (0.5, 0.25, 0.1):
        for rank in range(at.rank, space.rank):
            ahead = at.closed(h * space.longest * t, rank)
            if ahead is not None and ahead.rank < space.rank:
                weakest = float(ahead.singular_values[ahead.rank - 1]) / h
                return replace(space, rank=ahead.rank, weakest=weakest)
            if ahead is not None:
                return space
    return space


def _step(
    space: CurveSpace, at: Linearised, t: Floats, h: float, leaves: bool
) -> tuple[Linearised, Floats, float] | None:
    """The next position, its tangent, and the step that it took; None if there is none."""
    n = space.model.n
    while h >= _SHORTEST * space.longest:
        ahead = at.closed(h * t, space.rank)
        if ahead is not None:
            gone = ahead.q[:n] - at.q[:n]
            size = float(np.linalg.norm(gone))
            if size > 0.0:
                onward = tangent_at(space, ahead, gone)
                straight = gone @ t > _TURNED * size
                # where a step ends beside a singular position its tangent may be any
                smooth = onward @ t > _TURNED or space.sigma(ahead) < 1e-3
                if straight and (smooth or leaves) and 0.5 * h < size < 2.0 * h:
                    return ahead, (onward if onward @ t > _TURNED else t), h
        h *= 0.5
    return None


def _passed(space: CurveSpace, piece: Piece) -> Floats | None:
    """The singular position (blocks D, m) beside the last but one position, if there is one."""
    if len(piece.q) < 3:
        return None
    before, middle, now = piece.sigma[-3:]
    if middle > min(before, now) or middle > _SUSPECT:
        return None
    found = bottom(space.at(piece.q[-3]), space.at(piece.q[-1]), space.rank)
    if found is None or space.sigma(found) > _SINGULAR:
        return None
    back = space.at(piece.q[-3])
    near = approached(back, piece.tangents[-3], space.rank, 0.02 * space.longest, space.weakest)
    return located(space.known, found.q if near is None else near.q)


def _cut(piece: Piece, node: Floats, n: int) -> Piece:
    """The piece up to a node that it has passed."""
    for _ in range(2):
        gone = node[:n] - piece.q[-1][:n]
        if gone @ piece.tangents[-1] <= 0.0 or not gone.any():
            piece.q.pop(), piece.tangents.pop(), piece.sigma.pop()
    last = node[:n] - piece.q[-1][:n]
    size = float(np.linalg.norm(last))
    piece.add(node, last / size if size else piece.tangents[-1], 0.0)
    return piece
