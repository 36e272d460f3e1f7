"""Values of the elements of an SDF: names, numbers, truth."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.scene.text.yaml_document import LARGEST

Refuse = Callable[..., Exception]  # key, message, details -> the error to raise


def name_of(element: ElementTree.Element, refuse: Refuse) -> str:
    """The name of an element. Raises the error without one."""
    given = element.get('name', '')
    if not given:
        raise refuse(element.tag, 'it has no name')
    return given


def numbers(text: str, count: int, refuse: Refuse, key: str) -> Floats:
    """So many numbers, that can be computed with. Raises the error."""
    try:
        found = np.array([float(word) for word in text.split()])
    except ValueError:
        found = np.empty(0)
    if found.size != count or not np.all(np.abs(found) <= LARGEST):
        raise refuse(key, 'not usable numbers', value=text.strip(), expected=f'{count} numbers')
    return found


def number(
    element: ElementTree.Element | None, tag: str, default: float, refuse: Refuse, key: str
) -> float:
    """The number in an element below another. Raises the error."""
    text = None if element is None else element.findtext(tag)
    if text is None or not text.strip():
        return default
    return float(numbers(text, 1, refuse, key)[0])


def is_true(text: str | None) -> bool:
    """Whether a text says so."""
    return (text or '').strip().lower() in ('1', 'true')
