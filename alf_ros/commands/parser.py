"""The parser of every command, and the options that several commands share."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.text.decimal_numbers import decimal, whole
from alf_ros.scene.text.expression import ExpressionError, evaluate

# the beginning of a word that is a number, never an option
_NEGATIVE = re.compile(r'-(?:\.?[0-9]|inf|nan)', re.IGNORECASE)

_PATHS = ('FILE', 'DIR', 'FOLDER')  # metavars of options that name one


class Parser(argparse.ArgumentParser):
    """Raises InputError, one line, for what it cannot read. Numbers are finite. Its help names the
    command as its errors do: `alf_ros <command>`.

    A repeated option adds up if several values may follow it. An option of one value is given
    once: argparse would keep the last one without a word.
    """

    def __init__(self, command: str, **settings: Any) -> None:
        super().__init__(prog=f'alf_ros {command}', **settings)
        self.register('type', float, _finite)
        self.register('type', int, whole)
        for name in (None, 'store'):
            self.register('action', name, _Store)
        # argparse takes -1e-3 for an option
        self._negative_number_matcher = _NEGATIVE
        self.given: set[str] = set()

    def parse_known_args(self, *args: Any, **settings: Any) -> Any:
        """As of argparse, from no option on."""
        self.given = set()
        return super().parse_known_args(*args, **settings)

    def naming(self, **others: str) -> AbstractContextManager[None]:
        """`naming` with all options; `others`: of arguments that have another name than theirs."""
        own = {
            name: max(action.option_strings, key=len)
            for action in self._actions
            for name in (action.dest, *(each.lstrip('-') for each in action.option_strings))
            if action.option_strings
        }
        return naming(own | others)

    def error(self, message: str) -> NoReturn:
        """Raise InputError with the message of argparse. Never returns."""
        raise InputError(f'{message} (see --help)')


@contextmanager
def naming(options: Mapping[str, str]) -> Iterator[None]:
    """Errors of the block about an argument of the library name the option that gives it, unless
    they are about a line of a file.

    options: as typed, by the argument.
    """
    try:
        yield
    except InputError as error:
        name, _, rest = (error.key or '').partition('.')
        if error.line is not None or name not in options:
            raise
        option = options[name] if rest.isdigit() else f'{options[name]} {rest}'.rstrip()
        raise error.about(option, error.file) from None


class _Store(argparse.Action):
    """Stores the value of an option, or the values of several times the same one. An empty text
    names no file and no folder: it would count as none given, or as the present folder."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        assert isinstance(parser, Parser)
        if option_string is not None and values == '' and self.metavar in _PATHS:
            raise InputError('no name', key=option_string, value='', expected='a path')
        if option_string is not None and self.dest in parser.given:
            if self.nargs not in ('+', '*'):
                raise InputError('given twice', key=option_string, expected='it once')
            values = [*getattr(namespace, self.dest), *values]
        parser.given.add(self.dest)
        setattr(namespace, self.dest, values)


def _finite(text: str) -> float:
    found = decimal(text)
    if not math.isfinite(found):
        raise argparse.ArgumentTypeError(f'not a finite number: {text!r}')
    return found


def of_log(command: str, description: str) -> Parser:
    """A parser with the argument LOG."""
    parser = Parser(command, description=description)
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


def pairs(texts: Iterable[str], option: str, expected: str = 'NAME=VALUE') -> dict[str, str]:
    """The values of an option by name. Raises InputError for a text that is no pair, and for a
    name that is given twice."""
    found: dict[str, str] = {}
    for text in texts:
        name, given, value = text.partition('=')
        if not given or not name:
            raise InputError('not a pair', key=option, value=text, expected=expected)
        if name in found:
            raise InputError('given twice', key=option, value=name, expected='it once')
        found[name] = value
    return found


def numbers(assignments: Iterable[str], option: str = '--set') -> dict[str, float]:
    """The numbers of an option by name; each is an expression of constants. Raises InputError."""
    texts = pairs(assignments, option, 'NAME=NUMBER')
    return {name: _number(name, text, option) for name, text in texts.items()}


def _number(name: str, text: str, option: str) -> float:
    try:
        return evaluate(text, {})
    except ExpressionError as error:
        raise InputError(
            f'not a number by name: {error}',
            key=option,
            value=f'{name}={text}',
            expected='NAME=NUMBER',
        ) from None


@contextmanager
def writing_into(folder: str) -> Iterator[Path]:
    """Makes the folder of --folder and yields its path.

    Raises InputError if the folder, or a file written in the block, cannot be written.
    """
    path = paths.named(folder, '--folder')
    with writing('--folder', path):
        path.mkdir(parents=True, exist_ok=True)
        yield path


def refuse_given(
    options: argparse.Namespace, names: Iterable[str], why: str, **typed: str
) -> None:
    """Raises InputError for the first of these options, None, False or [] by default, that was
    given; `typed`: the options that have another name than their value."""
    for name in names:
        value = getattr(options, name)
        if value is not None and value is not False and value != []:
            raise InputError(why, key=f'--{typed.get(name, name.replace("_", "-"))}')


def refuse_source(option: str, target: str | None, sources: Iterable[str | None]) -> None:
    """Raises InputError if the file that an option names is one of those that the command reads:
    it would be gone."""
    for source in sources:
        if target is None or source is None:
            continue
        with suppress(OSError):  # one of them is not there yet, or a name of the library
            if paths.named(target).samefile(paths.named(source)):
                text = 'the file that is read, and left as it is'
                raise InputError(text, key=option, value=target, expected='another file')


@contextmanager
def writing(option: str, path: str | Path) -> Iterator[None]:
    """Raises InputError that names the option and its path where the block raises OSError."""
    try:
        yield
    except BrokenPipeError:  # of what is printed: the reader has gone, which `__main__` knows
        raise
    except OSError as error:
        raise InputError(str(error.strerror), key=option, value=str(path)) from None
