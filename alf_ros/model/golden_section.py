"""Golden section: where a function of one minimum is least (Kiefer, Proc. AMS 4 (1953), 502).

For functions with a kink there, such as the least singular value, where parabolas do not help;
SciPy's optimisers take a tenth of a start to import.
"""

from __future__ import annotations

import math
from collections.abc import Callable

_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)


def lowest(height: Callable[[float], float], low: float, high: float, width: float) -> float:
    """The lowest argument that was tried, when the minimum is known to within `width`."""
    left, right = high - _RATIO * (high - low), low + _RATIO * (high - low)
    of_left, of_right = height(left), height(right)
    while high - low > width:
        if of_left < of_right:
            high, right, of_right = right, left, of_left
            left = high - _RATIO * (high - low)
            of_left = height(left)
        else:
            low, left, of_left = left, right, of_right
            right = low + _RATIO * (high - low)
            of_right = height(right)
    return left if of_left <= of_right else right
