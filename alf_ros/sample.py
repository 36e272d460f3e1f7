"""Sample: one instant of a run. Every quantity is computed when it is first read, then kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.applied import Applied
from alf_ros.arrays import Floats
from alf_ros.errors import StepError
from alf_ros.kernel import Work
from alf_ros.mechanism import GROUND
from alf_ros.model import Model, allocate
from alf_ros.rank import effective_rank
from alf_ros.scene import Solver

if TYPE_CHECKING:
    from alf_ros.simulation import State

T = TypeVar('T')


@dataclass(frozen=True)
class JointState:
    """position (rad, or m along a slider), velocity, effort (N m or N) on the free axis."""

    position: float
    velocity: float
    effort: float


@dataclass(frozen=True)
class Reaction:
    """What the parent exerts on the child at the joint, world frame: force (2,) N, torque N m.

    `indeterminate` says that the constraints are redundant here, and that the share of this joint
    is one of many that balance (the one of least norm).
    """

    force: Floats
    torque: float
    indeterminate: bool


class _ByName(Mapping[str, T], Generic[T]):
    """Values by name, made when asked for."""

    def __init__(self, names: Sequence[str], value: Callable[[int], T]) -> None:
        self._names, self._value = {name: n for n, name in enumerate(names)}, value

    def __getitem__(self, name: str) -> T:
        return self._value(self._names[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Diagnostics:
    """The health of a sample: violations, iterations, rank, cost."""

    def __init__(self, sample: Sample, iterations: int, step_cost: float) -> None:
        self._sample = sample
        self.iterations = iterations  # most in one solve of the last call
        self.step_cost = step_cost  # s of wall time per step of the last call

    @cached_property
    def position_violation(self) -> float:
        """Largest distance by which a constraint is open, m."""
        return float(np.max(np.abs(self._sample.phi) * self._sample._scale, initial=0.0))

    @cached_property
    def velocity_violation(self) -> float:
        """Largest speed at which a constraint opens, m/s."""
        return float(np.max(np.abs(self._sample.phi_dot) * self._sample._scale, initial=0.0))

    @cached_property
    def rank(self) -> int:
        """Rank of Φ_q, from the factor of A."""
        return round(effective_rank(self._sample.model, self._sample._linearised))

    @property
    def redundant(self) -> int:
        """Number of constraint rows that depend on the others here."""
        return len(self._sample.model.row_names) - self.rank

    @cached_property
    def singular(self) -> bool:
        """Whether the rank is lower here than at ordinary positions."""
        return self.redundant > self._sample._dependent_rows()


class Sample:
    """State, forces and health at one instant; arrays are read-only, SI, world frame."""

    def __init__(
        self,
        model: Model,
        applied: Applied,
        solver: Solver,
        t: float,
        state: State,
        dependent_rows: Callable[[], int],
        iterations: int,
        step_cost: float,
    ) -> None:
        self.model, self.t, self.step = model, t, state.step
        self._applied, self._solver, self._state = applied, solver, state
        self._dependent_rows = dependent_rows
        self.diagnostics = Diagnostics(self, iterations, step_cost)

    # ----------------------------------------------------------------------------------- motion

    @cached_property
    def q(self) -> Floats:
        """Natural coordinates (n,), m: movable points in the order of the file."""
        return _read_only(self._positions[: self.model.layout.movable].ravel())

    @cached_property
    def qd(self) -> Floats:
        """Their velocities (n,), m/s."""
        return _read_only(self._velocities[: self.model.layout.movable].ravel())

    @cached_property
    def qdd(self) -> Floats:
        """Their accelerations (n,), m/s^2."""
        qdd = self._named(self._accelerated.qdd)
        return _read_only(qdd[: self.model.layout.movable].ravel())

    @cached_property
    def _positions(self) -> Floats:
        return self._named(self._state.q)

    @cached_property
    def _velocities(self) -> Floats:
        return self._named(self._state.qd)

    def _named(self, blocks: Floats) -> Floats:
        """Blocks in the kernel's order -> (points, D) in the order of point_names."""
        return _read_only(blocks.reshape(-1, self.model.layout.dimension)[self.model.point_block])

    @property
    def points(self) -> Mapping[str, Floats]:
        """Position of each point (D,), m."""
        return _ByName(self.model.point_names, self._positions.__getitem__)

    @property
    def velocities(self) -> Mapping[str, Floats]:
        """Velocity of each point (D,), m/s."""
        return _ByName(self.model.point_names, self._velocities.__getitem__)

    @cached_property
    def energy(self) -> float:
        """Total mechanical energy, J: kinetic, and the potential of the effects that have one."""
        model, state = self.model, self._state
        momenta = np.zeros(model.n)
        kernel.add_mass_times(model.unit, model.system.mass, 1.0, state.qd, momenta)
        kinetic = 0.5 * float(momenta @ state.qd[: model.n])
        return kinetic + kernel.potential_energy(self._applied.assembled, self.t, state.q)

    # ----------------------------------------------------------------------------------- bodies

    @cached_property
    def _axes(self) -> tuple[Floats, Floats]:
        """x axis of each body (bodies, 2), m, and its rate, m/s; zero for bodies of one point."""
        i, j = self.model.system.axes.T
        q, qd = self._state.q.reshape(-1, 2), self._state.qd.reshape(-1, 2)
        return q[j] - q[i], qd[j] - qd[i]

    @cached_property
    def _angles(self) -> Floats:
        d, _ = self._axes
        # adding zero makes -0.0 positive, so that atan2 agrees with the count of turns
        return np.arctan2(d[:, 1] + 0.0, d[:, 0]) + 2.0 * np.pi * self._state.turns

    @cached_property
    def _spins(self) -> Floats:
        d, dd = self._axes
        d2 = (d**2).sum(axis=1)
        return (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / np.where(d2 > 0.0, d2, 1.0)

    @cached_property
    def body_poses(self) -> Floats:
        """(bodies, 3): x, y (m) of the first point, angle of the x axis (rad, turns counted)."""
        origin = self._state.q.reshape(-1, 2)[self.model.system.axes[:, 0]]
        return _read_only(np.column_stack([origin, self._angles]))

    # ----------------------------------------------------------------------------------- joints

    @cached_property
    def joint_positions(self) -> Floats:
        """(joints,) rad: child's x axis from the parent's, turns counted; or m along a slider."""
        return self._joint_values(self._angles, self._positions, 1.0)

    @cached_property
    def joint_velocities(self) -> Floats:
        """(joints,) rad/s or m/s."""
        return self._joint_values(self._spins, self._velocities, 0.0)

    def _joint_values(self, of_bodies: Floats, of_points: Floats, offset: float) -> Floats:
        body = {name: n for n, name in enumerate(self.model.body_names)}
        point = {name: n for n, name in enumerate(self.model.point_names)}
        values = np.zeros(len(self.model.joint_names))
        for n, joint in enumerate(self.model.mechanism.joints):
            if joint.direction is not None and joint.through is not None:
                place = of_points[point[joint.point]] - offset * np.array(joint.through)
                values[n] = place @ np.array(joint.direction)
            else:
                values[n] = of_bodies[body[joint.child]]
                if joint.parent != GROUND:
                    values[n] -= of_bodies[body[joint.parent]]
        return _read_only(values)

    @cached_property
    def joint_efforts(self) -> Floats:
        """(joints,) what acts on the free axis, N m or N; not the reaction."""
        efforts = self._applied.inputs.efforts
        return _read_only(np.array([efforts.get(name, 0.0) for name in self.model.joint_names]))

    @property
    def joints(self) -> Mapping[str, JointState]:
        """Position, velocity and effort of each joint."""
        return _ByName(
            self.model.joint_names,
            lambda n: JointState(
                float(self.joint_positions[n]),
                float(self.joint_velocities[n]),
                float(self.joint_efforts[n]),
            ),
        )

    # ------------------------------------------------------------------------------ constraints

    @cached_property
    def _linearised(self) -> Work:
        """Φ_q and the factor of A at this instant, in a workspace of its own."""
        work = allocate(self.model, self.model.system, 0)
        work.q[:] = self._state.q
        work.qd[:] = self._state.qd
        if not kernel.linearise(self.model.unit, self.model.system, work, work.q):
            raise StepError('the leading matrix is not positive definite', 'see step()', self.t)
        return work

    @cached_property
    def _accelerated(self) -> Work:
        work = self._linearised
        kernel.accelerate(
            self.model.unit,
            self.model.system,
            self._applied.assembled,
            work,
            self.t,
            self._solver.iterations,
            True,
        )
        return work

    @property
    def _scale(self) -> Floats:
        """(rows,) what turns Φ into metres."""
        return self.model.system.rows.scale[self.model.row]

    @cached_property
    def phi(self) -> Floats:
        """(rows,) Φ."""
        model, phi = self.model, np.zeros(len(self.model.row_names))
        kernel.violation(model.unit, model.system.rows, self._state.q, phi)
        return _read_only(phi[model.row])

    @cached_property
    def phi_dot(self) -> Floats:
        """(rows,) Φ_q q̇."""
        model, work, rate = self.model, self._linearised, np.zeros(len(self.model.row_names))
        kernel.times_jacobian(model.unit, model.system.rows, work.g, work.g2, work.qd, rate)
        return _read_only(rate[model.row])

    @cached_property
    def lam(self) -> Floats:
        """(rows,) multipliers λ from a cold solve: M q̈ + Φ_qᵀ λ = Q."""
        return _read_only(self._accelerated.y[self.model.row])

    @property
    def multipliers(self) -> Mapping[str, float]:
        """λ of each constraint row by name."""
        return _ByName(self.model.row_names, lambda n: float(self.lam[n]))

    # -------------------------------------------------------------------------------- reactions

    @cached_property
    def reaction_forces(self) -> Floats:
        """(joints, D) N: parent on child at the joint, world frame.

        Each body alone needs M q̈ + Φ_qᵀ λ - Q at its points; a joint carries the sum over the
        bodies on the child's side of its pin.
        """
        model, unit, system = self.model, self.model.unit, self.model.cut_system
        q, qd, qdd = (
            self._on_cut_blocks(array)
            for array in (self._state.q, self._state.qd, self._accelerated.qdd)
        )
        needed, Q = np.zeros(q.size), np.zeros(q.size)
        g, g2 = self._cut_jacobian
        kernel.add_mass_times(unit, system.mass, 1.0, qdd, needed)
        kernel.add_transposed(unit, system.rows, g, g2, self._accelerated.y[model.cut_row], needed)
        kernel.applied_forces(self._applied.cut, self.t, q, qd, Q)
        return _read_only(model.reaction @ (needed - Q).reshape(-1, model.layout.dimension))

    def _on_cut_blocks(self, blocks: Floats) -> Floats:
        return blocks.reshape(-1, self.model.layout.dimension)[self.model.cut_source].ravel()

    @cached_property
    def _cut_jacobian(self) -> tuple[Floats, Floats]:
        """Φ_q of the bodies' own rows on the cut blocks: distance rows, entries of the others."""
        rows, D = self.model.cut_system.rows, self.model.layout.dimension
        g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
        kernel.jacobian(self.model.unit, rows, self._on_cut_blocks(self._state.q), g, g2)
        return g, g2

    @cached_property
    def reaction_torques(self) -> Floats:
        """(joints,) N m: parent on child; pins and sliders carry none."""
        return _read_only(np.zeros(len(self.model.joint_names)))

    @property
    def reactions(self) -> Mapping[str, Reaction]:
        """Force and torque of parent on child in each joint."""
        return _ByName(
            self.model.joint_names,
            lambda n: Reaction(
                self.reaction_forces[n],
                float(self.reaction_torques[n]),
                bool(self._indeterminate[n]),
            ),
        )

    @cached_property
    def _indeterminate(self) -> NDArray[np.bool_]:
        """(joints,) whether λ may change without a change of motion and yet change the reaction.

        A component of a reaction is w·λ. It is unique if w lies in the range of Φ_q, that is if
        the projector Φ_q A⁻¹ Φ_qᵀ α leaves it as it is.
        """
        model, unit, D = self.model, self.model.unit, self.model.layout.dimension
        flags = np.zeros(len(model.joint_names), dtype=bool)
        if not self.diagnostics.redundant:
            return flags
        g, g2 = self._cut_jacobian
        work, rows = self._linearised, model.system.rows
        x, back = np.zeros(model.q.size), np.zeros(rows.alpha.size)
        w, w_cut = np.zeros(rows.alpha.size), np.zeros(model.cut_row.size)
        for n in range(flags.size):
            for axis in range(D):
                v = np.zeros((model.cut.blocks, D))
                v[:, axis] = model.reaction[[n]].toarray()[0]
                kernel.times_jacobian(unit, model.cut_system.rows, g, g2, v.ravel(), w_cut)
                w[:] = 0.0
                w[model.cut_row] = w_cut
                x[:] = 0.0
                kernel.add_transposed(unit, rows, work.g, work.g2, rows.alpha * w, x)
                kernel.solve(unit, model.system.pattern, work.diagonal, work.off, x)
                x[model.n :] = 0.0
                kernel.times_jacobian(unit, rows, work.g, work.g2, x, back)
                left = np.sqrt((rows.alpha * (w - back) ** 2).sum())
                flags[n] |= left > 1e-3 * np.sqrt((rows.alpha * w**2).sum())
        return flags


def _read_only(array: Floats) -> Floats:
    array.flags.writeable = False
    return array
