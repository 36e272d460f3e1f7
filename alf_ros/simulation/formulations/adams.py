"""Adams's method with variable step and order, as predictor and corrector (PECE): ẏ = rates(t, y).

The scheme of Shampine & Gordon, Computer Solution of Ordinary Differential Equations (1975), as
Hairer, Nørsett & Wanner I (1993), III.5 derive it. With t_0 > t_1 > … the last times and D_j the
divided differences ẏ[t_0 … t_j], a step to t of order k is

    π_j(x) = Π_i<j (x - t_i),   G_j = ∫ π_j dx from t_0 to t
    p = y + Σ_j<k G_j D_j                                   predicted, then ẏ evaluated there
    d_j = rates(t, p) - Σ_i<j π_i(t) D_i                    what it differs from the prediction by
    y = p + G_k d_k / π_k(t)                                corrected, then ẏ evaluated there

The correction is of order k + 1; what one of order j would differ by, (G_j / π_j - G_j-1 / π_j-1)
d_j, is the error that order j is judged by. The corrector is applied once. An integrator that
repeats it until it converges needs h |∂rates/∂y| < 1, and so takes short steps beside a singular
position, where ∂rates/∂y has a pole.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import StepError

HIGHEST = 12  # order
# ∫ of polynomials up to degree 13, exact
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)


class Adams:
    """A motion y(t), step by step; y is where the last step has ended.

    tolerance: what the error of a step may be, relative to 1 + |y|, in the norm of all components.
    """

    def __init__(self, rates: Callable[[float, Floats], Floats], y: Floats, tolerance: float):
        self.t, self.y = 0.0, y.copy()
        self._rates, self._tolerance = rates, tolerance
        first = rates(0.0, self.y)
        self._times, self._slopes = np.zeros(1), first[None]  # newest first
        # a step of order 1 has an error of about h² |ẏ| at first
        speed = self._norm(first)
        self._h = 0.25 / math.sqrt(speed) if speed > 0.0 else 1e-3
        self._order, self._used = 1, 1
        self._equal = 0  # steps of the same length in a row
        self._starting = True

    def step(self) -> None:
        """Take a step. Raises StepError where none is short enough."""
        differences = _divided_differences(self._times, self._slopes)
        h, failures = self._h, 0
        while True:
            k, t = self._order, self.t + h
            if not abs(h) > 4.0 * np.finfo(float).eps * max(self.t, 1e-3):
                raise StepError('no step is short enough', 'use a larger tolerance', self.t)
            G = _integrals(self._times, self.t, t, k + 1)
            products = _products(self._times, np.array([t]), k + 1)
            share = G / products[:, 0]
            known = min(k + 1, differences.shape[0])
            guess = np.cumsum(products[:known] * differences[:known], axis=0)  # Σ_i<=j π_i D_i
            predicted = self.y + G[:k] @ differences[:k]
            slope = self._rates(t, predicted)
            error = [0.0] * (k + 1)  # of the orders k - 2 to k
            for j in range(max(1, k - 2), k + 1):
                error[j] = self._norm((share[j] - share[j - 1]) * (slope - guess[j - 1]))
            lower = max(error[k - 2 : k]) if k > 2 else 2.0 * error[1] if k == 2 else math.inf
            if error[k] <= 1.0:
                break
            failures += 1
            self._starting, self._equal = False, 0
            self._order = k - 1 if lower <= error[k] else k
            h *= 0.5
            if failures >= 3:
                self._order = 1
        self.y = predicted + share[k] * (slope - guess[k - 1])
        slope = self._rates(t, self.y)
        higher = math.inf
        if known > k:
            higher = self._norm((share[k + 1] - share[k]) * (slope - guess[k]))
        self._times = np.concatenate([[t], self._times[: HIGHEST + 1]])
        self._slopes = np.concatenate([slope[None], self._slopes[: HIGHEST + 1]])
        self.t, self._used = t, k
        self._equal += 1
        self._choose(h, k, error, lower, higher)

    def at(self, t: float) -> Floats:
        """y at t (s), within the last step: the polynomial that the step has integrated."""
        k = min(self._used + 1, self._times.size)
        times = self._times[:k]
        moved: Floats = _integrals(times, self.t, t, k - 1) @ _divided_differences(
            times, self._slopes[:k]
        )
        return self.y + moved

    def _choose(self, h: float, k: int, error: list[float], lower: float, higher: float) -> None:
        """Order and length of the next step, after one of h and of order k."""
        self._starting = self._starting and lower > error[k] and k < HIGHEST
        if self._starting:  # as fast as a step of each order allows
            self._order, self._h, self._equal = k + 1, 2.0 * h, 0
            return
        expected = error[k]
        # an estimate for the higher order needs steps of one length
        known = self._equal > k and k < HIGHEST
        if lower <= error[k] or (known and k > 1 and error[k - 1] <= min(error[k], higher)):
            self._order, expected = k - 1, error[k - 1]
        elif known and higher < (error[k] if k > 1 else 0.5 * error[1]):
            self._order, expected = k + 1, higher
        else:
            self._order = k
        room = (0.5 / max(expected, 1e-30)) ** (1.0 / (self._order + 1))
        if room >= 2.0:
            self._h, self._equal = 2.0 * h, 0
        elif room >= 1.0:
            self._h = h
        else:
            self._h, self._equal = h * min(0.9, max(0.5, room)), 0

    def _norm(self, error: Floats) -> float:
        return float(np.linalg.norm(error / (self._tolerance * (1.0 + np.abs(self.y)))))


def _divided_differences(times: Floats, values: Floats) -> Floats:
    """D_j (m, size) of `values` (m, size) at `times` (m,)."""
    found = values.copy()
    for j in range(1, times.size):
        found[j:] = (found[j:] - found[j - 1 : -1]) / (times[j:] - times[:-j])[:, None]
    return found


def _integrals(times: Floats, start: float, end: float, highest: int) -> Floats:
    """G_j, j = 0 .. highest, as far as there are times."""
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    return half * _products(times, middle + half * _NODES, highest) @ _WEIGHTS


def _products(times: Floats, x: Floats, highest: int) -> Floats:
    """π_j at each x, j = 0 .. highest, as far as there are times: (j, x)."""
    factors = x - times[:highest, None]
    return np.cumprod(np.concatenate([np.ones((1, x.size)), factors]), axis=0)
