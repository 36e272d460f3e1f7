"""Simulation: a scene in motion. State in, compiled steps, Samples out."""

from __future__ import annotations

import copy
import math
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from alf_ros.arrays import Integers
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import AssemblyError, InputError
from alf_ros.kernel import Phase, Status, Watch
from alf_ros.mechanism.form_of_rows import form_of, whole_form
from alf_ros.model.compile import Model
from alf_ros.model.singular_branches import Branch, Position
from alf_ros.resources import version
from alf_ros.scene.scene import Scene, Solver, joined
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.accuracy import Budget, pick
from alf_ros.simulation.adjoint_following import AdjointFollowing
from alf_ros.simulation.applied import NO_INPUTS, Applied, Inputs, Target
from alf_ros.simulation.between import Between
from alf_ros.simulation.displaced_scenes import Middle
from alf_ros.simulation.formulations import Formulation
from alf_ros.simulation.one_thread import by_one_thread
from alf_ros.simulation.parameter_slopes import AnotherFormError
from alf_ros.simulation.placement import placed
from alf_ros.simulation.present import Present
from alf_ros.simulation.quantity_tangents import QuantityTangents
from alf_ros.simulation.resolution import Resolution
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.singular_passes import Pass, Watcher
from alf_ros.simulation.solver_choice import chosen
from alf_ros.simulation.start import started
from alf_ros.simulation.state import State
from alf_ros.simulation.state_trail import StateTrail
from alf_ros.simulation.stepping import Stepper
from alf_ros.simulation.tangent_following import (
    Followed,
    TangentFollowing,
    check_settings,
    checked_names,
)
from alf_ros.simulation.work_ledger import named_accounts


class Simulation:
    """A scene, stepped.

    Keywords override the scene's solver section: `step` (s), `integrator`, `formulation`,
    `penalty` (α without dimension; alf2 uses 1e6 at least, and in soft mechanisms, such as long
    chains, more), `iterations` (at most, per solve), `tolerance` (relative error of a step, for an
    adaptive integrator, whose `step` is the grid it keeps), `accuracy` (m, in place of integrator
    and tolerance: they are picked by trying; the attribute `solver` says which, `accuracy` how
    well). With `watch` the passes through singular positions are found, for about the cost of one
    stage more a step. With `ledger` the work of each effect is integrated (`Sample.works`), for
    about the cost of the effects. Where redundant lengths contradict each other by a little they
    are adjusted; the attribute `adjustment` says how. With `tangents`, names of numbers of the
    scene, derivatives follow the steps (`Sample.tangents`). `like` is a simulation of the scene
    with other numbers: where its slopes serve again, fewer scenes are read. Raises InputError for
    a value that cannot be used, AssemblyError if the mechanism cannot be closed, redundant lengths
    contradict each other by more, or the initial velocities contradict each other.

    A call that raises InputError has changed nothing. A step that fails or is interrupted leaves
    the state of the last whole step, with its time. A copy, by `copy` or `pickle`, continues from
    the present independently, bit for bit. One thread at a time may use a Simulation, else
    BusyError; `t`, `step_index` and `stop` are free for all.
    """

    _present: Present
    _watcher: Watcher | None
    _written = False  # whether steps are written down for gradients

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
        tangents: Sequence[str] = (),
        like: Simulation | None = None,
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
        if not isinstance(scene, Scene):
            raise InputError('not a scene', key='scene', value=scene, expected='load_scene(…)')
        if like is not None and not isinstance(like, Simulation):
            raise InputError('not a simulation', key='like', value=like, expected='Simulation(…)')
        watches, self.ledger = check.truth(watch, 'watch'), check.truth(ledger, 'ledger')
        names = checked_names(tangents)
        self._lock = threading.Lock()
        self.scene = scene
        self._following: TangentFollowing | None = None
        self._unfolded: dict[str, float] = {}  # t (s) from which a tangent does not exist
        self.accuracy: Budget | None = None
        solver, to_pick = chosen(scene, {k: v for k, v in given.items() if v is not None})
        # of `Sample.works`, by name
        self.accounts = named_accounts(scene.effects, solver) if self.ledger else ()
        self._begin(solver)
        if to_pick:
            self.accuracy = pick(solver, self._with, explicit=bool(names))
            self._use(self.accuracy.solver)
        if names:
            known = like.following if like is not None else None
            self._following = self._following_of(names, known)
            self._use(self.solver)
        if watches or (self._following is not None and self._following.placing):
            self._watcher = self._watching()

    def _begin(self, solver: Solver) -> None:
        """The scene where it starts."""
        self._start = started(self.scene, solver)
        self.adjustment = self._start.adjustment
        self._set_up(solver)
        self._initial = self._stepper.initial(self.accounts)
        self._enter(self._initial, self._stepper.applied)
        try:
            told = self._stepper.examined(self._applied)
        except AssemblyError as error:
            raise AssemblyError(
                error.message, file=self.scene.file, key=error.key, expected=error.expected
            ) from None
        if told:
            self._start = replace(self._start, unexamined=told)
            self._use(solver)

    def _following_of(
        self, names: Sequence[str], known: TangentFollowing | None = None
    ) -> TangentFollowing:
        """Tangents by these numbers, from the start. Where scenes beside this one have equations
        with other entries, the scene is begun again with all of them."""
        try:
            return TangentFollowing(names, self.scene, self.solver, self._start, known)
        except AnotherFormError:
            here, first = self.state, self._initial
            same = np.array_equal(here.q, first.q) and np.array_equal(here.qd, first.qd)
            begins = here.step == 0 and here.inputs == first.inputs and same
            if self._start.model.layout.asked.whole or not begins:
                raise
        with form_of(whole_form()):
            self._begin(self.solver)
        return TangentFollowing(names, self.scene, self.solver, self._start, known)

    def _set_up(self, solver: Solver, formulation: Formulation | None = None) -> None:
        """The data of steps with these settings."""
        self.solver, self.model = solver, self._start.model
        self._stepper = Stepper(
            self._start,
            solver,
            self.scene.effects,
            self.ledger,
            formulation,
            self._following,
            self._written,
        )
        self._quantity_tangents: QuantityTangents | None = None
        if self._following is not None:
            middle = Middle(self.scene, self.model, solver, type(self))
            self._quantity_tangents = QuantityTangents(self._following, middle)
        self._watcher = None
        self._between = Between(self._stepper)
        self._step_cost = math.nan

    def _use(self, solver: Solver) -> None:
        """Take other settings, of alf2, from the start; nothing is assembled again."""
        self._set_up(solver)
        start = self._following.initial if self._following else np.zeros(0)
        pace = self._stepper.first_pace(self._initial.qd)
        self._initial = replace(self._initial, pace=pace, tangents=start)
        self._enter(self._initial, self._stepper.applied)

    def with_solver(
        self, integrator: str | None = None, tolerance: float | None = None
    ) -> Simulation:
        """The same scene from its start, solved otherwise by alf2; it is not assembled again.

        integrator, tolerance: as of `Simulation`; None keeps the present one. Raises InputError.
        """
        given = {'integrator': integrator, 'tolerance': tolerance}
        changes = {k: v for k, v in given.items() if v is not None}
        solver = Solver(**joined(vars(self.solver), changes))
        if self._following is not None:
            check_settings(solver)
        return self._with(solver)

    def _with(self, solver: Solver) -> Simulation:
        other = copy.copy(self)
        other._use(solver)
        return other

    @property
    def following(self) -> TangentFollowing | None:
        """How the scene changes with each number of `tangents`; None without tangents."""
        return self._following

    # ------------------------------------------------------------------------------------ copies

    @by_one_thread
    def __getstate__(self) -> dict[str, Any]:
        """Scene, start, state and counts, without the arrays that compiled code writes."""
        return {
            'version': version(),
            'scene': self.scene,
            'solver': self.solver,
            'accuracy': self.accuracy,
            'ledger': self.ledger,
            'start': self._start,
            'initial': self._initial,
            'state': self._present.state(),
            'since': self._present.since,
            'within': self._present.phase.within.copy(),
            'formulation': self._stepper.formulation,
            'following': self._following,
            'unfolded': dict(self._unfolded),
            'steps': self._stepper.memory,
            'step_cost': self._step_cost,
            'watcher': self._watcher.memory if self._watcher else None,
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        if saved['version'] != version():
            raise InputError(
                'pickled by another version', value=saved['version'], expected=version()
            )
        self._lock = threading.Lock()
        self.scene, self.accuracy, self.ledger = (
            saved[name] for name in ('scene', 'accuracy', 'ledger')
        )
        self._start, self._initial = saved['start'], saved['initial']
        self._following, unfolded = saved['following'], saved['unfolded']
        self._unfolded = {}
        self.adjustment = self._start.adjustment
        self.accounts = named_accounts(self.scene.effects, saved['solver']) if self.ledger else ()
        self._set_up(saved['solver'], saved['formulation'])
        self._enter(saved['state'], self._stepper.applied)
        self._present = replace(self._present, since=saved['since'])
        self._present.phase.within[:] = saved['within']
        self._stepper.recall(saved['steps'])
        self._step_cost, self._unfolded = saved['step_cost'], dict(unfolded)
        if saved['watcher'] is not None:
            self._watcher = self._watching()
            self._watcher.recall(saved['watcher'])

    def __copy__(self) -> Simulation:
        return self._of(self._start.model.apart())

    def _standing(self) -> Simulation:
        """A copy in which drives and moving surfaces stay where a state has them."""
        return self._of(self._start.model.standing())

    def _of(self, model: Model) -> Simulation:
        """A copy with a model of the same coordinates."""
        saved = self.__getstate__()
        start = saved['start'] = replace(self._start, model=model)
        if saved['formulation'] is not None:
            saved['formulation'] = saved['formulation'].apart(start.model)
        other = type(self).__new__(type(self))
        other.__setstate__(saved)
        return other

    def __deepcopy__(self, memo: dict[int, Any]) -> Simulation:
        return self.__copy__()

    # ------------------------------------------------------------------------------------- time

    @property
    def h(self) -> float:
        """The solver step, s."""
        return self._stepper.h

    @property
    def step_index(self) -> int:
        """Number of steps taken."""
        return self._present.step

    @property
    def t(self) -> float:
        """Simulated time, s: step_index times h, so that no rounding adds up."""
        return self._present.step * self._stepper.h

    @property
    def stages(self) -> int:
        """Stages of a step of the method."""
        return int(self._stepper.method.b.size)

    @property
    def yields(self) -> bool:
        """Whether an implicit integrator has something to do: an effect says how it yields."""
        return bool(self._stepper.system.soft.weight.size)

    @property
    def evaluations(self) -> int:
        """Stages evaluated so far, each with its q̈: what a run costs, whatever the machine."""
        return self._stepper.evaluations

    @property
    def rounded_steps(self) -> int:
        """Steps taken so far although rounding kept their error above the tolerance.

        A shorter one would be no better. More than a few say that the tolerance asks too much.
        """
        return self._stepper.rounded

    @property
    def resolution(self) -> Resolution:
        """How well the steps resolve the motion since the start or the last restored state, and
        whether they are too long; and the parts that were not examined. Measured with alf2, steps
        with the integrators of fixed steps."""
        return self._stepper.resolution_later(self._applied)()

    @property
    def missed(self) -> float:
        """By how much (m) lengths miss a singular position on the way from the start; 0 if by
        nothing that is felt, or if it is not looked for: with drives, rows of velocities, or more
        than 600 coordinates. Known from when it is first asked for: some tenths of a second."""
        return self._stepper.missed.on_the_way

    @property
    def step_error(self) -> float:
        """Estimated errors of the steps, displacements in parts of the size of the mechanism:
        their largest sum over about 1000 steps since the start or the last restored state.

        With more than 1e-6 a step, of 100 steps at least, they are too long, see `resolution`.
        NaN where nothing is measured.
        """
        return self._stepper.step_error

    # ------------------------------------------------------------------------------------- steps

    @by_one_thread
    def step(self, n: int = 1) -> None:
        """Take n steps in one compiled call that releases the GIL.

        Raises StepError if one fails, and StoppedError or the exception of a signal handler if one
        is interrupted; the state is then the end of the last whole step.
        """
        self._advance(n)

    @by_one_thread
    def _step_along(self, n: int, trail: StateTrail) -> None:
        """n steps, with the states on the way. Raises as `step` does."""
        self._stepper.trail = trail.trail
        try:
            self._advance(n)
        finally:
            self._stepper.trail = None

    def _advance(self, n: int) -> None:
        started, present = time.perf_counter(), self._present
        first = present.step
        n = check.whole(n, 'n', 0, check.MOST_STEPS - first)
        if self._watcher is None:
            status = self._stepper.advance(present, n)
        else:
            status = self._watcher.step(present.phase, n)
        if present.step > first:
            self._step_cost = (time.perf_counter() - started) / (present.step - first)
        if status != Status.OK:
            raise self._stepper.error(status, present)

    def stop(self) -> None:
        """End the step that another thread takes, or else the next one, with StoppedError.

        Any thread may call this, and a handler of signals.
        """
        self._stepper.listener.stop()

    def run(
        self, duration: float, every: int = 1, at: Sequence[float] | None = None
    ) -> Iterator[Sample]:
        """Advance by `duration` (s), yielding a Sample now and after every `every` steps.

        Or at the times `at` (s from the start of the scene, ascending), also behind the duration.
        An instant between two steps is computed separately, so that the motion does not depend on
        the requested instants. This costs a step per instant, and with an adaptive method at most
        the steps of the motion again. After an early end of the run the simulation continues from
        the last whole step.
        """
        last = self.step_index + check.steps_of(duration, self.h, self.step_index)
        every = check.whole(every, 'every', 1)
        if at is None:
            return self._run_every(every, last)
        return self._run_at(check.times(at, self.t, self.h), last)

    def _run_every(self, every: int, last: int) -> Iterator[Sample]:
        yield self.sample()
        while self.step_index + every <= last:
            self.step(every)
            yield self.sample()
        if self.step_index < last:
            self.step(last - self.step_index)

    def _run_at(self, times: Sequence[float], last: int) -> Iterator[Sample]:
        for t in times:
            steps = math.floor(t / self.h + check.CLOSE) - self.step_index
            if steps > 0:
                self.step(steps)
            yield self._sample_at(t)
        if self.step_index < last:
            self.step(last - self.step_index)

    def _trail(self, steps: Integers) -> StateTrail:
        """For `_step_along`, at these steps."""
        return StateTrail(steps, self._present.phase)

    @by_one_thread
    def _begin_writing(self) -> None:
        """From here on steps end at the kinks that derivatives need, as with tangents."""
        state, self._written = self._present.state(), True
        self._set_up(self.solver)
        self._enter(state, self._stepper.applied)

    @by_one_thread
    def _write_down(self, adjoint: AdjointFollowing, n: int) -> None:
        """n steps, written down. Raises StepError."""
        adjoint.write_down(self._present, n)

    # ------------------------------------------------------------------------ singular positions

    def _watching(self) -> Watcher:
        if self._stepper.formulation is not None:
            raise InputError(
                'only alf2 watches for singular positions',
                key='formulation',
                value=self.solver.formulation,
            )
        return Watcher(
            self.model,
            self._start.dependent_rows,
            self._start.ordinary,
            self.h,
            self._advance_watched,
            self._step_aside,
            self._energy,
        )

    def _advance_watched(self, n: int, watch: Watch | None) -> Status:
        return self._stepper.advance(self._present, n, watch)

    def _step_aside(self, phase: Phase, start: float, h: float) -> Status:
        present = replace(self._present, phase=phase)
        return self._stepper.aside(present, start, h, counted=False)

    def _energy(self, t: float, phase: Phase) -> float:
        return self._sample(t, replace(self._present, phase=phase).state(), False).energy

    @property
    def passes(self) -> tuple[Pass, ...]:
        """The passes through singular positions since the start or the last restored state.

        A pass is known after the step in which it happens. Raises InputError if the simulation
        does not watch.
        """
        return self._passes()

    @by_one_thread
    def _passes(self) -> tuple[Pass, ...]:
        if self._watcher is None:
            raise InputError('nobody watches', key='passes', expected='Simulation(…, watch=True)')
        self._watcher.finish()
        return tuple(self._watcher.passes)

    @property
    def departure(self) -> Branch | None:
        """The branch on which forces start the motion, if the scene starts at rest exactly in a
        singular position.

        By Gauss's principle of least constraint, see `branching.Position.departure`. None for
        other starts, if no force acts along a branch, and if branches are not enumerated. In the
        last case the motion follows the branch nearest to the acceleration without the lost rows.
        """
        return self._stepper.departure(self._applied)

    @property
    def singular_start(self) -> Position | None:
        """The position where the scene starts, to second order, if it is a singular one."""
        return self._start.singular

    @property
    def dependent_rows(self) -> int:
        """Number of constraint rows that depend on the others in ordinary positions."""
        return self._start.dependent_rows

    # ------------------------------------------------------------------------------------ state

    @property
    def state(self) -> State:
        """A copy of the present state."""
        return self._state()

    @by_one_thread
    def _state(self) -> State:
        return self._present.state()

    @by_one_thread
    def restore(self, state: State) -> None:
        """Continue from a state of this scene. The run repeats bit for bit.

        A state reached with steps of another length continues at its time.
        Works that the state does not know begin at zero, loads with the balance that is reached as
        friction grows from zero. Raises InputError, and changes nothing, for a state of another
        scene, or one whose time is not a whole number of steps.
        """
        model, effects = self.model, self.scene.effects
        state = check.checked_state(model, effects, state, self._initial, self.accounts)
        self._enter(state.counted(self.h), self._applied)

    def _enter(self, state: State, applied: Applied) -> None:
        """Continue from a usable state; uses the packed parts of `applied`."""
        present = Present.at(self.model, state, applied, self.accounts, self.h)
        self._stepper.begin()
        self._unfolded = {n: t for n, t in self._unfolded.items() if t <= state.step * self.h}
        if self._watcher is not None:
            self._watcher.restart()
        self._present = present

    @by_one_thread
    def reset(self) -> None:
        """Back to the initial state, no inputs held."""
        self._enter(self._initial, self._applied)

    @by_one_thread
    def place(
        self,
        body: str,
        pose: Sequence[float] | Any | None = None,
        twist: Sequence[float] | Any | None = None,
        branch: int | None = None,
    ) -> None:
        """Continue with the frame of a body elsewhere, or with another velocity of it.

        pose and twist are given as `Sample.body_poses` has them: x, y (m), angle (rad) and their
        rates in the plane; x, y, z, quaternion x, y, z, w, and velocity and angular velocity (6,)
        in the world frame in space. The mechanism is assembled around it, on its branch, with its
        turns counted; velocities follow from an impulse on the body. Without a pose all places
        stay, without a twist the body keeps its own if possible. branch: in a singular position,
        the number of the branch on which the motion continues, as `branches` and `check` count
        them; without a twist the velocities become the nearest ones of the branch. Raises
        InputError, and changes nothing, for an impossible request.
        """
        if self._following is not None:
            raise InputError('no tangents of a placed body', key='body', value=body)
        now, formulation = self._present.state(), self._stepper.formulation
        if branch is not None:
            branch = check.whole(branch, 'branch', 1)
        q, qd, turns = placed(
            self.model, now, self.t, body, pose, twist, branch, self.dependent_rows
        )
        carried = formulation.start(q, qd) if formulation else now.carried
        pace, loads = self._stepper.first_pace(qd), np.zeros_like(now.loads)
        moved = replace(now.moved(q, qd, turns), pace=pace, carried=carried, loads=loads)
        self._enter(moved, self._applied)

    # ----------------------------------------------------------------------------------- inputs

    @property
    def _applied(self) -> Applied:
        return self._present.applied

    @by_one_thread
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
        else its centre of mass; frame: the frame of both, 'world' or 'body'. Raises InputError,
        and changes nothing, for an unknown name, numbers that are not finite, or a torque on a
        point.
        """
        wrench = check.checked_wrench_of(self.model, name, force, torque, at, frame)
        inputs = self._applied.inputs
        self._hold(replace(inputs, wrenches={**inputs.wrenches, name: wrench}))

    @by_one_thread
    def apply_effort(self, joint: str, effort: float | Curve) -> None:
        """Hold an effort (N m, or N on a slider) on a joint: on the child, and back on the parent.

        A curve is an effort over the simulated time. Raises InputError, and changes nothing, for
        an unknown joint or a number that is not finite.
        """
        effort = check.checked_effort(self.model, check.text(joint, 'joint'), effort)
        inputs = self._applied.inputs
        self._hold(replace(inputs, efforts={**inputs.efforts, joint: effort}))

    @by_one_thread
    def apply_target(
        self, joint: str, position: float | Curve | None = None, velocity: float | None = None
    ) -> None:
        """Give the motor on a joint, or the tendon of that name, another x* (rad or m, or a curve
        over the simulated time) and ẋ* (rad/s or m/s; the slope of x* if absent), in place of the
        ones before.

        Raises InputError, and changes nothing, for an unknown joint, one on which no motor of the
        scene controls that, or a number that is not finite.
        """
        target = Target(position, velocity)
        check.checked_target(self.model, self.scene.effects, check.text(joint, 'joint'), target)
        inputs = self._applied.inputs
        self._hold(replace(inputs, targets={**inputs.targets, joint: target}))

    @by_one_thread
    def clear_inputs(self) -> None:
        """Hold nothing any more."""
        self._hold(NO_INPUTS)

    def _hold(self, inputs: Inputs) -> None:
        """Raises InputError, and changes nothing, for what cannot be packed."""
        if inputs != self._applied.inputs:
            present = replace(self._present, applied=self._applied.holding(inputs))
            self._present = present

    # ---------------------------------------------------------------------------------- samples

    @by_one_thread
    def sample(self) -> Sample:
        """The present state to read from; nothing in it is computed before it is asked for."""
        present = self._present
        return self._sample(self.t, present.state(), self._stepper.beside(present))

    def _sample_at(self, t: float) -> Sample:
        """The motion at t (s), now or before the end of the next step. Raises StepError."""
        return self.sample() if t - self.t <= check.CLOSE * self.h else self._sample_between(t)

    @by_one_thread
    def _sample_between(self, t: float) -> Sample:
        """The motion at t (s), between two grid points."""
        return self._sample(t, *self._between.at(self._present, t), whole=False)

    def _followed(self, whole: bool) -> Followed | None:
        """The tangents of a sample, and those that do not exist there; `whole`: it is one of a
        whole step, up to which singular positions are found."""
        following, watcher = self._following, self._watcher
        if following is None:
            return None
        if following.placing and watcher is not None:
            for passed in watcher.passes:
                for name in following.unfolded_by(passed):
                    self._unfolded.setdefault(name, passed.t)
        told = 'it unfolds the singular position passed at t = {:.6g} s'
        refused = {name: told.format(t) for name, t in self._unfolded.items()}
        if not whole:
            told = 'of a length or a drive it is known at whole steps, where passes are found'
            refused = {**dict.fromkeys(following.placing, told), **refused}
        assert self._quantity_tangents is not None
        return Followed(following, refused, self._quantity_tangents.of)

    def _sample(self, t: float, state: State, beside: bool | None, whole: bool = True) -> Sample:
        """`beside`: whether the step that ended there was interpolated beside a singular position;
        None if no step did; `whole`: whether it is at the end of a whole step."""
        return Sample(
            self.model,
            self._applied,
            self.solver,
            t,
            state,
            self._start.dependent_rows,
            self._stepper.instruments,
            self._stepper.iterations,
            self._step_cost,
            False if self._stepper.formulation else beside,
            self._stepper.resolution_later(self._applied),
            self._followed(whole),
        )
