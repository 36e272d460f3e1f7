"""Three revolutes in a row through links without mass, near gimbal lock: why a step failed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Joint
from alf_ros.model.compile import Model

_NEAR = 0.3  # sine between the first and the last axis
_TOGETHER = 1e-9  # of the size: joints at one place
_RIGHT = 1e-3  # cosine between axes at right angles


def explained(model: Model, q: Floats) -> tuple[str, str] | None:
    """The end of a message and the remedy, if a row is near gimbal lock at q (blocks D, m)."""
    if model.layout.dimension == 2:
        return None
    places, nearest = q.reshape(-1, 3), (_NEAR, '')
    for first, middle, last in _rows(model):
        at = [
            model.layout.place(each.parent, each.frames[0].origin).value(places)
            for each in (first, middle, last)
        ]
        if np.ptp(at, axis=0).max() > _TOGETHER * model.size:
            continue
        axes = [
            model.layout.direction(each.parent, each.frames[0].axes[2]).value(places)
            for each in (first, middle, last)
        ]
        one, between, other = (axis / np.linalg.norm(axis) for axis in axes)
        if max(abs(one @ between), abs(between @ other)) > _RIGHT:
            continue  # it is no ball
        sine = float(np.linalg.norm(np.cross(one, other)))
        nearest = min(nearest, (sine, f'{first.name}, {middle.name}, {last.name}'))
    sine, names = nearest
    if not names:
        return None
    return (
        f': {names} are {np.degrees(np.arcsin(sine)):.2g} degrees from gimbal lock, and the links '
        'between have no mass',
        'put a ball in place of such a row (`spherical` with `angles`)',
    )


def _rows(model: Model) -> Iterator[tuple[Joint, Joint, Joint]]:
    """Three revolutes in a row that two bodies hold, which have no mass and no other joint."""
    at: dict[str, list[Joint]] = {}
    for joint in model.mechanism.joints:
        for side in (joint.parent, joint.child):
            at.setdefault(side, []).append(joint)
    held = {
        body.name
        for body in model.mechanism.bodies
        if not body.mass and [each.kind for each in at.get(body.name, [])] == ['revolute'] * 2
    }
    for middle in model.mechanism.joints:
        if {middle.parent, middle.child} <= held:
            first, last = (
                next(each for each in at[side] if each is not middle)
                for side in (middle.parent, middle.child)
            )
            yield first, middle, last
