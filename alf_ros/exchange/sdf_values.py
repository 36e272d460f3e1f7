"""Values of the elements of an SDF: names, numbers, truth."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.scene.text.decimal_numbers import decimal
from alf_ros.scene.text.yaml_document import LARGEST

_TRUE, _FALSE = ('true', '1'), ('false', '0')
Refuse = Callable[..., Exception]  # key, message, element, details -> the error


def name_of(element: ElementTree.Element, refuse: Refuse) -> str:
    """The name of an element. Raises the error without one."""
    given = element.get('name', '')
    if not given:
        raise refuse(element.tag, 'it has no name', at=element)
    return given


def numbers(
    text: str, count: int, refuse: Refuse, key: str, at: ElementTree.Element | None = None
) -> Floats:
    """So many numbers, that can be computed with, in a text of the element `at`. Raises the
    error."""
    try:
        found = np.array([decimal(word) for word in text.split()])
    except ValueError:
        found = np.empty(0)
    if found.size != count or not np.all(np.abs(found) <= LARGEST):
        expected = 'a number' if count == 1 else f'{count} numbers'
        raise refuse(key, 'not usable numbers', at=at, value=text.strip(), expected=expected)
    return found


def number(
    element: ElementTree.Element | None, tag: str, default: float, refuse: Refuse, key: str
) -> float:
    """The number in an element below another. Raises the error."""
    inner = None if element is None else element.find(tag)
    if inner is None or not (inner.text or '').strip():
        return default
    return float(numbers(inner.text or '', 1, refuse, key, inner)[0])


def is_true(
    text: str | None,
    refuse: Refuse,
    key: str,
    at: ElementTree.Element | None,
    default: bool = False,
) -> bool:
    """Whether a text of the element `at` says so; the default where there is none. Raises the
    error for another word than SDF has."""
    word = (text or '').strip().lower()
    if word not in ('', *_TRUE, *_FALSE):
        raise refuse(key, 'neither true nor false', at=at, value=text, expected='true or false')
    return word in _TRUE if word else default


def says(
    element: ElementTree.Element | None, tag: str, refuse: Refuse, key: str, default: bool = False
) -> bool:
    """Whether the element below another says so. Raises the error."""
    inner = None if element is None else element.find(tag)
    return default if inner is None else is_true(inner.text, refuse, key, inner, default)
