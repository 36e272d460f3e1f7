"""Sample: one instant of a run. Every quantity is computed when it is first read, then kept."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError, StepError
from alf_ros.kernel import Phase, Rows, Work
from alf_ros.mechanism.orientation import orientation
from alf_ros.model.compile import Model, allocate
from alf_ros.model.constraints.drives import effort
from alf_ros.model.prescribed import prescribe
from alf_ros.model.rank import effective_rank
from alf_ros.model.softest_modes import found
from alf_ros.scene.scene import Solver
from alf_ros.simulation.applied import Applied, Inputs, Part
from alf_ros.simulation.joint_efforts import unit_motion
from alf_ros.simulation.reactions import Reactions
from alf_ros.simulation.resolution import Resolution
from alf_ros.simulation.sample_limits import Limits, Place, limits
from alf_ros.simulation.state import State

# distances to a singular position: from which down efforts of drives are limits, and a pole hides
# what it is in rounding
_DOUBTFUL, _BLIND = 5e-3, 1e-6

T = TypeVar('T')
_FEW = 300  # coordinates for which eigenvalues are found in no time


@dataclass(frozen=True)
class JointState:
    """position (rad, or m along a slider), velocity, effort (N m or N) on the free axis."""

    position: float
    velocity: float
    effort: float


@dataclass(frozen=True)
class Reaction:
    """What the parent exerts on the child at the joint, world frame: force (D,) N; torque N m, in
    the plane a number, about +z, in space (3,).

    `indeterminate` says that the constraints are redundant here, and that the share of this joint
    is one of many that balance (the one of least norm); or that it is sampled in a singular
    position where the reaction has a pole: components that have no limit are NaN.
    """

    force: Floats
    torque: float | Floats
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

    def __init__(
        self, sample: Sample, iterations: int, step_cost: float, resolution: Resolution
    ) -> None:
        self._sample = sample
        self.iterations = iterations  # most in one solve of the last call
        self.step_cost = step_cost  # s of wall time per step of the last call
        self.resolution = resolution  # of the motion by the steps so far

    @cached_property
    def adequate_step(self) -> float:
        """A step (s) that would do: that of the run if it does, NaN where nothing is measured.

        Where effects chatter beyond the stability limit it is half of their limit at this instant.
        """
        found = self.resolution
        if found.chatters and self._sample.model.n <= _FEW:
            from alf_ros.simulation.stiffness import stiffest  # seldom needed

            _, mode = stiffest([self._sample])
            limit = mode.step(self._sample._solver.integrator)
            if limit < found.step:
                return found.within(0.5 * limit)
        return found.adequate

    @property
    def trouble(self) -> str:
        """That the steps are too long, and which would do; empty if they are not."""
        return self.resolution.trouble(self.adequate_step)

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
        return round(self._effective_rank)

    @cached_property
    def _effective_rank(self) -> float:
        return effective_rank(self._sample.model, self._sample._linearised)

    @property
    def redundant(self) -> int:
        """Number of constraint rows that depend on the others here."""
        return len(self._sample.model.row_names) - self.rank

    @property
    def distance(self) -> float:
        """Distance to a singular position: the least singular value σ of the scaled Φ_q among rows
        that are independent at ordinary positions nearby; 1 without any."""
        return self._softest[0]

    @property
    def distance_error(self) -> float:
        """By how much it may be off, by rounding and by what is left of the iteration for it."""
        return self._softest[1]

    @cached_property
    def _softest(self) -> tuple[float, float]:
        sample = self._sample
        modes = found(sample.model, sample._linearised, sample._dependent_rows())
        return (float(modes.sigma[0]), float(modes.error[0])) if modes else (1.0, 0.0)

    @property
    def distance_if_known(self) -> float:
        """The same, where reactions or multipliers were asked for; else infinite: alone it costs
        more than a small mechanism's step."""
        return self.distance if '_linearised' in vars(self._sample) else math.inf

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
        reactions: Callable[[], Reactions],
        iterations: int,
        step_cost: float,
        beside: bool | None,
        resolution: Resolution,
    ) -> None:
        """`beside`: whether the step that ended here was interpolated beside a singular position;
        None if no step did."""
        self.model, self.t, self.step = model, t, state.step
        self._beside = beside
        self._applied, self._solver, self._state = applied, solver, state
        self._dependent_rows, self._reactions = dependent_rows, reactions
        self.diagnostics = Diagnostics(self, iterations, step_cost, resolution)

    # ----------------------------------------------------------------------------------- motion

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
    def qdd(self) -> Floats:
        """Their accelerations (n,), m/s^2."""
        return self._by_coordinate(self._read(lambda place: place.work.qdd))

    @cached_property
    def _positions(self) -> Floats:
        return self._named(self._state.q)

    @cached_property
    def _velocities(self) -> Floats:
        return self._named(self._state.qd)

    def _named(self, blocks: Floats) -> Floats:
        """Blocks in the kernel's order -> (points, D) in the order of point_names."""
        return _read_only(blocks.reshape(-1, self.model.layout.dimension)[self.model.point_block])

    def _by_coordinate(self, blocks: Floats) -> Floats:
        """Blocks in the kernel's order -> (n,): points in m, unit vectors without unit."""
        layout = self.model.layout
        values = blocks.reshape(-1, layout.dimension)[self.model.coordinate_block]
        values[sum(not point.fixed for point in layout.mechanism.points) :] /= layout.length
        return _read_only(values.ravel())

    @property
    def points(self) -> Mapping[str, Floats]:
        """Position of each point (D,), m."""
        return _ByName(self.model.point_names, self._positions.__getitem__)

    @property
    def velocities(self) -> Mapping[str, Floats]:
        """Velocity of each point (D,), m/s."""
        return _ByName(self.model.point_names, self._velocities.__getitem__)

    @property
    def inputs(self) -> Inputs:
        """The wrenches and efforts held."""
        return self._applied.inputs

    @cached_property
    def energy(self) -> float:
        """Total mechanical energy, J: kinetic, and the potential of the effects that have one."""
        effects = self._applied.assembled.effects
        stored = kernel.potential_energy(effects, self.t, self._state.q, self._near)
        return self.kinetic_energy + stored

    @cached_property
    def kinetic_energy(self) -> float:
        """½ q̇ᵀ M q̇, J."""
        model, qd = self.model, self._state.qd
        momenta = np.zeros(model.n)
        kernel.add_mass_times(model.unit, model.system.mass, 1.0, qd, momenta)
        return 0.5 * float(momenta @ qd[: model.n])

    @cached_property
    def stored(self) -> Mapping[str, float]:
        """Potential energy of each effect of the scene, J; 0 for what stores none."""
        return {
            label: kernel.potential_energy(part.effects, self.t, self._state.q, self._near)
            for label, part in self._applied.each.items()
        }

    @property
    def works(self) -> Mapping[str, float]:
        """What each effect has given to the motion since the start, J, named as in `powers`; of
        all that is held from outside 'inputs', of drives and belts 'drives'.

        Together they are the change of kinetic energy. An effect has taken from the mechanism for
        good what its work lacks of the fall of what it stores. Raises InputError without a ledger.
        """
        if not self._state.works:
            raise InputError(
                'no ledger is kept', key='works', expected='Simulation(…, ledger=True)'
            )
        return self._state.works

    @cached_property
    def powers(self) -> Mapping[str, float]:
        """What each effect of the scene gives to the motion now, W; less than zero: it takes.

        By kind, or `kind.name` where it has a name of its own.
        """
        state, Q = self._state, np.zeros(self._state.q.size)
        powers = {}
        for label, part in self._applied.each.items():
            self._act(part, state.q, state.qd, Q)
            powers[label] = float(Q @ state.qd)
        return powers

    def _act(self, part: Part, q: Floats, qd: Floats, Q: Floats) -> None:
        """Q of some of what acts, friction with the loads of now."""
        kernel.applied_forces(part.effects, self.t, q, qd, self._near, Q)
        if part.loads:
            loads = self._loads[part.loads]
            kernel.add_friction(part.effects, self.t, q, qd, self._near, loads, Q)

    @cached_property
    def _loads(self) -> Floats:
        """N, of each effect with friction that depends on reactions."""
        return self._read(lambda place: place.loads)

    # ----------------------------------------------------------------------------------- bodies

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
            return _read_only(np.column_stack([origins, self._angles]))
        turns = [orientation(layout, name, q) for name in self.model.body_names]
        return _read_only(np.column_stack([origins, np.array(turns).reshape(-1, 4)]))

    # ----------------------------------------------------------------------------------- joints

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
        return _read_only(values)

    @cached_property
    def joint_efforts(self) -> Floats:
        """(joint coordinates,) what acts on the free axis, N m or N: inputs held, motors, springs,
        stops, friction, drives; not the reaction."""
        inputs = self._applied.inputs.efforts
        held = (inputs.get(name, 0.0) for name in self.model.coordinate_names)
        efforts = np.array([e.at(self.t)[0] if isinstance(e, Curve) else e for e in held])
        if any(effect.coordinates for effect in self._applied.effects):
            reactions, state = self._reactions(), self._state
            q, qd = reactions.on_cut_blocks(state.q), reactions.on_cut_blocks(state.qd)
            Q, on_joints = np.zeros(q.size), self._applied.on_joints(reactions.cut)
            for n, coordinate in enumerate(self.model.coordinates):
                if coordinate.name in on_joints:
                    self._act(on_joints[coordinate.name], q, qd, Q)
                    efforts[n] += Q @ unit_motion(coordinate, reactions.cut, q)
        for drive in self.model.mechanism.drives:
            if drive.kind in ('angle', 'length'):
                n = self.model.coordinate_names.index(drive.of[0])
                efforts[n] += self.drive_efforts[drive.name][0]
        return _read_only(efforts)

    @cached_property
    def drive_efforts(self) -> Mapping[str, Floats]:
        """What each drive exerts: (1,) N m or N along its coordinate, (D,) N on its point."""
        model, drives = self.model, self.model.mechanism.drives
        layout, of = model.layout, model.layout.of_prescribed

        def read(place: Place) -> Floats:
            work, pull = place.work, np.zeros(place.work.q.size)
            kernel.add_transposed(model.unit, model.system.rows, work.g, work.g2, work.y, pull)
            q, pulls = work.q.reshape(-1, layout.dimension), pull.reshape(-1, layout.dimension)
            efforts = [effort(drive, q[of[drive.name]], pulls[of[drive.name]]) for drive in drives]
            sizes[:] = [each.size for each in efforts]
            return np.concatenate([np.zeros(0), *efforts])

        sizes: list[int] = []
        values = self._read(read)
        ends = np.cumsum(sizes)[:-1]
        return (
            {
                drive.name: _read_only(value)
                for drive, value in zip(drives, np.split(values, ends), strict=True)
            }
            if drives
            else {}
        )

    @cached_property
    def drives(self) -> tuple[Floats, Floats, Floats]:
        """(motions,) position (rad or m), velocity and effort (N m or N) of each function of time
        that a drive prescribes, in the order of `driving.motion_names`."""
        layout, state = self.model.layout, self._state
        rows: list[tuple[float, float, float]] = []
        for drive in self.model.mechanism.drives:
            efforts = self.drive_efforts[drive.name]
            if drive.kind == 'angle':
                joint = self.joints[drive.of[0]]
                rows.append((joint.position, joint.velocity, efforts[0]))
                continue
            block = layout.of_prescribed[drive.name]
            s, sd = (x.reshape(-1, layout.dimension)[block] for x in (state.q, state.qd))
            moving = zip(s, sd, efforts, drive.motion, strict=False)
            rows += [(x, v, e) for x, v, e, motion in moving if motion is not None]
        position, velocity, efforts = np.array(rows, dtype=float).reshape(-1, 3).T
        return _read_only(position), _read_only(velocity), _read_only(efforts)

    @property
    def joints(self) -> Mapping[str, JointState]:
        """Position, velocity and effort of each joint coordinate; of a joint that has one, by the
        name of the joint."""
        return _ByName(
            self.model.coordinate_names,
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
        work.near[:] = self._near
        prescribe(self.model.system, self.t, work.q, work.qd, work.qdd)
        if not kernel.linearise(self.model.unit, self.model.system, work, work.q):
            raise StepError('the leading matrix is not positive definite', 'see step()', self.t)
        return work

    @cached_property
    def _accelerated(self) -> tuple[Work, Floats, float]:
        """q̈ and λ, the loads of friction, and the least singular value met, if it is small."""
        work, forces = self._linearised, self._applied.assembled
        kernel.begin_balance(forces.bearings, self._state.loads)
        count, sigma = kernel.accelerate(
            self.model.unit,
            self.model.system,
            forces,
            work,
            self.t,
            self._solver.iterations,
            True,
        )
        if count < 0:
            raise StepError(kernel.Status.JAMMED.reason, 'see step()', self.t)
        return work, self._applied.loads, sigma

    @cached_property
    def _limits(self) -> Limits | None:
        """What values are limits of, in a singular position or too near to one."""
        if not self._within and not self._doubtful:
            return None
        state, applied = self._state, self._applied.assembled
        works = np.array(list(state.works.values()))
        phase = Phase(state.q, state.qd, state.turns, np.array([state.pace]), works, state.loads)
        return limits(self.model, applied, phase, self._near, self.t, self._solver.iterations)

    def _read(self, read: Callable[[Place], Floats]) -> Floats:
        """Something of the accelerated mechanism: its limit, in a singular position."""
        if self._limits is None:
            return read(Place(*self._accelerated[:2]))
        limit, far = self._limits.of(read), _BLIND * self.model.system.ordinary
        if far < self._accelerated[2] < np.inf and not self._lost:  # a pole, beside it
            limit = np.where(np.isnan(limit), read(Place(*self._accelerated[:2])), limit)
        return limit

    @cached_property
    def _within(self) -> bool:
        """Whether it is in a singular position, or closer to one than can be computed."""
        system = self.model.system
        return self._accelerated[2] < system.close * system.ordinary or self._lost

    @property
    def _lost(self) -> bool:
        """Whether a row has lost its direction, so that nothing is felt of it: only a step that
        was interpolated ends there."""
        return self._beside is not False and self.diagnostics.singular

    @property
    def _doubtful(self) -> bool:
        """Whether drives make rounding count: efforts are off by it over x⁴, x the distance to a
        singular position."""
        model = self.model
        if not model.mechanism.drives:
            return False
        return self._accelerated[2] < _DOUBTFUL * model.system.ordinary

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
        """(rows,) Φ_q q̇; of rows that bind velocities only, N q̇ + B."""
        model, work, rate = self.model, self._linearised, np.zeros(len(self.model.row_names))
        kernel.times_jacobian(model.unit, model.system.rows, work.g, work.g2, work.qd, rate)
        return _read_only(rate[model.row])

    @cached_property
    def lam(self) -> Floats:
        """(rows,) multipliers λ from a cold solve: M q̈ + Φ_qᵀ λ = Q."""
        return _read_only(self._read(lambda place: place.work.y[self.model.row]))

    @property
    def multipliers(self) -> Mapping[str, float]:
        """λ of each constraint row by name."""
        return _ByName(self.model.row_names, lambda n: float(self.lam[n]))

    @property
    def constraint_forces(self) -> Floats:
        """(n,) Φ_qᵀ λ, N on each coordinate in the order of `q`: unlike λ it is unique where rows
        depend on each other."""
        model = self.model

        def read(place: Place) -> Floats:
            work, pull = place.work, np.zeros(place.work.q.size)
            kernel.add_transposed(model.unit, model.system.rows, work.g, work.g2, work.y, pull)
            return pull

        return self._by_coordinate(self._read(read))

    # -------------------------------------------------------------------------------- reactions

    @cached_property
    def _wrenches(self) -> tuple[Floats, Floats]:
        cut, state = self._reactions(), self._state
        applied = np.zeros(cut.source.size * self.model.layout.dimension)
        effects, t, near = self._applied.on(cut.cut), self.t, self._near
        q, qd = cut.on_cut_blocks(state.q), cut.on_cut_blocks(state.qd)
        kernel.applied_forces(effects, t, q, qd, near, applied)

        def read(place: Place) -> Floats:
            work, Q = place.work, applied.copy()
            q, qd = cut.on_cut_blocks(work.q), cut.on_cut_blocks(work.qd)
            if place.loads.size:
                kernel.add_friction(effects, t, q, qd, near, place.loads, Q)
            forces, torques = cut.of(q, cut.on_cut_blocks(work.qdd), work.y, Q)
            return np.column_stack([forces, torques])

        wrenches = self._read(read)
        D = self.model.layout.dimension
        return wrenches[:, :D].copy(), wrenches[:, D:].copy()

    @property
    def reaction_forces(self) -> Floats:
        """(joints, D) N: parent on child at the joint, world frame."""
        return _read_only(self._wrenches[0])

    @property
    def reaction_torques(self) -> Floats:
        """(joints, 1 or 3) N m: parent on child about the joint, world frame; in the plane +z."""
        return _read_only(self._wrenches[1])

    @property
    def reactions(self) -> Mapping[str, Reaction]:
        """Force and torque of parent on child in each joint."""
        planar = self.model.layout.dimension == 2
        return _ByName(
            self.model.joint_names,
            lambda n: Reaction(
                self.reaction_forces[n],
                float(self.reaction_torques[n, 0]) if planar else self.reaction_torques[n],
                bool(self._indeterminate[n]),
            ),
        )

    @cached_property
    def _indeterminate(self) -> NDArray[np.bool_]:
        """(joints,) whether the reaction is one of many that balance."""
        cut, work = self._reactions(), self._linearised
        redundant = self.diagnostics.redundant
        unknown: NDArray[np.bool_] = np.zeros(len(self.model.joint_names), dtype=bool)
        if self._limits is not None:  # of rows that depend on others also beside the position
            redundant, work = self._dependent_rows(), self._limits.beside
            unknown = np.asarray(np.isnan(np.column_stack(self._wrenches)).any(axis=1))
        if redundant:
            unknown |= cut.indeterminate(cut.on_cut_blocks(work.q), work)
        return unknown


def _read_only(array: Floats) -> Floats:
    array.flags.writeable = False
    return array
