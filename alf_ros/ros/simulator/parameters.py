"""The parameters of the simulator node: names, defaults, ranges, what may change at run time."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.parameter import Parameter

from alf_ros.errors import InputError
from alf_ros.ros.messages.topics import TF, TOPICS
from alf_ros.scene.scene import Scene, Solver
from alf_ros.scene.text.yaml_document import LARGEST

if TYPE_CHECKING:
    from rclpy.node import Node

# YAML, and so every ROS command line, turns an unquoted on or off into a boolean.
MODES = {'auto': 'auto', 'on': 'on', 'off': 'off', True: 'on', False: 'off'}
OFFERED = (*(topic.name for topic in TOPICS), '/diagnostics', 'robot_description')
TOPIC_NAMES = OFFERED if TF in OFFERED else (*OFFERED, TF)
_DEFAULT_MODE = {TF: 'off'}
RECORDED = [
    'joint_states',
    '~/reactions',
    '~/constraints',
    '~/drives',
    '~/state',
    '~/energy',
    '~/work',
    '/diagnostics',
]
# A saved state's name is a file's name.
ALL = 'all'  # `record.rate.all` is for every topic without a rate of its own
_STATE_NAME = re.compile(r'[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}')
# Numbers of effects are parameters up to this many: declaring one takes a tenth of a millisecond.
MOST_EFFECT_VALUES = 512

_TYPES = {
    Parameter.Type.NOT_SET: 'nothing',
    Parameter.Type.BOOL: 'true or false',
    Parameter.Type.INTEGER: 'a whole number',
    Parameter.Type.DOUBLE: 'a number',
    Parameter.Type.STRING: 'a text',
    Parameter.Type.BYTE_ARRAY: 'a list of bytes',
    Parameter.Type.BOOL_ARRAY: 'a list of true or false',
    Parameter.Type.INTEGER_ARRAY: 'a list of whole numbers',
    Parameter.Type.DOUBLE_ARRAY: 'a list of numbers',
    Parameter.Type.STRING_ARRAY: 'a list of texts',
}


@dataclass(frozen=True)
class Spec:
    """One parameter. `limits` are inclusive. A parameter that shapes the run or its log is
    `fixed`. Only an `untyped` parameter may have a value of another type than the default."""

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


SCENE = Spec(
    'scene',
    'slider_crank',
    'Scene: a name under config/scenes, or a path. Setting it loads the scene, paused at its '
    'start',
    fixed=False,
)


def solver_specs(solver: Solver) -> list[Spec]:
    """`solver.*` and `accuracy`: defaults come from the scene, limits from `Solver`."""
    return [
        Spec(
            'accuracy',
            solver.accuracy or 0.0,
            'Requested position error, m; chooses integrator and tolerance; 0: no request',
            (0.0, 1e6),
            fixed=False,
        ),
        # stamps count ns: those of shorter steps would not say which step it was
        Spec('solver.step', solver.step, 'Solver step, s', (1e-9, 1e6), fixed=False),
        Spec(
            'solver.integrator',
            solver.integrator,
            'Integrator, such as rk4 or dop853; esdirk43 for stiff effects',
            fixed=False,
        ),
        Spec(
            'solver.formulation',
            solver.formulation,
            'Formulation of the equations of motion, such as alf2',
            fixed=False,
        ),
        Spec(
            'solver.penalty',
            solver.penalty,
            'Penalty, dimensionless',
            (1e-60, 1e12),
            fixed=False,
        ),
        Spec(
            'solver.iterations',
            solver.iterations,
            'Maximum iterations of a solve',
            (1, 1000),
            fixed=False,
        ),
        Spec(
            'solver.tolerance',
            solver.tolerance,
            'Relative error of a step, for adaptive integrators',
            (0.0, 1.0),
            fixed=False,
        ),
    ]


def effect_specs(scene: Scene) -> list[Spec]:
    """`effects.*`: the numbers of the scene's effects; none if there are too many."""
    # Imported late: loading the solver takes a good part of the start.
    from alf_ros.scene.effect_values import effect_values

    values = effect_values(scene)
    if len(values) > MOST_EFFECT_VALUES:
        return []
    limits = (-LARGEST, LARGEST)
    return [
        Spec(name, v.value, v.doc, limits if type(v.value) is float else None, fixed=False)
        for name, v in values.items()
    ]


def node_specs(rate: float) -> list[Spec]:
    """Everything but scene, solver and effects; `rate` (Hz) is the default one of the scene."""
    modes = 'auto: with subscribers; on: always; off: never'
    return [
        Spec(
            'rate',
            rate,
            'Ticks (and messages) per simulated second, Hz; 1/rate must be a whole number of '
            'steps',
            (1e-6, 1e5),
            fixed=False,
        ),
        Spec(
            'real_time_factor',
            1.0,
            'Simulated seconds per second; 0: as fast as possible',
            (0.0, 1e3),
            fixed=False,
        ),
        Spec('step_count', 1, 'Ticks per call of ~/step', (1, 10**9), fixed=False),
        Spec(
            'command_timeout',
            0.0,
            'Time (steady clock) after which a command without a new message becomes zero, s; 0: '
            'held',
            (0.0, 3600.0),
            fixed=False,
        ),
        *(
            Spec(f'trajectory.{name}', 0.0, description, (0.0, 1e6), fixed=False)
            for name, description in (
                (
                    'path_tolerance',
                    'Permitted error of a joint on its trajectory, rad or m; 0: any',
                ),
                (
                    'goal_tolerance',
                    'Permitted error of a joint at the end of its trajectory, rad or m; 0: any',
                ),
                (
                    'goal_time',
                    'Time after the end of a trajectory at which goal_tolerance is checked, '
                    'simulated s',
                ),
            )
        ),
        Spec(
            'trust_scenes',
            False,
            'Scenes loaded while the node runs may contain effects of their own (Python code)',
        ),
        Spec('ledger', False, 'Compute the work of each effect, for ~/work and diagnostics'),
        Spec(
            'start_paused', False, 'Start paused: ~/pause with false continues, ~/step makes ticks'
        ),
        Spec('duration', 0.0, 'Simulated time to run, s; 0: until stopped', (0.0, 1e9)),
        Spec('status_line', True, 'Print a live status line (plain lines without a terminal)'),
        Spec(
            'state.name',
            'default',
            'Name of the state for ~/save_state and ~/restore_state',
            fixed=False,
        ),
        Spec('state.folder', 'states', 'Folder of saved states; empty: in memory only'),
        Spec('record.enabled', True, 'Record an MCAP log'),
        Spec('record.folder', 'logs', 'Folder for logs; each run makes a folder in it'),
        Spec(
            'record.topics', RECORDED, f'Recorded topics, a selection of {", ".join(TOPIC_NAMES)}'
        ),
        Spec('record.sensors', True, 'Record the sensors of the scene'),
        Spec(
            'record.max_size',
            0,
            'Size at which a log continues in a new file, bytes; 0: never',
            (0, 10**15),
        ),
        Spec(
            'record.max_duration',
            0.0,
            'Simulated time after which a log continues in a new file, s; 0: never',
            (0.0, 1e9),
        ),
        Spec(
            f'record.rate.{ALL}',
            0.0,
            'Messages in the log per simulated second of each topic without a rate of its own, '
            'Hz; 0: all',
            (0.0, 1e5),
        ),
        *(
            Spec(
                f'record.rate.{name.rpartition("/")[2]}',
                0.0,
                f'Messages of {name} in the log per simulated second, Hz; 0: as `all` says',
                (0.0, 1e5),
            )
            for name in dict.fromkeys((*(topic.name for topic in TOPICS), TF))
        ),
        Spec(
            'display_rate',
            30.0,
            'Messages per simulated second on ~/markers and tf, Hz, at most `rate`',
            (1e-6, 1e5),
            fixed=False,
        ),
        Spec(
            'force_scale',
            0.0,
            'Length of force arrows, m/N; 0: the weight is a quarter of the size of the mechanism',
            (0.0, 1e6),
            fixed=False,
        ),
        Spec('frame_prefix', '', 'Prefix of the names of body frames, such as left/'),
        *(
            Spec(
                mode_of(name),
                _DEFAULT_MODE.get(name, 'auto'),
                f'Publish {name}: {modes}',
                fixed=False,
                untyped=True,
            )
            for name in TOPIC_NAMES
        ),
    ]


def mode_of(topic: str) -> str:
    """Name of the parameter that says whether `topic` is published."""
    return f'publish.{topic.rpartition("/")[2]}'


def declare(node: Node, specs: Iterable[Spec], override: bool = True) -> dict[str, Any]:
    """Declare parameters and return their values; `override`: with the values given at the start.

    Raises InputError, one line, for a value of the wrong type or out of range.
    """
    values = {}
    overrides = node._parameter_overrides
    for spec in specs:
        given = overrides.get(spec.name) if override else None
        if given is not None:
            overrides[spec.name] = given = _as_number(given, spec.default)
        expected = _TYPES[Parameter.Type.from_parameter_value(spec.default)]
        if spec.limits is not None:
            expected += f' from {spec.limits[0]:g} to {spec.limits[1]:g}'
        if given is not None and given.type_ == Parameter.Type.NOT_SET:
            # `[]`: rcl finds no type in it, and rclpy declares no list without entries
            text = 'bad value of a parameter: an empty list given'
            expected += ' with an entry or more' if isinstance(spec.default, list) else ''
            raise InputError(text, key=spec.name, expected=expected)
        try:
            parameter = node.declare_parameter(
                spec.name, spec.default, spec.descriptor(), ignore_override=not override
            )
        except (InvalidParameterTypeException, InvalidParameterValueException):
            value = given.value if given is not None else spec.default
            wanted, came = map(Parameter.Type.from_parameter_value, (spec.default, value))
            text = 'bad value of a parameter'
            text += f': {_TYPES[came]} given' if came != wanted else ''
            raise InputError(text, key=spec.name, value=value, expected=expected) from None
        values[spec.name] = plain(parameter.value)
        reason = refusal(parameter)
        if reason:
            raise InputError(reason)
    return values


def plain(value: Any) -> Any:
    """The value of a parameter, arrays as lists."""
    return value if isinstance(value, (bool, int, float, str)) else list(value)


def _as_number(given: Parameter[Any], default: object) -> Parameter[Any]:
    """`duration:=10` on a command line is an integer; nobody means to be refused for that."""
    if isinstance(default, float) and type(given.value) is int:
        return Parameter(given.name, value=float(given.value))
    numbers = isinstance(default, list) and all(isinstance(x, float) for x in default)
    if numbers and given.type_ == Parameter.Type.INTEGER_ARRAY:
        return Parameter(given.name, value=[float(number) for number in given.value])
    return given


def fitted(node: Node, asked: Sequence[Parameter[Any]]) -> tuple[list[Parameter[Any]], str]:
    """Parameters somebody wants to set, whole numbers as numbers where numbers are; and why that
    cannot be, '' if types and names are right."""
    found = []
    for parameter in asked:
        name = parameter.name
        if not node.has_parameter(name):
            known = sorted(node.get_parameters_by_prefix(''))
            return [], str(InputError('unknown parameter of the node', value=name, choices=known))
        present = node.get_parameter(name)
        parameter = _as_number(parameter, plain(present.value))
        wanted, given = present.type_, parameter.type_
        if given != wanted and not node.describe_parameter(name).dynamic_typing:
            text = f'{_TYPES[given]} given'
            return [], str(InputError(text, key=name, expected=_TYPES[wanted]))
        found.append(parameter)
    return found, ''


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
    asked = name == mode_of(TF) and MODES[value] != 'off'
    if TF not in OFFERED and (asked or (name == 'record.topics' and TF in value)):
        return f'{name}: tf needs tf2_msgs, which comes with a ROS 2 installation: source one'
    if name == 'state.name' and not _STATE_NAME.fullmatch(value):
        wanted = "letters, digits, '_', '.', '-'; at most 100"
        return str(InputError('not a name', key=name, value=value, expected=wanted))
    return ''


def below(prefix: str, values: dict[str, Any]) -> dict[str, Any]:
    """The values below `prefix`, without it."""
    dotted = f'{prefix}.'
    return {k[len(dotted) :]: v for k, v in values.items() if k.startswith(dotted)}
