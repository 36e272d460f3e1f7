"""Rows as the kernel wants them: distances between blocks that move, others, forms, velocities.

And affine functions of the blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from alf_ros.arrays import Floats, Indices, Integers
from alf_ros.columns import array, concatenated
from alf_ros.kernel import Forms, Rows
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout, Shape
from alf_ros.model.constraints.row import Constraint, Distance, Row
from alf_ros.model.struct_memory import changed, frozen


class RowStructure(NamedTuple):
    """All of rows that is no number: which of them are distances, and which forms; the blocks of
    each distance; of each entry of a form its block, then the blocks of its terms; and `full` of
    all terms, as in `Rows`."""

    bars: tuple[int, ...]
    forms: tuple[int, ...]
    ends: tuple[tuple[int, int], ...]
    bound: tuple[tuple[tuple[int, ...], ...], ...]
    full: tuple[bool, ...]


class RowNumbers(NamedTuple):
    """The numbers of rows: lengths (distances,) m, and `b`, `term`, `c` as in `Rows`."""

    length: Floats
    b: Floats
    term: Floats
    c: Floats


def parts_of(rows: Sequence[Constraint]) -> tuple[RowStructure, RowNumbers]:
    """The structure and the numbers of rows."""
    bars = [(n, row) for n, row in enumerate(rows) if isinstance(row, Distance)]
    forms = [(n, row) for n, row in enumerate(rows) if not isinstance(row, Distance)]
    forms.sort(key=lambda each: each[1].velocity)
    bound, numbers, products = [], list[Floats](), list[Floats]()
    for _, row in forms:
        entries = []
        for i in row.blocks:  # ascending, so that fixed ones come last
            terms = row.terms.get(i, {})
            entries.append((i, *terms))
            numbers.append(row.b[i])
            products += terms.values()
        bound.append(tuple(entries))
    structure = RowStructure(
        tuple(n for n, _ in bars),
        tuple(n for n, _ in forms),
        tuple((row.start, row.end) for _, row in bars),
        tuple(bound),
        tuple(_full(products)),
    )
    return structure, RowNumbers(
        length=array([row.length for _, row in bars]),
        b=concatenated(numbers),
        term=concatenated(products).ravel(),
        c=array([row.c for _, row in forms if not row.velocity]),
    )


def _full(T: Sequence[Floats]) -> list[bool]:
    """`full` of matrices T. In the plane T turns, and numbers would decide whether T = c I."""
    if not T or len(T[0]) == 2:
        return [True] * len(T)
    products = np.array(T)
    return (products != products[:, :1, :1] * np.eye(3)).any(axis=(1, 2)).tolist()


def rows_of(rows: Sequence[Constraint], layout: Layout) -> tuple[Rows, list[int]]:
    """The rows as the kernel wants them, and which row stands at each of its places."""
    structure, numbers = parts_of(rows)
    moving_first, placed = placed_rows(structure, layout.movable)
    order = [structure.bars[n] for n in moving_first.tolist()] + [*structure.forms]
    arrays = changed(
        placed,
        length2=numbers.length[moving_first] ** 2,
        b=numbers.b,
        term=numbers.term,
        c=numbers.c,
        alpha=np.zeros(len(order)),
        scale=np.zeros(len(order)),
        bend=np.zeros(len(order)),
    )
    return arrays, order


def placed_rows(structure: RowStructure, movable: int) -> tuple[Integers, Rows]:
    """The order of the distances, those between blocks that move first, and the rows without
    numbers."""
    found: tuple[Integers, Rows] = _placed(*structure[2:], movable)
    return found


@remembered(64)
def _placed(
    bars: tuple[tuple[int, int], ...],
    forms: tuple[tuple[tuple[int, ...], ...], ...],
    full: tuple[bool, ...],
    movable: int,
) -> tuple[Integers, Rows]:
    """The order of the distances between `bars`, and the rows without numbers; `forms` has their
    entries: the block of each, and the blocks of its terms; `full` as in `Rows`."""
    ends = np.array(bars, dtype=np.int64).reshape(-1, 2)
    ends.sort(axis=1)
    fixed = ends[:, 1] >= movable
    moving_first = np.argsort(fixed, kind='stable')
    first, moving, block, first_term, term_block = [0], [], [], [0], []
    for entries in forms:
        for i, *terms in entries:
            block.append(i)
            term_block += terms
            first_term.append(len(term_block))
        moving.append(first[-1] + sum(i < movable for i, *_ in entries))
        first.append(len(block))
    nothing = np.zeros(0)
    rows = Rows(
        both=np.uint64(np.count_nonzero(~fixed)),
        i=indices(ends[moving_first, 0]),
        j=indices(ends[moving_first, 1]),
        length2=nothing,
        first=indices(first),
        movable=indices(moving),
        block=indices(block),
        b=nothing,
        first_term=indices(first_term),
        term_block=indices(term_block),
        full=indices(full),
        term=nothing,
        c=nothing,
        alpha=nothing,
        scale=nothing,
        bend=nothing,
    )
    return moving_first, frozen(rows)


def forms_of(forms: Sequence[Form], D: int) -> Forms:
    """Affine functions as the kernel wants them."""
    parts = [part for form in forms for part in form.parts.items()]
    return Forms(
        first=_starts(np.array([len(form.parts) for form in forms], dtype=np.int64)),
        block=indices(block for block, _ in parts),
        C=array([C for _, C in parts]).reshape(-1, D * D).ravel(),
        c=array([form.constant for form in forms]).ravel(),
    )


def of_shapes(layout: Layout, made: Callable[[Shape], Sequence[Row]]) -> Rows:
    """Linear rows that bodies of one shape have alike, on their own blocks: body after body."""
    shapes = [layout.shape(body.name) for body in layout.bodies]
    alike = {shape: made(shape) for shape in dict.fromkeys(shapes)}
    own, _ = rows_of([row for rows in alike.values() for row in rows], layout)
    number = {shape: n for n, shape in enumerate(alike)}
    return _gathered(
        own,
        _of_bodies(
            *_structure(own),
            np.cumsum([0, *(len(rows) for rows in alike.values())]),
            np.array([number[shape] for shape in shapes]),
            np.array([len(shape.local) for shape in shapes]),
            np.array([block for body in layout.bodies for block in layout.of_body[body.name]]),
            layout.movable,
        ),
    )


@remembered(64)
def _of_bodies(*given: Any) -> _Arrangement:
    """Rows for bodies one after another. given: the structure of the rows of all shapes; where the
    rows of each shape begin, and the end; the shape of each body, and how many blocks it has; the
    blocks of all bodies; how many blocks move."""
    *structure, ends, shape, count, place, movable = given
    own = _numbered(*structure)
    parts = [_forms(own, ends[n], ends[n + 1]) for n in shape]
    blocks = np.concatenate([[0], np.cumsum(count)])
    before = np.repeat(blocks[:-1], [part['block'].size for part in parts])
    rows = _joined(own, parts)
    return _arranged(_moved(replace(rows, block=indices(rows.block + before)), place, movable))


def renumbered(rows: Rows, place: Integers, movable: int) -> Rows:
    """The same of other blocks: block n of it is `place[n]`, of which so many move.

    Entries of a row are sorted again.
    """
    return _gathered(rows, _renumbered(*_structure(rows), place, movable))


@remembered(64)
def _renumbered(*given: Any) -> _Arrangement:
    *structure, place, movable = given
    return _arranged(_moved(_numbered(*structure), place, movable))


def _moved(rows: Rows, place: Integers, movable: int) -> Rows:
    """`renumbered`, of rows as `_numbered` has them."""
    ends = np.sort([place[rows.i], place[rows.j]], axis=0)
    block = place[rows.block]
    order = np.lexsort((block, np.repeat(np.arange(rows.movable.size), np.diff(rows.first))))
    moving = _starts(block[order] < movable)
    terms = np.diff(rows.first_term)[order]
    first_term = _starts(terms)
    moved = np.repeat(rows.first_term[order].astype(np.int64) - first_term[:-1], terms)
    moved += np.arange(moved.size)
    return replace(
        rows,
        i=indices(ends[0]),
        j=indices(ends[1]),
        movable=rows.first[:-1] + moving[rows.first[1:]] - moving[rows.first[:-1]],
        block=indices(block[order]),
        b=rows.b[order],
        first_term=first_term,
        term_block=indices(place[rows.term_block[moved]]),
        full=rows.full[moved],
        term=rows.term[moved],
    )


def with_more(rows: Rows, more: Rows, velocities: bool) -> Rows:
    """Rows, and more of forms behind theirs; with or without those that bind velocities only."""
    arrangement = _with_more(*_structure(rows), *_structure(more), velocities)
    numbers = {
        name: np.concatenate([getattr(rows, name), getattr(more, name)])
        for name in ('block', *_NUMBERS)
    }
    return _gathered(changed(rows, **numbers), arrangement)


@remembered(64)
def _with_more(*given: Any) -> _Arrangement:
    *both, velocities = given
    own, others = both[: len(both) // 2], both[len(both) // 2 :]
    rows, more = _numbered(*own), _numbered(*others)
    more = replace(
        more, b=more.b + rows.b.size, term=more.term + rows.term.size, c=more.c + rows.c.size
    )
    places, end = rows.c.size, rows.movable.size if velocities else rows.c.size
    parts = [_forms(rows, 0, places), _forms(more, 0, more.c.size), _forms(rows, places, end)]
    return _arranged(_joined(rows, parts))


_STRUCTURE = 'both', 'i', 'j', 'first', 'movable', 'block', 'first_term', 'term_block', 'full'
_NUMBERS = ('b', 'term', 'c')


class _Arrangement(NamedTuple):
    """Rows without numbers. The numbers are taken from other rows: from the entries `b`, the terms
    `term` and the rows `c` of these."""

    rows: Rows
    b: Integers
    term: Integers
    c: Integers


def _structure(rows: Rows) -> tuple[Any, ...]:
    """All of rows that is no number, and how many of them have a constant."""
    return (*(getattr(rows, name) for name in _STRUCTURE), rows.c.size)


def _numbered(*structure: Any) -> Rows:
    """Rows of a structure in a space of one dimension whose numbers are their places."""
    *parts, c = structure
    named = dict(zip(_STRUCTURE, parts, strict=True))
    sizes = {'b': named['block'].size, 'term': named['term_block'].size, 'c': c}
    numbers = {name: np.arange(size, dtype=float) for name, size in sizes.items()}
    nothing = dict.fromkeys(('length2', 'alpha', 'scale', 'bend'), np.zeros(0))
    return Rows(**{**named, **numbers, **nothing})


def _arranged(rows: Rows) -> _Arrangement:
    """The arrangement of rows that were `_numbered`."""
    return _Arrangement(frozen(rows), *(getattr(rows, n).astype(np.int64) for n in _NUMBERS))


def _gathered(rows: Rows, to: _Arrangement) -> Rows:
    """Rows that are arranged otherwise."""
    D, m = rows.b.size // max(1, rows.block.size), to.rows.i.size + to.rows.movable.size
    return changed(
        to.rows,
        length2=rows.length2,
        b=rows.b.reshape(-1, D)[to.b].ravel() if to.b.size else np.zeros(0),
        term=rows.term.reshape(-1, D * D)[to.term].ravel() if to.term.size else np.zeros(0),
        c=rows.c[to.c],
        alpha=np.zeros(m),
        scale=np.zeros(m),
        bend=np.zeros(m),
    )


def _joined(rows: Rows, parts: Sequence[dict[str, Any]]) -> Rows:
    """Rows with these forms in place of their own."""
    each = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    first = _starts(each.pop('entries'))
    return replace(
        rows,
        first=first,
        movable=indices(first[:-1] + each.pop('moving')),
        first_term=_starts(each.pop('terms')),
        **each,
    )


def _forms(rows: Rows, start: int, end: int) -> dict[str, Any]:
    """Of the rows that are no distances, from `start` to `end`: entries of each, how many of them
    move, terms of each entry; and blocks and numbers; as `_numbered` has them."""
    s, e = (int(rows.first[n]) for n in (start, end))
    t, u = (int(rows.first_term[n]) for n in (s, e))
    return {
        'entries': np.diff(rows.first[start : end + 1]),
        'moving': rows.movable[start:end] - rows.first[start:end],
        'terms': np.diff(rows.first_term[s : e + 1]),
        'block': rows.block[s:e],
        'b': rows.b[s:e],
        'term_block': rows.term_block[t:u],
        'full': rows.full[t:u],
        'term': rows.term[t:u],
        'c': rows.c[start:end],
    }


def _starts(counts: Indices | Integers) -> Indices:
    """Where each begins, and the end."""
    return indices(np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]))


def indices(values: Iterable[Any]) -> Indices:
    """Unsigned integers, as the kernel has them."""
    return np.array(values if isinstance(values, np.ndarray) else [*values], dtype=np.uint32)
