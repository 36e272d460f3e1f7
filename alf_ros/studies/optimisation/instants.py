"""Instants of a motion with the derivatives of their states by the numbers of a design."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.simulation.displaced_scenes import DisplacedScenes
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation


@dataclass(frozen=True, eq=False)
class PointTrack:
    """A point at K instants: position x (K, D), velocity v (K, D), and the derivatives dx
    (K, P, D) of the position by P numbers."""

    x: Floats
    v: Floats
    dx: Floats


class DesignMotion(Protocol):
    """The motion of one design, over its duration. What it raises is an AlfError.

    Samples are equally spaced.
    """

    @property
    def simulation(self) -> Simulation:
        """Of the scene, at its end."""
        ...

    @property
    def t(self) -> Floats:
        """(N,) s."""
        ...

    @property
    def samples(self) -> Sequence[Sample]:
        """(N,)."""
        ...

    @property
    def kinks(self) -> Floats:
        """The instants (s) at which functions of time of drives and effects have a kink."""
        ...

    def check_held(self, instants: Sequence[float], what: str) -> None:
        """Raise InputError, which says `what` jumps, if a number of the design moves one of these
        kinks (s)."""
        ...

    @property
    def trouble(self) -> str:
        """Steps of its run that are too long, in words; or empty."""
        ...

    @property
    def displaced(self) -> DisplacedScenes:
        """The scenes beside it."""
        ...

    def tangent(self, n: int) -> tuple[Floats, Floats]:
        """δq, δq̇ (P, blocks D) of sample n."""
        ...

    def places(self, point: str, times: Floats) -> tuple[Floats, Floats]:
        """(K, D) positions and velocities of a point at instants (s) within the duration."""
        ...

    def track(self, point: str, times: Floats) -> PointTrack:
        """The same with the derivatives of the positions."""
        ...


def path(samples: Sequence[Sample], point: str) -> tuple[Floats, Floats]:
    """(N, D) positions (m) and velocities (m/s) of a point in samples."""
    at = [(sample.points[point], sample.velocities[point]) for sample in samples]
    x, v = (np.array(each) for each in zip(*at, strict=True))
    return x, v
