"""Listed values that no scene can take: a word, an infinity or NaN in place of a number.

A value that a mechanism refuses, such as a negative mass, makes a member that fails. A value that
is no number where the scene has one is a slip of the pen: it is found before any member runs.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from alf_ros.errors import AssemblyError, InputError
from alf_ros.scene import overrides
from alf_ros.scene.mechanism_file import read_parameters
from alf_ros.scene.scene import Scene
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.expression import CONSTANTS, FUNCTIONS
from alf_ros.scene.text.yaml_document import LARGEST, SMALLEST, Entry
from alf_ros.studies.ensemble.distributions import Value

_DECIMAL = re.compile(r'[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?')
_NOT_FINITE = re.compile(r'[-+]?\.?(inf|infinity|nan)', re.IGNORECASE)
_NAME = re.compile(r'[A-Za-z_]\w*')


def refused(scene: Scene, name: str, values: Sequence[Value]) -> tuple[int, InputError] | None:
    """The place of the first value that can never be one of the scene, and the error about it;
    None if there is none."""
    others = [text for text in dict.fromkeys(values) if not _is_decimal(text)]
    if not others:
        return None
    number = next((text for text in values if _is_decimal(text) or text[:1] == '['), None)
    is_mixed = number is not None and _takes(scene, name, number)
    for text in others:
        try:
            entry = yaml_document.parse(f'value: {text}', None).mapping()['value']
            _check(scene, name, entry, is_mixed)
        except InputError as error:
            return values.index(text), error
    return None


def _check(scene: Scene, name: str, entry: Entry, is_mixed: bool) -> None:
    """Raise InputError for a value that cannot be there. `is_mixed`: other values of the name are
    numbers, so this one should be, also where the scene has none."""
    if entry.is_null:
        return
    if _has_number(scene, name):
        _check_number(scene, entry)
    elif isinstance(entry.value, tuple):
        for k, item in enumerate(entry.value):
            _check(scene, f'{name}.{k}', item, is_mixed)
    elif isinstance(entry.value, str) and (is_mixed or _NOT_FINITE.fullmatch(entry.value)):
        if not _takes(scene, name, entry.value):
            raise _no_number(entry, 'not a number')


def _takes(scene: Scene, name: str, text: Value) -> bool:
    """Whether the scene can be read with this value, whatever its mechanism says about it."""
    try:
        overrides.with_changes(scene, {name: text})
    except AssemblyError:
        return True
    except InputError:
        return False
    return True


def _has_number(scene: Scene, name: str) -> bool:
    """Whether the scene has a number of this name, and not a motion, which may be a function."""
    try:
        overrides.number(scene, name)
        return 'drives' not in name.split('.')
    except InputError:
        return False


def _check_number(scene: Scene, entry: Entry) -> None:
    """Raise InputError for a text that is no number. A quotient of parameters may be one of other
    members."""
    mechanism = scene.document.root.mapping()['mechanism'].mapping()
    parameters = read_parameters(mechanism.get('parameters'), {})
    try:
        entry.number(parameters)
    except InputError as error:
        if not isinstance(entry.value, str):
            raise _no_number(entry, 'not a number') from None
        used = set(_NAME.findall(entry.value))
        if used.isdisjoint(parameters) or not used <= {*parameters, *FUNCTIONS, *CONSTANTS}:
            is_word = _NAME.fullmatch(entry.value) and not _NOT_FINITE.fullmatch(entry.value)
            raise _no_number(entry, 'not a number' if is_word else error.message) from None


def _no_number(entry: Entry, message: str) -> InputError:
    value = entry.value if isinstance(entry.value, str) else 'a list'
    return InputError(message, value=value, expected='a finite number')


def _is_decimal(text: Value) -> bool:
    if _DECIMAL.fullmatch(text) is None:
        return False
    value = abs(float(text))
    return value == 0.0 or SMALLEST <= value <= LARGEST
