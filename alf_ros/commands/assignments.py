"""NAME=NUMBER, as the option --set of commands takes it."""

from __future__ import annotations

from alf_ros.errors import InputError
from alf_ros.scene.text.expression import ExpressionError, evaluate


def assignment(text: str) -> tuple[str, float]:
    """Name and value, which may be an expression of constants. Raises InputError."""
    name, given, value = text.partition('=')
    try:
        return name, evaluate(value if given else '', {})
    except ExpressionError as error:
        message = f'not a parameter: {error}'
        raise InputError(message, key='--set', value=text, expected='NAME=NUMBER') from None
