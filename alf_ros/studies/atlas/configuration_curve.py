"""Curves of positions, followed by arc length in the space of all coordinates.

The positions of a mechanism with one freedom form curves. A step goes along the tangent t, the
null vector of Φ_q, and is projected onto Φ = 0. t is continuous, whichever coordinate turns back:
only a singular position of the mechanism itself ends a piece of a curve.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.model.singular_location import located
from alf_ros.model.sure_step import BESIDE, SINGULAR, sure_step

_LEAVING = 1e-3  # of the longest step: the first one from a singular position
_STRAIGHT = 0.97  # least product of its direction and that of the branch
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
    at, t = space.at(q), direction / np.linalg.norm(direction)
    first, start = t, q[:n]
    piece.add(q, t, 0.0 if from_node else space.sigma(at))
    if from_node:
        space = _beside(space, at, t)
        piece.singular = space.rank < usual
    away = not from_node
    while len(piece.q) < MOST:
        leaves = from_node and len(piece.q) == 1
        ahead = (_left if leaves else _ahead)(space, at, t)
        if ahead is None:
            break
        gone, home = ahead.q[:n] - at.q[:n], ahead.q[:n] - start
        onward, sigma = tangent_at(space, ahead, gone), space.sigma(ahead)
        piece.add(ahead.q, onward, sigma)
        away = away or sigma > BESIDE
        if away and (sigma < SINGULAR or ahead.rank < space.rank):
            node = located(space.known, ahead.q)
            _end(piece, node, n)
            return FollowedCurve(piece, node)
        near = np.linalg.norm(home) <= 1.01 * np.linalg.norm(gone)
        if not from_node and len(piece.q) > 3 and near and home @ first >= 0.0 < onward @ first:
            piece.q[-1], piece.tangents[-1], piece.sigma[-1] = q, first, piece.sigma[0]
            piece.closed = True
            return FollowedCurve(piece)
        at, t = ahead, onward
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


def _ahead(space: CurveSpace, at: Linearised, t: Floats) -> Linearised | None:
    """The next position along a tangent t (n,); None if there is none."""
    return sure_step(at, t, space.longest, space.rank)


def _left(space: CurveSpace, at: Linearised, t: Floats) -> Linearised | None:
    """The first position on the branch t (n,) of a singular position; None if there is none.

    Nothing is sure there. The step is so short that there is no other singular position on it."""
    ahead = at.closed(_LEAVING * space.longest * t, space.rank)
    if ahead is None:
        return None
    gone = ahead.q[: t.size] - at.q[: t.size]
    return ahead if gone @ t > _STRAIGHT * np.linalg.norm(gone) else None


def _end(piece: Piece, node: Floats, n: int) -> None:
    """End a piece in a node, so that its last direction is the direction of the branch.

    Positions beside the node are left out: there rounding, and lengths that miss a crossing, turn
    the direction to the node."""
    while len(piece.q) > 1 and piece.sigma[-1] < BESIDE:
        piece.q.pop(), piece.tangents.pop(), piece.sigma.pop()
    last = node[:n] - piece.q[-1][:n]
    piece.add(node, last / np.linalg.norm(last), 0.0)
