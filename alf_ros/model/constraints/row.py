"""One constraint: a distance of two blocks, or a row Σ ½ q_iᵀ T_ij q_j + Σ b_i·q_i + c.

Rows that bind velocities only (38) have N_i = Σ T_ij q_j + b_i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from numpy import count_nonzero  # of small arrays in a third of the time of `any`

from alf_ros.arrays import Floats
from alf_ros.columns import dot, real
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.form_of_rows import row_form

Terms = dict[int, dict[int, Floats]]


class Distance(NamedTuple):
    """½(|q_end - q_start|² - length²) = 0, m."""

    name: str
    start: int
    end: int
    length: float

    def on(self, blocks: Sequence[int], name: str) -> Distance:
        """The same of other blocks: block n of it is `blocks[n]`."""
        return Distance(name, blocks[self.start], blocks[self.end], self.length)


@dataclass(frozen=True, eq=False, slots=True)
class Row:
    """One row that is a form of second order, or linear."""

    name: str
    b: dict[int, Floats] = field(default_factory=dict)  # by block: (D,)
    terms: Terms = field(default_factory=dict)  # by block, block: (D, D)
    c: float = 0.0
    velocity: bool = False

    @property
    def blocks(self) -> list[int]:
        """All blocks whose coordinates the row binds, ascending."""
        return sorted(self.b)

    def on(self, blocks: Sequence[int], name: str) -> Row:
        """The same of other blocks: block n of it is `blocks[n]`."""
        b = {blocks[i]: value for i, value in self.b.items()}
        terms = {
            blocks[i]: {blocks[j]: T for j, T in row.items()} for i, row in self.terms.items()
        }
        return Row(name, b, terms, self.c, self.velocity)


Constraint = Distance | Row


def linear(name: str, along: Floats, f: Form, offset: float = 0.0) -> Row:
    """along · f = offset."""
    b = {block: dot(C.T, along) for block, C in f.parts.items()}
    return Row(name, _kept(b), c=real(dot(along, f.constant)) - offset)


def product(name: str, f: Form, g: Form, offset: float = 0.0) -> Row:
    """f · g = offset."""
    b: dict[int, Floats] = {}
    terms: Terms = {}
    for first, second in ((f, g), (g, f)):
        for i, C in first.parts.items():
            b[i] = b.get(i, 0.0) + dot(C.T, second.constant)
            for j, G in second.parts.items():
                row = terms.setdefault(i, {})
                row[j] = row.get(j, 0.0) + dot(C.T, G)
    if not row_form().whole:
        terms = {i: {j: T for j, T in row.items() if count_nonzero(T)} for i, row in terms.items()}
        b = {i: v for i, v in b.items() if terms.get(i) or count_nonzero(v)}
    return Row(name, b, terms, real(dot(f.constant, g.constant)) - offset)


def motion(name: str, *pairs: tuple[Form, Form]) -> Row:
    """Σ ġ-products of the pairs: Σ f(q) · d/dt g(q) = 0, a row of velocities."""
    b: dict[int, Floats] = {}
    terms: Terms = {}
    for f, g in pairs:
        for i, C in g.parts.items():
            b[i] = b.get(i, 0.0) + dot(C.T, f.constant)
            for j, F in f.parts.items():
                row = terms.setdefault(i, {})
                row[j] = row.get(j, 0.0) + dot(C.T, F)
    return Row(name, b, terms, velocity=True)


def plus(name: str, *rows: Row) -> Row:
    """The sum of rows that are no distances."""
    b: dict[int, Floats] = {}
    terms: Terms = {}
    for row in rows:
        for i, value in row.b.items():
            b[i] = b[i] + value if i in b else value
        for i, others in row.terms.items():
            mine = terms.setdefault(i, {})
            for j, T in others.items():
                mine[j] = mine[j] + T if j in mine else T
    return Row(name, b, terms, sum(row.c for row in rows))


def scaled(factor: float, row: Row) -> Row:
    """A multiple of a row; half of a square has the vector itself as gradient, as a distance."""
    return replace(
        row,
        b={i: factor * b for i, b in row.b.items()},
        terms={i: {j: factor * T for j, T in t.items()} for i, t in row.terms.items()},
        c=factor * row.c,
    )


def value(row: Row, places: Floats) -> float:
    """Φ of a row that is a form, at places (blocks, D)."""
    total = row.c
    for i, b in row.b.items():
        turned = sum((T @ places[j] for j, T in row.terms.get(i, {}).items()), 0.0 * b)
        total += float(places[i] @ (b + 0.5 * turned))
    return total


def _kept(b: dict[int, Floats]) -> dict[int, Floats]:
    if row_form().whole:
        return b
    return {block: value for block, value in b.items() if count_nonzero(value)}
