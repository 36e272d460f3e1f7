"""Mechanisms so far from the origin that rounding of their places opens joints."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.projection import FAR


def nearer(size: float, q: Floats) -> str | None:
    """The remedy for a mechanism of a size (m) at q (blocks D, m); None near the origin."""
    away = float(np.abs(q).max(initial=0.0)) / size
    if not away > FAR:
        return None
    return (
        f'the mechanism nearer to the origin: it is {away:.2g} times its size away, and rounding '
        'of places opens joints there'
    )
