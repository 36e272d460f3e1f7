"""The integrals of rows of velocities, as the kernel wants them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from alf_ros.kernel import Integrals, Rows
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.meshing import integrals
from alf_ros.model.constraints.packing import indices, rows_of, with_more
from alf_ros.model.constraints.row import Row
from alf_ros.model.constraints.velocity_integral import IntegralTerm
from alf_ros.model.struct_memory import changed, frozen


def with_integrals(
    angles: Rows, velocities: Sequence[str], layout: Layout
) -> tuple[Rows, Integrals]:
    """The counted angles, with more that integrals have; and the integrals of the rows of
    velocities of these names. A belt or a line that moves has a velocity, and no integral."""
    moving = {joint.name for joint in layout.mechanism.joints if joint.motion}
    found = [each for each in integrals(layout) if each.name not in moving]
    if not found:
        return angles, _none()
    terms = [term for each in found for term in each.terms]
    turning = [term for term in terms if term.is_angle]
    lengths = [term.rows[0] for term in terms if not term.is_angle]
    angles, of_angle = _counted(angles, turning, layout)
    own = sorted(set(of_angle))
    angle, length = iter(of_angle), iter(range(len(own), len(own) + len(lengths)))
    row = {name: n for n, name in enumerate(velocities)}
    return angles, Integrals(
        row=indices(row[each.name] for each in found),
        angle=indices(own),
        first=indices(np.cumsum([0, *(len(each.terms) for each in found)])),
        place=indices(own.index(next(angle)) if t.is_angle else next(length) for t in terms),
        factor=np.array([term.factor for term in terms], dtype=float),
        lengths=rows_of(lengths, layout)[0],
    )


@cache
def _none() -> Integrals:
    none = {name: np.zeros(0, dtype=np.uint32) for name in ('row', 'angle', 'place')}
    rows = Rows.empty()
    rows = changed(rows, first=indices([0]), first_term=indices([0]))
    return frozen(Integrals(first=indices([0]), factor=np.zeros(0), lengths=frozen(rows), **none))


def _counted(
    angles: Rows, terms: Sequence[IntegralTerm], layout: Layout
) -> tuple[Rows, list[int]]:
    """The angles, followed by new ones of the terms, and the place of the angle of each term."""
    place: dict[bytes, int] = {}
    more: list[Row] = []
    found: list[int] = []
    for n in range(angles.c.size // 2):
        place.setdefault(_content(angles, n), n)
    for term in terms:
        content = _content(rows_of(term.rows, layout)[0], 0)
        if content not in place:
            place[content] = angles.c.size // 2 + len(more) // 2
            more += term.rows
        found.append(place[content])
    if more:
        angles = with_more(angles, rows_of(more, layout)[0], velocities=False)
    return angles, found


def _content(angles: Rows, n: int) -> bytes:
    """All numbers of the rows x, y of an angle."""
    start, end = (int(angles.first[2 * n + k]) for k in (0, 2))
    term, last = (int(angles.first_term[each]) for each in (start, end))
    D = angles.b.size // max(1, angles.block.size)
    parts = (
        angles.first[2 * n : 2 * n + 3] - angles.first[2 * n],
        angles.block[start:end],
        angles.b[start * D : end * D] + 0.0,
        angles.first_term[start : end + 1] - angles.first_term[start],
        angles.term_block[term:last],
        angles.term[term * D * D : last * D * D] + 0.0,
        angles.c[2 * n : 2 * n + 2] + 0.0,
    )
    return b''.join(part.tobytes() for part in parts)
