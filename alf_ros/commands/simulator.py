"""Simulate a scene as a ROS 2 node with topics, commands, services, diagnostics and a log."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

import rclpy
from rclpy.signals import SignalHandlerOptions

from alf_ros.commands.node_options import EPILOG, NodeOptions, without_ros
from alf_ros.commands.parser import Parser
from alf_ros.ros import unborn_ports
from alf_ros.ros.executor import spin
from alf_ros.ros.simulator.node import Simulator, Stop
from alf_ros.ros.terminal import StatusLine

# The writer thread may hold the interpreter that long (s) before a tick gets it; Python's 5 ms are
# several ticks.
SWITCH_INTERVAL = 2e-4


_PARAMETERS = {
    '--scene': 'scene',
    '--duration': 'duration',
    '--log-folder': 'record.folder',
    '--no-record': 'record.enabled',
}


def _options(arguments: Sequence[str]) -> NodeOptions:
    parser = Parser(
        command='simulator',
        description='Run a scene as the ROS 2 node `simulator`. Ctrl-C stops the node and closes '
        'the log.',
        epilog=EPILOG,
    )
    parser.add_argument('--scene', metavar='NAME', help='name under config/scenes, or a path')
    parser.add_argument('--duration', type=float, metavar='S', help='simulated time, s')
    parser.add_argument('--log-folder', metavar='DIR', help='folder for logs (default: logs)')
    parser.add_argument('--no-record', action='store_true', help='write no log')
    options = parser.parse_args(without_ros(arguments))
    given = {
        '--scene': options.scene,
        '--duration': options.duration,
        '--log-folder': options.log_folder,
        '--no-record': False if options.no_record else None,
    }
    return NodeOptions(arguments, given, _PARAMETERS)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node until its duration is over, Ctrl-C, SIGTERM or SIGHUP.

    Returns 0, or 1 if a log could not be written to its end. Raises AlfError, which the command
    line tells in one line.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    options = _options(arguments)
    sys.setswitchinterval(SWITCH_INTERVAL)
    stop = Stop()
    # Of `nohup` SIGHUP is ignored, and stays so.
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    ends = (signal.SIGINT, signal.SIGTERM) + (() if ignored else (signal.SIGHUP,))
    for number in ends:
        signal.signal(number, stop)
    try:
        # rclpy's own handlers would shut the context down under the feet of a tick.
        unborn_ports.remove()
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        with options.naming():
            node = Simulator(StatusLine(), stop, options.parameters)
        stop.gentle = True
        node.begin()
        try:
            spin(node)
        finally:
            node.close()
        return node.exit_code
    finally:
        rclpy.try_shutdown()
        # the interpreter would put the default back while it ends: a second Ctrl-C comes too late
        for number in ends:
            signal.signal(number, signal.SIG_IGN)
