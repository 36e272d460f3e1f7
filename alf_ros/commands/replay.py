"""Publish the topics of a log again, or simulate again with its inputs and publish the result."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

import rclpy
from rclpy.signals import SignalHandlerOptions

from alf_ros.commands.node_options import NodeOptions, without_ros
from alf_ros.commands.parser import add_trust, of_log, refuse_given
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.ros import unborn_ports
from alf_ros.ros.executor import spin
from alf_ros.ros.replay.replay_node import Replay
from alf_ros.ros.replay.sources import Recorded, Redriven, Source
from alf_ros.ros.terminal import StatusLine

_PARAMETERS = {'--rate': 'rate', '--start': 'seek', '--loop': 'loop', '--paused': 'start_paused'}


def main(argv: Sequence[str] | None = None) -> int:
    """Replay one log; returns 0, or 1 if a step fails when it is made again. Raises InputError."""
    parser = of_log(
        'replay',
        'Publish the topics of a log, and /clock, as the node `replay`. Its parameters rate, loop '
        'and seek can be set while the node runs. ~/pause pauses the replay.',
    )
    parser.add_argument('--rate', type=float, metavar='R', help='logged seconds per second')
    parser.add_argument('--start', type=float, metavar='T', help='simulated time of the start, s')
    parser.add_argument(
        '--loop', action='store_true', help='at the end, start again from the beginning'
    )
    parser.add_argument('--paused', action='store_true', help='start paused')
    parser.add_argument(
        '--redrive',
        action='store_true',
        help='use only the inputs of the log, and simulate again',
    )
    add_trust(parser)
    arguments = list(sys.argv[1:] if argv is None else argv)
    options = parser.parse_args(without_ros(arguments))
    given = {
        '--rate': options.rate,
        '--start': options.start,
        '--loop': options.loop or None,
        '--paused': options.paused or None,
    }
    if not options.redrive:
        refuse_given(options, ('trust',), 'has no meaning without --redrive')
    of_node = NodeOptions(arguments, given, _PARAMETERS)
    log, status = load(options.log), StatusLine()
    with ProgressBar('reading') as bar:
        source: Source = Redriven(log, options.trust) if options.redrive else Recorded(log, bar)
    if log.cut:
        print(f'alf_ros replay: {log.cut}', file=sys.stderr)
    try:
        unborn_ports.remove()
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        with of_node.naming():
            node = Replay(log, source, of_node.parameters, status)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, node.stop)
        status.say(f'replay of {log.path}: {len(source.topics)} topics, to t = {log.end:.9g} s')
        spin(node)
        node.deliver()
        status.say(f'stopped at t = {node.t:.9g} s, {node.published} messages')
    finally:
        rclpy.try_shutdown()
    if isinstance(source, Redriven) and source.trouble:
        print(f'alf_ros replay: {source.trouble}', file=sys.stderr)
    if node.failure is not None:
        if isinstance(node.failure, InputError):
            raise node.failure
        print(f'a step fails: {node.failure}')
        return 1
    return 0
