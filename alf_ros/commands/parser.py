"""The parser of every command, and the options that several commands share."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.text.expression import ExpressionError, evaluate


class Parser(argparse.ArgumentParser):
    """Raises InputError, one line, for what it cannot read. Numbers are finite."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self.register('type', float, _finite)

    def error(self, message: str) -> NoReturn:
        """Raise InputError with the message of argparse. Never returns."""
        raise InputError(f'{message} (see --help)')


def _finite(text: str) -> float:
    found = float(text)
    if not math.isfinite(found):
        raise argparse.ArgumentTypeError(f'not a finite number: {text!r}')
    return found


def of_log(prog: str, description: str) -> Parser:
    """A parser with the argument LOG."""
    parser = Parser(prog=prog, description=description)
    parser.add_argument('log', metavar='LOG', help='folder of a log, or one .mcap file')
    return parser


def add_trust(parser: Parser) -> None:
    """The option --trust, for what runs a log again."""
    parser.add_argument(
        '--trust',
        action='store_true',
        help='run the effect code that the log contains (read this code first)',
    )


def add_folder(parser: Parser, default: str, what: str = '') -> None:
    """The option --folder, for `what` a command writes; see `writing_into`."""
    parser.add_argument(
        '--folder', default=default, metavar='DIR', help=f'{what} (default: {default})'.lstrip()
    )


def add_numbers(
    parser: Parser,
    metavar: str = 'NAME=NUMBER',
    what: str = 'values that replace parameters of the mechanism',
) -> None:
    """The option --set, numbers by name; `numbers` reads them."""
    parser.add_argument('--set', metavar=metavar, nargs='+', default=[], help=what)


def numbers(assignments: Iterable[str], option: str = '--set') -> dict[str, float]:
    """The numbers of an option by name; each is an expression of constants. Raises InputError."""
    return dict(_number(text, option) for text in assignments)


def _number(text: str, option: str) -> tuple[str, float]:
    name, given, value = text.partition('=')
    try:
        return name, evaluate(value if given else '', {})
    except ExpressionError as error:
        message = f'not a number by name: {error}'
        raise InputError(message, key=option, value=text, expected='NAME=NUMBER') from None


@contextmanager
def writing_into(folder: str) -> Iterator[Path]:
    """Makes the folder of --folder and yields its path.

    Raises InputError if the folder, or a file written in the block, cannot be written.
    """
    path = paths.named(folder, '--folder')
    with writing('--folder', path):
        path.mkdir(parents=True, exist_ok=True)
        yield path


@contextmanager
def writing(option: str, path: str | Path) -> Iterator[None]:
    """Raises InputError that names the option and its path where the block raises OSError."""
    try:
        yield
    except BrokenPipeError:  # of what is printed: the reader has gone, which `__main__` knows
        raise
    except OSError as error:
        raise InputError(str(error.strerror), key=option, value=str(path)) from None
