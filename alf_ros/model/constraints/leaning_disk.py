"""A thin disk that rolls on a plane and may lean.

Its lowest point is C + R e, e the unit vector across the axle a that goes down steepest: in the
plane of a and the normal z. As rows are of second order, e is a block without mass, and so are its
components c_k = e·u_k in the disk: the material point at e moves with Ċ + R Σ c_k u̇_k.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.mechanism import Joint, affine
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.rolling import plane
from alf_ros.model.constraints.row import Row, linear, motion, plus, product, scaled


def disk_rows(joint: Joint, layout: Layout) -> Iterator[Row]:
    """What e and c are, that the lowest point touches, and that it does not slip."""
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
