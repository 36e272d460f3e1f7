"""The distance of a point of the mechanism from places that its path should go through.

With instants, place k is meant for instant k: r_k = x(t_k) - place_k. Without, it is meant for
the nearest point of the path: t_k is where |x(t) - place_k| is least. There r_k · ẋ = 0, or t_k is
an end of the motion, so that

    d|r_k|²/dθ = 2 r_k · (1 - ẋ ẋᵀ / b) ∂x/∂θ,  b = |ẋ|² + r_k · ẍ   (1 / b = 0 at an end)

and (1 - ẋ ẋᵀ / b) ∂x/∂θ serves as the derivative of r_k: the gradient of the sum of squares is
exact. Beside the path b is about |ẋ|², so that motion along the path does not count. Where the
point turns back ẋ = 0, and all motion counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from alf_ros.arrays import Floats
from alf_ros.studies.optimisation.instants import DesignMotion, path

_FINE = 8  # places looked at between two samples
_ROUNDS = 4  # of Newton's method on the cubics between samples, and
_EXACT = 2  # on the motion itself


@dataclass(frozen=True, eq=False)
class PathError:
    """The wanted path: places (K, D) of a point, m, and their instants (K,) s, if they count."""

    point: str
    places: Floats
    times: Floats | None

    def residuals(self, motion: DesignMotion) -> tuple[Floats, Floats]:
        """r (K D,) and its derivatives (K D, P), both over √K: the sum of squares is the mean
        square distance. Raises AlfError."""
        times = self._nearest(motion) if self.times is None else self.times
        track = motion.track(self.point, times)
        dx = track.dx
        if self.times is None:
            square = (track.v * track.v).sum(axis=1)
            bend = square + ((track.x - self.places) * self._curve(motion)(times, 2)).sum(axis=1)
            moves = (times > motion.t[0]) & (times < motion.t[-1]) & (square > 0.0)
            e = np.zeros_like(track.v)
            e[moves] = track.v[moves] / np.sqrt(np.maximum(bend, square)[moves, None])
            dx = dx - np.einsum('kd,kpe,ke->kpd', e, dx, e)
        root, P = np.sqrt(len(times)), dx.shape[1]
        r = (track.x - self.places) / root
        return r.ravel(), dx.transpose(0, 2, 1).reshape(-1, P) / root

    def distance(self, motion: DesignMotion) -> float:
        """The root of the mean square distance, m. Raises AlfError."""
        off = self.places_met(motion) - self.places
        return float(np.linalg.norm(off) / np.sqrt(len(off)))

    def places_met(self, motion: DesignMotion) -> Floats:
        """(K, D) where the point is at the instants, or nearest to the wanted places."""
        times = self._nearest(motion) if self.times is None else self.times
        return motion.places(self.point, times)[0]

    def _nearest(self, motion: DesignMotion) -> Floats:
        """(K,) s: where the path is nearest to each place."""
        first, last = float(motion.t[0]), float(motion.t[-1])
        curve = self._curve(motion)
        fine = np.linspace(first, last, _FINE * (motion.t.size - 1) + 1)
        away = np.linalg.norm(curve(fine)[:, None] - self.places, axis=2)
        times = fine[away.argmin(axis=0)]
        low, high = times - (fine[1] - fine[0]), times + (fine[1] - fine[0])
        for _ in range(_ROUNDS):
            off, v, a = curve(times) - self.places, curve(times, 1), curve(times, 2)
            bend = (v * v).sum(axis=1) + (off * a).sum(axis=1)
            times = np.clip(_newton(times, off, v, bend), low, high)
        times = np.clip(times, first, last)
        for _ in range(_EXACT):
            x, v = motion.places(self.point, times)
            off = x - self.places
            bend = (v * v).sum(axis=1) + (off * curve(times, 2)).sum(axis=1)
            times = np.clip(_newton(times, off, v, bend), first, last)
        return times

    def _curve(self, motion: DesignMotion) -> CubicHermiteSpline:
        """The path over time (s), by cubics between samples."""
        return CubicHermiteSpline(motion.t, *path(motion.samples, self.point))


def _newton(times: Floats, off: Floats, v: Floats, bend: Floats) -> Floats:
    """A step towards off · v = 0, whose slope is `bend`."""
    return times - np.where(bend > 0.0, (off * v).sum(axis=1) / np.where(bend > 0.0, bend, 1.0), 0)
