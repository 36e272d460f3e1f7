"""Show and command a simulator in a web browser, on this machine only."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
from collections.abc import Sequence

import rclpy
from rclpy.exceptions import InvalidNodeNameException
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_node_name import validate_node_name

from alf_ros.commands.node_options import refusing_rclpy, without_ros
from alf_ros.commands.parser import Parser
from alf_ros.errors import InputError
from alf_ros.ros import unborn_ports
from alf_ros.ros.view.serve import serve
from alf_ros.scene.text.decimal_numbers import whole


def _options(argv: Sequence[str]) -> argparse.Namespace:
    parser = Parser(
        command='view',
        description='Serve a web page that shows a running `simulator` and commands it. Only this '
        'machine can open the page. Ctrl-C ends the page, not the simulator.',
    )
    parser.add_argument(
        '--simulator',
        type=_node,
        default='simulator',
        metavar='NAME',
        help='node to show, in the namespace of the view',
    )
    parser.add_argument(
        '--port',
        type=_port,
        default=8080,
        metavar='N',
        help='port of the page (default: 8080; 0: any free port)',
    )
    parser.add_argument(
        '--foxglove',
        nargs='?',
        type=_port,
        const=8765,
        metavar='N',
        help='also serve Foxglove at this port (default: 8765); needs foxglove-sdk',
    )
    return parser.parse_args(argv)


def _node(text: str) -> str:
    try:
        validate_node_name(text)
    except InvalidNodeNameException:
        raise InputError(
            'not the name of a node',
            key='--simulator',
            value=text,
            expected="letters, digits and '_'; a namespace by --ros-args -r __ns:=/left",
        ) from None
    return text


def _port(text: str) -> int:
    port = whole(text)
    if not 0 <= port < 1 << 16:
        raise ValueError
    return port


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until Ctrl-C or SIGTERM. Returns 0. Raises InputError: told in one line."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    options = _options(without_ros(arguments))
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    unborn_ports.remove()
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        with refusing_rclpy():
            serve(options.simulator, options.port, options.foxglove, stop, _say)
    finally:
        rclpy.try_shutdown()
    return 0


def _say(text: str) -> None:
    print(f'view: {text}', flush=True)
