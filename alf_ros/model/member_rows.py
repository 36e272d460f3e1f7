"""Rows of members of one structure: places, lengths and directions differ, and with them the
numbers of rows; which blocks a row binds does not.

The rows of each member are made as for a single mechanism. What they bind is compared with
the first one in full: a coefficient that is zero, or a body that other points carry, makes another
structure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Addresses, Floats, Unit
from alf_ros.kernel import Rows, System, jacobian
from alf_ros.kernel.numba_ext.jit import ZERO, compiled
from alf_ros.kernel.numba_ext.lane_structs import struct_at
from alf_ros.kernel.numba_ext.structs import Struct
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.compile import Model, constraints, drawn, length_rows
from alf_ros.model.constraints.joint_coordinates import counted_rows
from alf_ros.model.constraints.packing import RowNumbers, parts_of, placed_rows, rows_of
from alf_ros.model.constraints.row import Constraint
from alf_ros.model.constraints.row_scales import RowLengths, curvatures
from alf_ros.model.member_structs import MemberStructs

# parts of a System that the geometry of its mechanism determines
GEOMETRY = (
    'rows.length2',
    'rows.b',
    'rows.term',
    'rows.c',
    'rows.scale',
    'rows.bend',
    'angles.b',
    'angles.term',
    'angles.c',
    'size',
)
LENGTHS = 'lengths.b', 'lengths.term', 'lengths.c'  # likewise, of `JointCoordinates`
_NUMBERS = 'b', 'term', 'c'


class Geometry(NamedTuple):
    """The numbers of one member: `size` (m) and q as `drawn` (blocks D, m); of its constraints, of
    the angles that are counted, and of the joint coordinates that are lengths, one after
    another."""

    size: float
    drawn: Floats
    rows: RowNumbers


class MemberRows:
    """The rows of members like a model, whose rows are no rows of velocities and whose angles
    belong to joints and bodies."""

    def __init__(self, model: Model) -> None:
        self._structure, _ = parts_of(_made(model.layout))
        self._order = placed_rows(self._structure, model.layout.movable)[0]  # of the distances
        self._parts = model.system.rows, model.system.angles, model.lengths

    def of(self, layout: Layout) -> Geometry | None:
        """The numbers of a member with this layout; None if it has another structure."""
        structure, numbers = parts_of(_made(layout))
        if structure != self._structure:
            return None
        return Geometry(layout.length, drawn(layout), numbers)

    def put(self, members: Sequence[Geometry], systems: MemberStructs) -> None:
        """Write the numbers of members into their systems, without scales."""
        length = np.array([each.rows.length for each in members])
        systems.rows.length2[:] = length[:, self._order] ** 2
        systems.size[:] = [each.size for each in members]
        for name in _NUMBERS:
            of_rows, of_angles, _ = self._apart(members, name)
            getattr(systems.rows, name)[:] = of_rows
            getattr(systems.angles, name)[:] = of_angles

    def put_lengths(self, members: Sequence[Geometry], joints: MemberStructs) -> None:
        """Write the rows of lengths into the joint coordinates of members."""
        for name in _NUMBERS:
            getattr(joints.lengths, name)[:] = self._apart(members, name)[2]

    def _apart(self, members: Sequence[Geometry], name: str) -> list[Floats]:
        """(members, ...) numbers of the constraints, of the angles and of the lengths."""
        every = np.array([getattr(each.rows, name) for each in members])
        ends = np.cumsum([getattr(part, name).size for part in self._parts])
        return np.split(every, ends[:-1], axis=1)


def are_rows_of(model: Model) -> bool:
    """Whether the rows that are made here equal the rows of the model, in all bits."""
    layout = model.layout
    known = model.system.rows, model.system.angles, model.lengths
    made = (rows_of(each, layout)[0] for each in _parts(layout))
    return all(
        np.asarray(getattr(one, name)).tobytes() == np.asarray(getattr(other, name)).tobytes()
        for one, other in zip(made, known, strict=True)
        for name in Rows.__dataclass_fields__
        if name not in ('alpha', 'scale', 'bend') and not name.startswith('_')
    )


def _made(layout: Layout) -> list[Constraint]:
    """The constraints, the rows of counted angles, and the rows of lengths."""
    return [row for rows in _parts(layout) for row in rows]


def _parts(layout: Layout) -> tuple[Sequence[Constraint], ...]:
    return constraints(layout.mechanism, layout), counted_rows(layout), length_rows(layout)


@dataclass(frozen=True, eq=False)
class MemberGradients(Struct):
    """Φ_q of the members as drawn."""

    addresses = ('system',)

    system: Addresses  # (members,) of its System
    drawn: Floats  # (members, all blocks D) m
    g: Floats  # (members, distance rows D)
    g2: Floats  # (members, entries D)
    q: Floats  # (all blocks D,) memory
    one: Floats  # (distance rows D,) memory
    one2: Floats  # (entries D,) memory


@compiled
def gradients(unit: Unit, of: System, found: MemberGradients) -> None:
    """Φ_q of each member as drawn. `of`: the System of any member."""
    members, size = np.uint64(found.system.size), np.uint64(found.q.size)
    bars, entries = np.uint64(found.one.size), np.uint64(found.one2.size)
    for m in range(ZERO, members):
        for i in range(ZERO, size):
            found.q[i] = found.drawn[m * size + i]
        jacobian(unit, struct_at(of, found.system[m]).rows, found.q, found.one, found.one2)
        for i in range(ZERO, bars):
            found.g[m * bars + i] = found.one[i]
        for i in range(ZERO, entries):
            found.g2[m * entries + i] = found.one2[i]


class MemberScales:
    """The scales of the rows of members, and their penalties."""

    def __init__(self, unit: Unit, systems: MemberStructs, blocks: int) -> None:
        rows: Rows = systems.like.rows  # type: ignore[attr-defined]
        members, D = systems.members, len(unit)
        self._unit, self._systems, self._blocks, self._rows = unit, systems, blocks, rows
        bars, entries = rows.i.size * D, rows.b.size
        self._found = MemberGradients(
            system=systems.addresses,
            drawn=np.zeros(members * blocks * D),
            g=np.zeros(members * bars),
            g2=np.zeros(members * entries),
            q=np.zeros(blocks * D),
            one=np.zeros(bars),
            one2=np.zeros(entries),
        )

    def put(self, drawn: Floats, diagonal: Floats, mean: Floats, penalty: Floats) -> None:
        """Write scale and α: members drawn (members, blocks D) m, with M of this `diagonal`
        (members, movable), its `mean`, and penalties (members,)."""
        found, systems, members = self._found, self._systems, self._systems.members
        found.drawn.reshape(members, -1)[:] = drawn
        gradients(self._unit, systems.member(0), found)
        g, g2 = (each.reshape(members, -1) for each in (found.g, found.g2))
        lengths = RowLengths(self._rows, g, g2, len(self._unit))
        moved = lengths.masses(diagonal, mean, self._blocks)
        systems.rows.alpha[:] = penalty[:, None] / moved
        systems.rows.scale[:] = 1.0 / np.sqrt(lengths.squared)
        systems.rows.bend[:] = systems.rows.scale * curvatures(self._rows, systems.rows.term)
