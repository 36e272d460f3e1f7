"""The node `simulator`: time, parameters, services and reports around a run."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from alf_ros import diagnostics, parameters
from alf_ros.errors import InputError, StepError
from alf_ros.messages import stamp_ns, to_time
from alf_ros.outputs import Outputs
from alf_ros.pacing import Pacer
from alf_ros.status import PLAIN_PERIOD, Status

if TYPE_CHECKING:
    from rclpy.timer import Timer

    from alf_ros.run import Run
    from alf_ros.scene import Scene

# Longest time (s) of ticks in one call of the timer, so that commands and services get their turn.
BURST = 0.01
# Period (s) of status line and graph watch; diagnostics come every fourth time.
LOOK_PERIOD = 0.25
LOOKS_PER_DIAGNOSIS = 4


class Stop:
    """Handler of SIGINT and SIGTERM: the node looks at `asked` and finishes between two ticks.

    Until `gentle` is set there is no log to close, and the process ends at once: an exception in
    the middle of a compilation would leave the compiler in a state that it does not survive.
    """

    def __init__(self) -> None:
        self.asked = self.gentle = False

    def __call__(self, signum: int, frame: object) -> None:
        self.asked = True
        if not self.gentle:
            os._exit(0)


class Simulator(Node):
    """The node `simulator`: runs a scene against the steady clock; holds no physics.

    `finished` is done when the parameter `duration` was reached or a stop was asked for.
    Raises InputError for anything it cannot start with.
    """

    def __init__(self, status: Status, stop: Stop, overrides: list[Parameter[Any]]) -> None:
        super().__init__('simulator', parameter_overrides=overrides)
        self.finished: Future[None] = Future()
        self._status, self._stop = status, stop
        self._looks = 0
        self._alarms: tuple[bool, ...] = ()
        self._lost = 0.0  # real time lost up to the last regular diagnosis, s

        name = parameters.declare(self, [parameters.SCENE])['scene']
        # Imported late: loading the solver takes a good part of the start.
        from alf_ros.scene import load_scene

        self._scene = load_scene(name)
        solver = parameters.declare(self, parameters.solver_specs(self._scene.solver))
        step = solver['solver.step']
        values = parameters.declare(self, parameters.node_specs(step))
        steps = parameters.steps_per_tick(values['rate'], step)
        self._outputs = Outputs(self, values['record.topics'])
        parameters.check_names(self)

        status.enabled = values['status_line']
        status.say(f'scene {self._scene.name}: preparing')
        with status.say_if_slow('compiling, the first time only ...', 2.0):
            settings = {key.partition('.')[2]: value for key, value in solver.items()}
            self._run = self._prepare(self._scene, settings, steps, values)
        self._pacer = Pacer(steps * step, values['real_time_factor'])
        self._paused: bool = values['start_paused']
        self._on_parameters([self.get_parameter(key) for key in values])
        self._connect()

    def _prepare(
        self, scene: Scene, settings: dict[str, Any], steps: int, values: dict[str, Any]
    ) -> Run:
        """Load the compiled code and use all of it once, so that no tick waits for it."""
        from alf_ros.inputs import Inputs
        from alf_ros.run import Run
        from alf_ros.simulation import Simulation

        simulation = Simulation(scene, **settings)
        folder = Path(values['record.folder']) if values['record.enabled'] else None
        run = Run(scene, simulation, self._outputs, steps, values['duration'], folder)
        self._inputs = Inputs(self, simulation, run.note, self._diagnose)
        self._outputs.prepare(simulation.model)
        try:
            simulation.step(0)
            self._outputs.warm_up(simulation.sample())
            diagnostics.constraints(simulation.sample())
        except StepError:
            pass  # the first tick will say so, with the log open
        return run

    def _connect(self) -> None:
        self.add_on_set_parameters_callback(parameters.judge)
        self.add_post_set_parameters_callback(self._on_parameters)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.create_service(Trigger, '~/step', self._on_step)
        self.create_service(Trigger, '~/reset', self._on_reset)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._on_look, clock=self._steady)
        self._pace()

    def _pace(self) -> None:
        self._timer: Timer = self.create_timer(
            self._pacer.beat, self._on_timer, clock=self._steady
        )

    # --------------------------------------------------------------------------------------- run

    def begin(self) -> None:
        """Start a run at t = 0 with a log of its own. Raises InputError if there can be none."""
        self._inputs.clear()
        self._run.begin()
        self._pacer.start()
        step, recorder = self._run.simulation.h, self._run.recorder
        state = 'paused' if self._paused else f'real-time factor {self._pacer.factor:g}'
        log = f'log {recorder.path}' if recorder else 'no log'
        self._status.say(f'running: step {step:g} s, tick {self._pacer.tick:g} s, {state}; {log}')

    def close(self) -> None:
        """End the log, with a last report in it."""
        recorder = self._run.recorder
        try:
            self._diagnose()
        finally:
            self._run.close()
        text = f'stopped at {self._run}'
        if recorder is not None:
            text += f'; log {recorder.path}, {recorder.written} messages'
            text += f', {recorder.dropped} dropped' if recorder.dropped else ''
            text += f', {recorder.error}' if recorder.error else ''
        self._status.say(text)

    def _on_timer(self) -> None:
        now = time.monotonic()
        self._inputs.expire(now)
        if self._stop.asked:
            self._finish()
        if self._paused or self.finished.done():
            return
        for _ in range(self._pacer.due(now)):
            going = self._tick()
            self._pacer.done()
            if not going or time.monotonic() - now > BURST:
                break

    def _tick(self) -> bool:
        """Make one tick; False when the run cannot or need not go on."""
        self._run.tick()
        if self._run.failure:
            self._paused = True
            self.get_logger().error(str(self._run.failure))
            self._diagnose()
            return False
        if self._run.over:
            self._finish()
        return not self._run.over

    def _finish(self) -> None:
        if not self.finished.done():
            self.finished.set_result(None)

    # ----------------------------------------------------------------------- parameters, services

    def _on_parameters(self, changed: list[Parameter[Any]]) -> None:
        modes = {parameters.mode_of(name): name for name in self._outputs.optional}
        for parameter in changed:
            if parameter.name in modes:
                mode = parameters.MODES[parameter.value]
                self._outputs.optional[modes[parameter.name]].mode = mode
            elif parameter.name == 'command_timeout':
                self._inputs.timeout = parameter.value
            elif parameter.name == 'real_time_factor' and parameter.value != self._pacer.factor:
                self._pacer.set_factor(parameter.value)
                self.destroy_timer(self._timer)
                self._pace()

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        before, self._paused = self._paused, request.data
        if before and not self._paused:
            self._pacer.start()
        state = 'paused' if self._paused else 'playing'
        response.success = True
        response.message = f'already {state}' if before == self._paused else state
        return response

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self._paused:
            response.message = 'playing: pause first'
            return response
        self._tick()
        response.success = self._run.failure is None
        response.message = str(self._run.failure or self._run)
        return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._diagnose()  # the last word of the log that ends here
        try:
            self.begin()
            response.success = True
            response.message = str(self._run)
        except InputError as error:
            self.get_logger().error(str(error))
            response.message = f'reset, but without a log: {error}'
        return response

    # ------------------------------------------------------------------------------------ reports

    def _on_look(self) -> None:
        if self._stop.asked:
            self._finish()
        self._looks += 1
        self._inputs.watch()
        recorder = self._run.recorder
        alarms = (
            self._inputs.troubled,
            self._pacer.lost > self._lost,
            recorder is not None and bool(recorder.dropped or recorder.error),
        )
        regular = self._looks % LOOKS_PER_DIAGNOSIS == 0
        if regular or alarms != self._alarms:
            self._alarms = alarms
            self._diagnose()
        if regular:
            self._lost = self._pacer.lost
            if self._paused:
                # Who came late, or missed the message, sees the state as well.
                self._run.send(record=False)
        if self._status.live or self._looks % round(PLAIN_PERIOD / LOOK_PERIOD) == 0:
            self._status.show(self._line())

    def _diagnose(self) -> None:
        output, run = self._outputs.diagnostics, self._run
        if not output.wanted:
            return
        sample = run.simulation.sample()
        ns = stamp_ns(sample.t)
        reports = [
            diagnostics.solver(sample, self._paused, run.failure),
            diagnostics.constraints(sample),
            diagnostics.energy(sample, run.initial_energy),
            diagnostics.timing(self._pacer, self._paused, self._lost),
            diagnostics.commands(self._inputs),
            diagnostics.record(run.recorder),
        ]
        mechanism = self._scene.mechanism.name
        message = diagnostics.array(self.get_name(), mechanism, to_time(ns), reports)
        output.send(serialize_message(message), ns)

    def _line(self) -> str:
        sample, recorder = self._run.simulation.sample(), self._run.recorder
        state = 'FAILED' if self._run.failure else 'paused' if self._paused else ''
        if not state and self._pacer.achieved:  # known after the first second
            state = f'real-time factor {self._pacer.achieved:.2f}'
        try:
            violation = f'{sample.diagnostics.position_violation:.0e} m'
        except StepError:
            violation = 'unknown'
        parts = [
            f't {sample.t:.2f} s',
            state,
            f'E {sample.energy:.6g} J',
            f'violation {violation}',
            f'overruns {self._pacer.overruns}',
            f'log {recorder.path.name}' if recorder else 'no log',
        ]
        if recorder is not None and recorder.dropped:
            parts.append(f'{recorder.dropped} messages dropped')
        return '  '.join(filter(None, parts))
