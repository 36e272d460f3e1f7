"""Parameters that change the run: scene, accuracy, rate, solver and effects."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from alf_ros.errors import AlfError, StoppedError
from alf_ros.ros.simulator import parameters
from alf_ros.ros.simulator.beside import Beside
from alf_ros.ros.simulator.sensor_outputs import check_types
from alf_ros.ros.simulator.slow_work import Compiling, searched
from alf_ros.ros.terminal import StatusLine
from alf_ros.simulation.setup import Setup

Setter = Callable[[list[Parameter[Any]]], SetParametersResult]


class SetupChanges:
    """Makes the setup that parameters ask for while they are judged, and keeps it until they have
    been accepted.

    Services come through `set`: long work is done beside the executor then. Code that sets
    parameters of the node directly waits for it. `setup` gives the present setup.
    """

    def __init__(self, node: Node, status: StatusLine, setup: Callable[[], Setup]) -> None:
        # Imported late: loading the solver takes a good part of the start.
        from alf_ros.simulation import setup as settings

        self._node, self._status, self._present = node, status, setup
        self._settings = settings
        self._beside = Beside()
        self._next: tuple[Setup, dict[str, Any]] | None = None  # what the next parameters make
        self._put_off: list[Callable[[], Setup]] | None = None  # long work, if it may be put off
        self._made: Setup | None = None  # what came of it

    async def set(self, asked: list[Parameter[Any]], setter: Setter) -> SetParametersResult:
        """Set parameters with `setter`, which calls `prepare`.

        Changes of the run come one after another, in the order of their requests. Each begins with
        what the one before has left.
        """
        if not any(_acts(parameter.name) for parameter in asked):
            return setter(asked)
        async with self._beside:
            self._put_off = []
            try:
                result = setter(asked)
                work = next(iter(self._put_off), None)
            finally:
                self._put_off = None
            if work is None:
                return result
            try:
                self._made = await self._beside.made(work)
            except AlfError as error:
                return SetParametersResult(successful=False, reason=str(error))
            try:
                return setter(asked)
            finally:
                self._made = None

    def prepare(self, values: dict[str, Any]) -> str:
        """Make the setup with these parameters, unless it is unchanged. Returns why not, ''
        otherwise; raises AlfError."""
        solver = parameters.below('solver', values)
        if 'scene' in values:
            work, long = self._loading_of(values, solver), True
        else:
            if 'accuracy' in values:
                before = self._present().simulation.solver
                solver = self._settings.asked(before, values['accuracy']) | solver
            effects = {k: v for k, v in values.items() if k.startswith('effects.')}
            if not solver and not effects and 'rate' not in values:
                return ''
            rate = values.get('rate', self._node.get_parameter('rate').value)
            work, long = self._remaking(solver, effects, rate)
        if self._made is None and self._put_off is not None and long:
            self._put_off.append(work)
            return 'not made yet'
        made = self._made or work()
        if 'scene' not in values:
            made, values = self._settings.continued(self._present(), made), effects
        self._next = made, values
        return ''

    def forget(self) -> None:
        """Drop the setup of parameters that were not accepted."""
        self._next = None

    def take(self) -> tuple[Setup, dict[str, Any]] | None:
        """The setup that was made, once, with the numbers of effects or the scene."""
        taken, self._next = self._next, None
        return taken

    def end(self) -> None:
        """End a search that still runs."""
        self._beside.end()

    def _loading_of(self, values: dict[str, Any], solver: dict[str, Any]) -> Callable[[], Setup]:
        """A function that loads a scene; it may run in another thread."""
        from alf_ros.scene.scene import load_scene

        settings, name, rate = self._settings, values['scene'], values.get('rate')
        ledger, code = (self._node.get_parameter(k).value for k in ('ledger', 'trust_scenes'))
        accuracy = values.get('accuracy')

        def work() -> Setup:
            with self._status.say_if_slow(lambda: f'loading {name} ...', 2.0):
                scene = load_scene(name, code=code)
                check_types(scene)  # refused now, not after the change
                own = {} if accuracy is None else settings.asked(scene.solver, accuracy)
                chosen = own | solver
                return self._searched(
                    settings.searches(scene.solver, chosen),
                    lambda: settings.made(scene, chosen, rate, ledger),
                )

        return work

    def _remaking(
        self, solver: dict[str, Any], effects: dict[str, Any], rate: float
    ) -> tuple[Callable[[], Setup], bool]:
        """A function that makes the run with other numbers, in any thread, and whether that is
        long."""
        setup, settings = self._present(), self._settings
        before = setup.simulation.solver
        accuracy = settings.searches(before, solver) if solver or effects else 0.0

        def work() -> Setup:
            with self._status.say_if_slow(Compiling(), 1.0):
                return self._searched(
                    accuracy, lambda: settings.remade(setup, solver, effects, rate)
                )

        return work, bool(solver or accuracy)

    def _searched(self, accuracy: float, make: Callable[[], Setup]) -> Setup:
        """As `searched`. The terminal hears of a failure here: its request may have timed out."""
        try:
            return searched(self._status, accuracy, make)
        except AlfError as error:
            if accuracy:
                ends = isinstance(error, StoppedError)
                self._status.say(
                    'search given up: the node ends' if ends else f'no settings: {error}'
                )
            raise


def _acts(name: str) -> bool:
    """Whether a parameter changes the run, so that changes of it come one after another."""
    return name in ('scene', 'accuracy', 'rate') or name.startswith(('solver.', 'effects.'))
