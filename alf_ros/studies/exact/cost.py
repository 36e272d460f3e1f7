"""The one freedom alone, integrated with the adaptive steps of the kernel: the cost of a motion.

State (θ, P), P = I(θ) θ̇ its momentum: θ̇ = P/I, Ṗ = I θ̈ + I' θ̇². The equation has no
singularity. The method, the embedded errors, their scales, and the choice of the next step are the
same as in `kernel.advance_adaptively`, so that evaluations can be compared at the same error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.tableaux import TABLEAUX, first_pace
from alf_ros.studies.exact.one_freedom import OneFreedom

SHARE = 0.05  # of the tolerance for one step, as in the kernel
MOST = 20_000  # evaluations, above which a tolerance asks for less than rounding leaves
_METHOD = TABLEAUX['dop853_adaptive']


@dataclass(frozen=True)
class Cost:
    """Largest position error (m) at the times looked at, and the evaluations it took."""

    position: float
    evaluations: int


def integrate(
    alone: OneFreedom,
    start: tuple[float, float],
    times: tuple[float, ...],
    exact: Floats,
    tolerance: float,
    size: float,
    slowest: float,
) -> Cost | None:
    """From θ (rad), θ̇ (rad/s) at times[0] through all `times` (s), each a point of the grid.

    exact: q (times, n) to compare with, m. size (m): of the mechanism, to which the tolerance is
    relative; slowest (m/s): the least speed for relative errors, as in the kernel. None if it
    needs more than MOST evaluations: rounding is then above the tolerance.
    """
    a, b, embedded = _METHOD.a, _METHOD.b, _METHOD.embedded
    assert embedded is not None  # as of an adaptive method
    stages = b.size
    k = np.zeros((stages, 2))
    theta, rate = start
    y = np.array([theta, alone.inertia(theta)[0] * rate])
    error = float(np.abs(alone.position(theta) - exact[0]).max())
    pace = first_pace(times[1] - times[0], size, rate * alone.tangent(theta))
    evaluations = 1
    k[0] = _rates(alone, y)
    for n in range(1, len(times)):
        t = times[n - 1]
        while t < times[n]:
            if evaluations > MOST:
                return None
            left = times[n] - t
            speed = abs(k[0, 0]) * np.abs(alone.tangent(y[0])).max()
            parts = max(1, math.ceil(0.999999 * left / pace))
            dt = left / parts
            for s in range(1, stages):
                k[s] = _rates(alone, y + dt * (a[s, :s] @ k[:s]))
            new = y + dt * (b @ k)
            evaluations += stages - 1
            e5, e3 = (
                _relative(alone, new[0], dt * (weights @ k), size, max(slowest, speed))
                / (SHARE * tolerance)
                for weights in embedded
            )
            wrong = e5 * e5 / math.sqrt(e5 * e5 + 0.01 * e3 * e3) if e5 > 0.0 else 0.0
            factor = 0.5
            if math.isfinite(wrong):
                factor = min(5.0, max(0.2, 0.8 * wrong**-0.125)) if wrong > 0.0 else 5.0
            if wrong <= 1.0:
                t = times[n] if parts == 1 else t + dt
                y, k[0], evaluations = new, _rates(alone, new), evaluations + 1
                pace = max(pace, factor * dt) if dt < pace else factor * dt
            else:
                pace = factor * dt
        error = max(error, float(np.abs(alone.position(y[0]) - exact[n]).max()))
    return Cost(error, evaluations)


def evaluations_for(position: float, costs: Sequence[Cost]) -> float:
    """Evaluations for a position error (m), interpolated in `costs` in logarithms.

    Some runs are lucky: the cheapest run below an error counts. Outside the errors of `costs` the
    nearest run counts.
    """
    errors: list[float] = []
    evaluations: list[int] = []
    for cost in sorted(costs, key=lambda cost: (cost.evaluations, cost.position)):
        if not errors or cost.position < errors[-1]:
            errors.append(cost.position)
            evaluations.append(cost.evaluations)
    logs = np.log(np.maximum(errors[::-1], 1e-300)), np.log(evaluations[::-1])
    return math.exp(np.interp(math.log(max(position, 1e-300)), *logs))


def _rates(alone: OneFreedom, y: Floats) -> tuple[float, float]:
    """θ̇ and Ṗ."""
    inertia, slope = alone.inertia(y[0])
    rate = y[1] / inertia
    return rate, inertia * alone.acceleration(y[0], rate) + slope * rate * rate


def _relative(alone: OneFreedom, theta: float, error: Floats, size: float, speed: float) -> float:
    """`error` of θ as a displacement relative to the size, of P as a velocity to the speed."""
    reach = np.abs(alone.tangent(theta)).max()
    velocity = error[1] / alone.inertia(theta)[0]
    return float(reach * max(abs(error[0]) / size, abs(velocity) / speed))
