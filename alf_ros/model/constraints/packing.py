"""Rows as the kernel wants them: distances between blocks that move, others, forms, velocities.

And affine functions of the blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from alf_ros.arrays import Indices, Integers
from alf_ros.kernel import Forms, Rows
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout, Shape
from alf_ros.model.constraints.row import Constraint, Distance, Row


def rows_of(rows: Sequence[Constraint], layout: Layout) -> tuple[Rows, list[int]]:
    """The rows as the kernel wants them, and which row stands at each of its places."""
    D = layout.dimension
    bars = [(n, row) for n, row in enumerate(rows) if isinstance(row, Distance)]
    forms = [(n, row) for n, row in enumerate(rows) if not isinstance(row, Distance)]
    forms.sort(key=lambda each: each[1].velocity)
    ends = np.array([row[1:3] for _, row in bars], dtype=np.int64).reshape(-1, 2)
    ends.sort(axis=1)
    fixed = ends[:, 1] >= layout.movable
    length = np.array([row.length for _, row in bars])
    moving_first = np.argsort(fixed, kind='stable')
    first, movable, block, b = [0], [], [], []
    first_term, term_block, term = [0], [], []
    for _, row in forms:
        for i in row.blocks:  # ascending, so that fixed blocks come last
            block.append(i)
            b.append(row.b[i])
            for j, T in row.terms.get(i, {}).items():
                term_block.append(j)
                term.append(T)
            first_term.append(len(term))
        movable.append(first[-1] + sum(i < layout.movable for i in row.blocks))
        first.append(len(block))
    order = [bars[n][0] for n in moving_first] + [n for n, _ in forms]
    arrays = Rows(
        both=np.uint64(np.count_nonzero(~fixed)),
        i=indices(ends[moving_first, 0]),
        j=indices(ends[moving_first, 1]),
        length2=length[moving_first] ** 2,
        first=indices(first),
        movable=indices(movable),
        block=indices(block),
        b=np.array(b, dtype=float).ravel(),
        first_term=indices(first_term),
        term_block=indices(term_block),
        term=np.array(term, dtype=float).reshape(-1, D * D).ravel(),
        c=np.array([row.c for _, row in forms if not row.velocity], dtype=float),
        alpha=np.zeros(len(order)),
        scale=np.zeros(len(order)),
    )
    return arrays, order


def forms_of(forms: Sequence[Form], D: int) -> Forms:
    """Affine functions as the kernel wants them."""
    parts = [part for form in forms for part in form.parts.items()]
    return Forms(
        first=_starts(np.array([len(form.parts) for form in forms], dtype=np.int64)),
        block=indices(block for block, _ in parts),
        C=np.array([C for _, C in parts], dtype=float).reshape(-1, D * D).ravel(),
        c=np.array([form.constant for form in forms], dtype=float).ravel(),
    )


def of_shapes(layout: Layout, made: Callable[[Shape], Sequence[Row]]) -> Rows:
    """Linear rows that bodies of one shape have alike, on their own blocks: body after body."""
    shapes = [layout.shape(body.name) for body in layout.bodies]
    alike = {shape: made(shape) for shape in dict.fromkeys(shapes)}
    own, _ = rows_of([row for rows in alike.values() for row in rows], layout)
    ends = np.cumsum([len(rows) for rows in alike.values()]).tolist()
    forms = {
        shape: _forms(own, end - len(rows), end)
        for (shape, rows), end in zip(alike.items(), ends, strict=True)
    }
    parts = [forms[shape] for shape in shapes]
    blocks = np.cumsum([0, *(len(shape.local) for shape in shapes)])
    before = np.repeat(blocks[:-1], [part['block'].size for part in parts])
    rows = _joined(rows_of([], layout)[0], parts)
    place = [block for body in layout.bodies for block in layout.of_body[body.name]]
    return renumbered(
        replace(rows, block=indices(rows.block + before)), np.array(place), layout.movable
    )


def renumbered(rows: Rows, place: Integers, movable: int) -> Rows:
    """The same of other blocks: block n of it is `place[n]`, of which so many move.

    Entries of a row are sorted again.
    """
    ends = np.sort([place[rows.i], place[rows.j]], axis=0)
    block = place[rows.block]
    order = np.lexsort((block, np.repeat(np.arange(rows.movable.size), np.diff(rows.first))))
    moving = _starts(block[order] < movable)
    terms = np.diff(rows.first_term)[order]
    first_term = _starts(terms)
    moved = np.repeat(rows.first_term[order].astype(np.int64) - first_term[:-1], terms)
    moved += np.arange(moved.size)
    D = rows.b.size // max(1, rows.block.size)
    return replace(
        rows,
        i=indices(ends[0]),
        j=indices(ends[1]),
        movable=rows.first[:-1] + moving[rows.first[1:]] - moving[rows.first[:-1]],
        block=indices(block[order]),
        b=rows.b.reshape(order.size, D)[order].ravel(),
        first_term=first_term,
        term_block=indices(place[rows.term_block[moved]]),
        term=rows.term.reshape(moved.size, D * D)[moved].ravel(),
    )


def with_more(rows: Rows, more: Rows, velocities: bool) -> Rows:
    """Rows, and more of forms behind theirs; with or without those that bind velocities only."""
    places, end = rows.c.size, rows.movable.size if velocities else rows.c.size
    parts = [_forms(rows, 0, places), _forms(more, 0, more.c.size), _forms(rows, places, end)]
    return _joined(rows, parts)


def _joined(rows: Rows, parts: Sequence[dict[str, Any]]) -> Rows:
    """Rows with these forms in place of their own."""
    each = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    m = rows.i.size + each['entries'].size
    first = _starts(each.pop('entries'))
    return replace(
        rows,
        first=first,
        movable=indices(first[:-1] + each.pop('moving')),
        first_term=_starts(each.pop('terms')),
        alpha=np.zeros(m),
        scale=np.zeros(m),
        **each,
    )


def _forms(rows: Rows, start: int, end: int) -> dict[str, Any]:
    """Of the rows that are no distances, from `start` to `end`: entries of each, how many of them
    move, terms of each entry; and blocks and numbers."""
    D = rows.b.size // max(1, rows.block.size)
    s, e = (int(rows.first[n]) for n in (start, end))
    t, u = (int(rows.first_term[n]) for n in (s, e))
    return {
        'entries': np.diff(rows.first[start : end + 1]),
        'moving': rows.movable[start:end] - rows.first[start:end],
        'terms': np.diff(rows.first_term[s : e + 1]),
        'block': rows.block[s:e],
        'b': rows.b[s * D : e * D],
        'term_block': rows.term_block[t:u],
        'term': rows.term[t * D * D : u * D * D],
        'c': rows.c[start:end],
    }


def _starts(counts: Indices | Integers) -> Indices:
    """Where each begins, and the end."""
    return indices(np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]))


def indices(values: Iterable[Any]) -> Indices:
    """Unsigned integers, as the kernel has them."""
    return np.array(values if isinstance(values, np.ndarray) else [*values], dtype=np.uint32)
