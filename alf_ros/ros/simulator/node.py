"""The node `simulator`: parameters, timers and services around a run."""

from __future__ import annotations

import math
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from alf_ros.errors import AlfError, InputError, StepError
from alf_ros.ros.parameter_services import ParameterServices
from alf_ros.ros.recording import mcap_file
from alf_ros.ros.recording.recorder import Split
from alf_ros.ros.simulator import parameters, startup_report
from alf_ros.ros.simulator.outputs import Outputs
from alf_ros.ros.simulator.pacing import SHORTEST_BEAT, Pacer
from alf_ros.ros.simulator.services import Services
from alf_ros.ros.simulator.setup_changes import SetupChanges
from alf_ros.ros.simulator.slow_work import Compiling, searched
from alf_ros.ros.terminal import LOOK_PERIOD, StatusLine
from alf_ros.simulation import listening
from alf_ros.simulation.display_geometry import Display
from alf_ros.simulation.setup import Setup
from alf_ros.simulation.simulation import Simulation


class Stop:
    """Handler of signals that end: the node looks at `asked` and finishes between two ticks.

    A tick that is under way ends after its last whole step, and a search for an accuracy at once.
    Until `gentle` is set there is no log to close, and the process ends at once: an exception in
    the middle of a compilation would leave the compiler in a state that it does not survive.
    """

    def __init__(self) -> None:
        self.asked = self.gentle = False

    def __call__(self, signum: int, frame: object) -> None:
        self.asked = True
        if not self.gentle:
            os._exit(0)
        listening.stop_all()


class Simulator(Node):
    """The node `simulator`: runs a scene against the steady clock; holds no physics.

    `finished` is done when the parameter `duration` was reached or a stop was asked for.
    Raises InputError for anything it cannot start with.
    """

    def __init__(self, status: StatusLine, stop: Stop, overrides: list[Parameter[Any]]) -> None:
        self._overtaking = ReentrantCallbackGroup()
        super().__init__(
            'simulator', parameter_overrides=overrides, start_parameter_services=False
        )
        ParameterServices(self, self.change)
        self.finished: Future[None] = Future()
        self._status, self._stop = status, stop
        self._loading = False

        scene = parameters.declare(self, [parameters.SCENE])['scene']
        # Imported late: loading the solver takes a good part of the start.
        from alf_ros.scene.effect_values import with_effect_values
        from alf_ros.scene.scene import load_scene
        from alf_ros.simulation import setup as settings

        self._changes = SetupChanges(self, status, lambda: self._control.run.setup)
        drawn = load_scene(scene)
        solver = parameters.declare(self, parameters.solver_specs(drawn.solver))
        effects = parameters.declare(self, parameters.effect_specs(drawn))
        rate = settings.default_rate(solver['solver.step'])
        values = parameters.declare(self, parameters.node_specs(rate))
        display = Display(values['frame_prefix'])
        rates = parameters.below('record.rate', values)
        sensors = values['record.sensors']
        self._outputs = Outputs(self, values['record.topics'], rates, display, sensors)
        parameters.check_names(self)

        status.enabled = values['status_line']
        status.say(f'scene {drawn.name}: preparing')
        with status.say_if_slow(Compiling(), 2.0):
            given = {spec.name: spec.default for spec in parameters.effect_specs(drawn)}
            changed = {name: value for name, value in effects.items() if value != given[name]}
            own, said = (
                parameters.below('solver', solver),
                parameters.below('solver', self._parameter_overrides),
            )
            chosen = settings.chosen(own, solver['accuracy'], said)
            scene = with_effect_values(drawn, changed)
            setup = searched(
                status,
                chosen.get('accuracy') or 0.0,
                lambda: settings.made(scene, chosen, values['rate'], values['ledger']),
            )
            self._assemble(setup, values)
        self._show_solver(setup)
        self._on_parameters([self.get_parameter(key) for key in values])
        self.add_on_set_parameters_callback(self._judge)
        self.add_post_set_parameters_callback(self._on_parameters)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._on_look, clock=self._steady)
        self._pace()

    def _assemble(self, setup: Setup, values: dict[str, Any]) -> None:
        """Make the parts, and use all compiled code once, so that no tick waits for it."""
        from alf_ros.ros.simulator.control import Control
        from alf_ros.ros.simulator.inputs import CommandSubscriber
        from alf_ros.ros.simulator.node_run import NodeRun
        from alf_ros.ros.simulator.reporting import Reporting
        from alf_ros.simulation.saved_states import SavedStates

        folder, lack = None, ''
        if values['record.enabled']:
            lack = mcap_file.lacking()
            folder = Path(values['record.folder']) if mcap_file.CAN_WRITE else None
        if lack:
            self._status.say(lack)
        split = Split(values['record.max_size'], values['record.max_duration'])
        run = NodeRun(setup, self._outputs, values['duration'], folder, split)
        run.unrecorded = lack if folder is None else ''
        self._pacer = Pacer(setup.tick, values['real_time_factor'])
        # The alarm looks the report up when it comes: that needs the control, which needs this.
        inputs = CommandSubscriber(
            self,
            setup.simulation,
            run.note,
            lambda: self._reporting.diagnose(),
            lambda: run.ahead,
        )
        inputs.frame_prefix = values['frame_prefix']
        saved = SavedStates(Path(values['state.folder']) if values['state.folder'] else None)
        self._control = Control(
            run, self._pacer, inputs, saved, self._on_event, self._pace, self._finish
        )
        self._reporting = Reporting(self, self._control, self._pacer, self._outputs, self._status)
        Services(self, self._control)
        try:
            from alf_ros.ros.simulator.simulation_interfaces import SimulationServices
        except ModuleNotFoundError as error:
            # Only a ROS 2 installation has simulation_interfaces.
            if (error.name or '').partition('.')[0] != 'simulation_interfaces':
                raise
        else:
            self._standard = SimulationServices(self, self._control, self.change)
        self._playing_first = not values['start_paused']
        self._warm_up(setup.simulation)

    def _warm_up(self, simulation: Simulation) -> None:
        """Use what ticks, reports and commands will use, compiled code above all."""
        from alf_ros import effects
        from alf_ros.simulation.held_inputs import from_outside

        for kind in sorted(from_outside(simulation.model)):
            effects.load(kind)
        self._outputs.prepare(simulation)
        try:
            self._outputs.warm_up(simulation.sample())
            self._reporting.warm_up()
        except StepError:
            pass  # the first tick will say so, with the log open

    def _pace(self) -> None:
        """Call the control as often as ticks come, from now on."""
        self._beat = SHORTEST_BEAT if self._control.stepping else self._pacer.beat
        self._next_beat = time.monotonic() + self._beat

    # --------------------------------------------------------------------------------------- run

    def begin(self) -> None:
        """Start a run at t = 0 with a log of its own. Raises InputError if there can be none."""
        control = self._control
        control.run.begin()
        if self._playing_first:
            with suppress(StepError):  # reported already; the log is open
                control.play()
        simulation, recorder = control.run.simulation, control.run.recorder
        state = 'paused' if control.paused else f'real-time factor {self._pacer.factor:g}'
        log = f'log {recorder.path}' if recorder else 'no log'
        self._say_what_is_on()
        step, tick = simulation.h, self._pacer.tick
        self._status.say(f'running: step {step:g} s, tick {tick:g} s, {state}; {log}')

    def _say_what_is_on(self) -> None:
        simulation, tick = self._control.run.simulation, self._control.run.setup.tick
        prices = self._outputs.sensor_prices(simulation)
        for line in startup_report.lines(simulation, self._outputs.switched(), prices, tick):
            self._status.say(line)

    def close(self) -> None:
        """End the log, with a last report in it, and a search that still runs."""
        self._changes.end()
        run = self._control.run
        recorder = run.recorder
        try:
            self._reporting.diagnose()
        finally:
            run.close()
            self._outputs.deliver()
        text = f'stopped at {run}'
        if recorder is not None:
            text += f'; log {recorder.path}, {recorder.written} messages'
            text += f', {recorder.dropped} dropped' if recorder.dropped else ''
        for reason in run.lost:
            text += f'; log incomplete: {reason}'
        self._status.say(text)

    @property
    def exit_code(self) -> int:
        """1 if a log could not be written to its end, else 0."""
        return 1 if self._control.run.lost else 0

    def work(self) -> float:
        """Make the ticks that are due. Returns the time (s) until the next ones are."""
        now = time.monotonic()
        if now >= self._next_beat:
            self._next_beat += self._beat
        elif not self._free:
            return self._next_beat - now
        if not self._control.run.under_way:
            self._control.inputs.expire(now)
        if self._stop.asked:
            self._finish()
        if not self.finished.done():
            self._control.advance(now)
        now = time.monotonic()
        if now > self._next_beat:  # beats that were missed are left out
            self._next_beat += math.ceil((now - self._next_beat) / self._beat) * self._beat
        return 0.0 if self._free else self._next_beat - now

    @property
    def _free(self) -> bool:
        """Whether ticks are made as fast as possible, or one is under way."""
        control = self._control
        if control.stepping or control.run.under_way:
            return True
        return not (control.paused or self._pacer.factor)

    def _on_look(self) -> None:
        if self._stop.asked:
            self._finish()
        self._control.inputs.watch()
        self._reporting.look()

    def _on_event(self) -> None:
        """A step failed, or a log ends: that is reported at once."""
        if self._control.run.failure:
            self.get_logger().error(str(self._control.run.failure))
        self._reporting.diagnose()

    def _finish(self) -> None:
        if not self.finished.done():
            self.finished.set_result(None)

    # -------------------------------------------------------------------------------- parameters

    def set_parameters_atomically(
        self, parameter_list: list[Parameter[Any]]
    ) -> SetParametersResult:
        """Callback of `ros2 param set` and others: reports the expected and the given type."""
        fitted, reason = parameters.fitted(self, parameter_list)
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        return super().set_parameters_atomically(fitted)

    @property
    def default_callback_group(self) -> CallbackGroup:
        """Of all callbacks: those that wait for a search let others overtake them."""
        return self._overtaking

    async def change(self, asked: list[Parameter[Any]]) -> SetParametersResult:
        """Set parameters at once, as services do. What takes long is made beside the executor."""
        return await self._changes.set(asked, self.set_parameters_atomically)

    def _judge(self, changed: list[Parameter[Any]]) -> SetParametersResult:
        """On-set callback: rejects with the reason, all or nothing."""
        if self._loading:
            return SetParametersResult(successful=True)
        reason = next(filter(None, map(parameters.refusal, changed)), '')
        self._changes.forget()
        if not reason:
            values = {p.name: parameters.plain(p.value) for p in changed}
            try:
                reason = self._changes.prepare(values)
            except AlfError as error:
                reason = str(error)
        return SetParametersResult(successful=not reason, reason=reason)

    def _on_parameters(self, changed: list[Parameter[Any]]) -> None:
        """Post-set callback: takes effect at once, which is between two ticks."""
        if self._loading:
            return
        taken = self._changes.take()
        if taken is not None:
            setup, values = taken
            if 'scene' in values:
                self._load(setup)
            else:
                self._control.change(setup, values)
                self._show_solver(setup)
        self._thin_out()
        modes = {parameters.mode_of(name): name for name in self._outputs.optional}
        for parameter in changed:
            if parameter.name in modes:
                mode = parameters.MODES[parameter.value]
                self._outputs.optional[modes[parameter.name]].mode = mode
            elif parameter.name == 'force_scale':
                self._outputs.display.force_scale = parameter.value
            elif parameter.name == 'command_timeout':
                self._control.inputs.timeout = parameter.value
            elif parameter.name == 'trajectory.path_tolerance':
                self._control.inputs.tracking.path = parameter.value
            elif parameter.name == 'trajectory.goal_tolerance':
                self._control.inputs.tracking.goal = parameter.value
            elif parameter.name == 'trajectory.goal_time':
                self._control.inputs.tracking.goal_time = parameter.value
            elif parameter.name == 'real_time_factor' and parameter.value != self._pacer.factor:
                self._pacer.set_factor(parameter.value)
                self._pace()

    def _show_solver(self, setup: Setup) -> None:
        """The parameters say what runs: an accuracy picks some of them, and they can end it."""
        before, self._loading = self._loading, True
        try:
            specs = parameters.solver_specs(setup.simulation.solver)
            self.set_parameters([Parameter(spec.name, value=spec.default) for spec in specs])
        finally:
            self._loading = before

    def _thin_out(self) -> None:
        rate, wanted = (self.get_parameter(name).value for name in ('rate', 'display_rate'))
        self._outputs.shown_every = max(1, round(rate / wanted))

    def _load(self, setup: Setup) -> None:
        """Another scene, paused at its start; its parameters say what it says."""
        self._loading = True
        try:
            for name in self.get_parameters_by_prefix('effects'):
                self.undeclare_parameter(f'effects.{name}')
            parameters.declare(self, parameters.effect_specs(setup.scene), override=False)
            self._show_solver(setup)
            self.set_parameters([Parameter('rate', value=1.0 / setup.tick)])
        finally:
            self._loading = False
        self._warm_up(setup.simulation)
        try:
            self._control.load(setup)
        except InputError as error:
            self.get_logger().error(f'no log: {error}')
        self._status.say(f'scene {setup.scene.name}: loaded, paused')
        self._say_what_is_on()
