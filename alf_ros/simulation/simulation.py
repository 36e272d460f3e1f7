"""Simulation: a scene in motion. State in, compiled steps, Samples out."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cached_property
from typing import Any

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import AssemblyError, InputError, StepError
from alf_ros.kernel import Phase, Status, Watch
from alf_ros.model import assembly, singular_branches
from alf_ros.model.compile import allocate, compile_model
from alf_ros.model.consistency import Adjustment, made_consistent
from alf_ros.model.effect_directions import softened
from alf_ros.model.penalty import LEAST_PENALTY, fitted
from alf_ros.model.prescribed import prescribe
from alf_ros.model.singular_branches import Branch, Position
from alf_ros.model.tableaux import TABLEAUX, first_pace
from alf_ros.scene.scene import PICKED, Scene, Solver, joined
from alf_ros.simulation.accuracy import Budget, pick
from alf_ros.simulation.applied import NO_INPUTS, Applied, Inputs, Target, Wrench
from alf_ros.simulation.formulations import Formulation
from alf_ros.simulation.input_checks import checked_effort, checked_target, checked_wrench
from alf_ros.simulation.placement import placed
from alf_ros.simulation.reactions import Reactions
from alf_ros.simulation.resolution import Resolution, resolution
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.singular_passes import Pass, Watcher
from alf_ros.simulation.state import State
from alf_ros.simulation.status import beyond_reach
from alf_ros.simulation.work_ledger import DRIVES, INPUTS, accounts


class Simulation:
    """A scene, stepped.

    Keywords override the scene's solver section: `step` (s), `integrator`, `formulation`,
    `penalty` (α without dimension; alf2 takes 1e6 at least, and in soft mechanisms, such as long
    chains, more), `iterations` (at most, per solve), `tolerance` (relative error of a step, for an
    adaptive integrator, whose `step` is the grid it keeps), `accuracy` (m, in place of integrator
    and tolerance: they are picked by trying; the attribute `solver` says which, `accuracy` how
    well). With `watch` the passes through singular positions are found, for about the cost of one
    stage more a step. With `ledger` the work of each effect is integrated (`Sample.works`), for
    about the cost of the effects. Where redundant lengths contradict each other by a little they
    are adjusted; the attribute `adjustment` says how. Raises InputError for an unknown keyword,
    AssemblyError if the mechanism cannot be closed, redundant lengths contradict each other by
    more, or the initial velocities contradict each other.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        step: float | None = None,
        integrator: str | None = None,
        formulation: str | None = None,
        penalty: float | None = None,
        iterations: int | None = None,
        tolerance: float | None = None,
        accuracy: float | None = None,
        watch: bool = False,
        ledger: bool = False,
    ) -> None:
        given: dict[str, Any] = {
            'step': step,
            'integrator': integrator,
            'formulation': formulation,
            'penalty': penalty,
            'iterations': iterations,
            'tolerance': tolerance,
            'accuracy': accuracy,
        }
        self.scene = scene
        self.accuracy: Budget | None = None
        self.adjustment: Adjustment | None = None
        self._to_pick = False
        self.solver = self._asked({k: v for k, v in given.items() if v is not None})
        least = LEAST_PENALTY if self.solver.formulation == 'alf2' else 0.0
        self.model = compile_model(scene.mechanism, max(self.solver.penalty, least))
        self._method = self.solver.method
        try:
            q = self._assembled()
            consistent = made_consistent(self.model, q, self._dependent_rows)
            if consistent is not None:
                mechanism, self.adjustment = consistent
                self.model = compile_model(mechanism, self.model.penalty)
                q = self._assembled()
            if self.solver.formulation == 'alf2':
                self.model = fitted(self.model, self.model.system.ordinary)
            near = assembly.within(self.model, q, self._dependent_rows)
            if near:
                q = assembly.close(self.model, scene.positions, q, least=0.0)
            qd, self._singular = singular_branches.start(
                self.model, q, scene.velocities, self._dependent_rows, near
            )
        except AssemblyError as error:
            raise AssemblyError(error.message, file=scene.file, key=error.key) from None
        self._within = near and bool(qd.any())
        self.ledger = ledger
        # of `Sample.works`, by name
        self.accounts = self._named_accounts() if ledger else ()
        self._prepare()
        turns = np.zeros(self.model.system.angles.c.size // 2, dtype=np.int64)
        works = np.zeros(len(self.accounts))
        pace = self._first_pace(qd)
        loads = np.zeros(self._applied.load_count)
        self._phase = Phase(q.copy(), qd.copy(), turns.copy(), np.array([pace]), works, loads)
        self._formulation: Formulation | None = None
        self._carried: Floats = np.zeros(0)
        if self.solver.formulation != 'alf2':
            self._formulation = Formulation(self.model, self.solver, q)
            self._carried = self._formulation.start(q, qd)
        self._initial = State(
            0,
            q,
            qd,
            turns,
            pace,
            self._carried.copy(),
            NO_INPUTS,
            self._works(works),
            loads.copy(),
        )
        try:
            _ = self.departure  # raises where it is not unique
        except AssemblyError as error:
            raise AssemblyError(error.message, file=scene.file, key=error.key) from None
        self._watcher: Watcher | None = None
        # t (s), state, `_beside` and `Phase.within` of the last step aside
        self._aside: tuple[float, State, bool | None, Floats] | None = None
        self._iterations = 0
        self._step_cost = math.nan
        # whether the end of the last step was interpolated beside a singular position
        self._beside: bool | None = None
        if self._to_pick:
            self.accuracy = pick(self.solver, self._trial)
            self._use(self.accuracy.solver)
        self._watcher = self._watching() if watch else None
        self.restore(self._initial)

    def _assembled(self) -> Floats:
        """Closed positions q (blocks D, m), and what is ordinary near them, for the model to
        know."""
        q = assembly.close(self.model, self.scene.positions)
        self._dependent_rows, self._ordinary, sigma = assembly.ordinary(self.model, q)
        self.model = self.model.accustomed(sigma, self._dependent_rows)
        return q

    def _asked(self, given: Mapping[str, Any]) -> Solver:
        """The scene's solver section with what was given; without a section that of `given`."""
        scene = self.scene
        section = scene.solver if scene.says_solver or not given else Solver()
        settings = joined(asdict(section), given)
        solver = Solver(**settings)
        picked = [key for key in PICKED if key in settings]
        if solver.accuracy is None or len(picked) == len(PICKED):  # both: as a log says
            return solver
        if picked or solver.formulation != 'alf2':
            key = picked[0] if picked else 'formulation'
            raise InputError(
                'an accuracy picks integrator and tolerance, of alf2',
                key=key,
                value=settings[key],
                expected='one or the other',
            )
        self._to_pick = True
        return solver

    def _prepare(self) -> None:
        """What acts when nothing is held, and what a step of the method works on."""
        weights = self._method.b if self.ledger else None
        implicit = TABLEAUX[self.solver.integrator].implicit
        self._applied = Applied(
            self.model,
            self.scene.effects,
            NO_INPUTS,
            lambda: self._reactions,
            weights,
            tangents=implicit,
        )
        self._system = self.model.system
        self._advance_kernel = kernel.advance
        if implicit:
            directions = self._applied.directions
            self._system = softened(self._system, self.model.layout, directions)
            self._advance_kernel = kernel.advance_implicitly
        elif self._method.embedded.size:
            self._advance_kernel = kernel.advance_adaptively
        self._work = allocate(self.model, self._system, self._method.b.size)

    def _use(self, solver: Solver) -> None:
        """Take other settings, of alf2, from the start; nothing is assembled again."""
        self.solver, self._method = solver, solver.method
        self._prepare()
        pace = self._first_pace(self._initial.qd)
        self._initial = start = replace(self._initial, pace=pace)
        # arrays of its own: a trial shares everything else with the simulation it is a copy of
        self._phase = Phase(
            start.q.copy(),
            start.qd.copy(),
            start.turns.copy(),
            np.array([pace]),
            np.zeros(len(self.accounts)),
            start.loads.copy(),
        )
        self.restore(start)

    def _first_pace(self, qd: Floats) -> float:
        return first_pace(self.h, self.model.size, qd)

    def _trial(self, solver: Solver) -> Simulation:
        """The same simulation with other settings, to try them."""
        other = copy.copy(self)
        other._use(solver)
        return other

    # ------------------------------------------------------------------------------------- time

    @property
    def h(self) -> float:
        """The solver step, s."""
        return self.solver.step

    @property
    def step_index(self) -> int:
        """Number of steps taken."""
        return self._step

    @property
    def t(self) -> float:
        """Simulated time, s: step_index times h, so that no rounding adds up."""
        return self._step * self.solver.step

    @property
    def stages(self) -> int:
        """Stages of a step of the method."""
        return int(self._method.b.size)

    @property
    def yields(self) -> bool:
        """Whether an implicit integrator has something to do: an effect says how it yields."""
        return bool(self._system.soft.weight.size)

    @property
    def evaluations(self) -> int:
        """Stages evaluated so far, each with its q̈: what a run costs, whatever the machine."""
        return int(self._work.evaluations[0])

    @property
    def rounded_steps(self) -> int:
        """Steps taken so far although rounding kept their error above the tolerance.

        A shorter one would be no better. More than a few say that the tolerance asks too much.
        """
        return int(self._work.rounded[0])

    @property
    def resolution(self) -> Resolution:
        """How well the steps resolve the motion since the start or the last restored state, and
        whether they are too long. Measured with alf2 and the integrators of fixed steps."""
        if self._formulation is not None or not self._method.estimate.size:
            return Resolution(self.h)
        return resolution(self.h, self._work.judged)

    @property
    def step_error(self) -> float:
        """Estimated errors of the steps, displacements in parts of the size of the mechanism:
        their largest sum over about 1000 steps since the start or the last restored state.

        Above 0.005 the steps are too long, see `resolution`. NaN where nothing is measured.
        """
        return self.resolution.error

    def step(self, n: int = 1) -> None:
        """Take n steps in one compiled call that releases the GIL.

        Raises StepError if one fails; the state is then the last good one.
        """
        started = time.perf_counter()
        self._aside = None
        if self._watcher is None:
            result, taken = self._advance(self._phase, self._carried, self._step, n, self.h)
        else:
            result, taken = self._watcher.step(self._phase, self._step, n)
        self._step += taken
        if taken:
            self._beside = bool(self._work.aside[0])
            self._step_cost = (time.perf_counter() - started) / taken
        if result != Status.OK:
            raise StepError(*self._failure(result), self.t)

    def _watching(self) -> Watcher:
        if self._formulation is not None:
            raise InputError(
                'only alf2 watches for singular positions',
                key='formulation',
                value=self.solver.formulation,
            )
        return Watcher(
            self.model,
            self._dependent_rows,
            self._ordinary,
            self.h,
            self._advance_watched,
            self._step_aside,
            lambda t, phase: self._sample(t, self._state_of(phase), False).energy,
        )

    def _named_accounts(self) -> tuple[str, ...]:
        if self.solver.formulation != 'alf2':
            raise InputError(
                'only alf2 keeps a ledger', key='formulation', value=self.solver.formulation
            )
        labels = [effect.label for effect in self.scene.effects]
        for label in labels:
            if labels.count(label) > 1 or label in (INPUTS, DRIVES):
                raise InputError('two accounts of this name in the ledger', value=label)
        return accounts(labels)

    def _works(self, works: Floats) -> dict[str, float]:
        return dict(zip(self.accounts, works.tolist(), strict=True))

    @property
    def passes(self) -> tuple[Pass, ...]:
        """The passes through singular positions since the start or the last restored state.

        A pass is known after the step in which it happens. Raises InputError if the simulation
        does not watch.
        """
        if self._watcher is None:
            raise InputError('nobody watches', key='passes', expected='Simulation(…, watch=True)')
        return tuple(self._watcher.passes)

    def _failure(self, result: int) -> tuple[str, str]:
        found = beyond_reach(self.model, self._phase.q, self.t, self.h)
        if found is not None:
            return found
        if self._formulation:
            return self._formulation.failure(result)
        status = Status(result)
        reason, remedy = status.reason, status.remedy
        if status == Status.JAMMED:
            reason += f', at t = {self._applied.assembled.bearings.ended[0]:.9g} s'
        if status == Status.TOO_LONG:
            longest = self.resolution.adequate
            remedy = f'take a smaller step, {longest:g} s or less, or an adaptive integrator'
        return reason, remedy

    def _advance_watched(
        self, phase: Phase, first: int, n: int, watch: Watch | None
    ) -> tuple[int, int]:
        if watch is None:  # steps made before
            with self._unjudged():
                return self._advance(phase, self._carried, first, n, self.h)
        return self._advance(phase, self._carried, first, n, self.h, watch=watch)

    @contextmanager
    def _unjudged(self) -> Iterator[None]:
        """Steps that are not part of the run are not judged."""
        judged = self._work.judged.copy()
        yield
        self._work.judged[:] = judged

    def _step_aside(self, phase: Phase, start: float, h: float) -> int:
        """A step that is no part of the run, and is not counted; returns its result."""
        work, iterations = self._work, self._iterations
        counts = int(work.evaluations[0]), int(work.rounded[0]), int(work.aside[0])
        with self._unjudged():
            result, _ = self._advance(phase, self._carried, 0, 1, h, start)
        work.evaluations[0], work.rounded[0], work.aside[0] = counts
        self._iterations = iterations
        return result

    def _advance(
        self,
        phase: Phase,
        carried: Floats,
        first: int,
        n: int,
        h: float,
        start: float = 0.0,
        watch: Watch | None = None,
    ) -> tuple[int, int]:
        """n steps of h from `start` + `first` h (s); phase and `carried` are changed in place."""
        if self._formulation is not None:
            result, taken, self._iterations = self._formulation.advance(
                self._applied.assembled, self._work, phase, carried, start, first, n, h
            )
            return result, taken
        system, forces = self._system, self._applied.assembled
        method, work, unit = self._method, self._work, self.model.unit
        within = self._within and first == 0 and start == 0.0
        if self._singular is not None and first == 0 and start == 0.0 and not phase.qd.any():
            within = bool(self._singular.pull(self._forces_at_rest()).any())
        result, taken, self._iterations = self._advance_kernel(
            unit, system, forces, method, work, phase, watch, start, first, n, h, within
        )
        return result, taken

    @property
    def departure(self) -> Branch | None:
        """The branch on which what acts sets the mechanism going, if the scene starts at rest
        exactly in a singular position.

        By Gauss's principle of least constraint, see `branching.Position.departure`. None if it
        does not start so, if nothing acts on a branch, and if branches are not enumerated: then
        it goes where the branch is nearest to its acceleration without the rows that are lost.
        """
        if self._singular is None or self._initial.qd.any() or self._formulation is not None:
            return None
        return self._singular.departure(self._forces_at_rest())

    @property
    def singular_start(self) -> Position | None:
        """The position where the scene starts, to second order, if it is a singular one."""
        return self._singular

    def _forces_at_rest(self) -> Floats:
        """(blocks D,) N, where the scene starts, with what is held."""
        start, system = self._initial, self.model.system
        Q, near = np.zeros_like(start.q), np.zeros(system.angles.c.size // 2)
        angles = np.zeros(system.angles.c.size)
        kernel.violation(self.model.unit, system.angles, start.q, angles)
        kernel.nearby(angles, start.turns, near)
        effects = self._applied.assembled.effects
        kernel.applied_forces(effects, 0.0, start.q, start.qd, near, Q)
        return Q

    def run(
        self, duration: float, every: int = 1, at: Sequence[float] | None = None
    ) -> Iterator[Sample]:
        """Advance by `duration` (s), yielding a Sample now and after every `every` steps.

        Or at the times `at` (s from the start of the scene, ascending). An instant between two
        steps is reached aside, so that the motion is the same whatever is looked at. This costs
        a step per instant, and with an adaptive method at most the steps of the motion again.
        """
        if at is None:
            last = self._step + math.floor(duration / self.h + 1e-6)
            yield self.sample()
            while self._step + every <= last:
                self.step(every)
                yield self.sample()
            if self._step < last:
                self.step(last - self._step)
            return
        for t in at:
            if t < self.t - 1e-6 * self.h:
                raise InputError('lies in the past', key='at', value=t, expected='ascending times')
            steps = math.floor(t / self.h + 1e-6) - self._step
            if steps > 0:
                self.step(steps)
            yield self.sample() if t - self.t <= 1e-6 * self.h else self._sample_between(t)
        rest = math.floor(duration / self.h + 1e-6) - self._step
        if rest > 0:
            self.step(rest)

    # ------------------------------------------------------------------------------------ state

    @property
    def state(self) -> State:
        """A copy of the present state."""
        return self._state_of(self._phase)

    def _state_of(self, phase: Phase) -> State:
        return State(
            self._step,
            phase.q.copy(),
            phase.qd.copy(),
            phase.turns.copy(),
            float(phase.pace[0]),
            self._carried.copy(),
            self._applied.inputs,
            self._works(phase.works),
            phase.loads.copy(),
        )

    def restore(self, state: State) -> None:
        """Go on from a state of this scene. The run repeats bit for bit.

        Works that the state does not know begin at zero, loads with the balance that friction
        leads to as it is put on.
        """
        phase = self._phase
        self._step, self._beside = state.step, None
        phase.q[:], phase.qd[:], phase.turns[:] = state.q, state.qd, state.turns
        phase.pace[0], self._carried[:] = state.pace, state.carried
        phase.works[:] = [state.works.get(name, 0.0) for name in self.accounts]
        phase.loads[:] = state.loads if state.loads.size == phase.loads.size else 0.0
        phase.within[0] = math.nan if state.step else 0.0
        # a state may come from a log, which holds what moves freely
        prescribe(self.model.system, self.t, phase.q, phase.qd, np.zeros_like(phase.q))
        self._work.judged[:] = 0.0
        if self._watcher is not None:
            self._watcher.restart()
        self._hold(state.inputs)

    def reset(self) -> None:
        """Back to the initial state, no inputs held."""
        self.restore(self._initial)

    def place(
        self,
        body: str,
        pose: Sequence[float] | Floats | None = None,
        twist: Sequence[float] | Floats | None = None,
    ) -> None:
        """Go on with the frame of a body elsewhere, or with another velocity of it.

        pose and twist are given as `Sample.body_poses` has them: x, y (m), angle (rad) and their
        rates in the plane; x, y, z, quaternion x, y, z, w, and velocity and angular velocity (6,)
        in the world frame in space. The mechanism is assembled around it, on its branch, with its
        turns counted; velocities are those after an impulse on the body. Without a pose nothing
        changes its place, without a twist the body keeps its own where it can. Raises InputError,
        and changes nothing, for what cannot be.
        """
        q, qd, turns = placed(self.model, self.state, self.t, body, pose, twist)
        carried = self._formulation.start(q, qd) if self._formulation else self._carried.copy()
        pace = self._first_pace(qd)
        loads = np.zeros_like(self._phase.loads)
        self.restore(
            replace(self.state, q=q, qd=qd, turns=turns, pace=pace, carried=carried, loads=loads)
        )

    # ----------------------------------------------------------------------------------- inputs

    def apply_wrench(
        self,
        name: str,
        force: Sequence[float] | None = None,
        torque: float | Sequence[float] = 0.0,
        at: str | None = None,
        frame: str = 'world',
    ) -> None:
        """Hold a wrench on a body or a point from the next step on, in place of the one before.

        force: (D,) N; torque: N m, in the plane about +z, in space (3,); at: a point of the body,
        else its centre of mass; frame: that of both, 'world' or 'body'. Raises InputError, and
        changes nothing, for an unknown name, numbers that are not finite, or a torque on what does
        not turn.
        """
        zero = (0.0,) * self.model.layout.dimension
        moment = tuple(map(float, torque)) if isinstance(torque, Sequence) else float(torque)
        wrench = Wrench(zero if force is None else tuple(map(float, force)), moment, at, frame)
        checked_wrench(self.model, name, wrench)
        inputs = self._applied.inputs
        self._hold(replace(inputs, wrenches={**inputs.wrenches, name: wrench}))

    def apply_effort(self, joint: str, effort: float | Curve) -> None:
        """Hold an effort (N m, or N on a slider) on a joint: on the child, and back on the parent.

        A curve is an effort over the simulated time. Raises InputError, and changes nothing, for
        an unknown joint or a number that is not finite.
        """
        effort = checked_effort(self.model, joint, effort)
        inputs = self._applied.inputs
        self._hold(replace(inputs, efforts={**inputs.efforts, joint: effort}))

    def apply_target(
        self, joint: str, position: float | Curve | None = None, velocity: float | None = None
    ) -> None:
        """Give the motor on a joint another x* (rad or m, or a curve over the simulated time) and
        ẋ* (rad/s or m/s; the slope of x* if absent), in place of the ones before.

        Raises InputError, and changes nothing, for an unknown joint, one on which no motor of the
        scene controls that, or a number that is not finite.
        """
        target = Target(position, velocity)
        checked_target(self.model, self.scene.effects, joint, target)
        inputs = self._applied.inputs
        self._hold(replace(inputs, targets={**inputs.targets, joint: target}))

    def clear_inputs(self) -> None:
        """Hold nothing any more."""
        self._hold(NO_INPUTS)

    def _hold(self, inputs: Inputs) -> None:
        if inputs != self._applied.inputs:
            self._aside = None
            self._applied = self._applied.holding(inputs)

    # ---------------------------------------------------------------------------------- samples

    def sample(self) -> Sample:
        """The present state to read from; nothing in it is computed before it is asked for."""
        return self._sample(self.t, self.state, self._beside)

    def _sample_between(self, t: float) -> Sample:
        """The motion at t (s), between two grid points. The state of the run does not change.

        A method of fixed steps takes one step from the last grid point. An adaptive method goes
        on from the last instant that was asked for: otherwise each instant would cost all steps
        since the grid point.
        """
        here = self.t, self.state, self._beside, self._phase.within
        start, state, beside, within = self._aside or here
        if t < start or not self._method.embedded.size:
            start, state, beside, within = here
        if t > start:
            works = np.array([state.works[name] for name in self.accounts])
            pace, carried = np.array([state.pace]), state.carried.copy()
            arrays = state.q.copy(), state.qd.copy(), state.turns.copy()
            phase = Phase(*arrays, pace, works, state.loads.copy(), within.copy())
            with self._unjudged():
                result, _ = self._advance(phase, carried, 0, 1, t - start, start)
            if result != Status.OK:
                raise StepError(*self._failure(result), self.t)
            state = replace(
                state,
                q=phase.q,
                qd=phase.qd,
                turns=phase.turns,
                pace=float(pace[0]),
                carried=carried,
                loads=phase.loads,
                works=self._works(works),
            )
            beside = bool(self._work.aside[0])
            self._aside = t, state, beside, phase.within
        return self._sample(t, state, beside)

    def _sample(self, t: float, state: State, beside: bool | None) -> Sample:
        """`beside`: whether the step that ended there was interpolated beside a singular position;
        None if no step did."""

        return Sample(
            self.model,
            self._applied,
            self.solver,
            t,
            state,
            lambda: self._dependent_rows,
            lambda: self._reactions,
            self._iterations,
            self._step_cost,
            False if self._formulation else beside,
            self.resolution,
        )

    @cached_property
    def _reactions(self) -> Reactions:
        return Reactions(self.model)
