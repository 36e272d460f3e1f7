"""Compute the passive joints of a robot with loops from its active ones, as a ROS 2 node."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from typing import Any

import rclpy
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from alf_ros.commands.parser import Parser
from alf_ros.errors import InputError
from alf_ros.ros import unborn_ports
from alf_ros.ros.closing.closing_node import INPUT, CloseNode
from alf_ros.ros.executor import spin
from alf_ros.ros.terminal import StatusLine


def _overrides(argv: Sequence[str]) -> list[Parameter[Any]]:
    """Options of the command line as node parameters."""
    parser = Parser(
        prog='close',
        description='Close the loops of a robot as the ROS 2 node `close`: active joints on '
        f'`{INPUT}`, all joints on `joint_states`. Ctrl-C stops the node.',
        epilog='Each option sets a parameter of the node. Set other parameters with --ros-args -p '
        'name:=value.',
    )
    parser.add_argument('--scene', metavar='NAME', help='scene or mechanism: a name, or a path')
    parser.add_argument('--active', metavar='JOINT', nargs='+', help='active joint coordinates')
    options = parser.parse_args(argv)
    given = {'scene': options.scene, 'active': options.active}
    return [Parameter(key, value=value) for key, value in given.items() if value is not None]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node until Ctrl-C or SIGTERM. Returns 0. Raises InputError: told in one line."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        own = remove_ros_args(arguments)
    except Exception as error:  # rclpy's exceptions for this have no common root
        raise InputError(f'{type(error).__name__}: {error}', key='--ros-args') from None
    overrides, status = _overrides(own), StatusLine()
    try:
        unborn_ports.remove()
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        node = CloseNode(overrides, status)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, node.stop)
        closure = node.closure
        passive = len(closure.joint_names) - len(closure.active)
        status.say(
            f'running: {closure.model.mechanism.name}, {len(closure.active)} active and {passive} '
            f'passive joints; active ones on {INPUT}'
        )
        spin(node)
        status.say(f'stopped after {node.postures} postures')
    finally:
        rclpy.try_shutdown()
    return 0
