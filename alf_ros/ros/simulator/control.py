"""Playing, paused, stepping: the state machine of the simulator, behind all its services."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.task import Future

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError, StepError
from alf_ros.ros.simulator.inputs import CommandSubscriber
from alf_ros.ros.simulator.node_run import BURST, NodeRun
from alf_ros.ros.simulator.pacing import Pacer
from alf_ros.simulation.saved_states import SavedStates
from alf_ros.simulation.setup import Setup, on_grid
from alf_ros.simulation.state import State

# Of the size: how far open constraints of a restored state are. Steps close larger gaps too, but
# at a place that nobody asked for. The formulations for comparison drift.
_OPEN, _DRIFT = 1e-6, 1e-2


class WrongState(AlfError):
    """A transition that the present state does not allow."""


class Control:
    """The state machine of the run; every transition falls between two ticks: one that is under
    way ends there.

    While playing, the pacer triggers ticks. While paused, only `step` triggers ticks, as fast as
    possible. A failed step pauses. `report` is called then, `pace` when another period is needed,
    `end` when the run is over.
    """

    def __init__(
        self,
        run: NodeRun,
        pacer: Pacer,
        inputs: CommandSubscriber,
        saved: SavedStates,
        report: Callable[[], None],
        pace: Callable[[], None],
        end: Callable[[], None],
    ) -> None:
        self.run, self.inputs, self.paused = run, inputs, True
        self._pacer, self._saved = pacer, saved
        self._report, self._pace, self._end = report, pace, end
        self._asked = self._left = self._dropped = 0
        self._each: Callable[[int], None] | None = None
        self._stepped: Future[None] = Future()
        self._stepped.set_result(None)
        self._stopped = False  # by a failed step: it would be playing otherwise

    @property
    def stepping(self) -> bool:
        """Whether steps that were asked for are still to be made."""
        return self._left > 0

    @property
    def state(self) -> str:
        """One word for people and diagnostics."""
        if self.run.failure:
            return 'failed'
        if self.stepping:
            return 'stepping'
        return 'paused' if self.paused else 'playing'

    def advance(self, now: float) -> None:
        """Make the ticks that are due at `now` (s, steady clock)."""
        if self.run.under_way:
            due = 1  # inputs act from the next tick
        else:
            due = self._left if self.paused else self._pacer.due(now)
            self.inputs.apply()
        self.run.free = self.paused or not self._pacer.factor
        for _ in range(due):
            # The last of some steps is looked at: it is shown as well.
            if not self.run.tick(whole=self.paused and self._left == 1):
                break
            if self.paused:
                self._left -= 1
                if self._each is not None and not self.run.failure:
                    self._each(self._asked - self._left)
            else:
                self._pacer.done()
            if self.run.failure:
                self._fail()
            elif self.inputs.tracking.active:
                self.inputs.tracking.look(self.run.simulation.sample())
            if self.run.over:
                self._end()
            if self.run.failure or self.run.over or time.monotonic() - now > BURST:
                break
        if self.paused and due and (self._left == 0 or self.run.over):
            self._finish_steps()

    # -------------------------------------------------------------------------------- transitions

    def play(self) -> str:
        """Continue. After a failure this tries again, at once: raises StepError if it fails
        again."""
        if not self.paused:
            return 'already playing'
        self._finish_steps()
        self.paused = False
        self._pacer.start()
        if self.run.failure:
            self.inputs.apply()
            self.run.tick()
            if self.run.failure:
                self._fail()
                raise self.run.failure
        return 'playing'

    def _fail(self) -> None:
        """A step failed: pause until a request to play or to reset."""
        stopped = self._stopped or not self.paused  # steps that fail again change nothing in it
        self.pause()
        self._stopped = stopped
        self._report()

    def _begin(self, state: State | None = None, keep_time: bool = False) -> None:
        """Begin a run from a state, playing if only a failed step has stopped it."""
        self._pacer.start()
        try:
            self.run.begin(state, keep_time)
        finally:
            if self._stopped and not self.run.failure:
                self._stopped, self.paused = False, False

    def pause(self) -> str:
        """Stand still; steps not yet made are dropped."""
        self._stopped = False
        if self.paused and not self.stepping:
            return 'already paused'
        self.paused = True
        self._finish_steps()
        return 'paused'

    async def step(self, count: int, each: Callable[[int], None] | None = None) -> str:
        """Make `count` ticks and return when they are published; `each` gets the number made.

        Raises WrongState unless paused, StepError for a step that fails.
        """
        if not self.paused:
            raise WrongState('playing: pause first')
        if self.stepping:
            raise WrongState(f'stepping: {self._left} of {self._asked} still to be made')
        self._asked = self._left = count
        self._dropped, self._each = 0, each
        self._stepped = Future()
        self.advance(time.monotonic())
        if self.stepping:
            self._pace()
            await self._stepped
        if self.run.failure:
            raise self.run.failure
        made = self._asked - self._dropped
        if self._dropped and not self.run.over:
            raise WrongState(f'stopped after {made} of {self._asked}, at {self.run}')
        return str(self.run)

    def quit(self) -> str:
        """End the node, with its log closed."""
        self._end()
        return 'ending'

    def reset(self, keep_time: bool) -> str:
        """The initial state without held inputs; with `keep_time` stamps continue, else they start
        again. A new log begins. Raises InputError if it cannot be written; the run is reset
        nevertheless. If no message can have the next stamp, nothing changes."""
        self.run.check_stamp(keep_time=keep_time)
        self._finish_steps()
        self._report()  # the last word of the log that ends here
        self.inputs.clear()
        self._begin(keep_time=keep_time)
        return str(self.run)

    def change(self, setup: Setup, effects: dict[str, Any]) -> None:
        """Continue at the same state with other settings, noted in the log."""
        self.run.end_tick()
        tick = self.run.setup.tick
        self.inputs.use(setup.simulation)
        self.run.change(setup, effects)
        if setup.tick != tick:
            self._pacer.set_tick(setup.tick)
            self._pace()

    def load(self, setup: Setup) -> None:
        """Another scene, paused at its start, with a log of its own.

        Raises InputError, the scene being loaded, if there can be none.
        """
        self.pause()
        self._report()
        self.inputs.load(setup.simulation)
        self.run.setup = setup
        self._pacer.set_tick(setup.tick)
        self._pace()
        self.run.begin()

    def save(self, name: str) -> str:
        """Keep the present state under `name`."""
        self.run.end_tick()
        self.inputs.apply()
        setup = self.run.setup
        return f'{name}: {self.run}, {self._saved.save(name, setup.scene, setup.simulation)}'

    def restore(self, name: str) -> str:
        """The state kept under `name`, with its held inputs; stamps continue. A new log begins.

        Raises InputError, and changes nothing, without a state that fits. A log that cannot be
        written is an InputError too, but the state is restored nevertheless.
        """
        self.run.end_tick()
        setup = self.run.setup
        before = setup.simulation.state
        formulation = setup.simulation.solver.formulation
        state, step, q = self._saved.find(name, setup.scene, before, formulation)
        state = on_grid(state, step, setup.simulation.h)
        try:
            setup.simulation.restore(state)
            setup.simulation.step(0)
            sample = setup.simulation.sample()
            if sample.q.tolist() != q:
                raise InputError('kept with another order of coordinates', key=name)
            gap = sample.diagnostics.position_violation
            share = _OPEN if setup.simulation.solver.formulation == 'alf2' else _DRIFT
            if gap > share * sample.model.size:
                raise InputError(f'its positions violate the constraints by {gap:.3g} m', key=name)
        except (InputError, StepError, KeyError) as error:
            raise InputError(f'not a state of this scene: {error}', key='state.name') from None
        finally:
            setup.simulation.restore(before)
        self.run.check_stamp(state, keep_time=True)
        self._finish_steps()
        self._report()
        self.inputs.hold(state.inputs)
        self._begin(state, keep_time=True)
        return f'{name}: {self.run}'

    def place(self, body: str, pose: Floats | None, twist: Floats | None) -> str:
        """A body elsewhere, or with another velocity (`Simulation.place`); stamps continue. A new
        log begins.

        Raises InputError, and changes nothing, if this is impossible.
        """
        self.run.end_tick()
        self.inputs.apply()
        simulation = self.run.simulation
        before = simulation.state
        simulation.place(body, pose, twist)
        state = simulation.state
        simulation.restore(before)
        self._report()
        self._begin(state, keep_time=True)
        return f'{body}: {self.run}'

    def _finish_steps(self) -> None:
        """Answer requests that wait for steps; the remaining steps are dropped."""
        self.run.end_tick()
        self._dropped, self._left = self._left, 0
        if not self._stepped.done():
            self._stepped.set_result(None)
            self._pace()
