"""Interface that draws the symbol of a joint, for joint types."""

from __future__ import annotations

from typing import Protocol

from alf_ros.arrays import Floats
from alf_ros.mechanism import Joint


class Pen(Protocol):
    """Draws a joint in a picture. Places (D,) m and directions (D,) are of the world.

    at: where the child has it; `there`: where the parent. `axes`: of the parent's frame, `own`: of
    the child's. `along`: the axis in space, the line in the plane; `side`: across it. `size`: of
    symbols, m. Colours: 'ink', 'pale', 'white'.
    """

    joint: Joint
    at: Floats
    there: Floats
    axes: list[Floats]
    own: list[Floats]
    along: Floats
    side: Floats
    size: float

    def dot(self, colour: str, size: float) -> None:
        """A round mark at the joint; size in points."""
        ...

    def square(self) -> None:
        """A square mark at the joint."""
        ...

    def bar(self, along: Floats, half: float, width: float = 1.5) -> None:
        """A line through the joint; `half` its length, m."""
        ...

    def box(self, along: Floats, side: Floats, long: float, wide: float) -> None:
        """A rectangle around the joint, by halves of its sides, m."""
        ...

    def rail(self, middle: Floats, along: Floats, side: Floats, half: float) -> None:
        """A line of the ground, hatched on the side away from `side`."""
        ...

    def line(self, places: Floats, style: str = '-', width: float = 1.0) -> None:
        """A line through (k, D) places."""
        ...

    def dots(self, places: Floats) -> None:
        """Small marks at (k, D) places."""
        ...

    def circle(self, at: Floats, radius: float) -> None:
        """A pitch circle."""
        ...

    def wheel(self, axle: Floats | None, leans: bool = False) -> None:
        """A wheel of radius `value` and the ground under it; in space across its axle."""
        ...

    def stiffest(self) -> Floats:
        """The axis about which the child has most inertia."""
        ...
