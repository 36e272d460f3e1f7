"""Rolling: rows of velocities Σ f(q) · d/dt g(q) = 0, the speed of slip.

A spin enters as ω = J d · ḋ / |d|² in the plane, d fixed in the body, and as ω × r = Σ (r·u_k)
u̇_k in space, u_k the axes of the body: both linear in q, as rows that bind velocities must be
(38).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.mechanism import GROUND, Joint, affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import TURN, Layout
from alf_ros.model.constraints.row import Row, motion, product
from alf_ros.model.constraints.velocity_integral import IntegralTerm, planar_angle
from alf_ros.model.joints.contract.frames import Frames

Pair = tuple[Form, Form]


def on_a_line(joint: Joint, layout: Layout) -> Row:
    """d/dt (x · gap) + R (ω - ω_parent) = 0: where a wheel of radius R meets the x axis of the
    parent's frame, both have one velocity along x.

    The centre is at R from the line. A belt on a line of the ground may move: ṡ is its speed.
    """
    base, tip = joint.frames
    x = layout.direction(joint.parent, base.axes[0])
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
    pairs = [(x, gap), _spin(joint.child, joint.value, layout)]
    if joint.parent != GROUND:
        pairs += [(gap, x), _spin(joint.parent, -joint.value, layout)]
    if joint.motion:
        s = affine.of_block(layout.of_prescribed[joint.name], 2)
        pairs.append((affine.constant((-1.0, 0.0)), s))
    return motion(joint.name, *pairs)


def of_gears(joint: Joint, layout: Layout) -> Row:
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
    return motion(joint.name, *pairs)


def integral_on_a_line(frames: Frames) -> list[IntegralTerm]:
    """x · gap + R (θ_child - θ_parent): `on_a_line`, with the centre at R from the line."""
    joint = frames.joint
    along = IntegralTerm(1.0, (product('', frames.axis(0, 0), frames.gap),))
    return [along, *_turned(frames, joint.value, -joint.value)]


def integral_of_gears(frames: Frames) -> list[IntegralTerm]:
    """R θ_parent + r θ_child - (R + r) × the angle of the line of centres."""
    R, r = frames.joint.of_parent, frames.joint.value
    return [*_turned(frames, r, R), planar_angle(-(R + r), frames.gap)]


def on_a_plane(joint: Joint, layout: Layout) -> Iterator[Row]:
    """t·(v + ω × r - v_plane) = 0 for t = x, y of the plane, r = -R z."""
    normal, radius = np.array(joint.frames[0].axes[2]), joint.value
    axes = [layout.direction(joint.child, tuple(e)) for e in np.eye(3)]
    centre = layout.place(joint.child, joint.frames[1].origin)
    for k, t in enumerate(np.array(joint.frames[0].axes[:2])):
        # t · u̇_k times -R z · u_k: the matrix t zᵀ carries u_k to where it meets u̇_k
        spun = [(u.times(-radius * np.outer(t, normal)), u) for u in axes]
        name = f'{joint.name}_{"xy"[k]}'
        yield motion(
            name, (affine.constant(tuple(t)), centre), *spun, *plane(joint, layout, k, centre)
        )


def plane(joint: Joint, layout: Layout, k: int, touching: Form) -> list[Pair]:
    """-t·v_plane along the k-th axis t of the plane, at the place or above the place that touches.

    v_plane is zero, or ṡ_x x + ṡ_y y + ṡ_z z × (r - origin): a belt, a turntable.
    """
    if not joint.motion:
        return []
    base, spun = joint.frames[0], np.zeros((3, 3))
    spun[2] = -np.cross(base.axes[k], base.axes[2])  # -t · z × = -(t × z) ·
    gap = touching - layout.place(joint.parent, base.origin)
    f = gap.times(spun) + affine.constant(tuple(-np.eye(3)[k]))
    return [(f, affine.of_block(layout.of_prescribed[joint.name], 3))]


def _spin(body: str, radius: float, layout: Layout) -> Pair:
    """radius × ω in the plane."""
    d = layout.direction(body, (1.0, 0.0))
    return d.times(radius * TURN), d


def _turned(frames: Frames, child: float, parent: float) -> list[IntegralTerm]:
    """These factors (m/rad) times the angles of both bodies in the plane."""
    pairs = ((frames.joint.child, child), (frames.joint.parent, parent))
    return [
        planar_angle(factor, frames.layout.direction(body, (1.0, 0.0)))
        for body, factor in pairs
        if body != GROUND
    ]
