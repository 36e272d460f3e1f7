"""The numbers of a URDF, checked with their link or joint and line before the parser sees them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from alf_ros.errors import InputError
from alf_ros.exchange import xml_file
from alf_ros.scene.text.decimal_numbers import decimal
from alf_ros.scene.text.yaml_document import LARGEST

_MOMENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
# how many numbers an attribute has, by elements of a link or a joint
_COUNTS = {
    'mass': {'value': 1},
    'inertia': dict.fromkeys(_MOMENTS, 1),
    'origin': {'xyz': 3, 'rpy': 3},
    'axis': {'xyz': 3},
    'limit': dict.fromkeys(('lower', 'upper', 'effort', 'velocity'), 1),
    'mimic': {'multiplier': 1, 'offset': 1},
    'dynamics': {'damping': 1, 'friction': 1},
    'calibration': {'rising': 1, 'falling': 1},
    'safety_controller': dict.fromkeys(
        ('soft_lower_limit', 'soft_upper_limit', 'k_position', 'k_velocity'), 1
    ),
}
_NEEDED = {'mass': 'value', 'axis': 'xyz'}  # attributes that the parser takes for granted
# attributes that URDF requires, but many files lack, as some readers take 0
_ZERO = {'inertia': ('ixy', 'ixz', 'iyz'), 'limit': ('effort', 'velocity')}


def completed(part: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Write the zeros that a link or a joint leaves out. Yields the kind of each, as in the
    report, and its name."""
    name = part.get('name', '')
    for element in (*part, *(each for inner in part.findall('inertial') for each in inner)):
        for attribute in _ZERO.get(element.tag, ()):
            if attribute not in element.attrib:
                element.set(attribute, '0')
                if element.tag == 'limit':
                    yield f'limits of {attribute}', f'{name} has none'
                else:
                    yield 'products of inertia: there is none', f'{attribute} of {name}'


def checked(part: ElementTree.Element, path: Path) -> None:
    """Refuse attributes of a link or a joint that are no numbers, cannot be computed with, or are
    absent.

    Elements that URDF does not have are not looked at. Raises InputError.
    """
    for element in (*part, *(each for inner in part.findall('inertial') for each in inner)):
        needed = _NEEDED.get(element.tag)
        if needed is not None and needed not in element.attrib:
            raise InputError(
                f'it has no {needed}',
                **xml_file.place_of(element, str(path)),
                key=f'{part.tag} {part.get("name", "")}: {element.tag}',
            )
        for attribute, count in _COUNTS.get(element.tag, {}).items():
            given = element.get(attribute)
            if given is None:
                continue
            if attribute == 'damping' and part.get('type') == 'planar' and len(given.split()) > 1:
                count = 3  # one of each freedom, as Drake has it
            message = fault(given, count)
            if message is not None:
                raise InputError(
                    message,
                    **xml_file.place_of(element, str(path)),
                    key=f'{part.tag} {part.get("name", "")}: {element.tag} {attribute}',
                    value=given,
                    expected='a number' if count == 1 else f'{count} numbers',
                )


def fault(given: str, count: int) -> str | None:
    """The fault of a text of so many numbers; None without one."""
    words = given.split()
    try:
        usable = all(abs(decimal(word)) <= LARGEST for word in words)
    except ValueError:
        return 'not a number' if count == 1 else 'not numbers'
    if not usable:
        return 'not a usable number' if count == 1 else 'not usable numbers'
    return None if len(words) == count else 'the wrong number of values'
