"""Reports of the simulator: /diagnostics, and the line on the terminal."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING

from rclpy.serialization import serialize_message

from alf_ros.errors import StepError
from alf_ros.ros.messages.templates import to_time
from alf_ros.ros.namesake import Namesake
from alf_ros.ros.recording.recorder import Recorder
from alf_ros.ros.simulator import diagnostics
from alf_ros.ros.simulator.control import Control
from alf_ros.ros.simulator.diagnostics import Pace
from alf_ros.ros.simulator.output_costs import NOTHING, Spent
from alf_ros.ros.simulator.outputs import Outputs
from alf_ros.ros.simulator.pacing import Pacer
from alf_ros.ros.terminal import LOOK_PERIOD, PLAIN_PERIOD, StatusLine
from alf_ros.simulation.simulation import Simulation

if TYPE_CHECKING:
    from rclpy.node import Node

# Diagnostics come every fourth time.
LOOKS_PER_DIAGNOSIS = 4


class Reporting:
    """Reports once a second, and at once when something goes wrong or well again."""

    def __init__(
        self, node: Node, control: Control, pacer: Pacer, outputs: Outputs, status: StatusLine
    ) -> None:
        # Several simulators on one machine share the topic: the namespace tells them apart.
        self._logger = node.get_logger()
        self._lost: Recorder | None = None  # whose error was reported
        self._warned: tuple[int, Simulation] | None = None  # whose steps were said to be too long
        self._name = node.get_fully_qualified_name().lstrip('/')
        self._control, self._pacer, self._outputs = control, pacer, outputs
        self._namesake = Namesake(node, outputs.diagnostics.topic, f'{self._name}: ')
        self._twice = ''  # what was said of a second node of this name
        self._status = status
        self._looks = 0
        self._alarms: tuple[bool, ...] = ()
        self._spent = NOTHING
        # ticks, seconds of the solver; seconds and bytes of the thread that writes the log
        self._counted: tuple[float, ...] = (0, 0.0, 0.0, 0)
        self._written_by: Recorder | None = None
        self._before = Pace(0, 0, 0.0)  # at the last regular diagnosis

    def look(self) -> None:
        """To be called every `LOOK_PERIOD`."""
        self._looks += 1
        self._outputs.look(self._control.run.stamp)
        run = self._control.run
        recorder = run.recorder
        if recorder is not None and recorder.error and recorder is not self._lost:
            self._lost = recorder
            run.lose_log()
            text = f'recording has stopped, the simulation continues: {recorder.error}'
            self._logger.error(text)
        self._warn(run.simulation)
        regular = self._looks % LOOKS_PER_DIAGNOSIS == 0
        if regular:
            self._look_for_namesake()
        alarms = (
            bool(self._twice),
            run.simulation.resolution.too_long,
            self._control.inputs.troubled,
            bool(self._control.inputs.tracking.trouble),
            self._pacer.lost > self._before.lost,
            recorder is not None and bool(recorder.dropped or recorder.error),
        )
        if regular:
            self._measure()
        if regular or alarms != self._alarms:
            self._alarms = alarms
            self.diagnose()
        if regular:
            self._before = Pace(self._pacer.ticks, self._pacer.overruns, self._pacer.lost)
            if self._control.paused and not run.under_way:
                # Late subscribers, and those that missed the message, receive the state too. In
                # the middle of a tick it is no state of the run: sensors would remember it.
                run.send(record=False, whole=True)
        if self._status.live or self._looks % round(PLAIN_PERIOD / LOOK_PERIOD) == 0:
            self._status.show(self._line())

    def _measure(self) -> None:
        """Take the costs of the ticks since the last time."""
        run, pacer, before = self._control.run, self._pacer, self._counted
        recorder = run.recorder
        writing = (recorder.busy, recorder.taken) if recorder else (0.0, 0)
        known = recorder is self._written_by
        self._counted, self._written_by = (pacer.ticks, run.stepping, *writing), recorder
        ticks, step, busy, taken = map(operator.sub, self._counted, before)
        self._spent = Spent(
            int(ticks),
            pacer.tick / pacer.factor if pacer.factor else 0.0,
            step / max(1, ticks),
            self._outputs.costs(),
            busy if known else 0.0,
            int(taken) if known else 0,
        )

    def _look_for_namesake(self) -> None:
        """Say once, and again if it went and came back, that a second node has this name."""
        self._namesake.look()
        other = self._namesake.other
        text = f'a second node {self._name} runs, and takes each command too: process {other}'
        if other and not self._twice:
            self._logger.warning(text)
        self._twice = text if other else ''

    def _warn(self, simulation: Simulation) -> None:
        """Say once that the steps of a run are too long."""
        run = self._control.run.number, simulation
        if run != self._warned and simulation.resolution.too_long:
            self._warned = run
            self._logger.warning(simulation.sample().diagnostics.trouble)

    def warm_up(self) -> None:
        """Compute once what reports need, so that no tick has to wait for a compiler."""
        diagnostics.constraints(self._control.run.simulation.sample())

    def diagnose(self) -> None:
        """Publish and log the diagnostics, if anybody wants them."""
        output, run = self._outputs.diagnostics, self._control.run
        if not output.wanted:
            return
        sample, ns = run.simulation.sample(), run.stamp
        reports = [
            diagnostics.solver(run.simulation, self._control.state, run.failure),
            diagnostics.constraints(sample, run.closest),
            diagnostics.energy(sample, run.initial_energy),
            *([diagnostics.work(sample, run.balance)] if run.simulation.ledger else []),
            diagnostics.timing(
                self._pacer,
                self._control.paused,
                self._before,
                self._spent,
                self._outputs.lagging,
            ),
            diagnostics.commands(self._control.inputs, self._namesake.process, self._twice),
            diagnostics.trajectory(self._control.inputs.tracking),
            diagnostics.record(run.recorder, run.unrecorded, self._spent, 1.0 / run.setup.tick),
        ]
        run.closest = math.inf
        mechanism = run.setup.scene.mechanism.name
        message = diagnostics.array(self._name, mechanism, to_time(ns), reports)
        output.send(serialize_message(message), ns)

    def _line(self) -> str:
        run = self._control.run
        sample, recorder = run.simulation.sample(), run.recorder
        state = {'failed': 'FAILED', 'playing': ''}.get(self._control.state, self._control.state)
        if not state and self._pacer.achieved:  # known after the first second
            state = f'real-time factor {self._pacer.achieved:.2f}'
        try:
            violation = f'{sample.diagnostics.position_violation:.0e} m'
        except StepError:
            violation = 'unknown'
        try:
            energy = f'{sample.energy:.6g} J'
        except StepError:
            energy = 'unknown'
        parts = [
            f't {sample.t:.2f} s',
            state,
            f'E {energy}',
            f'violation {violation}',
            f'overruns {self._pacer.overruns}',
            f'log {recorder.path.name}' if recorder else 'no log',
        ]
        if recorder is not None and recorder.dropped:
            parts.append(f'{recorder.dropped} messages dropped')
        return '  '.join(filter(None, parts))
