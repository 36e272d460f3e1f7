"""`disk`: a thin disk that rolls on a plane and may lean.

Its lowest point is C + R e, e the unit vector across the axle a that goes down steepest: in the
plane of a and the normal z. As rows are of second order, e is a block without mass, and so are its
components c_k = e·u_k in the disk: the material point at e moves with Ċ + R Σ c_k u̇_k.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND, Joint, affine
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.row import Row, linear, motion, plus, product, scaled
from alf_ros.model.joints.contract import (
    AT,
    ON,
    RADIUS,
    Frames,
    Given,
    JointType,
    Key,
    Pen,
    wheels,
)
from alf_ros.model.joints.contract.rolling import plane


def _read(given: Given) -> Joint:
    point, on, radius = wheels.rolls_on(given)
    axle, _ = given.direction('axle')
    if np.linalg.norm(np.cross(axle, on.along)) < 1e-6:
        raise given.error('axle', 'the disk lies flat: no point of it is lowest')
    return given.joint(
        given.frame_at(GROUND, on.through, given.axes(on.along)),
        given.frame(given.child, point, given.axes(axle)),
        value=radius,
        motion=on.motion,
        auxiliary=('.down', '.arm'),
    )


def _rows(joint: Joint, layout: Layout) -> Iterator[Row]:
    """Rows that define e and c, keep the lowest point on the plane, and prevent slip."""
    (base, tip), R, name = joint.frames, joint.value, joint.name
    length, z = layout.length, np.array(base.axes[2])
    e, c = (
        affine.of_block(layout.of_auxiliary[f'{name}.{which}'], 3).times(1.0 / length)
        for which in ('down', 'arm')
    )
    axle = layout.direction(joint.child, tip.axes[2])
    axes = [layout.direction(joint.child, tuple(u)) for u in np.eye(3)]
    centre = layout.place(joint.child, tip.origin)
    lowest = centre + e.times(R)
    yield scaled(0.5 * length, product(f'{name}_down_unit', e, e, 1.0))
    yield product(f'{name}_down_across', e, axle)
    yield product(f'{name}_down_steepest', e, axle.times(np.cross(z, np.eye(3)).T))
    for which, along, u in zip('xyz', np.eye(3), axes, strict=True):
        less = scaled(-1.0, product('', e, u))
        yield plus(f'{name}_arm_{which}', linear('', along, c), less)
    yield linear(f'{name}_touch', z, lowest - layout.place(joint.parent, base.origin))
    for k, t in enumerate(np.array(base.axes[:2])):
        spun = [(c.times(R * np.outer(t, d)), u) for d, u in zip(np.eye(3), axes, strict=True)]
        moving = (affine.constant(tuple(t)), centre), *spun, *plane(joint, layout, k, lowest)
        yield motion(f'{name}_{"xy"[k]}', *moving)


def _block(joint: Joint, suffix: str, layout: Layout, places: Floats) -> Floats:
    """e as `.down`, c as `.arm`, both as long as the drawing."""
    frames = Frames(joint, layout)
    axle, z = frames.axis(1, 2).value(places), frames.axis(0, 2).value(places)
    down = (z @ axle) * axle - z
    size = float(np.linalg.norm(down))
    down = layout.length / size * down if size > 0.0 else down
    if suffix == '.down':
        return np.asarray(down)
    axes = (layout.direction(joint.child, tuple(e)) for e in np.eye(3))
    return np.array([down @ u.value(places) for u in axes])


def _draw(pen: Pen) -> None:
    pen.wheel(pen.own[2], leans=True)


SPATIAL = JointType(
    keys=(AT, Key('axle', 'axis', 'direction across the disk: numbers, or a vector'), ON, RADIUS),
    read=_read,
    rows=lambda frames: list(_rows(frames.joint, frames.layout)),
    draw=_draw,
    listed=210,
    on_ground=True,
    is_round=True,
    block=_block,
)
