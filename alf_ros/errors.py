"""Everything this package raises on purpose has one root."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any


class AlfError(Exception):
    """Root of all errors raised by this package. `exit_code` is what a command returns."""

    exit_code = 1


class InputError(AlfError):
    """A file, an argument or a command cannot be used as given: one line, exit code 2.

    The line names file, line, key and value as far as they are known, the expected value and the
    nearest valid name.
    """

    exit_code = 2

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        key: str | None = None,
        value: object = None,
        expected: str | None = None,
        choices: Iterable[str] | None = None,
    ) -> None:
        self.message, self.file, self.line, self.key, self.value = message, file, line, key, value
        self.expected = expected
        self.choices = None if choices is None else list(choices)
        where = file or ''
        if line is not None:
            where += f':{line}' if where else f'line {line}'
        said = ' '.join(map(shortened, message.split()))  # also what parsers of others quote
        text = ': '.join(part for part in (where, shortened(key or ''), said) if part)
        if value is not None:
            text += f', got {shortened(repr(value))}'
        if expected:
            text += f'; expected {expected}'
        if self.choices is not None:
            names = self.choices
            near = difflib.get_close_matches(str(value), names, 1, 0.5)
            if near and value is not None:
                text += f'; did you mean {shortened(repr(near[0]))}?'
            elif names:
                some = ', '.join(shortened(str(name)) for name in names[:12])
                text += f'; known: {some}{" ..." if len(names) > 12 else ""}'
        super().__init__(printable(' '.join(text.split())))

    def about(self, key: str | None, file: str | None = None) -> InputError:
        """The same about a key of other input, which has no file with lines."""
        return InputError(
            self.message,
            file=file,
            key=key,
            value=self.value,
            expected=self.expected,
            choices=self.choices,
        )


@contextmanager
def argument_of(caller: str, callee: str) -> Iterator[None]:
    """Errors of the block about the argument `callee` of a function that it calls, or about a part
    of it, name the argument `caller` that was given for it."""
    try:
        yield
    except InputError as error:
        name, dot, rest = (error.key or '').partition('.')
        if error.line is not None or name != callee:
            raise
        raise error.about(f'{caller}{dot}{rest}', error.file) from None


def printable(text: str) -> str:
    """The text for a terminal: what would move its cursor, colour it or turn its direction is
    escaped, as is what cannot be encoded. Names come from files that anybody may have written."""
    if text.isprintable():
        return text
    return ''.join(c if c.isprintable() else c.encode('unicode_escape').decode() for c in text)


def shortened(shown: str) -> str:
    """At most 80 characters; of a path the end, which says more."""
    if len(shown) <= 80:
        return shown
    return shown[0] + '...' + shown[-76:] if '/' in shown else shown[:77] + '...'


class UnknownNameError(InputError, KeyError):
    """A mapping has nothing of this name: a KeyError, whose message has the nearest valid name."""

    __str__ = Exception.__str__  # the text; a KeyError shows it in quotes


class AssemblyError(InputError):
    """The mechanism cannot be closed, or the velocities given contradict its constraints."""


class StepError(AlfError):
    """A step failed. The state before it is kept.

    `reason` says what happened, `remedy` what to change, `t` is the time of the last good state.
    """

    def __init__(self, reason: str, remedy: str, t: float) -> None:
        self.reason, self.remedy, self.t = reason, remedy, t
        super().__init__(printable(f't = {t:.9g} s: {reason}; {remedy}'))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.reason, self.remedy, self.t)


class StoppedError(AlfError):
    """A call was ended from outside: by `Simulation.stop`, or because the program ends.

    The state is the end of the last step; the next call continues from there.
    """

    def __init__(self) -> None:
        super().__init__('stopped; the state is the end of the last whole step')

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), ()


class BusyError(AlfError):
    """An object is used by two threads at once, or by the handler of a signal that came in a call.

    The object is unchanged, and the other call continues.
    """

    def __init__(self, name: str, call: str) -> None:
        self.name, self.call = name, call
        super().__init__(
            f'{name}.{call}: another call uses this {name}; give each thread its own, by copy.copy'
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name, self.call)
