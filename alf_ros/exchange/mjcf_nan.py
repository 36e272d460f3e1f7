"""Numbers of an MJCF that are NaN: MuJoCo warns, and takes some of them for absent ones; and
numbers that are infinite or too large, and negative coefficients of friction, of which it says
nothing.

A mass of NaN, for example, becomes the one that follows from the density.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

from alf_ros.errors import InputError
from alf_ros.exchange import mjcf_files, xml_file
from alf_ros.scene.text.yaml_document import LARGEST

WARNING = "'NaN'"  # in what MuJoCo says then
# names, of the element itself and of others, which may be `nan`
_NAMES = ('name', 'model', 'mesh', 'material', 'hfield', 'texture', 'file', 'target')
_NAMED = re.compile(r'(child)?class|\w*(site|body|geom|joint|tendon)[12]?|(ref|obj)name')
_NOT_NEGATIVE = ('stiffness', 'damping', 'frictionloss', 'armature')
_MOVE_NOTHING = ('user', 'data')  # numbers for programs of the user
_OF_STATES = ('qpos', 'qvel', 'act', 'ctrl', 'ref', 'pos')


def check(path: Path) -> None:
    """Refuse the first number that is NaN in a file, or in one that it includes or attaches; one
    that moves nothing may be. Raises InputError."""
    for element in mjcf_files.elements(path):
        for key, value in element.attrib.items():
            if key in (*_NAMES, *_MOVE_NOTHING) or _NAMED.fullmatch(key):
                continue
            if not any(map(_is_nan, value.split())):
                continue
            raise _error(path, element, key)


def check_friction(path: Path) -> None:
    """Refuse the first coefficient of friction that is infinite or negative. Raises InputError."""
    for element in mjcf_files.elements(path):
        words = element.get('friction', '').split()
        if any(map(_is_infinite, words)):
            raise _error(path, element, 'friction')
        if any(map(_is_negative, words)):
            raise _error(path, element, 'friction', 'a negative coefficient')


def check_signs(path: Path) -> None:
    """Refuse the first negative stiffness, damping, friction or armature. Raises InputError."""
    for element in mjcf_files.elements(path):
        for key in _NOT_NEGATIVE:
            linear = element.get(key, '').split()[:1]  # the others are of square and cube
            if any(map(_is_negative, linear)):
                raise _error(path, element, key, 'a negative number')


def check_size(path: Path) -> None:
    """Refuse the first number that cannot be computed with. Ranges may be infinite, and so may
    planes. Raises InputError."""
    for element in mjcf_files.elements(path):
        for key, value in element.attrib.items():
            if key in (*_NAMES, *_MOVE_NOTHING) or _NAMED.fullmatch(key) or key.endswith('range'):
                continue
            if key == 'size' and element.get('type') == 'plane':
                continue
            if any(_is_beyond(LARGEST, word) for word in value.split()):
                raise _error(path, element, key, 'not a usable number')


def check_states(path: Path, most: float) -> None:
    """Refuse the first number of a state that is larger. Raises InputError."""
    for element in mjcf_files.elements(path):
        for key in _OF_STATES:
            if any(_is_beyond(most, word) for word in element.get(key, '').split()):
                raise _error(path, element, key, 'not a usable number')


def _error(
    path: Path, element: ElementTree.Element, key: str, text: str = 'not a finite number'
) -> InputError:
    name = element.get('name')
    at = f'{element.tag} {name}' if name else element.tag
    place, value = xml_file.place_of(element, str(path)), element.get(key)
    return InputError(text, **place, key=f'{at}: {key}', value=value)


def _is_nan(word: str) -> bool:
    try:
        return math.isnan(float(word))
    except ValueError:
        return False


def _is_beyond(most: float, word: str) -> bool:
    try:
        return abs(float(word)) > most
    except ValueError:
        return False


def _is_infinite(word: str) -> bool:
    try:
        return math.isinf(float(word))
    except ValueError:
        return False


def _is_negative(word: str) -> bool:
    try:
        return float(word) < 0.0
    except ValueError:
        return False
