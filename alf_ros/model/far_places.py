"""Mechanisms so far from the origin that rounding of their places opens joints."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats

_SUSPECT = 1e3  # sizes: no nearer place has been seen to open joints


def nearer(size: float, q: Floats) -> str | None:
    """The remedy for a mechanism of a size (m) at q (blocks D, m), if its place may be the cause;
    None near the origin."""
    away = float(np.abs(q).max(initial=0.0)) / size
    if not away > _SUSPECT:
        return None
    return (
        f'the mechanism nearer to the origin: it is {away:.2g} times its size away, and rounding '
        'of places may open joints there'
    )
