"""A run of a scene: its ticks, their stamps, what they publish, and its log."""

from __future__ import annotations

import dataclasses
import math
import time
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from alf_ros.errors import InputError, StepError, StoppedError
from alf_ros.logs import journal, provenance
from alf_ros.logs.stamps import ENDS, LAST, message_stamp, stamp_ns
from alf_ros.ros.recording.recorder import Recorder, Split
from alf_ros.ros.simulator import diagnostics
from alf_ros.ros.simulator.outputs import Outputs
from alf_ros.simulation.saved_states import as_data
from alf_ros.simulation.setup import Setup
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State

# Longest time (s) of ticks in one call, so that commands and services get their turn.
BURST = 0.01
DISTANCE_PERIOD = 2e-3  # simulated s between two looks at the distance to a singular position
_SHORT = 1e-9
_GROWTH = 8  # of the steps between two looks at the clock


class NodeRun:
    """Ticks of a setup; after `duration` (simulated s, 0: never) it is `over`.

    A tick of more than `BURST` is made in parts, and `under_way` between them. A failed step
    leaves the last good state and its reason in `failure`. Every `begin` makes a log of its own in
    `log_folder`, so that a log is always one run from its start.
    """

    def __init__(
        self,
        setup: Setup,
        outputs: Outputs,
        duration: float,
        log_folder: Path | None,
        split: Split | None = None,
    ) -> None:
        self.setup = setup
        self.recorder: Recorder | None = None
        self.unrecorded = ''  # why there is no log although one is wanted
        self.lost: list[str] = []  # why logs could not be written to their end
        self.failure: StepError | None = None
        self.initial_energy = 0.0
        self.balance = 0.0  # J, kinetic energy less all works, where the run began
        self.free = False  # ticks are made as fast as possible: readers are waited for
        self.stepping = 0.0  # s that the solver has taken
        self._looked = -math.inf  # s, when the distance was looked for
        self.closest = math.inf  # to a singular position, since somebody set it back
        # This run, counted since the start of the node, and the step where it began.
        self.number = self.first_step = 0
        self.ahead = 0  # ns by which stamps are ahead of the simulated time
        self._outputs, self._duration = outputs, duration
        self._folder, self._split = log_folder, split
        self._chain = ''  # digest of the journal so far
        self._left = 0  # steps of the tick that is under way
        self._part = 1  # steps that take about `BURST`
        self._cut = False  # in the middle of a tick, by the end of the node

    @property
    def simulation(self) -> Simulation:
        """The simulation that runs."""
        return self.setup.simulation

    @property
    def stamp(self) -> int:
        """Stamp (ns) of the present state: never zero, which means "no time yet" in ROS."""
        return stamp_ns(self.simulation.t, self.ahead)

    @property
    def under_way(self) -> bool:
        """Whether steps of a tick are still to be made."""
        return self._left > 0

    @property
    def over(self) -> bool:
        """Whether the duration has been reached."""
        return 0 < self._last_step <= self.simulation.step_index

    @property
    def _last_step(self) -> int:
        return max(1, round(self._duration / self.simulation.h)) if self._duration else 0

    def begin(self, state: State | None = None, keep_time: bool = False) -> None:
        """Start from `state`, or the initial one.

        With `keep_time` the stamps continue a tick after the last, for any time of the state;
        otherwise they are its time. Raises InputError, and changes nothing, if no message can have
        such a stamp. If the log cannot be written the run begins without one, and then this raises
        InputError.
        """
        ahead = self.check_stamp(state, keep_time)
        self.close()
        if state is None:
            self.simulation.reset()
        else:
            self.simulation.restore(state)
        self.ahead, self.failure, self._left = ahead, None, 0
        self.number += 1
        self.first_step = self.simulation.step_index
        scene = self.setup.scene
        about = provenance.start(self.setup, self.ahead, self._outputs.topics)
        if state is not None:
            about['state'] = as_data(state)
        unwritten: InputError | None = None
        if self._folder is not None:
            info = provenance.record(about, scene)
            try:
                self.recorder = Recorder(self._folder, scene.name, info, split=self._split)
            except InputError as error:
                unwritten = error
            self.unrecorded = '' if unwritten is None else str(unwritten)
        self._chain = ''
        self._outputs.record(self.recorder)
        self._outputs.begin()
        self._outputs.describe(scene, self.stamp)
        self.note({'kind': 'start', **about})
        sample = self.simulation.sample()
        self.initial_energy = sample.energy
        self.balance = diagnostics.balance(sample)
        self.send(whole=True)
        if unwritten is not None:
            raise unwritten

    def check_stamp(self, state: State | None = None, keep_time: bool = False) -> int:
        """By how much (ns) stamps are ahead of the time of a run that begins so (see `begin`).

        Raises InputError if no message can have its first stamp.
        """
        later = self.ahead + round((self.simulation.t + self.setup.tick) * 1e9)
        first = 0.0 if state is None else state.step * self.simulation.h
        ahead = later - round(first * 1e9) if keep_time else 0
        if stamp_ns(first, ahead) > LAST:
            raise InputError(ENDS, key='t', value=first + ahead * 1e-9)
        return ahead

    def change(self, setup: Setup, effects: dict[str, Any]) -> None:
        """Continue with other settings at the same state; `effects` are the numbers that
        changed."""
        self.end_tick()
        self.setup = setup
        self.note({'kind': 'settings', **self._settings(), 'effects': effects})
        if effects:
            self._outputs.describe(setup.scene, self.stamp)

    def _settings(self) -> dict[str, Any]:
        solver = dataclasses.asdict(self.simulation.solver)
        return {'solver': solver, 'steps_per_tick': self.setup.steps}

    def tick(self, whole: bool = False) -> bool:
        """Make one tick's steps, fewer at the end of the run, and send the results; `whole`: with
        topics that are not shown at every tick. False if the tick takes long and is under way:
        the next call continues it."""
        if self._cut:
            return True
        if not self._left:
            self._left = self.setup.steps
            if self._last_step:
                self._left = min(self._left, self._last_step - self.simulation.step_index)
        begun = time.thread_time()
        try:
            self._make_steps()
        except StepError as error:
            self.failure, self._left = error, 0
            return True
        except StoppedError:
            self._cut, self._left = True, 0  # the node ends; the log has the last whole tick
            return True
        self.failure = None
        self.stepping += time.thread_time() - begun
        if self._left:
            return False
        self.send(whole=whole)
        return True

    def _make_steps(self) -> None:
        """Steps of the tick that is under way, for about `BURST`. Raises StepError, also if there
        is no stamp for its end."""
        now, h = self.simulation.t, self.simulation.h
        message_stamp(now + self._left * h, self.ahead, now)
        begun = time.monotonic()
        end = begun + BURST
        while self._left and begun < end:
            steps = min(self._left, self._part)
            self.simulation.step(steps)
            self._left -= steps
            now = time.monotonic()
            fitting = int(steps * BURST / max(now - begun, _SHORT))
            self._part = max(1, min(fitting, max(self._part, _GROWTH * steps)))
            begun = now

    def end_tick(self) -> None:
        """A tick that is under way ends with the steps made so far."""
        if self._left:
            self._left = 0
            self.send(whole=True)

    def send(self, record: bool = True, whole: bool = False) -> None:
        """Publish and log the present state; `whole`: with topics that are not shown at every
        tick."""
        t, near = self.simulation.t, False
        hold = self.free and record  # a state that is sent again waits for nobody
        if abs(t - self._looked) > DISTANCE_PERIOD - _SHORT:
            near, self._looked = self._outputs.diagnostics.wanted, t
        try:
            found = self._outputs.send(self.simulation, self.stamp, record, whole, near, hold)
        except StepError as error:
            self.failure = error
        else:
            self.closest = min(self.closest, found)

    def note(self, entry: dict[str, Any]) -> None:
        """Write to the journal the inputs that act from the next step."""
        if self._outputs.journal.wanted:
            step, t = self.simulation.step_index, self.simulation.t
            text, self._chain = journal.chained({'step': step, 't': t, **entry}, self._chain)
            self._outputs.journal.send(serialize_message(String(data=text)), self.stamp)

    def lose_log(self) -> None:
        """Continue without a log that can no longer be written; `recorder` still has the
        reason."""
        self._outputs.record(None)

    def close(self) -> None:
        """End the log."""
        if self.recorder is not None:
            self._outputs.record(None)
            self.recorder.close()
            if self.recorder.error:
                self.lost.append(self.recorder.error)
            self.recorder = None

    def __str__(self) -> str:
        return f't = {self.simulation.t:.9g} s, step {self.simulation.step_index}'
