"""Steps: one method on one mechanism, with all the memory that its compiled code writes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.effects.contract import Effect
from alf_ros.errors import InputError
from alf_ros.kernel import Forces, Problem, Span, Status, StepRecord, Tangents, Trail, Watch, Work
from alf_ros.kernel.crossed_kinks import divider
from alf_ros.kernel.implicit_tangents import following_implicitly
from alf_ros.kernel.numba_ext.structs import Struct, address_of
from alf_ros.kernel.singularity_monitor import follow_step
from alf_ros.kernel.step_tape import writing_down
from alf_ros.kernel.tangent_step import following
from alf_ros.model import singular_start
from alf_ros.model.compile import allocate
from alf_ros.model.effect_directions import softened
from alf_ros.model.singular_branches import Branch
from alf_ros.model.struct_memory import changed
from alf_ros.model.tableaux import TABLEAUX, first_pace
from alf_ros.scene.scene import Solver
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.drive_jumps import DriveJump, DriveJumps
from alf_ros.simulation.dynamics import Dynamics
from alf_ros.simulation.formulations import Formulation
from alf_ros.simulation.input_values import NO_INPUTS
from alf_ros.simulation.instruments import Instruments
from alf_ros.simulation.listening import Listener
from alf_ros.simulation.missed_positions import MissedPositions
from alf_ros.simulation.packed_effects import AskedFunctions
from alf_ros.simulation.present import Present
from alf_ros.simulation.reactions import ReactionsOf
from alf_ros.simulation.resolution import Judged, Resolution, measured
from alf_ros.simulation.start import Start
from alf_ros.simulation.state import State
from alf_ros.simulation.tangent_following import TangentFollowing

# of a workspace, by a copy that continues to count and judge
_REMEMBERED = 'evaluations', 'rounded', 'judged', 'crossing', 'trend', 'aside'


class Stepper:
    """Takes the steps of a simulation.

    It owns the workspaces and knows no state: what it steps is given to it. `formulation`: one
    that was prepared before; `written`: steps are written down for gradients. Raises InputError
    for an effect that does not fit the mechanism, and for a formulation that does not fit the
    integrator. `step_failures` says why a step failed.
    """

    def __init__(
        self,
        start: Start,
        solver: Solver,
        effects: Sequence[Effect],
        ledger: bool,
        formulation: Formulation | None = None,
        following: TangentFollowing | None = None,
        written: bool = False,
    ) -> None:
        self.h, self.solver = solver.step, solver
        self.method = method = solver.method
        self.iterations = 0  # most in one solve of the last call
        self.unexamined = start.unexamined  # as of `Resolution`
        self.start, self.model = start, start.model
        self.missed = MissedPositions(start, method.tolerance if method.embedded.size else 0.0)
        tableau, adaptive = TABLEAUX[solver.integrator], method.embedded.size > 0
        self.instruments = Instruments(self.model, ReactionsOf(self.model))
        # with nothing held
        self.applied = Applied(
            self.model,
            effects,
            NO_INPUTS,
            self.instruments.reactions,
            method.b if ledger else None,
            AskedFunctions(
                tangents=tableau.implicit,
                sides=adaptive and not tableau.implicit,
                branches=following is not None or written,
                intervals=solver.formulation == 'alf2',
                ends=not (adaptive or written or following is not None),
            ),
        )
        if following is not None:
            following.check(self.applied)
        self.system = self.model.system
        self._kernel = kernel.advance
        if tableau.implicit:
            self.system = softened(self.system, self.model.layout, self.applied.directions)
            self._kernel = kernel.advance_implicitly
        elif adaptive:
            self._kernel = kernel.advance_adaptively
        self.work = allocate(self.model, self.system, method.b.size)
        self.listener = Listener(self.work)
        self._aside: Work | None = None
        self.divider = np.zeros(3, dtype=np.uint64)  # as in `Work`
        self._following = following
        self._behind: Work | None = None  # of tangents
        # of the run, and aside; with the parameters that act
        self._tangents: dict[bool, tuple[Problem, Tangents, Floats]] = {}
        self._problems: dict[bool, Problem] = {}  # of the run, and aside
        # of the run, while somebody watches; and the problem without the watch
        self._watched: tuple[Problem, Problem] | None = None
        self.trail: Trail | None = None  # on which the steps of the run are written down
        self._jumps = DriveJumps.of(self.model, ledger)
        self.drive_jump: DriveJump | None = None
        # forces, corners of drives, and the same forces with steps that end at these
        self._cornered: tuple[Forces, list[float], Forces] | None = None
        self.formulation = formulation
        if solver.formulation != 'alf2' and formulation is None:
            self.formulation = Formulation(self.model, solver, start.q)

    # ------------------------------------------------------------------------------------ states

    def initial(self, accounts: tuple[str, ...]) -> State:
        """The state in which the scene starts, works (J) of these accounts."""
        q, qd = self.start.q, self.start.qd
        turns = np.zeros(self.model.system.angles.c.size // 2, dtype=np.int64)
        return State(
            0,
            q,
            qd,
            turns,
            self.first_pace(qd),
            self.formulation.start(q, qd) if self.formulation else np.zeros(0),
            NO_INPUTS,
            dict.fromkeys(accounts, 0.0),
            np.zeros(self.applied.load_count),
            self._following.initial if self._following else np.zeros(0),
            h=self.h,
        )

    def first_pace(self, qd: Floats) -> float:
        """With which an adaptive method begins at velocities q̇ (blocks D, m/s), s."""
        return first_pace(self.h, self.model.size, qd)

    # ------------------------------------------------------------------------------------- steps

    def advance(self, present: Present, n: int, watch: Watch | None = None) -> Status:
        """n steps from the present, fewer if one fails or is to be looked at."""
        of = self._following
        for steps in [n] if of is None else of.places.stretches(present.step, n):
            end = present.step + steps
            status = self._take(self.work, present, present.step, steps, self.h, 0.0, watch)
            if status != Status.OK or present.step < end:
                break
        return status

    def aside(self, present: Present, start: float, h: float, counted: bool = True) -> Status:
        """One step of h (s) from `present` at `start` (s), outside the steps of the run.

        `counted`: whether its evaluations count, and tangents follow.
        """
        if self._aside is None:
            self._aside = self._allocated()
        work, iterations = self._aside, self.iterations
        counts = int(work.evaluations[0]), int(work.rounded[0])
        status = self._take(work, present, 0, 1, h, start, None, counted)
        if not counted:
            (work.evaluations[0], work.rounded[0]), self.iterations = counts, iterations
        return status

    def advance_recorded(self, present: Present, n: int, record: StepRecord) -> Status:
        """n steps from the present, written down in `record`; fewer if one fails."""
        first, applied = present.step, present.applied
        within = self.begins_within(present) and first == 0
        free, corners = self._free_of_jumps(0.0, first, n, self.h)
        if free == 0 < n:
            return Status.DRIVE_JUMPS
        forces = self._ending_at(corners, applied.assembled)
        problem = self._problem(self.work, present, forces)
        code = writing_down(self.model.layout.dimension, self.is_implicit)
        problem = self._accompanied(problem, code.address, record, np.zeros(0))
        span = Span(0.0, first, free, self.h)
        result, _, self.iterations = self._kernel(problem, present.phase, span, within)
        return self._ended(result, present, free < n, first + free)

    def problem_aside(self, present: Present) -> Problem:
        """The problem of the steps from the present, with another workspace."""
        return replace(self.problem_of(present), work=self._allocated())

    def _allocated(self) -> Work:
        """Another workspace, which is stopped together with the one of the run."""
        made = allocate(self.model, self.system, self.method.b.size)
        return replace(made, pulse=self.work.pulse, caller=self.work.caller)

    def _take(
        self,
        work: Work,
        present: Present,
        first: int,
        n: int,
        h: float,
        start: float,
        watch: Watch | None,
        followed: bool = True,
    ) -> Status:
        """n steps of h from `start` + `first` h (s); tangents follow if `followed`."""
        phase = present.phase
        free, corners = self._free_of_jumps(start, first, n, h)
        if free == 0 < n:
            return Status.DRIVE_JUMPS
        forces = self._ending_at(corners, present.applied.assembled)
        if self.formulation is not None:
            if self.trail is not None:
                raise InputError('alf2 alone leaves a trail', key='formulation')
            result, _, self.iterations = self.formulation.advance(
                forces, work, phase, present.carried, start, first, free, h
            )
            return self._ended(result, present, free < n, first + free)
        within = first == 0 and start == 0.0 and self.begins_within(present)
        self.work.crossing[1] = 0.0
        problem, span = self._problem(work, present, forces), Span(start, first, free, h)
        if followed and self._following is not None:
            problem = self._followed(present, problem)
        if watch is not None:
            problem = self._watched_by(watch, problem)
        if self.trail is not None and work is self.work:
            problem = changed(problem, work=changed(problem.work, trail=self.trail))
        result, _, self.iterations = self._kernel(problem, phase, span, within)
        return self._ended(result, present, free < n, first + free)

    def _free_of_jumps(
        self, start: float, first: int, n: int, h: float
    ) -> tuple[int, list[float]]:
        """How many of n steps of h from `start` + `first` h (s) come before a drive jumps, and the
        corners (s) of drives in these."""
        if self._jumps is None:
            return n, []
        free, corners, self.drive_jump = self._jumps.ahead(start, first, n, h)
        return free, corners

    def _ending_at(self, corners: list[float], forces: Forces) -> Forces:
        """Forces whose steps end at corners of drives (s), too."""
        if not corners:
            return forces
        known = self._cornered
        if known is None or known[0] is not forces or known[1] != corners:
            instants = np.union1d(forces.kinks.instants, corners)
            kinks = changed(forces.kinks, instants=instants)
            known = self._cornered = forces, corners, changed(forces, kinks=kinks)
        return known[2]

    @staticmethod
    def _ended(result: int, present: Present, jumps: bool, last: int) -> Status:
        """The status of steps; `jumps`: a drive jumps behind step `last`."""
        if jumps and result == Status.OK and present.step == last:
            return Status.DRIVE_JUMPS
        return Status(result)

    def begins_within(self, present: Present) -> bool:
        """Whether it is where the scene starts, in a singular position that solves do not show."""
        if not np.array_equal(present.phase.q, self.start.q):
            return False
        if self.start.singular is not None and not present.phase.qd.any():
            pull = self.start.singular.pull(self._forces_at(present.applied, self.start.q))
            return bool(pull.any())
        return self.start.near and bool(self.start.qd.any())

    def _followed(self, present: Present, problem: Problem) -> Problem:
        """A problem whose steps tangents follow; replaced when held inputs change, and where a
        parameter begins or ends to act."""
        assert self._following is not None
        of_run, acting = problem.work is self.work, self._following.places.acting(present.step)
        known = self._tangents.get(of_run)
        same = known is not None and _are_alike(known[0], problem)
        if known is None or not same or (known[2] != acting).any():
            if self._behind is None:
                self._behind = self._allocated()
            before = known[1] if known is not None else None
            applied, behind = present.applied, self._behind
            tangents = self._following.tangents(applied, problem, behind, acting, before)
            code_of = following_implicitly if self.is_implicit else following
            code = code_of(self.model.layout.dimension, tangents._lanes())
            good = np.zeros_like(self._following.initial)
            known = self._accompanied(problem, code.address, tangents, good), tangents, acting
            self._tangents[of_run] = known
        return known[0]

    def _accompanied(self, problem: Problem, code: int, by: Struct, good: Floats) -> Problem:
        """A problem whose steps have a companion: code at an address, and the struct that it
        fills. `good`: memory for tangents at the last point of the grid."""
        companion = np.array([code, address_of(by)], dtype=np.uint64)
        kinks = problem.forces.effects.side.size > 0
        if kinks:
            self.divider[0] = divider(self.model.layout.dimension).address
        work = changed(
            problem.work,
            companion=companion,
            divider=self.divider if kinks else self.divider[:0],
            good_tangents=good,
        )
        return changed(problem, work=work)

    def problem_of(self, present: Present) -> Problem:
        """The problem of the steps from the present."""
        return self._problem(self.work, present, present.applied.assembled)

    @property
    def may_jump(self) -> bool:
        """Whether the rates of drives may jump, so that steps look for it."""
        return self._jumps is not None

    @property
    def is_implicit(self) -> bool:
        """Whether the method solves for its stages."""
        return self._kernel is kernel.advance_implicitly

    def _problem(self, work: Work, present: Present, forces: Forces) -> Problem:
        """The problem of the kernel; replaced when held inputs change, and where the run is set at
        rest in another singular position."""
        departures = present.model.system.departures
        if self.system.departures is not departures:
            self.system = changed(self.system, departures=departures)
        known = self._problems.get(work is self.work)
        if known is None or known.forces is not forces or known.system is not self.system:
            known = Problem(self.model.unit, self.system, forces, self.method, work)
            self._problems[work is self.work] = known
        return known

    def _watched_by(self, watch: Watch, problem: Problem) -> Problem:
        """The problem of the run, whose steps `watch` follows."""
        known = self._watched
        if known is None or known[0] is not problem or known[1].work.watch is not watch:
            code = follow_step(self.model.layout.dimension)
            follow = np.array([code.address], dtype=np.uint64)
            work = changed(problem.work, follow=follow, watch=watch)
            known = self._watched = problem, changed(problem, work=work)
        return known[1]

    def sample(self, present: Present, step: int, state: State) -> Dynamics:
        """Of a state at a step, with all that acts at the present."""
        return Dynamics(
            present.model,
            present.applied,
            self.solver,
            step * self.h,
            state,
            self.start.dependent_rows,
            self.beside(present),
            self.instruments,
        )

    # ------------------------------------------------------------------------------------ counts

    @property
    def evaluations(self) -> int:
        """Stages evaluated so far."""
        return sum(int(work.evaluations[0]) for work in self._works)

    @property
    def rounded(self) -> int:
        """Steps taken although rounding kept their error above the tolerance."""
        return sum(int(work.rounded[0]) for work in self._works)

    @property
    def _works(self) -> list[Work]:
        return [self.work] if self._aside is None else [self.work, self._aside]

    @property
    def step_error(self) -> float:
        """Its `error`."""
        found = self.formulation is None and self.method.estimate.size > 0
        return measured(self.h, self.work.judged, self.method.caution)[1] if found else math.nan

    def resolution_later(self) -> Callable[[], Resolution]:
        """How well the steps so far resolve the motion, where that is measured: computed when it
        is called, as it may take a search."""
        if self.formulation is not None:
            return partial(Resolution, self.h)
        judged: Judged = self.h, math.nan, math.nan, math.nan, False, 1.0
        if self.method.estimate.size:
            judged = measured(self.h, self.work.judged, self.method.caution)
        told, _, beside, leapt = self.work.crossing.tolist()
        resolution = self.missed.resolution
        return partial(resolution, judged, told, beside, leapt, self.unexamined)

    def beside(self, present: Present) -> bool | None:
        """Whether the last step of the run ended beside a singular position, interpolated, or at
        rest in it; None if it has made none."""
        return None if present.step == present.since else bool(self.work.aside.any())

    def beside_aside(self) -> bool:
        """The same of the last step aside."""
        return self._aside is not None and bool(self._aside.aside.any())

    def begin(self, present: Present) -> None:
        """The run continues from another state: its steps are judged again."""
        self.work.judged[:] = 0.0
        self.work.crossing[:] = 0.0
        self.work.trend[:] = 0.0
        self.unexamined, rest = self.start.unexamined, present.rest
        if rest is not None and self.formulation is None:
            Q = self._forces_at(present.applied, rest.q, rest.t)
            self.unexamined = rest.unexamined(self.model, Q)

    @property
    def memory(self) -> dict[str, Any]:
        """Data of a copy that continues to count and judge."""
        work = self.work
        counts = {name: getattr(work, name).copy() for name in _REMEMBERED}
        counts['evaluations'][0], counts['rounded'][0] = self.evaluations, self.rounded
        return {**counts, 'iterations': self.iterations, 'unexamined': self.unexamined}

    def recall(self, memory: dict[str, Any]) -> None:
        """Count and judge on from the memory of another."""
        for name in _REMEMBERED:
            getattr(self.work, name)[:] = memory[name]
        self.iterations, self.unexamined = memory['iterations'], memory['unexamined']

    # -------------------------------------------------------------------------------------- rest

    def examined(self, applied: Applied) -> str:
        """The parts of a start at rest near a singular position that were not examined; empty if
        all were.

        Raises AssemblyError where the motion that begins is not unique.
        """
        start = self.start
        self.departure(applied)
        if not start.near or self.formulation is not None or start.qd.any():
            return ''
        Q = self._forces_at(applied, start.q)
        return singular_start.unexamined(start.model, start.q, start.singular, Q)

    def departure(self, applied: Applied) -> Branch | None:
        """The branch on which forces start the motion, from rest in a singular position. Raises
        AssemblyError where it is not unique."""
        start = self.start
        if start.singular is None or start.qd.any() or self.formulation is not None:
            return None
        return start.singular.departure(self._forces_at(applied, start.q))

    def _forces_at(self, applied: Applied, q: Floats, t: float = 0.0) -> Floats:
        """(blocks D,) N, at rest in q (blocks D, m) at t (s), with held inputs."""
        qd, angles = np.zeros_like(q), self.model.system.angles
        Q, near = np.zeros_like(q), np.zeros(angles.c.size // 2)
        places, turns = np.zeros(angles.c.size), np.zeros(near.size, dtype=np.int64)
        kernel.violation(self.model.unit, angles, q, places)
        kernel.nearby(places, turns, near)
        kernel.applied_forces(applied.assembled.effects, t, q, qd, near, Q)
        return Q


def _are_alike(one: Problem, other: Problem) -> bool:
    """Whether problems differ in their workspace only."""
    return one.forces is other.forces and one.system is other.system
