"""Data that functions of the kernel pass on together: the problem, and three bundles of
numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.data.forces import Forces
from alf_ros.kernel.data.motion import Method
from alf_ros.kernel.data.system import System
from alf_ros.kernel.data.work import Work
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class Problem(Struct):
    """All that a step works with, except its state, a `Phase`: the same from step to step."""

    unit: Unit
    system: System
    forces: Forces
    method: Method
    work: Work


class Scales(NamedTuple):
    """Scales of the nearness to a singular position in a step, known at its start."""

    radius: float  # m, of the path
    close: float  # distance x to a singular position below which rounding would be felt
    falling: float  # m/s, the speed that the forces give along the size


class Span(NamedTuple):
    """Steps of h (s) on the grid t0 + k h (s), from k = `first`."""

    t0: float
    first: int
    steps: int
    h: float


class Until(NamedTuple):
    """When an augmented solve ends."""

    iterations: int | np.int64  # at most
    tolerance: float  # relative to x, or to what f would do to the masses alone
    patience: float  # ratio of two rounds above which a solve is slow and left


class ModeLimits(NamedTuple):
    """Which modes conjugate residuals leave out, and when rows count as fulfilled."""

    noise: float  # by which rows may be off, in the unit of x
    faintest: float  # σ of a mode below which it does not differ from rounding
    furthest: float  # step of x along a mode, at most, over its σ
    unbound: float  # rows from this one on bind nothing where they are not open at the start


EVERY_MODE = ModeLimits(0.0, 0.0, np.inf, np.inf)
