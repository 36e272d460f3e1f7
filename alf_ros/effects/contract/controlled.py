"""Effects with a controller, k_p (x* - x) + k_v (ẋ* - ẋ): what they follow, and targets from
outside."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol, TypeVar

from alf_ros.effects.contract.piecewise import Points


class Controller(Protocol):
    """Parameters of such an effect."""

    @property
    def position(self) -> float | Points | None:
        """x*."""
        ...

    @property
    def position_gain(self) -> float | None:
        """k_p; none or 0 if it follows no position."""
        ...

    @property
    def velocity_gain(self) -> float:
        """k_v; 0 if it follows no velocity."""
        ...


C = TypeVar('C', bound=Controller)


def gain_of_position(parameters: Controller) -> None:
    """Raise ValueError for one of x* and k_p without the other: a gain of zero must be given."""
    if parameters.position is None:
        if parameters.position_gain:
            raise ValueError('position and position_gain go together')
    elif parameters.position_gain is None:
        raise ValueError('position and position_gain go together, also where the gain is 0')


def follows(parameters: Controller) -> tuple[bool, bool]:
    """Whether it follows positions, and velocities."""
    return bool(parameters.position_gain), bool(parameters.velocity_gain)


def aimed(parameters: C, position: float | Points | None, velocity: float | None) -> C:
    """With a target in place of its own, as far as it follows one."""
    if position is not None and parameters.position_gain:
        return replace(parameters, position=position, velocity=velocity)  # type: ignore[type-var]
    if velocity is not None and parameters.velocity_gain:
        return replace(parameters, velocity=velocity)  # type: ignore[type-var]
    return parameters
