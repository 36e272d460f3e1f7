"""The free axes of joints on which effects act, as the kernel wants them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from alf_ros.kernel import Axes
from alf_ros.mechanism import Coordinate
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.packing import forms_of, indices


def axes_of(coordinates: Sequence[Coordinate], effects: Mapping[str, int], cut: Layout) -> Axes:
    """Of the coordinates that `effects` names, in its order, each with how many effects it has."""
    D = cut.dimension
    number = {coordinate.name: n for n, coordinate in enumerate(coordinates)}
    chosen = [coordinates[number[name]] for name in effects]
    own = [cut.of_body[each.joint.child] for each in chosen]
    points = [len(cut.body[each.joint.child].points) for each in chosen]
    weights = [
        float(n < k) for k, blocks in zip(points, own, strict=True) for n in range(len(blocks))
    ]
    return Axes(
        coordinate=indices(number[name] for name in effects),
        is_angle=indices(each.is_angle for each in chosen),
        first_effect=indices(np.cumsum([0, *effects.values()])),
        first=indices(np.cumsum([0, *map(len, own)])),
        block=indices(block for blocks in own for block in blocks),
        is_point=np.array(weights, dtype=float),
        directions=forms_of([_direction(each, cut) for each in chosen], D),
        origins=forms_of(
            [cut.place(each.joint.child, each.joint.frames[1].origin) for each in chosen], D
        ),
    )


def _direction(coordinate: Coordinate, cut: Layout) -> Form:
    """The axis of a joint coordinate; of an angle in the plane nothing."""
    D, joint = cut.dimension, coordinate.joint
    base, tip = joint.frames
    if coordinate.is_angle and D == 2:
        return Form({}, np.zeros(2))
    if coordinate.is_angle and coordinate.freedom.on_child:
        return cut.direction(joint.child, tip.axes[0])
    return cut.direction(joint.parent, base.axes[0 if D == 2 else 2])
