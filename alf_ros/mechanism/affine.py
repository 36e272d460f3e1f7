"""Affine functions of the natural coordinates with values in space: places, directions, gaps.

All joints are made of them: a place on a body is one, a direction fixed in a body is one, and
nearly every constraint is the scalar product of two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats

_EYE = {D: np.eye(D) for D in (2, 3)}  # nobody writes into a form
_ZERO = {D: np.zeros(D) for D in (2, 3)}


@dataclass(frozen=True, eq=False, slots=True)
class Form:
    """Σ C_b q_b + c over blocks b: `parts` holds C_b (D, D), `constant` c (D,)."""

    parts: Mapping[int, Floats]
    constant: Floats

    def __add__(self, other: Form) -> Form:
        parts = dict(self.parts)
        for block, C in other.parts.items():
            parts[block] = parts[block] + C if block in parts else C
        return Form(parts, self.constant + other.constant)

    def on(self, blocks: Sequence[int]) -> Form:
        """The same of other blocks: block n of it is `blocks[n]`."""
        return Form({blocks[n]: C for n, C in self.parts.items()}, self.constant)

    def __sub__(self, other: Form) -> Form:
        return self + other.times(-1.0)

    def times(self, factor: Floats | float) -> Form:
        """The form multiplied from the left, by a number or a (D, D) matrix."""
        if isinstance(factor, np.ndarray):
            parts = {block: columns.dot(factor, C) for block, C in self.parts.items()}
            return Form(parts, columns.dot(factor, self.constant))
        parts = {block: factor * C for block, C in self.parts.items()}
        return Form(parts, factor * self.constant)

    def value(self, places: Floats) -> Floats:
        """(D,) of the blocks `places` (blocks, D)."""
        moved = sum(C @ places[block] for block, C in self.parts.items())
        return np.asarray(self.constant + moved)


class FormArray:
    """Many forms, evaluated at once."""

    def __init__(self, forms: Sequence[Form], dimension: int) -> None:
        terms = [(n, block, C) for n, form in enumerate(forms) for block, C in form.parts.items()]
        self._of = np.array([n for n, _, _ in terms], dtype=int)
        self._blocks = np.array([block for _, block, _ in terms], dtype=int)
        D = dimension
        self._factors = np.array([C for _, _, C in terms]).reshape(-1, D, D)
        self._constants = np.array([form.constant for form in forms]).reshape(-1, D)

    def __len__(self) -> int:
        return len(self._constants)

    def values(self, places: Floats) -> Floats:
        """(forms, D) of the blocks `places` (blocks, D)."""
        found = self._constants.copy()
        np.add.at(found, self._of, np.einsum('kij,kj->ki', self._factors, places[self._blocks]))
        return found


def constant(value: tuple[float, ...]) -> Form:
    """A place or direction in the world."""
    return Form({}, columns.array(value))


def of_block(block: int, dimension: int) -> Form:
    """A block itself."""
    return Form({block: _EYE[dimension]}, _ZERO[dimension])
