"""Cubic splines through points. To import the interpolation of SciPy takes long: scenes without a
spline start without it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from alf_ros.arrays import Floats

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


def cubic_spline(x: Floats, f: Floats, ends: Literal['clamped', 'natural']) -> CubicSpline:
    """The spline through f (n,) at x (n,), ascending; at both ends its slope is zero (clamped), or
    its second derivative (natural)."""
    from scipy.interpolate import CubicSpline

    return CubicSpline(x, f, bc_type=ends)
