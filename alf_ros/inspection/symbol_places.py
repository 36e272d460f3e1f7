"""Lines of a mechanism beside those between the points of bodies, as places at any position.

Symbols of joints (sliders with their rails, hinges in space, threads, rods of a distance) as in
`check`'s picture, and limbs: lines from a body to joints that are not at one of its points.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.inspection.joint_pen import JointPen
from alf_ros.inspection.wheel_places import DrawnPosture
from alf_ros.mechanism import GROUND, Joint, Mechanism
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.joints import type_of

_SIZE = 0.02  # of symbols, as a part of the mechanism's largest extent
_SHORTEST = 0.25  # the most, as a part of the shortest body
_SAME = 1e-9  # of the largest extent: places that are one


class _SymbolPen(JointPen):
    """Keeps the lines of a joint, at its place on the child and with the axes of the parent."""

    def __init__(self, posture: DrawnPosture, joint: Joint) -> None:
        super().__init__(posture, joint)
        self.found: list[Form] = []
        self._posture = posture
        self._centre = posture.layout.place(joint.child, joint.frames[1].origin)

    def bar(self, along: Floats, half: float, width: float = 1.5) -> None:
        own = any(along is axis for axis in self.own)
        ends = np.array([self.at - half * along, self.at + half * along])
        self._keep(ends, self.joint.child if own else self.joint.parent)

    def box(self, along: Floats, side: Floats, long: float, wide: float) -> None:
        corners = [(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)]
        line = np.array([self.at + a * long * along + b * wide * side for a, b in corners])
        self._keep(line, self.joint.parent)

    def rail(self, middle: Floats, along: Floats, side: Floats, half: float) -> None:
        self._keep(np.array([middle - half * along, middle + half * along]), self.joint.parent)

    def line(self, places: Floats, style: str = '-', width: float = 1.0) -> None:
        if np.array_equal(places, [self.there, self.at]):  # from body to body
            base = self.joint.frames[0].origin
            self.found += [self._posture.layout.place(self.joint.parent, base), self._centre]
        else:
            self._keep(places, self.joint.parent)

    def dot(self, colour: str, size: float) -> None:
        """Points of joints are drawn as joints."""

    def square(self) -> None:
        """As `dot`."""

    def dots(self, places: Floats) -> None:
        """As `dot`."""

    def circle(self, at: Floats, radius: float) -> None:
        """`wheel_places` has the rims."""

    def wheel(self, axle: Floats | None, leans: bool = False) -> None:
        """As `circle`."""

    def _keep(self, places: Floats, body: str) -> None:
        local = self._posture.local_directions(body, places - self.at).tolist()
        direction = self._posture.layout.direction
        forms = [self._centre + direction(body, tuple(each)) for each in local]
        for pair in zip(forms, forms[1:], strict=False):
            self.found += pair


def symbol_lines(mechanism: Mechanism, layout: Layout, q: Floats) -> list[Form]:
    """The ends of lines of the symbols of all joints, two for each line; q (n,) m: a position."""
    posture = DrawnPosture(layout, q.reshape(-1, layout.dimension))
    extent = _extent(mechanism)
    bars = [float(np.linalg.norm(body.local[1])) for body in mechanism.bodies if body.local[1:]]
    posture.size = min(_SIZE * extent, _SHORTEST * min(bars, default=extent))
    found: list[Form] = []
    for joint in mechanism.joints:
        pen = _SymbolPen(posture, joint)
        type_of(joint).draw(pen)
        found += pen.found
    return found


def limb_lines(mechanism: Mechanism, layout: Layout) -> list[Form]:
    """The ends of a line from the first point of a body to each of its joints that is not at one
    of its points, two for each line; of a body with one point also to its centre of mass."""
    near = _SAME * _extent(mechanism)
    found: list[Form] = []
    bodies = {body.name: body for body in mechanism.bodies}
    for name, origin in (*_joint_places(mechanism), *_centres(mechanism)):
        local = np.array(bodies[name].local)
        if np.linalg.norm(local - origin, axis=1).min() > near:
            ends = (bodies[name].local[0], origin)
            found += [layout.place(name, tuple(end)) for end in ends]
    return found


def _joint_places(mechanism: Mechanism) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Bodies, and the places of their joints in the frames of the bodies (m), each once."""
    seen = set()
    for joint in mechanism.joints:
        for name, frame in zip((joint.parent, joint.child), joint.frames, strict=True):
            if name != GROUND and (name, frame.origin) not in seen:
                seen.add((name, frame.origin))
                yield name, frame.origin


def _centres(mechanism: Mechanism) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Bodies with one point and mass, and their centres of mass in their frames (m)."""
    for body in mechanism.bodies:
        if len(body.points) == 1 and body.mass > 0.0:
            yield body.name, body.com


def _extent(mechanism: Mechanism) -> float:
    """Largest extent along an axis, m; 1 for a single point."""
    places: Any = np.array([point.at for point in mechanism.points])
    return float(np.ptp(places, axis=0).max()) or 1.0
