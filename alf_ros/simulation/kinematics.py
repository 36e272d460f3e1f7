"""Kinematics of a sample: what follows from q and q̇ alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Rows
from alf_ros.mechanism.orientation import orientation
from alf_ros.model.compile import Model
from alf_ros.simulation.named_values import NamedValues, read_only
from alf_ros.simulation.state import State


class Kinematics:
    """Positions and velocities of points, bodies and joints, and Φ; arrays are read-only, SI,
    world frame."""

    def __init__(self, model: Model, t: float, state: State) -> None:
        self.model, self.t, self.step = model, t, state.step
        self._state = state

    @property
    def state(self) -> State:
        """The state it is a sample of."""
        return self._state

    @cached_property
    def q(self) -> Floats:
        """Natural coordinates (n,): movable points in the order of the file, m, then vectors."""
        return self._by_coordinate(self._state.q)

    @cached_property
    def qd(self) -> Floats:
        """Their velocities (n,), m/s."""
        return self._by_coordinate(self._state.qd)

    @cached_property
    def _positions(self) -> Floats:
        return self._named(self._state.q)

    @cached_property
    def _velocities(self) -> Floats:
        return self._named(self._state.qd)

    def _named(self, blocks: Floats) -> Floats:
        """Blocks in the kernel's order -> (points, D) in the order of point_names."""
        return read_only(blocks.reshape(-1, self.model.layout.dimension)[self.model.point_block])

    def _by_coordinate(self, blocks: Floats) -> Floats:
        """Blocks in the kernel's order -> (n,): points in m, unit vectors without unit."""
        layout = self.model.layout
        values = blocks.reshape(-1, layout.dimension)[self.model.coordinate_block]
        values[sum(not point.fixed for point in layout.mechanism.points) :] /= layout.length
        return read_only(values.ravel())

    @property
    def points(self) -> Mapping[str, Floats]:
        """Position of each point (D,), m."""
        return NamedValues(self.model.point_names, self._positions.__getitem__)

    @property
    def velocities(self) -> Mapping[str, Floats]:
        """Velocity of each point (D,), m/s."""
        return NamedValues(self.model.point_names, self._velocities.__getitem__)

    @cached_property
    def _angle_parts(self) -> tuple[Floats, Floats]:
        """(angles, 2) x and y of each angle that is counted, and their rates."""
        rows = self.model.system.angles
        values, rates = self._values(rows)
        return values.reshape(-1, 2), rates.reshape(-1, 2)

    def _values(self, rows: Rows) -> tuple[Floats, Floats]:
        """Values and rates of quadratic rows that are no constraints."""
        unit, state = self.model.unit, self._state
        values, rates, g2 = np.zeros(rows.c.size), np.zeros(rows.c.size), np.zeros(rows.b.size)
        kernel.violation(unit, rows, state.q, values)
        kernel.jacobian(unit, rows, state.q, g2[:0], g2)
        kernel.times_jacobian(unit, rows, g2[:0], g2, state.qd, rates)
        return values, rates

    @cached_property
    def _angles(self) -> Floats:
        xy, _ = self._angle_parts
        # adding zero makes -0.0 positive, so that atan2 agrees with the count of turns
        return np.arctan2(xy[:, 1] + 0.0, xy[:, 0]) + 2.0 * np.pi * self._state.turns

    @cached_property
    def _near(self) -> Floats:
        """(angles,) rad: what effects unwrap angles by."""
        near = np.zeros(self._state.turns.size)
        kernel.nearby(self._angle_parts[0].ravel(), self._state.turns, near)
        return near

    @cached_property
    def _spins(self) -> Floats:
        (x, y), (xd, yd) = (part.T for part in self._angle_parts)
        return (x * yd - y * xd) / (x * x + y * y)

    @cached_property
    def body_poses(self) -> Floats:
        """Frame of each body: in the plane (bodies, 3) x, y (m), angle of the x axis (rad, turns
        counted); in space (bodies, 7) x, y, z (m), quaternion x, y, z, w.

        A body without orientation has that of the world, a rod its x axis and no turn about it.
        """
        layout, q = self.model.layout, self._state.q.reshape(-1, self.model.layout.dimension)
        origins = q[[layout.of_body[name][0] for name in self.model.body_names]]
        if layout.dimension == 2:
            return read_only(np.column_stack([origins, self._angles]))
        turns = [orientation(layout, name, q) for name in self.model.body_names]
        return read_only(np.column_stack([origins, np.array(turns).reshape(-1, 4)]))

    @cached_property
    def _lengths(self) -> tuple[Floats, Floats]:
        return self._values(self.model.lengths)

    @cached_property
    def joint_positions(self) -> Floats:
        """(joint coordinates,) rad: child from parent, turns counted; or m along the axis."""
        return self._joint_values(self._angles, self._lengths[0])

    @cached_property
    def joint_velocities(self) -> Floats:
        """(joint coordinates,) rad/s or m/s."""
        return self._joint_values(self._spins, self._lengths[1])

    def _joint_values(self, angles: Floats, lengths: Floats) -> Floats:
        values = np.zeros(len(self.model.coordinates))
        for n, coordinate in enumerate(self.model.coordinates):
            values[n] = (angles if coordinate.is_angle else lengths)[coordinate.place]
            if coordinate.less >= 0:
                values[n] -= angles[coordinate.less]
        return read_only(values)

    @property
    def _scale(self) -> Floats:
        """(rows,) what turns Φ into metres."""
        return self.model.system.rows.scale[self.model.row]

    @cached_property
    def phi(self) -> Floats:
        """(rows,) Φ."""
        model, phi = self.model, np.zeros(len(self.model.row_names))
        kernel.violation(model.unit, model.system.rows, self._state.q, phi)
        return read_only(phi[model.row])
