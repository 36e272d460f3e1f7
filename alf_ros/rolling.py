"""What rolls: pairs of forms whose sum Σ f(q) · d/dt g(q) is the speed of slip.

A spin enters as ω = J d · ḋ / |d|² in the plane, d fixed in the body, and as ω × r = Σ (r·u_k) u̇_k
in space, u_k the axes of the body: both linear in q, as rows that bind velocities must be (38).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros import form
from alf_ros.form import Form
from alf_ros.layout import TURN, Layout
from alf_ros.mechanism import GROUND, Joint

Pair = tuple[Form, Form]


def on_a_line(joint: Joint, layout: Layout) -> list[Pair]:
    """x · (v - v_line) + R ω = 0 where a wheel of radius R meets the x axis of the parent's frame.

    The line may move: what is on it has the same velocity along x everywhere.
    """
    base, tip = joint.frames
    x = layout.direction(joint.parent, base.axes[0])
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
    return [(x, gap), _spin(joint.child, joint.value, layout)]


def of_gears(joint: Joint, layout: Layout) -> list[Pair]:
    """R ω_parent + r ω_child = (R + r) × the rate of the line of centres.

    With u the direction from centre to centre, t = J u: where the pitch circles touch, R u from
    one centre and -r u from the other, both have the same velocity along t. The smaller radius of
    an internal pair counts as negative.
    """
    base, tip = joint.frames
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
    R, r = joint.of_parent, joint.value
    pairs = [(gap.times(-TURN / (R + r)), gap), _spin(joint.child, r, layout)]
    if joint.parent != GROUND:
        pairs.append(_spin(joint.parent, R, layout))
    return pairs


def on_a_plane(joint: Joint, layout: Layout) -> Iterator[tuple[str, list[Pair]]]:
    """t·(v + ω × r) = 0 for t = x, y of the plane, r = -R z."""
    base, tip = joint.frames
    centre = layout.place(joint.child, tip.origin)
    normal = np.array(base.axes[2])
    for name, t in zip('xy', np.array(base.axes[:2]), strict=True):
        pairs = [(form.constant(tuple(t)), centre)]
        for k in range(3):
            u = layout.direction(joint.child, tuple(np.eye(3)[k]))
            # t · u̇_k times -R z · u_k: the matrix t zᵀ carries u_k to where it meets u̇_k
            pairs.append((u.times(-joint.value * np.outer(t, normal)), u))
        yield name, pairs


def _spin(body: str, radius: float, layout: Layout) -> Pair:
    """radius × ω in the plane."""
    d = layout.direction(body, (1.0, 0.0))
    return d.times(radius * TURN), d
