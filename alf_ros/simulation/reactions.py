"""Reactions of joints: the wrench of the parent on the child, from the multipliers.

Each body alone, on blocks of its own, needs f = M q̈ + Φᵀλ - Q there. Constraints of a joint act
on the child with -Φᵀλ. The remaining force at a shared block goes through the joints that connect
the bodies there. These joints form a tree with the ground: cutting one separates the child's side,
and the joint carries the sum of the forces that this side needs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.arrays import Integers
from alf_ros.kernel import BlockSums, Cut, CutWork, Shares, Work
from alf_ros.mechanism import GROUND, Joint, natural_coordinates
from alf_ros.mechanism.form_of_rows import form_of
from alf_ros.model.compile import Model, constraints
from alf_ros.model.constraints.packing import forms_of, indices, rows_of
from alf_ros.model.constraints.rows import joint_rows
from alf_ros.model.mass import mass_of

_ROUNDED = 1e-9  # of what a joint transmits, up to which a component is only rounding


class Reactions:
    """The cut mechanism of a model, analysed once."""

    def __init__(self, model: Model) -> None:
        with form_of(model.layout.asked):
            self._analyse(model)

    def _analyse(self, model: Model) -> None:
        mechanism = model.mechanism
        self.model = model
        self.cut = natural_coordinates.cut(mechanism)
        self.mass = mass_of(self.cut)
        rows = constraints(mechanism, self.cut)
        self.rows, order = rows_of(rows, self.cut)
        place = dict(zip(model.row_names, model.row.tolist(), strict=True))
        self.source_row = np.array([place[rows[n].name] for n in order], dtype=np.int64)
        self.source = _sources(model, self.cut)
        self._shared_points = self._sums(mechanism.joints, 'point')
        self._shared_vectors = self._sums(mechanism.joints, 'vector')
        form = {rows[n].name: k - self.rows.i.size for k, n in enumerate(order)}
        entry, row, block, self._first = [], [], [], [0]
        for joint in mechanism.joints:
            for each in joint_rows(joint, self.cut):
                for n, at in enumerate(each.blocks):
                    if at in self.cut.of_body[joint.child]:
                        entry.append(int(self.rows.first[form[each.name]]) + n)
                        row.append(place[each.name])
                        block.append(at)
            self._first.append(len(entry))
        is_point = np.zeros(self.cut.blocks)
        for name, own in self.cut.of_body.items():
            is_point[list(own[: len(self.cut.body[name].points)])] = 1.0
        self._entry: Integers = np.array(entry, dtype=np.int64)
        self._row: Integers = np.array(row, dtype=np.int64)
        self._block: Integers = np.array(block, dtype=np.int64)
        self._is_point = is_point[self._block]

    @property
    def components(self) -> int:
        """Of a force and a torque."""
        return 3 if self.cut.dimension == 2 else 6

    def _sums(self, joints: Sequence[Joint], kind: str) -> Any:
        """(joints, cut blocks): which blocks to sum for the force of parent on child."""
        at: dict[str, list[Joint]] = {}
        for joint in joints:
            if getattr(joint, kind) is not None:
                at.setdefault(getattr(joint, kind), []).append(joint)
        number = {joint.name: n for n, joint in enumerate(joints)}
        i, j, signs = [], [], []
        for name, there in at.items():
            for joint in there:
                side, sign = _child_side(joint, there)
                for body in side:
                    each = self.cut.body[body]
                    names = each.points + each.vectors
                    first = len(each.points) if kind == 'vector' else 0
                    i.append(number[joint.name])
                    j.append(self.cut.of_body[body][names.index(name, first)])
                    signs.append(sign)
        return sparse.csr_matrix((signs, (i, j)), shape=(len(joints), self.cut.blocks))

    def shared(self, joint: Joint) -> list[tuple[int, float]]:
        """Cut blocks, each with its sign, that sum to the force of the parent on the child at the
        point they share; none if they share none."""
        row = self._shared_points[[self.model.mechanism.joints.index(joint)]].tocoo()
        return list(zip(row.col.tolist(), row.data.tolist(), strict=True))

    def own_entries(self, joint: Joint) -> list[tuple[int, int]]:
        """Entries of the cut rows whose gradients times -λ are forces of the joint on the child,
        each with the row of the model that it belongs to."""
        n = self.model.mechanism.joints.index(joint)
        own = slice(self._first[n], self._first[n + 1])
        each = zip(self._entry[own], self._row[own], self._is_point[own], strict=True)
        return [(int(entry), int(row)) for entry, row, is_point in each if is_point]

    @cached_property
    def arrays(self) -> Cut:
        """Arrays with which the kernel sums wrenches."""
        joints, D = self.model.mechanism.joints, self.cut.dimension
        places = [self.cut.place(joint.child, joint.frames[1].origin) for joint in joints]
        return Cut(
            mass=self.mass,
            rows=self.rows,
            source=indices(self.source),
            source_row=indices(self.source_row),
            points=_block_sums(self._shared_points),
            vectors=_block_sums(self._shared_vectors),
            first=indices(self._first),
            entry=indices(self._entry),
            row=indices(self._row),
            block=indices(self._block),
            is_point=self._is_point,
            origins=forms_of(places, D),
        )

    def workspace(self) -> CutWork:
        """Memory for it."""
        whole, D = self.cut.blocks * self.cut.dimension, self.cut.dimension
        return CutWork(
            **{name: np.zeros(whole) for name in ('q', 'qd', 'qdd', 'Q', 'needed')},
            y=np.zeros(self.rows.alpha.size),
            g=np.zeros(self.rows.i.size * D),
            g2=np.zeros(self.rows.b.size),
        )

    def indeterminate(self, there: CutWork, work: Work) -> NDArray[np.bool_]:
        """(joints, D + 1 or 3) whether λ may change without a change of motion and yet change this
        component of the force, or of the torque, of the joint. `work`: q, Φ_q and the factor."""
        rows, flags = work.y.size, (len(self._first) - 1, self.components)
        shares = Shares(
            part=np.zeros(math.prod(flags)),
            whole=np.zeros(math.prod(flags)),
            w=np.zeros(rows),
            back=np.zeros(rows),
            x=np.zeros(work.q.size),
        )
        unit, system = self.model.unit, self.model.system
        kernel.open_shares(unit, system, self.arrays, there, work, shares)
        # What a joint does not transmit is zero to rounding, and the part of that is any number.
        D = self.cut.dimension
        whole = shares.whole.reshape(flags)
        whole[:, D:] /= self.model.size  # of a unit couple with forces that far apart
        felt = whole > _ROUNDED * np.linalg.norm(whole, axis=1, keepdims=True)
        return np.asarray(felt & (shares.part.reshape(flags) > kernel.OPEN))


class ReactionsOf:
    """The `Reactions` of a model, analysed when they are first asked for."""

    def __init__(self, model: Model) -> None:
        self._model = model

    def __call__(self) -> Reactions:
        return self._reactions

    @cached_property
    def _reactions(self) -> Reactions:
        return Reactions(self._model)

    def __reduce__(self) -> tuple[Any, ...]:
        return ReactionsOf, (self._model,)


def _child_side(joint: Joint, there: Sequence[Joint]) -> tuple[set[str], float]:
    """The bodies that hang on the child when the joint is cut at a shared block; and the sign.

    The ground is never summed: if it is among them, the other side is taken, with the other sign.
    """
    neighbours: dict[str, list[tuple[str, str]]] = {}
    for each in there:
        neighbours.setdefault(each.parent, []).append((each.child, each.name))
        neighbours.setdefault(each.child, []).append((each.parent, each.name))
    seen, waiting = {joint.child}, [joint.child]
    while waiting:
        for other, through in neighbours[waiting.pop()]:
            if through != joint.name and other not in seen:
                seen.add(other)
                waiting.append(other)
    if GROUND in seen:
        return set(neighbours) - seen, -1.0
    return seen, 1.0


def _sources(model: Model, cut: natural_coordinates.Layout) -> Integers:
    """(cut blocks,) the block of the model that each is a copy of."""
    source = np.zeros(cut.blocks, dtype=np.int64)
    for copies, blocks in (
        (cut.of_point, model.layout.of_point),
        (cut.of_vector, model.layout.of_vector),
        (cut.of_body, model.layout.of_body),
        (cut.of_auxiliary, model.layout.of_auxiliary),
        (cut.of_prescribed, model.layout.of_prescribed),
    ):
        for name in copies:
            source[np.array(copies[name])] = blocks[name]
    return source


def _block_sums(sums: Any) -> BlockSums:
    """Of a sparse matrix (joints, cut blocks)."""
    return BlockSums(indices(sums.indptr), indices(sums.indices), sums.data.astype(float))
