"""Wrenches, efforts and targets that are held from outside on a mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from alf_ros.effects.contract.trajectory import Curve


@dataclass(frozen=True)
class Wrench:
    """A force (N) and a torque (N m; in the plane about +z), held on a body or point.

    `at` names a point of the body (default: its centre of mass); `frame` is 'world' or 'body'.
    """

    force: tuple[float, ...]
    torque: float | tuple[float, ...] = 0.0
    at: str | None = None
    frame: str = 'world'


@dataclass(frozen=True)
class Target:
    """Target of the motor on a joint, or of a tendon, in place of the target in the scene: x* (rad
    or m), and ẋ* (rad/s or m/s) if not the slope of x*."""

    position: float | Curve | None = None
    velocity: float | None = None


@dataclass(frozen=True)
class Inputs:
    """All that is held from outside: wrenches by body or point, efforts (N m or N) by joint, and
    targets of motors by joint, of tendons by their names.

    added: wrenches by body beside those, in the world frame at the centre of mass: numbers that
    are added to a wrench in the frame of the body, or at a point of it.
    """

    wrenches: Mapping[str, Wrench]
    efforts: Mapping[str, float | Curve]
    targets: Mapping[str, Target] = field(default_factory=dict)
    added: Mapping[str, Wrench] = field(default_factory=dict)

    @property
    def all_wrenches(self) -> tuple[tuple[str, Wrench], ...]:
        """Each wrench that acts, with its body or point."""
        return (*self.wrenches.items(), *self.added.items())


NO_INPUTS = Inputs({}, {})
