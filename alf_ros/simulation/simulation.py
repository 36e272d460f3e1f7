"""Simulation: a scene in motion. State in, compiled steps, Samples out."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from alf_ros.arrays import Integers
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import AssemblyError, InputError
from alf_ros.mechanism.form_of_rows import form_of, whole_form
from alf_ros.model.compile import Model
from alf_ros.model.singular_branches import Branch, Position
from alf_ros.resources import version
from alf_ros.scene.scene import SceneSource, Solver, joined, load_scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.accuracy import Budget, pick
from alf_ros.simulation.adjoint_following import AdjointFollowing
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.displaced_scenes import Middle
from alf_ros.simulation.formulations import Formulation
from alf_ros.simulation.input_values import NO_INPUTS, Target
from alf_ros.simulation.lasting_tangents import LastingTangents
from alf_ros.simulation.one_thread import by_one_thread
from alf_ros.simulation.parameter_slopes import AnotherFormError
from alf_ros.simulation.placement import placed
from alf_ros.simulation.resolution import Resolution
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.singular_passes import Pass
from alf_ros.simulation.solver_choice import chosen
from alf_ros.simulation.start import started
from alf_ros.simulation.state import State
from alf_ros.simulation.state_trail import StateTrail
from alf_ros.simulation.stepped_run import SteppedRun
from alf_ros.simulation.stepping import Stepper
from alf_ros.simulation.tangent_following import (
    TangentFollowing,
    check_settings,
    checked_names,
)
from alf_ros.simulation.work_ledger import named_accounts


class Simulation:
    """A scene, stepped: a Scene, or what `load_scene` takes.

    Keywords override the scene's solver section: `step` (s), `integrator`, `formulation`,
    `penalty` (α without dimension; alf2 uses 1e6 at least, and in soft mechanisms, such as long
    chains, more), `iterations` (at most, per solve), `tolerance` (relative error of a step, for an
    adaptive integrator, whose `step` is the grid it keeps), `accuracy` (m, in place of integrator
    and tolerance: they are picked by trying; the attribute `solver` says which, `accuracy` how
    well). With `watch` the passes through singular positions are found, for about the cost of one
    stage more a step. With `ledger` the work of each effect is integrated (`Sample.works`), for
    about the cost of the effects. Where redundant lengths contradict each other by a little they
    are adjusted; the attribute `adjustment` says how. With `tangents`, names of numbers of the
    scene or of inputs, derivatives follow the steps (`Sample.tangents`). `like` is a
    simulation of the scene with other numbers: where its slopes serve again, fewer scenes are
    read. Raises InputError for a value that cannot be used, AssemblyError if the mechanism
    cannot be closed, redundant lengths contradict each other by more, or the initial
    velocities contradict each other.

    A call that raises InputError has changed nothing. A step that fails or is interrupted leaves
    the state of the last whole step, with its time. A copy, by `copy` or `pickle`, continues from
    the present independently, bit for bit. One thread at a time may use a Simulation, else
    BusyError; `t`, `step_index` and `stop` are free for all.
    """

    _run: SteppedRun

    def __init__(
        self,
        scene: SceneSource,
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
        scene = load_scene(scene)
        if like is not None and not isinstance(like, Simulation):
            raise InputError('not a simulation', key='like', value=like, expected='Simulation(…)')
        watches, self.ledger = check.truth(watch, 'watch'), check.truth(ledger, 'ledger')
        names = checked_names(tangents)
        self._lock = threading.Lock()
        self.scene = scene
        self._following: TangentFollowing | None = None
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
            self._run.watch()

    def _begin(self, solver: Solver) -> None:
        """The scene where it starts."""
        self._start = started(self.scene, solver)
        self.adjustment = self._start.adjustment
        self._use(solver)
        try:
            told = self._run.stepper.examined(self._run.applied)
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

    def _use(self, solver: Solver) -> None:
        """The run with these settings, from the start; nothing is assembled again."""
        self.solver, self.model = solver, self._start.model
        stepper = self._stepper_for(solver)
        self._initial = stepper.initial(self.accounts)
        self._run = self._run_from(self._initial, stepper, self._tangents())

    def _stepper_for(
        self, solver: Solver, formulation: Formulation | None = None, written: bool = False
    ) -> Stepper:
        effects, following = self.scene.effects, self._following
        return Stepper(self._start, solver, effects, self.ledger, formulation, following, written)

    def _tangents(self) -> LastingTangents | None:
        """As a run has them that nothing has passed."""
        if self._following is None:
            return None
        middle = Middle(self.scene, self.model, self.solver, type(self))
        return LastingTangents(self._following, middle)

    def _run_from(
        self, state: State, stepper: Stepper, tangents: LastingTangents | None
    ) -> SteppedRun:
        return SteppedRun(self._start, self.solver, stepper, state, self.accounts, tangents)

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
            'formulation': self._run.stepper.formulation,
            'following': self._following,
            'run': self._run.memory,
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
        self._following, memory = saved['following'], saved['run']
        self.adjustment = self._start.adjustment
        self.solver, self.model = saved['solver'], self._start.model
        self.accounts = named_accounts(self.scene.effects, self.solver) if self.ledger else ()
        stepper = self._stepper_for(self.solver, saved['formulation'])
        self._run = self._run_from(memory['state'], stepper, self._tangents())
        self._run.recall(memory)

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
        return self._run.stepper.h

    @property
    def step_index(self) -> int:
        """Number of steps taken."""
        return self._run.present.step

    @property
    def t(self) -> float:
        """Simulated time, s: step_index times h, so that no rounding adds up."""
        return self._run.t

    @property
    def stages(self) -> int:
        """Stages of a step of the method."""
        return int(self._run.stepper.method.b.size)

    @property
    def yields(self) -> bool:
        """Whether an implicit integrator has something to do: an effect says how it yields."""
        return bool(self._run.stepper.system.soft.weight.size)

    @property
    def evaluations(self) -> int:
        """Stages evaluated so far, each with its q̈: what a run costs, whatever the machine."""
        return self._run.stepper.evaluations

    @property
    def rounded_steps(self) -> int:
        """Steps taken so far although rounding kept their error above the tolerance.

        A shorter one would be no better. More than a few say that the tolerance asks too much.
        """
        return self._run.stepper.rounded

    @property
    def resolution(self) -> Resolution:
        """How well the steps resolve the motion since the start or the last restored state, and
        whether they are too long; and the parts that were not examined. Measured with alf2, steps
        with the integrators of fixed steps."""
        return self._run.stepper.resolution_later()()

    @property
    def missed(self) -> float:
        """By how much (m) lengths miss a singular position on the way from the start; 0 if by
        nothing that is felt, or if it is not looked for: with more than one freedom without
        drives, or more than 600 coordinates. Known from when it is first asked for: some tenths
        of a second."""
        return self._run.stepper.missed.on_the_way

    @property
    def step_error(self) -> float:
        """Estimated errors of the steps, displacements in parts of the size of the mechanism:
        their largest sum over about 1000 steps since the start or the last restored state.

        With more than 1e-6 a step, of 100 steps at least, they are too long, see `resolution`.
        NaN where nothing is measured.
        """
        return self._run.stepper.step_error

    # ------------------------------------------------------------------------------------- steps

    @by_one_thread
    def step(self, n: int = 1) -> None:
        """Take n steps in one compiled call that releases the GIL.

        Raises StepError if one fails, and StoppedError or the exception of a signal handler if one
        is interrupted; the state is then the end of the last whole step.
        """
        self._run.advance(n)

    @by_one_thread
    def _step_along(self, n: int, trail: StateTrail) -> None:
        """n steps, with the states on the way. Raises as `step` does."""
        self._run.advance_along(n, trail)

    def stop(self) -> None:
        """End the step that another thread takes, or else the next one, with StoppedError.

        Any thread may call this, and a handler of signals.
        """
        self._run.stepper.listener.stop()

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
        return StateTrail(steps, self._run.present.phase)

    @by_one_thread
    def _begin_writing(self) -> None:
        """From here on steps end at the kinks that derivatives need, as with tangents."""
        run, stepper = self._run, self._stepper_for(self.solver, written=True)
        self._run = self._run_from(run.present.state(), stepper, run.tangents)

    @by_one_thread
    def _write_down(self, adjoint: AdjointFollowing, n: int) -> None:
        """n steps, written down. Raises StepError."""
        adjoint.write_down(self._run.present, n)

    # ------------------------------------------------------------------------ singular positions

    @property
    def passes(self) -> tuple[Pass, ...]:
        """The passes through singular positions since the start or the last restored state.

        A pass is known after the step in which it happens. Raises InputError if the simulation
        does not watch.
        """
        return self._passes()

    @by_one_thread
    def _passes(self) -> tuple[Pass, ...]:
        return self._run.passes()

    @property
    def departure(self) -> Branch | None:
        """The branch on which forces start the motion, if the scene starts at rest exactly in a
        singular position.

        By Gauss's principle of least constraint, see `branching.Position.departure`. None for
        other starts, if no force acts along a branch, and if branches are not enumerated. In the
        last case the motion follows the branch nearest to the acceleration without the lost rows.
        """
        return self._run.stepper.departure(self._run.applied)

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
        return self._run.present.state()

    @property
    def initial_state(self) -> State:
        """A copy of the state to which `reset` goes back: where the scene starts, without
        inputs."""
        return copy.deepcopy(self._initial)

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
        self._run.enter(state.counted(self.h))

    def __repr__(self) -> str:
        solver = self.solver
        how = f'{solver.integrator} at {solver.step:g} s'
        return f'<Simulation of {self.scene.name}, t = {self.t:.9g} s, {how}>'

    @by_one_thread
    def reset(self) -> None:
        """Back to the initial state, no inputs held."""
        self._run.enter(self._initial)

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
        them; without a twist the velocities become the nearest ones of the branch. Without a
        number it is the branch on which velocities change least. Raises InputError, and changes
        nothing, for an impossible request.
        """
        if self._following is not None:
            raise InputError('no tangents of a placed body', key='body', value=body)
        now, stepper = self._run.present.state(), self._run.stepper
        if branch is not None:
            branch = check.whole(branch, 'branch', 1)
        q, qd, turns = placed(
            self.model, now, self.t, body, pose, twist, branch, self.dependent_rows
        )
        formulation, pace = stepper.formulation, stepper.first_pace(qd)
        carried = formulation.start(q, qd) if formulation else now.carried
        loads = np.zeros_like(now.loads)
        moved = replace(now.moved(q, qd, turns), pace=pace, carried=carried, loads=loads)
        self._run.enter(moved)

    # ----------------------------------------------------------------------------------- inputs

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
        inputs = self._run.applied.inputs
        self._run.hold(replace(inputs, wrenches={**inputs.wrenches, name: wrench}))

    @by_one_thread
    def apply_effort(self, joint: str, effort: float | Curve) -> None:
        """Hold an effort (N m, or N on a slider) on a joint: on the child, and back on the parent.

        A curve is an effort over the simulated time. Raises InputError, and changes nothing, for
        an unknown joint or a number that is not finite.
        """
        effort = check.checked_effort(self.model, check.text(joint, 'joint'), effort)
        inputs = self._run.applied.inputs
        self._run.hold(replace(inputs, efforts={**inputs.efforts, joint: effort}))

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
        inputs = self._run.applied.inputs
        self._run.hold(replace(inputs, targets={**inputs.targets, joint: target}))

    @property
    def applied(self) -> Applied:
        """The forces of the effects and the inputs now, as compiled code takes them. Packed again
        at each change of the inputs, and not changed in place."""
        return self._run.applied

    @by_one_thread
    def clear_inputs(self) -> None:
        """Hold nothing any more."""
        self._run.hold(NO_INPUTS)

    # ---------------------------------------------------------------------------------- samples

    @by_one_thread
    def sample(self) -> Sample:
        """The present state to read from; nothing in it is computed before it is asked for."""
        return self._run.sample()

    def _sample_at(self, t: float) -> Sample:
        """The motion at t (s), now or before the end of the next step. Raises StepError."""
        return self.sample() if t - self.t <= check.CLOSE * self.h else self._sample_between(t)

    @by_one_thread
    def _sample_between(self, t: float) -> Sample:
        """The motion at t (s), between two grid points."""
        return self._run.sample_between(t)

    def _sample(self, t: float, state: State, beside: bool | None) -> Sample:
        """Another state at t (s), with the present forces; `beside` as of
        `SteppedRun.sample_of`."""
        return self._run.sample_of(t, state, beside)
