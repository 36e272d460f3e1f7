"""Functions of the simulated time from outside: polynomials up to the fifth power, piece by piece.

Between two knots the piece is what both say: linear if one says no velocity, cubic if one says no
acceleration, else quintic, as ros2_controllers' joint_trajectory_controller has it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

# (x,), (x, ẋ) or (x, ẋ, ẍ)
Knot = Sequence[float]
_POWERS = 6


@dataclass(frozen=True)
class Curve:
    """x(t) = Σ c_k (t - t_i)^k from t_i (s) on, to the next; `pieces` are (t_i, c_0 … c_5).

    Before the first it is c_0 of the first; the last one is held at its c_0. Raises ValueError
    unless a piece is seven finite numbers, instants ascend and the end does not move.
    """

    pieces: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if not self.pieces or any(len(piece) != 1 + _POWERS for piece in self.pieces):
            raise ValueError(f'a curve has pieces of {1 + _POWERS} numbers')
        if not all(math.isfinite(x) for piece in self.pieces for x in piece):
            raise ValueError('a curve must be finite')
        if any(b[0] <= a[0] for a, b in zip(self.pieces, self.pieces[1:], strict=False)):
            raise ValueError('the instants of a curve must ascend')
        if any(self.pieces[-1][2:]):
            raise ValueError('the last piece of a curve is held: it has no slope')

    @property
    def end(self) -> float:
        """The instant (s) from which on it is constant."""
        return self.pieces[-1][0]

    def at(self, t: float) -> tuple[float, float, float]:
        """x, ẋ, ẍ at t (s)."""
        if t < self.pieces[0][0]:
            return self.pieces[0][1], 0.0, 0.0
        start, *c = next(piece for piece in reversed(self.pieces) if piece[0] <= t)
        d = t - start
        x = v = a = 0.0
        for k in reversed(range(_POWERS)):  # Horner, of the derivatives too
            a = a * d + 2.0 * v
            v = v * d + x
            x = x * d + c[k]
        return x, v, a

    def shifted(self, by: float) -> Curve:
        """x(t) and a constant."""
        pieces = tuple((t, c + by, *more) for t, c, *more in self.pieces)
        return Curve(pieces)

    def until(self, t: float) -> tuple[tuple[float, ...], ...]:
        """The pieces that begin before t (s)."""
        return tuple(piece for piece in self.pieces if piece[0] < t)


def through(times: Sequence[float], knots: Sequence[Knot], before: Curve | None = None) -> Curve:
    """The curve through `knots` at `times` (s, ascending); up to the first, `before`.

    Raises ValueError as `Curve` does.
    """
    pieces = [] if before is None else list(before.until(times[0]))
    for t0, t1, a, b in zip(times, times[1:], knots, knots[1:], strict=False):
        if t1 <= t0:
            raise ValueError('the instants of a curve must ascend')
        pieces.append((t0, *_between(a, b, t1 - t0)))
    pieces.append((times[-1], knots[-1][0], *[0.0] * (_POWERS - 1)))
    return Curve(tuple(pieces))


def _between(a: Knot, b: Knot, h: float) -> tuple[float, ...]:
    """c_0 … c_5 of the polynomial from a to b in h (s) that has what both of them say."""
    known = min(len(a), len(b))
    x = b[0] - a[0]
    if known == 1:
        return (a[0], x / h, 0.0, 0.0, 0.0, 0.0)
    # What the power series of a misses at the end, in units of its last coefficients.
    x, v = x - a[1] * h, (b[1] - a[1]) * h
    if known == 2:
        return (a[0], a[1], (3.0 * x - v) / h**2, (v - 2.0 * x) / h**3, 0.0, 0.0)
    x, v, w = x - 0.5 * a[2] * h**2, v - a[2] * h**2, (b[2] - a[2]) * h**2
    return (
        a[0],
        a[1],
        0.5 * a[2],
        (10.0 * x - 4.0 * v + 0.5 * w) / h**3,
        (-15.0 * x + 7.0 * v - w) / h**4,
        (6.0 * x - 3.0 * v + 0.5 * w) / h**5,
    )
