"""Speeds along a path that limited efforts allow, by reachability analysis.

Along a path q(s) the efforts are m(s) s̈ + c(s) ṡ² + g(s). Let x = ṡ². Over a piece of the path
of length Δ with constant s̈ = u, x grows by 2 Δ u, so that x + Δ u is its value in the middle,
where the limits hold. Backwards from the end of the path, the interval of x at the start of each
piece is found from which the end can be reached; then forwards the largest u that stays within.
For one piece this is a linear programme in u and x.

Near a zero of m, where |m| < Δ |c|, a limit in the middle would bound little but the sum of x at
both ends, and x alternates about the largest value, down to zero. There c ṡ² + g keeps the limit
at both ends instead. The other limits in these pieces are the same, and so is the order of the
error.

Source: H. Pham, Q.-C. Pham, A new approach to time-optimal path parameterization based on
reachability analysis, IEEE Trans. Robotics 34 (2018) 645-659.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats

_ROUNDED = 1e-12  # of a number, by which inequalities may be missed


@dataclass(frozen=True, eq=False)
class EffortLimits:
    """In the middle of each of N pieces of length `way`: m (N, a) effort for a unit of s̈, c (N, a)
    for a unit of ṡ², g (N, a) the rest; low, high (a,): limits of the efforts."""

    way: float
    m: Floats
    c: Floats
    g: Floats
    low: Floats
    high: Floats

    def fastest(self, first: float, last: float) -> tuple[Floats, int]:
        """x = ṡ² (N + 1,) at the ends of the pieces, of the fastest run from x = first to x =
        last; and -1, or the piece at which it fails."""
        count = len(self.m)
        reach = np.zeros((count + 1, 2))
        reach[-1] = last
        for k in range(count - 1, -1, -1):
            with np.errstate(over='ignore'):  # to an infinite speed, which is no bound
                low, high = self._controllable(k, *reach[k + 1])
            if not max(low, 0.0) <= high:
                return np.zeros(0), k
            reach[k] = max(low, 0.0), high
        x = np.zeros(count + 1)
        x[0] = first
        for k in range(count):
            most = self._most(k, x[k])
            x[k + 1] = np.clip(x[k] + 2.0 * self.way * most, *reach[k + 1])
        # beside the speeds of the run: what can be reached backwards grows without bound with drag
        noise = _ROUNDED * float(x[np.isfinite(x)].max())
        if not reach[0, 0] - noise <= first <= reach[0, 1] + noise:
            return np.zeros(0), 0
        return x, -1

    def _rows(self, k: int) -> tuple[Floats, Floats, Floats]:
        """a u + b x ≤ d of the limits in piece k."""
        own = self.way * self.c[k]
        light = np.abs(self.m[k]) < np.abs(own)
        which = np.concatenate([np.arange(own.size), np.flatnonzero(light)])
        # c x with x at the end of the piece, then at its start; else m u + c x in the middle
        a = np.where(light, 2.0 * own, self.m[k] + own)
        a = np.concatenate([a, np.zeros(which.size - a.size)])
        b, above, below = self.c[k], self.high - self.g[k], self.g[k] - self.low
        return (
            np.concatenate([a, -a]),
            np.concatenate([b[which], -b[which]]),
            np.concatenate([above[which], below[which]]),
        )

    def _controllable(self, k: int, low: float, high: float) -> tuple[float, float]:
        """The interval of x at the start of piece k from which [low, high] at its end is
        reached."""
        a, b, d = self._rows(k)
        a = np.concatenate([a, [2.0 * self.way, -2.0 * self.way]])
        b = np.concatenate([b, [1.0, -1.0]])
        d = np.concatenate([d, [high, -low]])
        return _projected(a, b, d)

    def _most(self, k: int, x: float) -> float:
        """The largest s̈ in piece k with this x at its start."""
        a, b, d = self._rows(k)
        up = a > 0.0
        return float(((d - b * x)[up] / a[up]).min(initial=np.inf))


def _projected(a: Floats, b: Floats, d: Floats) -> tuple[float, float]:
    """The interval of x for which there is a u with a u + b x ≤ d, by elimination of u."""
    up, down, none = a > 0.0, a < 0.0, a == 0.0
    # u ≤ (d - b x) / a above, ≥ below: each pair bounds x
    slope = (b[up] / a[up])[:, None] - (b[down] / a[down])[None, :]
    room = (d[up] / a[up])[:, None] - (d[down] / a[down])[None, :]
    slope = np.concatenate([slope.ravel(), b[none]])
    room = np.concatenate([room.ravel(), d[none]])
    above, below, flat = slope > 0.0, slope < 0.0, slope == 0.0
    if (room[flat] < 0.0).any():
        return np.inf, -np.inf
    high = float((room[above] / slope[above]).min(initial=np.inf))
    low = float((room[below] / slope[below]).max(initial=-np.inf))
    return low, high
