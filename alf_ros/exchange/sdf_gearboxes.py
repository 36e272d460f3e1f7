"""Gearboxes of an SDF as couplings of the hinges that carry their two links.

θ₂ = -ratio θ₁, with the angles from the reference body to the parent about `axis`, and to the
child about `axis2`. As drawn both are zero. Source: the description of `gearbox_reference_body` at
sdformat.org.
"""

from __future__ import annotations

from collections.abc import Sequence

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import Coupled, Robot

ALONG = 1.0 - 1e-9  # cosine between two axes that are the same


def couple(
    robot: Robot,
    name: str,
    reference: str,
    parts: Sequence[str],
    axes: Sequence[Floats],
    ratio: float,
) -> None:
    """Couple the hinges of two parts on the reference part, each about its unit axis; list a
    gearbox whose parts are not on such hinges. A part fixed to the reference part has no angle.
    """
    of: dict[str, float] = {}
    turning = [
        each for each in zip(parts, axes, (ratio, 1.0), strict=True) if each[0] != reference
    ]
    for part, u, factor in reversed(turning):
        hinge, sign = _hinge(robot, reference, part, u) or ('', 0.0)
        if not hinge or hinge in of:
            robot.leave('gearboxes', name)
            return
        of[hinge] = factor * sign
    if any(of.values()):
        robot.couplings.append(Coupled(name, {each: x for each, x in of.items() if x}))


def _hinge(robot: Robot, reference: str, part: str, axis: Floats) -> tuple[str, float] | None:
    """The joint that turns a part on the reference part, and the sign of its coordinate."""
    for each in robot.connections:
        ends = (each.parent, each.child)
        if each.kind != 'revolute' or ends not in ((reference, part), (part, reference)):
            continue
        along = float(each.axes[0] @ axis)
        if abs(along) > ALONG:
            forwards = (along > 0.0) == (each.child == part)
            return each.name, 1.0 if forwards else -1.0
    return None
