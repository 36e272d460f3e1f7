"""Kinematics of a sample: values that depend on q and q̇ alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.mechanism.orientation import orientation
from alf_ros.model.compile import Model, allocate
from alf_ros.simulation.instruments import Instruments
from alf_ros.simulation.kept import Keeper, kept
from alf_ros.simulation.named_values import NamedValues, read_only
from alf_ros.simulation.state import State


class Kinematics(Keeper):
    """Positions and velocities of points, bodies and joints, and Φ; arrays are read-only, SI,
    world frame."""

    def __init__(self, model: Model, t: float, state: State, instruments: Instruments) -> None:
        super().__init__()
        self.model, self.t, self.step = model, t, state.step
        self._state, self._instruments = state, instruments

    @property
    def state(self) -> State:
        """The state it is a sample of."""
        return self._state

    @kept
    def q(self) -> Floats:
        """Natural coordinates (n,): movable points in the order of the file, m, then vectors."""
        return self._by_coordinate(self._state.q)

    @kept
    def qd(self) -> Floats:
        """Their velocities (n,), m/s."""
        return self._by_coordinate(self._state.qd)

    @kept
    def _positions(self) -> Floats:
        return self._named(self._state.q)

    @kept
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

    @kept
    def _counted(self) -> tuple[Floats, Floats, Floats]:
        """(angles,) of each angle that is counted: with its turns (rad), its rate (rad/s), and to
        a quarter turn."""
        unit, rows, state = self.model.unit, self.model.system.angles, self._state
        angles, spins, near = np.zeros((3, state.turns.size))
        kernel.counted_angles(unit, rows, state.q, state.qd, state.turns, angles, spins, near)
        return angles, spins, near

    @property
    def _angles(self) -> Floats:
        return self._counted[0]

    @property
    def _spins(self) -> Floats:
        return self._counted[1]

    @property
    def _near(self) -> Floats:
        """(angles,) rad: what effects unwrap angles by."""
        return self._counted[2]

    @kept
    def body_poses(self) -> Floats:
        """Frame of each body: in the plane (bodies, 3) x, y (m), angle of the x axis (rad, turns
        counted); in space (bodies, 7) x, y, z (m), quaternion x, y, z, w.

        A body without orientation has the orientation of the world, a rod its x axis without a
        turn about it.
        """
        layout, q = self.model.layout, self._state.q.reshape(-1, self.model.layout.dimension)
        origins = q[[layout.of_body[name][0] for name in self.model.body_names]]
        if layout.dimension == 2:
            return read_only(np.column_stack([origins, self._angles[: len(origins)]]))
        turns = [orientation(layout, name, q) for name in self.model.body_names]
        return read_only(np.column_stack([origins, np.array(turns).reshape(-1, 4)]))

    @kept
    def _joint_coordinates(self) -> tuple[Floats, Floats]:
        joints, state = self._instruments.coordinates, self._state
        values, rates = np.empty((2, joints.place.size))
        angles, spins, _ = self._counted
        kernel.joint_coordinates(
            self.model.unit, joints, state.q, state.qd, angles, spins, values, rates
        )
        return read_only(values), read_only(rates)

    @property
    def joint_positions(self) -> Floats:
        """(joint coordinates,) rad: child from parent, turns counted; or m along the axis."""
        return self._joint_coordinates[0]

    @property
    def joint_velocities(self) -> Floats:
        """(joint coordinates,) rad/s or m/s."""
        return self._joint_coordinates[1]

    @kept
    def angles_of_balls(self) -> tuple[Floats, Floats]:
        """(3 balls,) rad and rad/s, in the order of `ball_angles`."""
        balls, unit, state = self._instruments.balls, self.model.unit, self._state
        angles, rates = np.empty((2, 3 * balls.tilt.size))
        kernel.ball_angles(unit, balls, state.q, state.qd, np.uint64(0), angles, rates)
        return read_only(angles), read_only(rates)

    @property
    def ball_angles(self) -> Mapping[str, tuple[float, float]]:
        """Angle (rad) and rate (rad/s) by name, of balls that stand for three revolutes in a row
        (`angles` of `spherical`).

        The middle angle stays within a half turn, the others within a turn. In gimbal lock, where
        the first and the last axis align, their rates are not a number.
        """
        angles, rates = self.angles_of_balls
        names = self.model.mechanism.ball_angles
        return NamedValues(names, lambda n: (float(angles[n]), float(rates[n])))

    @property
    def _scale(self) -> Floats:
        """(rows,) what turns Φ into metres."""
        return self.model.system.rows.scale[self.model.row]

    @kept
    def phi(self) -> Floats:
        """(rows,) Φ; of gears, racks, threads, wheels on a line and couplings the slip, m."""
        model, state, phi = self.model, self._state, np.zeros(len(self.model.row_names))
        kernel.violation(model.unit, model.system.rows, state.q, phi)
        if state.sums.size:
            work = allocate(model, model.system, 0)
            kernel.slips(model.unit, model.system, work, state.q, state.turns, state.sums, phi)
        return read_only(phi[model.row])
