"""Bodies in space that have an orientation get the directions to carry it.

Three independent directions, to points or along vectors, carry a body that can turn in every way.
A slender rod and a point mass need none besides their points, as long as no joint holds on to an
axis of theirs. What a body lacks is added as unit vectors along the axes of its frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats
from alf_ros.mechanism import Body, Joint, Vector
from alf_ros.mechanism.natural_coordinates import independent
from alf_ros.model.joints import type_of
from alf_ros.scene.mechanism_file.bodies import Pose
from alf_ros.scene.text.yaml_document import Entry

_APART = 0.1  # sine of the least angle at which directions carry a body well


def orient(
    bodies: dict[str, Body],
    vectors: dict[str, Vector],
    poses: dict[str, Pose],
    joints: Iterable[Joint],
    entries: dict[str, Entry],
) -> None:
    """Add vectors `<body>_x`, `_y`, `_z` where they are needed. Raises InputError."""
    holding = (joint for joint in joints if type_of(joint).holds_axis or joint.angles)
    held = {name for joint in holding for name in _both(joint)}
    for name, body in list(bodies.items()):
        directions = [np.array(each) for each in (*body.local[1:], *body.axes)]
        rank = len(independent(directions, 3))
        chosen = [directions[k] for k in independent(directions, 3, _APART)]
        if len(chosen) == 3 or (rank <= 1 and name not in held and not _turns(body)):
            continue
        added: list[tuple[str, Floats]] = []
        # the frame has x along the first direction and y in the plane of the next
        for axis, e in zip('zyx', np.eye(3)[::-1], strict=True):
            more = [*chosen, e]
            if len(chosen) < 3 and len(independent(more, 3, _APART)) == len(more):
                chosen = more
                added.append((f'{name}_{axis}', e))
        for vector, e in added:
            if vector in entries:
                message = f'{name!r} needs a vector of this name for its orientation: rename it'
                raise entries[vector].error(message, value=vector)
            along = columns.dot(np.array(poses[name].axes).T, e)
            vectors[vector] = Vector(vector, tuple(map(columns.real, along)))
            entries[vector] = entries[name]
            body = replace(
                body,
                vectors=(*body.vectors, vector),
                axes=(*body.axes, tuple(map(float, e))),
            )
        bodies[name] = body


def _both(joint: Joint) -> tuple[str, str]:
    return joint.parent, joint.child


def _turns(body: Body) -> bool:
    """Whether it has inertia about the axis of its points, or axes of its own."""
    moments = np.array(body.inertia)
    return bool(moments[0].any() or body.axes or np.any(np.array(body.com)[1:]))
