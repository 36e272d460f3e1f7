"""The derivatives of a sample by a number of the scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Rows
from alf_ros.model.compile import Model
from alf_ros.simulation.input_slopes import Slopes
from alf_ros.simulation.instruments import Instruments
from alf_ros.simulation.kept import Keeper, kept
from alf_ros.simulation.named_values import NamedValues, read_only
from alf_ros.simulation.state import State


@dataclass(frozen=True)
class JointTangent:
    """Derivatives of position (rad or m) and velocity of a joint coordinate, per unit of the
    number."""

    position: float
    velocity: float


class MotionTangent(Keeper):
    """Derivatives of a sample by one number of the scene: the unit of the quantity, over the unit
    of the number. Arrays are read-only, in the world frame."""

    def __init__(
        self,
        model: Model,
        state: State,
        k: int,
        slopes: Slopes,
        quantity: Callable[[str], float | Floats],
        instruments: Instruments,
    ) -> None:
        super().__init__()
        self._model, self._state, self._slopes = model, state, slopes.arrays
        self._quantity, self._instruments = quantity, instruments
        self._dq, self._dqd = state.tangents.reshape(-1, 2, state.q.size)[k]

    def of(self, quantity: str) -> float | Floats:
        """Of a quantity by name, as of `record`: `reactions.knee.force`, `joints.knee.effort`,
        `powers.spring`, `energy`; a number, or (components,).

        Along the derivatives of q and q̇ the quantity is read in eight scenes around this one, or
        in this one and once more by an effort or a wrench from outside; the difference is off by
        about 1e-11 of the largest value. Raises InputError for a quantity
        without a derivative, and where it is not smooth.
        """
        return self._quantity(quantity)

    @kept
    def q(self) -> Floats:
        """Of the natural coordinates (n,)."""
        return self._by_coordinate(self._dq)

    @kept
    def qd(self) -> Floats:
        """Of their velocities (n,)."""
        return self._by_coordinate(self._dqd)

    def _by_coordinate(self, change: Floats) -> Floats:
        """Blocks in the kernel's order -> (n,), as `Sample.q`; the kernel has vectors in a length
        of the drawing."""
        layout, order = self._model.layout, self._model.coordinate_block
        D, points = layout.dimension, sum(not p.fixed for p in layout.mechanism.points)
        found = change.reshape(-1, D)[order]
        found[points:] /= layout.length
        return read_only(found.ravel())

    @property
    def points(self) -> Mapping[str, Floats]:
        """Of the position of each point (D,)."""
        return self._named(self._dq)

    @property
    def velocities(self) -> Mapping[str, Floats]:
        """Of the velocity of each point (D,)."""
        return self._named(self._dqd)

    def _named(self, blocks: Floats) -> Mapping[str, Floats]:
        model = self._model
        of = read_only(blocks.reshape(-1, model.layout.dimension)[model.point_block])
        return NamedValues(model.point_names, of.__getitem__)

    @property
    def joints(self) -> Mapping[str, JointTangent]:
        """Of position and velocity of each joint coordinate."""
        return NamedValues(
            self._model.coordinate_names,
            lambda n: JointTangent(
                float(self.joint_positions[n]), float(self.joint_velocities[n])
            ),
        )

    @property
    def joint_positions(self) -> Floats:
        """(joint coordinates,) of their positions."""
        return self._joints[0]

    @property
    def joint_velocities(self) -> Floats:
        """(joint coordinates,) of their velocities."""
        return self._joints[1]

    @kept
    def _joints(self) -> tuple[Floats, Floats]:
        form, rate, change, change_of_rate = self._forms(self._model.system.angles, 'angle')
        x, y, xd, yd = form[::2], form[1::2], rate[::2], rate[1::2]
        dx, dy, dxd, dyd = change[::2], change[1::2], change_of_rate[::2], change_of_rate[1::2]
        square = x * x + y * y
        spin, turned = (x * yd - y * xd) / square, (x * dy - y * dx) / square
        faster = (dx * yd + x * dyd - dy * xd - y * dxd - 2.0 * spin * (x * dx + y * dy)) / square
        _, _, longer, quicker = self._forms(self._model.lengths, 'length')
        joints = self._instruments.coordinates
        found = []
        for each in (np.concatenate([turned, longer]), np.concatenate([faster, quicker])):
            values = each[joints.place.astype(np.int64)]
            other: Integers = joints.less
            values[other >= 0] -= each[other[other >= 0]]
            found.append(read_only(values))
        return found[0], found[1]

    def _forms(self, rows: Rows, name: str) -> tuple[Floats, Floats, Floats, Floats]:
        """Quadratic forms of a joint coordinate, their rates, and the derivatives of both."""
        unit, state, slopes = self._model.unit, self._state, self._slopes
        b, c, term = (slopes[f'{name}_{part}'] for part in ('b', 'c', 'term'))
        own = replace(rows, b=b, c=c, term=term)
        bent = replace(rows, b=np.zeros_like(b), c=np.zeros_like(c))

        def values(of: Rows) -> Floats:
            found = np.zeros(of.c.size)
            kernel.violation(unit, of, state.q, found)
            return found

        def along(of: Rows, q: Floats, v: Floats) -> Floats:
            found, g2 = np.zeros(of.c.size), np.zeros(of.b.size)
            kernel.jacobian(unit, of, q, np.zeros(0), g2)
            kernel.times_jacobian(unit, of, np.zeros(0), g2, v, found)
            return found

        change = along(rows, state.q, self._dq) + values(own)
        faster = along(rows, state.q, self._dqd) + along(bent, self._dq, state.qd)
        return (
            values(rows),
            along(rows, state.q, state.qd),
            change,
            faster + along(own, state.q, state.qd),
        )
