"""Dynamics of a sample: accelerations and multipliers, or their limits in a singular position."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import StepError
from alf_ros.kernel import CutWork, Phase, Work
from alf_ros.model.compile import Model
from alf_ros.model.prescribed import prescribe
from alf_ros.model.rank import effective_rank
from alf_ros.model.singular_branches import position
from alf_ros.model.softest_modes import found
from alf_ros.model.struct_memory import changed
from alf_ros.scene.scene import Solver
from alf_ros.simulation.applied import Applied, Part
from alf_ros.simulation.instruments import Instruments, Lent, Workspace
from alf_ros.simulation.integral_sums import sums_of
from alf_ros.simulation.kept import kept
from alf_ros.simulation.kinematics import Kinematics
from alf_ros.simulation.named_values import NamedValues, read_only
from alf_ros.simulation.sample_limits import Limits, Place, limits
from alf_ros.simulation.state import State

# distances to a singular position: from which down efforts of drives are limits, and a pole is
# lost in rounding
_DOUBTFUL, _ROUNDED = 5e-3, 1e-6
_NARROW = 0.25  # of the spacing of places, where values between wide ones are not determined
_BALANCED = 1e-9  # of the acceleration without rows, from which down nothing moves


class Dynamics(Kinematics):
    """q̈, λ and derived values."""

    def __init__(
        self,
        model: Model,
        applied: Applied,
        solver: Solver,
        t: float,
        state: State,
        dependent_rows: int,
        beside: bool | None,
        instruments: Instruments,
    ) -> None:
        """`beside`: whether the step that ended here was interpolated beside a singular position;
        None if no step did."""
        super().__init__(model, t, state, instruments)
        self._applied, self._solver = applied, solver
        self._dependent_rows, self._beside = dependent_rows, beside
        self._works_shared: set[int] = set()

    @kept
    def _lent(self) -> Lent[Workspace]:
        return self._instruments.lend()

    @property
    def _workspace(self) -> Workspace:
        """Where this sample computes. Until the sample is gone nobody else writes there."""
        return self._lent.workspace

    @kept
    def qdd(self) -> Floats:
        """Their accelerations (n,), m/s^2."""
        return self._by_coordinate(self._read(lambda place: place.work.qdd))

    @kept
    def kinetic_energy(self) -> float:
        """½ q̇ᵀ M q̇, J."""
        model, qd = self.model, self._state.qd
        momenta = np.zeros(model.n)
        kernel.add_mass_times(model.unit, model.system.mass, 1.0, qd, momenta)
        with np.errstate(over='ignore', invalid='ignore'):
            return self._within_numbers(0.5 * float(momenta @ qd[: model.n]))

    def _within_numbers(self, energy: float) -> float:
        """The energy (J) or power (W). Raises StepError if it is not finite: the square of a speed
        may be too large."""
        if math.isfinite(energy):
            return energy
        raise StepError('energies exceed the range of numbers', 'take smaller forces', self.t)

    def _act(self, part: Part, q: Floats, qd: Floats, Q: Floats) -> None:
        """Q of a part of the effects, friction with the present loads."""
        kernel.applied_forces(part.effects, self.t, q, qd, self._near, Q)
        if part.loads:
            loads = self._loads[part.loads]
            kernel.add_friction(part.effects, self.t, q, qd, self._near, loads, Q)

    def forces_by_effect(self) -> Iterator[tuple[str, Floats]]:
        """The label of each effect of the scene, and its Q (all blocks D,)."""
        state = self._state
        for label, part in self._applied.each.items():
            Q = np.zeros(state.q.size)
            self._act(part, state.q, state.qd, Q)
            yield label, Q

    @property
    def friction_loads(self) -> Floats:
        """A copy of the reactions (N) on which friction depends: one for each effect with such
        friction, in the order of `State.loads`."""
        return self._loads.copy()

    @kept
    def _loads(self) -> Floats:
        """N, of each effect with friction that depends on reactions."""
        return self._read(lambda place: place.loads)

    @kept
    def _linearised(self) -> Work:
        """Φ_q and the factor of A at this instant."""
        system, work = self._workspace.system, self._workspace.work
        work.q[:] = self._state.q
        work.qd[:] = self._state.qd
        work.near[:] = self._near
        prescribe(system, self.t, work.q, work.qd, work.qdd)
        if not kernel.linearise(self.model.unit, system, work, work.q):
            raise StepError('the leading matrix is not positive definite', 'see step()', self.t)
        return work

    @kept
    def _accelerated(self) -> tuple[Work, Floats, float]:
        """q̈ and λ, the loads of friction, and the least singular value met, if it is small."""
        work = self._linearised
        problem = self._workspace.problem(self._applied.assembled, self._solver)
        bearings = problem.forces.bearings
        kernel.restore_reactions(bearings, self._state.loads)
        count, sigma = kernel.accelerate(problem, self.t, True)
        if count < 0:
            raise StepError(kernel.Status.JAMMED.reason, 'see step()', self.t)
        return work, bearings.loads.copy(), sigma

    @kept
    def _limits(self) -> Limits | None:
        """The support positions of limits, in a singular position or too near to one."""
        if (not self._within and not self._doubtful) or self._rests:
            return None
        return self._places_around(1.0)

    @kept
    def _narrow_limits(self) -> Limits | None:
        """The same nearer to it, where loops of other sizes turn less from place to place."""
        return self._places_around(_NARROW)

    def _places_around(self, part: float) -> Limits | None:
        """Support positions a part of the usual way apart; None where they tell nothing."""
        state = self._state
        problem = self._workspace.problem(self._applied.assembled, self._solver)
        works = np.array(list(state.works.values()))
        phase = Phase(
            state.q,
            state.qd,
            state.turns,
            np.array([state.pace]),
            works,
            state.loads,
            sums=sums_of(self.model, state),
        )
        departures = self.model.system.departures
        model = replace(self.model, system=changed(problem.system, departures=departures))
        found = limits(model, problem.forces, problem.method, phase, self._near, self.t, part)
        if found is None or not self._lost:
            return found
        # what moves may not lead out of the position: then the places lack the lost rows too
        return None if self._dependent(found.beside) > self._dependent_rows else found

    def _read(self, read: Callable[[Place], Floats]) -> Floats:
        """Something of the accelerated mechanism: its limit, in a singular position. Raises
        StepError if it is not finite elsewhere."""

        def shared(place: Place) -> Floats:
            return read(self._shared(place))

        if self._limits is None:
            found = shared(Place(*self._accelerated[:2]))
            if not np.isfinite(found).all():  # in a singular position NaN says: indeterminate
                reason = 'accelerations or reactions exceed the range of numbers'
                raise StepError(reason, 'take smaller forces', self.t)
            if self._within and self._branch_unknown:
                return np.full_like(found, np.nan)
            return found
        limit, far = self._limits.of(shared), _ROUNDED * self.model.system.ordinary
        if np.isnan(limit).any() and self._narrow_limits is not None:
            limit = np.where(np.isnan(limit), self._narrow_limits.of(shared), limit)
        if far < self._accelerated[2] < np.inf and not self._lost:  # a pole, beside it
            limit = np.where(np.isnan(limit), shared(Place(*self._accelerated[:2])), limit)
        return limit

    def _shared(self, place: Place) -> Place:
        """The place with λ as bearings share redundant loads, if joints have a stiffness."""
        shares, work = self._instruments.shares, place.work
        if shares is None or id(work) in self._works_shared:
            return place
        self._works_shared.add(id(work))
        with self._on_cut() as there:
            shares.apply(work, there)
        return place

    @contextmanager
    def _on_cut(self) -> Iterator[CutWork]:
        """The cut mechanism at this instant, with the forces on its blocks, except friction that
        depends on reactions."""
        cut, lent = self._instruments.reactions(), self._instruments.lend_cut()
        there, state = lent.workspace, self._state
        kernel.place_on_cut(self.model.unit, cut.arrays, there, state.q, state.qd)
        effects = self._applied.on(cut.cut)
        kernel.applied_forces(effects, self.t, there.q, there.qd, self._near, there.Q)
        yield there

    @kept
    def _within(self) -> bool:
        """Whether it is in a singular position, or closer to one than can be computed."""
        system = self.model.system
        return self._accelerated[2] < system.close * system.ordinary or self._lost

    @property
    def _lost(self) -> bool:
        """Whether a row has lost its direction, so that nothing is felt of it: only a step that
        was interpolated ends there."""
        return self._beside is not False and self._singular

    @property
    def _rests(self) -> bool:
        """Whether it is at rest and remains so: rows balance all forces, also in a singular
        position, and λ is a share of least norm."""
        return not (self._state.qd.any() or self._leaves)

    @property
    def _leaves(self) -> bool:
        """Whether it is at rest and forces set it in motion."""
        if self._state.qd.any():
            return False
        work, n = self._accelerated[0], self.model.n
        free = np.abs(work.Q[:n]).max(initial=0.0) / self.model.system.mean
        return not np.abs(work.qdd[:n]).max(initial=0.0) <= _BALANCED * free

    @kept
    def _branch_unknown(self) -> bool:
        """Whether the acceleration, which lacks lost rows, is on no known branch: from rest, or
        where a loop leaves its singular position from rest while other parts move."""
        if not self._state.qd.any():
            return self._leaves
        if not self._lost:
            return False
        work = self._accelerated[0]
        here = position(self.model, self._state.q, self.t)
        return not here.may_continue(self._state.qd, work.qdd)

    @property
    def _doubtful(self) -> bool:
        """Whether drives make rounding count: efforts are off by it over x⁴, x the distance to a
        singular position."""
        model = self.model
        if not model.mechanism.drives:
            return False
        return self._accelerated[2] < _DOUBTFUL * model.system.ordinary

    @kept
    def phi_dot(self) -> Floats:
        """(rows,) Φ_q q̇; of rows that bind velocities only, N q̇ + B."""
        model, work, rate = self.model, self._linearised, np.zeros(len(self.model.row_names))
        kernel.times_jacobian(model.unit, model.system.rows, work.g, work.g2, work.qd, rate)
        return read_only(rate[model.row])

    @kept
    def lam(self) -> Floats:
        """(rows,) multipliers λ from a cold solve: M q̈ + Φ_qᵀ λ = Q."""
        return read_only(self._read(lambda place: place.work.y[self.model.row]))

    @property
    def multipliers(self) -> Mapping[str, float]:
        """λ of each constraint row by name."""
        return NamedValues(self.model.row_names, lambda n: float(self.lam[n]))

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

    @kept
    def _effective_rank(self) -> float:
        """Rank of Φ_q, not rounded, from the factor of A."""
        return effective_rank(self.model, self._linearised)

    @kept
    def _softest(self) -> tuple[float, float]:
        """Distance to a singular position, and by how much it may be off."""
        work, redundant = self._linearised, self._dependent_rows
        modes = found(self.model, work, redundant, self._workspace.modes(redundant))
        return (float(modes.sigma[0]), float(modes.error[0])) if modes else (1.0, 0.0)

    @property
    def _redundant(self) -> int:
        """How many constraint rows depend on the others here."""
        return self._dependent(self._linearised)

    def _dependent(self, work: Work) -> int:
        """The same at the place of a factor."""
        return len(self.model.row_names) - round(effective_rank(self.model, work))

    @kept
    def _singular(self) -> bool:
        """Whether the rank is lower here than at ordinary positions."""
        return self._redundant > self._dependent_rows
