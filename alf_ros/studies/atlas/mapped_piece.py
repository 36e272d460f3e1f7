"""A piece of a curve with the quantities of a map along it, and its turning points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from alf_ros.arrays import Floats
from alf_ros.studies.atlas.configuration_curve import CurveSpace, Piece, tangent_at
from alf_ros.studies.atlas.coordinate_reader import CoordinateReader
from alf_ros.studies.atlas.map_coordinate import MapCoordinate
from alf_ros.studies.atlas.transmission import Bar, ratio

TRAVEL_LIMIT, DEAD_POINT = 'travel limit', 'dead point'
# rate along a tangent of length 1, from which down a coordinate stands still: the tangent in a
# node is known to about the root of the rounding
_STILL = 1e-7
_EXACT = 4.0 * np.finfo(float).eps  # of the chord, to which a turning point is located


@dataclass(frozen=True, eq=False)
class Quantities:
    """The quantities that a map reads at a position."""

    reader: CoordinateReader
    over: MapCoordinate
    output: MapCoordinate | None
    bar: Bar | None

    def rate(self, coordinate: MapCoordinate, q: Floats, t: Floats) -> float:
        """The rate of a coordinate along a tangent (n,)."""
        return coordinate.read(self.reader, q, self._whole(q, t))[1]

    def row(self, q: Floats, t: Floats) -> tuple[float, ...]:
        """Input and its rate; output, its rate, velocity ratio, advantage; transmission angle."""
        v = self._whole(q, t)
        u, du = self.over.read(self.reader, q, v)
        w, dw = self.output.read(self.reader, q, v) if self.output else (math.nan, math.nan)
        angle = self.bar.angle(self.reader.model, q, v) if self.bar else math.nan
        return u, du, w, dw, ratio(dw, du), ratio(du, dw), angle

    def joints(self, q: Floats) -> Floats:
        """(joint coordinates,) rad from -π to π, or m."""
        return np.array(self.reader.read(q, np.zeros_like(q))[0])

    @staticmethod
    def _whole(q: Floats, t: Floats) -> Floats:
        v = np.zeros_like(q)
        v[: t.size] = t
        return v


@dataclass(frozen=True, eq=False)
class Turning:
    """A position at which a rate vanishes: `kind` TRAVEL_LIMIT (of the input) or DEAD_POINT (of
    the output), the position q (blocks D, m), the value of the input, and its place among the
    positions of the piece (2.5: between the third and the fourth)."""

    kind: str
    q: Floats
    value: float
    place: float


@dataclass(frozen=True, eq=False)
class MappedPiece:
    """A piece with its numbers.

    q (positions, blocks D, m); over (positions,): the input, angles with turns; output
    (positions,) the same; velocity_ratio, advantage, transmission (rad), sigma (positions,);
    joints (positions, joint coordinates): rad from -π to π, or m; is_angle: whether the input is
    one.
    """

    number: int
    circuit: int
    piece: Piece
    q: Floats
    over: Floats
    output: Floats
    velocity_ratio: Floats
    advantage: Floats
    transmission: Floats
    sigma: Floats
    joints: Floats
    turnings: tuple[Turning, ...]
    is_angle: bool

    def branches(self) -> list[tuple[int, int]]:
        """First and last position of each part in which the input goes one way."""
        cuts = [math.floor(t.place) + 1 for t in self.turnings if t.kind == TRAVEL_LIMIT]
        edges = [0, *sorted(cuts), len(self.q)]
        return [(a, b - 1) for a, b in zip(edges, edges[1:], strict=False) if b > a]

    def ends(self) -> list[float]:
        """Values of the input at the first position, at its travel limits, and at the last."""
        limits = sorted((t.place, self._near(t)) for t in self.turnings if t.kind == TRAVEL_LIMIT)
        return [float(self.over[0]), *(value for _, value in limits), float(self.over[-1])]

    def _near(self, turning: Turning) -> float:
        """The value of a turning point, of an angle with the turns of the piece."""
        near = float(self.over[math.floor(turning.place)])
        return turning.value + _turns(near - turning.value) if self.is_angle else turning.value


def mapped(
    space: CurveSpace, piece: Piece, reads: Quantities, number: int, circuit: int
) -> MappedPiece:
    """The numbers of a piece, with its turning points to rounding."""
    rows = np.array([reads.row(q, t) for q, t in zip(piece.q, piece.tangents, strict=True)])
    rates = {TRAVEL_LIMIT: (reads.over, rows[:, 1])}
    if reads.output is not None:
        rates[DEAD_POINT] = (reads.output, rows[:, 3])
    turnings = []
    for kind, (coordinate, rate) in rates.items():
        for k in _turned(rate, piece.closed):
            found = _turning(space, piece, k, partial(reads.rate, coordinate))
            if found is not None:
                q, part = found
                value = reads.over.read(reads.reader, q, np.zeros_like(q))[0]
                turnings.append(Turning(kind, q, value, k + part))
    is_angle = reads.over.is_angle
    out_angle = reads.output is not None and reads.output.is_angle
    return MappedPiece(
        number,
        circuit,
        piece,
        np.array(piece.q),
        np.unwrap(rows[:, 0]) if is_angle else rows[:, 0],
        np.unwrap(rows[:, 2]) if out_angle else rows[:, 2],
        rows[:, 4],
        rows[:, 5],
        rows[:, 6],
        np.array(piece.sigma),
        np.array([reads.joints(q) for q in piece.q]),
        tuple(sorted(turnings, key=lambda each: each.place)),
        is_angle,
    )


def _turned(rates: Floats, closed: bool) -> list[int]:
    """The positions behind which a coordinate turns, from its rates (positions,).

    Where it stands still its rate has any sign. It turns there if it moves one way before and the
    other way behind.
    """
    moving = np.flatnonzero(np.abs(rates) > _STILL).tolist()
    ways = list(pairwise(moving))
    if closed and moving:
        ways.append((moving[-1], moving[0] + len(rates) - 1))  # the last position is the first
    found = []
    for before, behind in ways:
        between = np.arange(before, behind + 1) % (len(rates) - 1 if closed else len(rates))
        signs = rates[between]
        if signs[0] * signs[-1] < 0.0:
            found.append(int(between[np.argmax(signs[:-1] * signs[1:] <= 0.0)]))
    return found


def _turning(
    space: CurveSpace, piece: Piece, k: int, rate: Callable[[Floats, Floats], float]
) -> tuple[Floats, float] | None:
    """The position between two of a piece at which a rate is zero, and its part of the way."""
    at, n = space.at(piece.q[k]), space.model.n
    span = piece.q[k + 1][:n] - piece.q[k][:n]
    rank = min(space.rank, at.rank) if piece.singular else space.rank

    def there(s: float) -> tuple[float, Floats]:
        ahead = at.closed(s * span, rank)
        if ahead is None:
            raise ArithmeticError
        return rate(ahead.q, tangent_at(space, ahead, span)), ahead.q

    try:
        part = brentq(lambda s: there(s)[0], 0.0, 1.0, xtol=_EXACT, rtol=_EXACT)
        return there(part)[1], part
    except (ArithmeticError, ValueError):
        return None


def _turns(difference: float) -> float:
    """The whole turns in a difference of angles, rad."""
    return 2.0 * math.pi * round(difference / (2.0 * math.pi))
