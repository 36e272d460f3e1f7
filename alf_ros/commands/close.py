"""Compute the passive joints of a robot with loops from its active ones, as a ROS 2 node."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

import rclpy
from rclpy.signals import SignalHandlerOptions

from alf_ros.commands.node_options import EPILOG, NodeOptions, without_ros
from alf_ros.commands.parser import Parser
from alf_ros.ros import unborn_ports
from alf_ros.ros.closing.closing_node import INPUT, CloseNode
from alf_ros.ros.executor import spin
from alf_ros.ros.terminal import StatusLine


def _options(arguments: Sequence[str]) -> NodeOptions:
    parser = Parser(
        command='close',
        description='Close the loops of a robot as the ROS 2 node `close`: active joints on '
        f'`{INPUT}`, all joints on `joint_states`. Ctrl-C stops the node.',
        epilog=EPILOG,
    )
    parser.add_argument('--scene', metavar='NAME', help='scene or mechanism: a name, or a path')
    parser.add_argument('--active', metavar='JOINT', nargs='+', help='active joint coordinates')
    options = parser.parse_args(without_ros(arguments))
    given = {'--scene': options.scene, '--active': options.active}
    return NodeOptions(arguments, given, {'--scene': 'scene', '--active': 'active'})


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node until Ctrl-C or SIGTERM. Returns 0. Raises InputError: told in one line."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    options, status = _options(arguments), StatusLine()
    try:
        unborn_ports.remove()
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        with options.naming():
            node = CloseNode(options.parameters, status)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, node.stop)
        closure = node.closure
        passive = len(closure.joint_names) - len(closure.active)
        status.say(
            f'running: {closure.model.mechanism.name}, {len(closure.active)} active and {passive} '
            f'passive joints; active ones on {node.input}'
        )
        spin(node)
        status.say(f'stopped after {node.postures} postures')
    finally:
        rclpy.try_shutdown()
    return 0
