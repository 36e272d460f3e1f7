"""What the commands on logs read from their command lines."""

from __future__ import annotations

import argparse
from typing import NoReturn

from alf_ros.errors import InputError


class Parser(argparse.ArgumentParser):
    """Raises InputError, one line, for what it cannot read."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f'{message} (see --help)')


def of_log(prog: str, description: str) -> Parser:
    """A parser with the argument LOG."""
    parser = Parser(prog=prog, description=description)
    parser.add_argument('log', metavar='LOG', help='the folder of a log, or one .mcap file')
    return parser


def add_trust(parser: Parser) -> None:
    """The option --trust, for what runs a log again."""
    parser.add_argument(
        '--trust',
        action='store_true',
        help='run the code of effects in the log whose files are no longer here',
    )
