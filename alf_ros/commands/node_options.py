"""Options of a command that set parameters of its node, beside those after --ros-args."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.exceptions import InvalidParameterTypeException
from rclpy.parameter import Parameter
from rclpy.utilities import remove_ros_args

from alf_ros.commands.parser import naming
from alf_ros.errors import InputError

EPILOG = (
    'Each option sets a parameter of the node. Set other parameters with '
    '--ros-args -p name:=value.'
)


def without_ros(arguments: Sequence[str]) -> list[str]:
    """The arguments that are not of ROS.

    Raises InputError for arguments that ROS cannot read, and for a parameter that they set twice:
    ROS would keep the last value without a word.
    """
    try:
        own: list[str] = remove_ros_args(list(arguments))
    except Exception as error:  # rclpy's exceptions for this have no common root
        raise InputError(f'{type(error).__name__}: {error}', key='--ros-args') from None
    names = list(_set_by_ros(arguments))
    for n, name in enumerate(names):
        if name in names[:n]:
            raise InputError('given twice', key='-p', value=name, expected='it once')
    return own


class NodeOptions:
    """The parameters that options set: values by the option, None where it is not given.

    Raises InputError for a parameter that the arguments set once more after --ros-args.
    """

    def __init__(
        self, arguments: Sequence[str], values: Mapping[str, Any], parameters: Mapping[str, str]
    ) -> None:
        given = {option: value for option, value in values.items() if value is not None}
        self._options = {parameters[option]: option for option in given}
        self.parameters = [Parameter(parameters[o], value=value) for o, value in given.items()]
        for name in _set_by_ros(arguments):
            option = self._options.get(name.rpartition(':')[2])
            if option is not None:
                text = f'given twice, also by -p {name}'
                raise InputError(text, key=option, expected='one of them')

    @contextmanager
    def naming(self) -> Iterator[None]:
        """Errors of the block about a parameter name the option that sets it."""
        with naming(self._options), refusing_rclpy():
            yield


@contextmanager
def refusing_rclpy() -> Iterator[None]:
    """Raise InputError for a value that a parameter of rclpy itself cannot have, which are all
    switches: a node is not made with it."""
    try:
        yield
    except InvalidParameterTypeException as error:
        found = re.search("parameter '(.*?)' to '(.*)' of type", str(error), re.DOTALL)
        name, value = found.groups() if found else ('', str(error))
        text = 'bad value of a parameter of rclpy'
        raise InputError(text, key=name, value=value, expected='true or false') from None


def _set_by_ros(arguments: Sequence[str]) -> Iterator[str]:
    """The names that -p sets, of a parameter or of node:parameter."""
    of_ros, before = False, ''
    for argument in arguments:
        if argument == '--ros-args':
            of_ros = True
        elif argument == '--':
            of_ros = False
        elif of_ros and before in ('-p', '--param'):
            yield argument.partition(':=')[0]
        before = argument
