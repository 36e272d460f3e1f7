"""Joints with teeth: by how much a gear or a rack would slip between two positions.

Their rows bind velocities. In the plane these can be integrated, so that what is moved by hand
stays in mesh.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND, Joint
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import TURN, Layout


def toothed(layout: Layout) -> tuple[Joint, ...]:
    """The gears and racks of a mechanism."""
    return tuple(joint for joint in layout.mechanism.joints if joint.kind in ('gear', 'rack'))


def slips(layout: Layout, joints: Sequence[Joint], before: Floats, after: Floats) -> Floats:
    """(joints,) m, what is given by `rolling.of_gears` and `on_a_line` from q to q (blocks D).

    No angle may have changed by half a turn.
    """
    places = before.reshape(-1, 2), after.reshape(-1, 2)
    return np.array([_slip(layout, joint, *places) for joint in joints])


def _slip(layout: Layout, joint: Joint, before: Floats, after: Floats) -> float:
    base, tip = joint.frames
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
    parent, child = (_turned(layout, body, before, after) for body in (joint.parent, joint.child))
    if joint.kind == 'gear':
        R, r = joint.of_parent, joint.value
        return R * parent + r * child - (R + r) * _angle(gap.value(before), gap.value(after))
    x = layout.direction(joint.parent, base.axes[0])
    along, apart = [], []
    for q in (before, after):
        along.append(x.value(q) @ gap.value(q))
        apart.append((TURN @ x.value(q)) @ gap.value(q))
    return float(along[1] - along[0] - 0.5 * sum(apart) * parent + joint.value * child)


def _turned(layout: Layout, body: str, before: Floats, after: Floats) -> float:
    if body == GROUND:
        return 0.0
    d: Form = layout.direction(body, (1.0, 0.0))
    return _angle(d.value(before), d.value(after))


def _angle(a: Floats, b: Floats) -> float:
    """rad, from a to b."""
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
