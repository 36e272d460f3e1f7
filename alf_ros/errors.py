"""Everything this package raises on purpose has one root."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class AlfError(Exception):
    """Root of all errors raised by this package. `exit_code` is what a command returns."""

    exit_code = 1


class InputError(AlfError):
    """A file, an argument or a command cannot be used as given: one line, exit code 2.

    The line names file, line, key and value as far as they are known, what was expected and the
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
        where = file or ''
        if line is not None:
            where += f':{line}' if where else f'line {line}'
        text = ': '.join(part for part in (where, shortened(key or ''), message) if part)
        if value is not None:
            text += f', got {shortened(repr(value))}'
        if expected:
            text += f'; expected {expected}'
        if choices is not None:
            names = list(choices)
            near = difflib.get_close_matches(
                str(value if value is not None else key), names, 1, 0.5
            )
            if near:
                text += f'; did you mean {near[0]!r}?'
            elif names:
                text += f'; known: {", ".join(names[:12])}{" ..." if len(names) > 12 else ""}'
        super().__init__(' '.join(text.split()))


def shortened(shown: str) -> str:
    """At most 80 characters; of a path the end, which says more."""
    if len(shown) <= 80:
        return shown
    return shown[0] + '...' + shown[-76:] if '/' in shown else shown[:77] + '...'


class AssemblyError(InputError):
    """The mechanism cannot be closed, or the velocities given contradict its constraints."""


class StepError(AlfError):
    """A step failed. The state before it is kept.

    `reason` says what happened, `remedy` what to change, `t` is the time of the last good state.
    """

    def __init__(self, reason: str, remedy: str, t: float) -> None:
        self.reason, self.remedy, self.t = reason, remedy, t
        super().__init__(f't = {t:.9g} s: {reason}; {remedy}')
