"""Parts of a spatial mechanism that two joints connect with the rest, such as a leg.

Such a part often fits in two ways, half a turn about the line through both joints apart: a leg
between a universal joint and a ball, the cross of which may be turned round. Noise and turns of
single bodies hardly ever lead to the second way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from alf_ros.mechanism import GROUND
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.parts import Joint
from alf_ros.model.compile import Model


@dataclass(frozen=True, eq=False)
class PartBetweenJoints:
    """The bodies of a part, their points and vectors that move with no other body, as blocks, the
    places of its two joints (m), and the axes of these on the part."""

    bodies: tuple[str, ...]
    points: tuple[int, ...]
    vectors: tuple[int, ...]
    ends: tuple[Form, Form]
    axes: tuple[Form, ...]


def parts_between_joints(model: Model) -> list[PartBetweenJoints]:
    """All parts of a model in space that two joints connect with the rest; none in the plane."""
    layout, joints = model.layout, model.mechanism.joints
    if layout.dimension == 2:
        return []
    all_points, found = {*layout.of_point.values()}, []
    for pair in combinations(joints, 2):
        for part in _parts([joint for joint in joints if joint not in pair], pair):
            own = {b for name in part for b in layout.of_body[name] if b < layout.movable}
            own -= {b for name, of in layout.of_body.items() if name not in part for b in of}
            first, last = (_end(model, joint, part) for joint in pair)
            points, vectors = sorted(own & all_points), sorted(own - all_points)
            axes = [axis for joint in pair for axis in _axis(model, joint, part)]
            bodies = [name for name in layout.of_body if name in part]
            found.append(
                PartBetweenJoints((*bodies,), (*points,), (*vectors,), (first, last), (*axes,))
            )
    return found


def _parts(kept: Sequence[Joint], cut: tuple[Joint, Joint]) -> list[set[str]]:
    """Bodies that hang together by the joints kept, off the ground, with one end of each joint
    that is cut."""
    found: list[set[str]] = []
    for start in (cut[0].parent, cut[0].child):
        part, grown = {start}, True
        while grown and GROUND not in part:
            ends = [{joint.parent, joint.child} for joint in kept]
            more = set[str]().union(*(pair for pair in ends if pair & part)) - part
            grown = bool(more)
            part |= more
        alone = all((joint.parent in part) != (joint.child in part) for joint in cut)
        if GROUND not in part and alone:
            found.append(part)
    return found


def _end(model: Model, joint: Joint, part: set[str]) -> Form:
    """The place of a joint on the body of the part (m)."""
    side = 0 if joint.parent in part else 1
    body = (joint.parent, joint.child)[side]
    return model.layout.place(body, joint.frames[side].origin)


def _axis(model: Model, joint: Joint, part: set[str]) -> list[Form]:
    """The axis of a joint on the body of the part, if it has one."""
    side = 0 if joint.parent in part else 1
    body = (joint.parent, joint.child)[side]
    axes = joint.frames[side].axes
    return [model.layout.direction(body, axes[-1])] if len(axes) else []
