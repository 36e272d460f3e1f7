"""One number of samples by its name: a quantity, or the magnitude of one.

A quantity has the name that `record` knows, such as `knee.force.x`. `norm(knee.force)` is the
magnitude of one with components, `abs(motor.effort)` of a number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.simulation.input_checks import closed
from alf_ros.simulation.named_quantity import NamedQuantity, named_quantity
from alf_ros.simulation.sample import Sample

CALL = re.compile(r'(\w+)\((.+)\)')
_SIZES = ('norm', 'abs')


@dataclass(frozen=True, eq=False)
class NamedNumber:
    """`text` as it was given; of the components of its quantity the magnitude is taken if it
    `is_size`."""

    text: str
    quantity: NamedQuantity
    is_size: bool

    @property
    def unit(self) -> str:
        """Its unit."""
        return self.quantity.units[0]


def number_of(components: Floats, is_size: bool) -> float:
    """The number that these components (components,) are: the only one, or their magnitude."""
    return float(np.linalg.norm(components) if is_size else components[0])


def named_number(text: str, key: str, sample: Sample, others: Sequence[str] = ()) -> NamedNumber:
    """The number of a text, for samples of the same scene. `others`: functions that its caller
    reads, which the refusal of an unknown one names. Raises InputError, which says `key`, also for
    one without a derivative."""
    text = closed(text.strip(), key)
    called = CALL.fullmatch(text)
    if called and called[1] not in _SIZES:
        choices = (*_SIZES, *others)
        raise InputError('no such function', key=key, value=called[1], choices=choices)
    inner = called[2].strip() if called else text
    quantity = named_quantity(inner, key, sample).checked(key)
    if called is None and quantity.is_vector:
        norm = f'norm({inner}) or ' if len(quantity.units) == 1 else ''
        raise InputError('not a single number', key=key, value=inner, expected=f'{norm}{inner}.x')
    if len(quantity.units) > 1:
        raise InputError('components of several units have no norm', key=key, value=inner)
    return NamedNumber(text, quantity, called is not None)
