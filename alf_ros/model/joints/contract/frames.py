"""The two frames of a joint as functions of q, of which its rows are made."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats
from alf_ros.mechanism import Joint
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.row import Row, linear, product

_ROUNDING = 1e-12  # of the largest factor of a block: a difference of factors that is none


def _largest(form: Form, blocks: int) -> Any:
    """The largest factor of the first blocks."""
    parts = (C for block, C in form.parts.items() if block < blocks)
    return columns.largest(abs(x) for C in parts for x in C.ravel().tolist())


class Frames:
    """A joint of a layout; rows get its name, and a suffix if they have one."""

    def __init__(self, joint: Joint, layout: Layout) -> None:
        self.joint, self.layout = joint, layout

    @cached_property
    def gap(self) -> Form:
        """From the parent's origin of the joint to the child's."""
        joint, layout = self.joint, self.layout
        base, tip = joint.frames
        to, start = (
            layout.place(body, frame.origin)
            for body, frame in ((joint.child, tip), (joint.parent, base))
        )
        gap, movable = to - start, self.layout.movable
        # bodies that share this place have no gap: its rounding would become rows of full size
        every = self.layout.blocks
        least = columns.largest([_largest(to, every), _largest(start, every)]) * _ROUNDING
        if _largest(gap, movable) > least:
            return gap
        still = {n: C if n >= movable else 0.0 * C for n, C in gap.parts.items()}
        return Form(still, gap.constant)

    def axis(self, side: int, n: int) -> Form:
        """The n-th axis of the frame on the parent (0) or the child (1)."""
        joint = self.joint
        body = (joint.parent, joint.child)[side]
        return self.layout.direction(body, joint.frames[side].axes[n])

    def product(self, suffix: str, f: Form, g: Form, offset: float = 0.0) -> Row:
        """f · g = offset."""
        return product(self.name(suffix), f, g, offset)

    def linear(self, suffix: str, along: Floats, f: Form) -> Row:
        """along · f = 0."""
        return linear(self.name(suffix), along, f)

    def coincident(self) -> list[Row]:
        """Both origins are one place; nothing if the bodies share it as a point."""
        if self.joint.point is not None:
            return []
        e = np.eye(self.layout.dimension)
        return [self.linear(axis, along, self.gap) for axis, along in zip('xyz', e, strict=False)]

    def parallel(self) -> list[Row]:
        """Both z axes are one direction; nothing if the bodies share it as a vector."""
        if self.joint.vector is not None:
            return []
        return [
            self.product('tilt_x', self.axis(0, 0), self.axis(1, 2)),
            self.product('tilt_y', self.axis(0, 1), self.axis(1, 2)),
        ]

    def aside(self) -> list[Row]:
        """The child's origin stays on the z axis of the parent."""
        return [
            self.product('side_x', self.axis(0, 0), self.gap),
            self.product('side_y', self.axis(0, 1), self.gap),
        ]

    def name(self, suffix: str = '') -> str:
        """Of a row."""
        return f'{self.joint.name}_{suffix}' if suffix else self.joint.name
