"""Runge-Kutta methods as their tableaux; the kernel steps any of them.

`rk4`, `dop853` and, for stiff scenes, `esdirk43` take the step of the scene; `dop853_adaptive` and
`esdirk43_adaptive` take as many steps between two grid points as their tolerance asks for.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel import Method
from alf_ros.model.dormand_prince import ERROR_3, ERROR_5, A, B, C


class Tableau(NamedTuple):
    """Butcher's a (s, s), b (s,), c (s,), the order, and the weights of embedded errors: (2, s) of
    an adaptive explicit method, (1, s) of an adaptive implicit one, else (0,); `estimate`: (2, s)
    the weights by which fixed steps are judged (`kernel/step_error.py`), else (0,), and `sharp`
    the part of h q̈ that their error reaches at about 0.7 of the stability limit; `lasting`: the
    ratio of both estimates below which errors outlast their step; `caution`: by how much such an
    estimate may be too small; `impact`: (2,) c and p, of a change of the velocity by a stop a step
    of ω h loses at most c (ω h)^p."""

    a: Floats
    b: Floats
    c: Floats
    order: int
    embedded: Floats = np.zeros(0)
    estimate: Floats = np.zeros(0)
    sharp: float = math.inf
    lasting: float = 0.0
    caution: float = 1.0
    impact: Floats = np.zeros(2)

    @property
    def implicit(self) -> bool:
        """Whether stages depend on themselves."""
        return bool(np.diag(self.a).any())


# Scales the lower of two embedded differences such that they are equal a third below the stability
# limit on the imaginary axis, and that the estimate is the error of the method far below.
_AT_ONE = {'rk4': 1.0 / 1.9, 'dop853': 0.1}
# On ẍ = -ω² x with short steps: the error of the method is `high` times the lower power of their
# ratio, times this.
_LASTING = {'rk4': 0.317, 'dop853': 0.146}
# So that hardly any run is off by 1e-3 of the size without a word (benchmark/coarse_steps.py):
# errors grow with the motion that follows them, and dop853 is beside singular positions off by
# more than its embedded formulas say.
_CAUTION = {'rk4': 4.0, 'dop853': 32.0, 'esdirk43': 6.0}
# `rk4` dampens the motion of a linear stop by so much. Stages of the others are of a lower order
# than the method, and may be on the other side of the kink. Theirs is what elastic stops lose at
# most that throw a rotor back within 0.7 to 5 steps (test/simulation/test_step_error.py).
_IMPACT = {'rk4': (1.0 / 144.0, 6.0), 'dop853': (7e-5, 4.0), 'esdirk43': (2e-3, 4.0)}


def _rk4() -> Tableau:
    """Kutta (1901), the classical method."""
    a = np.zeros((4, 4))
    a[1, 0], a[2, 1], a[3, 2] = 0.5, 0.5, 1.0
    # the fourth stage is of order 2, the second one a step of Euler's method
    estimate = np.array([[1.0, 2.0, -4.0, 1.0], [-6.0, 6.0, 0.0, 0.0]]) / 6.0
    estimate[1] *= _AT_ONE['rk4']
    b, c = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0, np.array([0.0, 0.5, 0.5, 1.0])
    return Tableau(
        a,
        b,
        c,
        4,
        estimate=estimate,
        sharp=0.2,
        lasting=_LASTING['rk4'],
        caution=_CAUTION['rk4'],
        impact=np.array(_IMPACT['rk4']),
    )


_PAIR = np.array([ERROR_5, ERROR_3])
_SCALE = np.array([[1.0], [_AT_ONE['dop853']]])
_DOP853 = Tableau(
    A,
    B,
    C,
    8,
    estimate=_PAIR * _SCALE,
    sharp=0.05,
    lasting=_LASTING['dop853'],
    caution=_CAUTION['dop853'],
    impact=np.array(_IMPACT['dop853']),
)


def _esdirk43() -> Tableau:
    """The implicit part of ARK4(3)6L[2]SA: L-stable, stiffly accurate, stages of order 2. Kennedy
    & Carpenter, Appl. Numer. Math. 44 (2003), 139, Appendix C."""
    a = np.zeros((6, 6))
    a[1, 0] = 1 / 4
    a[2, :2] = 8611 / 62500, -1743 / 31250
    a[3, :3] = 5012029 / 34652500, -654441 / 2922500, 174375 / 388108
    a[4, :4] = (
        15267082809 / 155376265600,
        -71443401 / 120774400,
        730878875 / 902184768,
        2285395 / 8070912,
    )
    a[5, :5] = 82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211
    a[1:, 1:] += np.eye(5) / 4
    b = a[5].copy()
    lower = np.array(
        [
            4586570599 / 29645900160,
            0.0,
            178811875 / 945068544,
            814220225 / 1159782912,
            -3700637 / 11593932,
            61727 / 225920,
        ]
    )
    return Tableau(a, b, a.sum(axis=1), 4, embedded=(b - lower)[None])


_ESDIRK43 = _esdirk43()

# Scales the difference of orders 3 and 4: on ẍ = -ω² x it is 0.3 to 0.15 of the error for ω h of
# 1 to 2.
_COARSE = 3.0


TABLEAUX = {
    'rk4': _rk4(),
    'dop853': _DOP853,
    'dop853_adaptive': _DOP853._replace(embedded=_PAIR, estimate=np.zeros(0)),
    'esdirk43': _ESDIRK43._replace(
        embedded=np.zeros(0),
        estimate=np.vstack([_COARSE * _ESDIRK43.embedded, np.zeros((1, 6))]),
        caution=_CAUTION['esdirk43'],
        impact=np.array(_IMPACT['esdirk43']),
    ),
    'esdirk43_adaptive': _ESDIRK43,
}


def _lag(a: Floats, c: Floats) -> Floats:
    """(s,) how far a stage is behind the path, in h² of its curvature."""
    lag = 0.5 * c * c
    for m in range(c.size):
        lag[m + 1 :] -= a[m + 1 :, m] * c[m]
    return lag


def _guess(c: Floats) -> Floats:
    """(s, s) weights that extrapolate a stage from those before: a polynomial through all."""
    weights = np.zeros((c.size, c.size))
    for s in range(1, c.size):
        for m in range(s):
            others = np.delete(c[:s], m)
            weights[s, m] = np.prod((c[s] - others) / (c[m] - others))
    return weights


@lru_cache(maxsize=256)
def method(integrator: str, iterations: int, tolerance: float) -> Method:
    """The solver section of a scene for the kernel; read only, so shared."""
    tableau = TABLEAUX[integrator]
    a, b, c, _, embedded, estimate, sharp, lasting, caution, impact = tableau
    return Method(
        a,
        b,
        c,
        _lag(a, c),
        embedded,
        estimate,
        sharp,
        lasting,
        caution,
        impact,
        guess=_guess(c) if tableau.implicit else np.zeros(0),
        iterations=np.uint64(iterations),
        tolerance=tolerance,
    )


def first_pace(h: float, size: float, qd: Floats) -> float:
    """The first step (s) that an adaptive method tries, on a grid of h (s): the fastest part of q̇
    (m/s) travels a fifth of the size (m) in it.

    A step of a radian can be far off and its embedded errors small, by chance.
    """
    return float(min(h, 0.2 * size / max(np.abs(qd).max(initial=0.0), 1e-300)))
