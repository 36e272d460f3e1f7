"""The parameters of the simulator node: names, defaults, ranges, what may change at run time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.parameter import Parameter

from alf_ros.errors import InputError
from alf_ros.messages import TOPICS

if TYPE_CHECKING:
    from rclpy.node import Node

    from alf_ros.scene import Solver

# YAML, and so every ROS command line, turns an unquoted on or off into a boolean.
MODES = {'auto': 'auto', 'on': 'on', 'off': 'off', True: 'on', False: 'off'}
TOPIC_NAMES = (*(topic.name for topic in TOPICS), '/diagnostics')
RECORDED = ['joint_states', '~/reactions', '~/constraints', '~/energy', '/diagnostics']
# Shortest tick (s) chosen by default: at 500 Hz a small mechanism, recorded and published, takes a
# fifth of a core, and 500 Hz is more than RViz, plots and most controllers use.
DEFAULT_TICK = 2e-3

_KINDS = {
    bool: 'true or false',
    int: 'a whole number',
    float: 'a number',
    str: 'a text',
    list: 'a list of texts',
}


@dataclass(frozen=True)
class Spec:
    """One parameter. `limits` are inclusive; what shapes the run or its log is `fixed`; only what
    is `untyped` may have a value of another type than the default."""

    name: str
    default: Any
    description: str
    limits: tuple[float, float] | None = None
    fixed: bool = True
    untyped: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """The descriptor as `ros2 param describe` shows it."""
        descriptor = ParameterDescriptor(
            description=self.description, read_only=self.fixed, dynamic_typing=self.untyped
        )
        if self.limits is not None and isinstance(self.default, float):
            low, high = self.limits
            limits = FloatingPointRange(from_value=float(low), to_value=float(high))
            descriptor.floating_point_range = [limits]
        elif self.limits is not None:
            low, high = self.limits
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
        return descriptor


SCENE = Spec('scene', 'slider_crank', 'Scene: a name under config/scenes, or a path')


def solver_specs(solver: Solver) -> list[Spec]:
    """`solver.*`: defaults are what the scene says, limits those of `Solver`."""
    return [
        Spec('solver.step', solver.step, 'Solver step, s', (1e-12, 1e6)),
        Spec('solver.integrator', solver.integrator, 'Integrator, such as rk4 or dop853'),
        Spec('solver.formulation', solver.formulation, 'Equations solved, such as alf2'),
        Spec('solver.penalty', solver.penalty, 'Penalty, without dimension', (1e-300, 1e300)),
        Spec('solver.iterations', solver.iterations, 'Most iterations a stage', (1, 1000)),
        Spec('solver.tolerance', solver.tolerance, 'Relative error (adaptive)', (0.0, 1.0)),
    ]


def node_specs(step: float) -> list[Spec]:
    """Everything but the scene and the solver, for a solver step of `step` seconds."""
    rate = 1.0 / (step * max(1, math.ceil(DEFAULT_TICK / step * (1.0 - 1e-9))))
    modes = 'auto: when somebody subscribes; on: always; off: never'
    return [
        Spec(
            'rate',
            rate,
            'Ticks, and so messages, per simulated second, Hz; 1/rate is a whole number of steps',
            (1e-6, 1e5),
        ),
        Spec(
            'real_time_factor',
            1.0,
            'Simulated seconds per second; 0 runs as fast as it can',
            (0.0, 1e3),
            fixed=False,
        ),
        Spec(
            'command_timeout',
            0.0,
            'Seconds (steady clock) after which a command not renewed becomes zero; 0 holds it',
            (0.0, 3600.0),
            fixed=False,
        ),
        Spec('start_paused', False, 'Start paused: ~/pause false plays, ~/step makes one tick'),
        Spec('duration', 0.0, 'Simulated seconds to run; 0 runs until stopped', (0.0, 1e9)),
        Spec('status_line', True, 'Print a live status line (plain lines if not on a terminal)'),
        Spec('record.enabled', True, 'Record an MCAP log'),
        Spec('record.folder', 'logs', 'Folder in which each run makes a folder for its log'),
        Spec('record.topics', RECORDED, f'Recorded topics, of {", ".join(TOPIC_NAMES)}'),
        *(
            Spec(mode_of(name), 'auto', f'Publish {name}: {modes}', fixed=False, untyped=True)
            for name in TOPIC_NAMES
        ),
    ]


def mode_of(topic: str) -> str:
    """Name of the parameter that says whether `topic` is published."""
    return f'publish.{topic.rpartition("/")[2]}'


def declare(node: Node, specs: Iterable[Spec]) -> dict[str, Any]:
    """Declare parameters and return their values.

    Raises InputError, one line, for a value of the wrong type or out of range.
    """
    values = {}
    overrides = node._parameter_overrides
    for spec in specs:
        given = overrides.get(spec.name)
        if given is not None and type(given.value) is int and isinstance(spec.default, float):
            # `duration:=10` on a command line is an integer; nobody means to be refused for that.
            overrides[spec.name] = Parameter(spec.name, value=float(given.value))
        expected = _KINDS[type(spec.default)]
        if spec.limits is not None:
            expected += f' from {spec.limits[0]:g} to {spec.limits[1]:g}'
        try:
            parameter = node.declare_parameter(spec.name, spec.default, spec.descriptor())
        except (InvalidParameterTypeException, InvalidParameterValueException):
            value = given.value if given is not None else spec.default
            raise InputError(
                'bad value of a parameter', key=spec.name, value=value, expected=expected
            ) from None
        values[spec.name] = parameter.value
        reason = refusal(parameter)
        if reason:
            raise InputError(reason)
    return values


def check_names(node: Node) -> None:
    """Refuse parameters given at start that the node does not have: rclpy would ignore them."""
    for name in node._parameter_overrides:
        if not node.has_parameter(name):
            known = sorted(node.get_parameters_by_prefix(''))
            raise InputError('unknown parameter of the node', value=name, choices=known)


def refusal(parameter: Parameter[Any]) -> str:
    """Why a value cannot be had, beyond what type and range say; '' if it can."""
    name, value = parameter.name, parameter.value
    if name.startswith('publish.') and (type(value) not in (str, bool) or value not in MODES):
        return str(InputError('not a mode', key=name, value=value, expected='auto, on or off'))
    if name == 'record.topics':
        for topic in value:
            if topic not in TOPIC_NAMES:
                return str(InputError('unknown topic', key=name, value=topic, choices=TOPIC_NAMES))
    return ''


def judge(parameters: list[Parameter[Any]]) -> SetParametersResult:
    """On-set callback: rejects with the reason, all or nothing."""
    reason = next(filter(None, map(refusal, parameters)), '')
    return SetParametersResult(successful=not reason, reason=reason)


def steps_per_tick(rate: float, step: float) -> int:
    """Number of solver steps (s) in a tick at `rate` (Hz). Raises InputError if not whole."""
    steps = 1.0 / (rate * step)
    whole = max(1, round(steps))
    if abs(steps - whole) > 1e-6 * whole:
        below, above = max(1, math.floor(steps)), math.ceil(steps)
        near = ' or '.join(f'{1.0 / (n * step):.9g}' for n in sorted({above, below}))
        raise InputError(
            f'a tick of 1/rate must be a whole number of solver steps of {step:g} s',
            key='rate',
            value=rate,
            expected=f'{near} Hz',
        )
    return whole
