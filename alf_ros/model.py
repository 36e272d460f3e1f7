"""Mechanism -> Model: flat read-only arrays for the kernel, and the names that go with them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from alf_ros import layout as layouts
from alf_ros.arrays import Floats, Indices, Integers, Unit
from alf_ros.errors import AssemblyError
from alf_ros.kernel import Mass, Pattern, Rows, System, Work
from alf_ros.layout import Layout
from alf_ros.mechanism import GROUND, Body, Joint, Mechanism


@dataclass(frozen=True)
class Row:
    """One constraint row, before it is put into arrays.

    A distance row has `length` (m) and two blocks; any other is linear: Σ b·q + c = 0, with one
    (block, b) entry for each block.
    """

    name: str
    entries: tuple[tuple[int, tuple[float, ...]], ...]
    length: float | None = None
    c: float = 0.0


@dataclass(frozen=True)
class Model:
    """A mechanism compiled for the kernel. All arrays are read-only."""

    mechanism: Mechanism
    layout: Layout
    cut: Layout
    system: System
    cut_system: System  # every body on its own blocks; rows of the bodies only
    penalty: float  # α without dimension
    q: Floats  # (blocks D,) as drawn, fixed points included
    mass_scale: float  # kg, mean of the diagonal of M
    point_names: tuple[str, ...]  # movable points, then fixed ones, each in the order of the file
    point_block: Integers  # (points,) block of each named point
    body_names: tuple[str, ...]
    joint_names: tuple[str, ...]
    row_names: tuple[str, ...]
    row: Integers  # (rows,) place in the kernel of each named row
    cut_row: Integers  # (rows of the cut system,) place in the kernel of its rows
    cut_source: Integers  # (cut blocks,) block of the layout at each cut block
    reaction: Any  # (joints, cut blocks) sparse: sums of the forces on cut blocks

    @property
    def unit(self) -> Unit:
        """A tuple as long as space has dimensions: what tells the kernel its D."""
        return (0.0,) * self.layout.dimension

    @property
    def size(self) -> float:
        """Largest extent of the drawing, m."""
        return self.system.size

    @property
    def n(self) -> int:
        """Number of natural coordinates (movable ones)."""
        return self.layout.movable * self.layout.dimension


def compile_model(mechanism: Mechanism, penalty: float) -> Model:
    """Analyse a mechanism once: coordinates, rows, mass matrix, elimination order, pattern of the
    factor.

    `penalty` is α without dimension: row r gets α_r = penalty · mean(diag M) / |Φ_q,r|².
    Raises AssemblyError if nothing has mass, or nothing moves.
    """
    movable = [point.name for point in mechanism.points if not point.fixed]
    fixed = [point.name for point in mechanism.points if point.fixed]
    if not movable:
        raise AssemblyError('nothing moves: every point is fixed', key='points')
    order = {name: block for block, name in enumerate(movable + fixed)}
    draft = layouts.assembled(mechanism, order)
    place = _elimination_order(draft, _rows(mechanism, draft))
    order = {name: place[block] for block, name in enumerate(movable)} | {
        name: len(movable) + n for n, name in enumerate(fixed)
    }
    layout, cut = layouts.assembled(mechanism, order), layouts.cut(mechanism)
    mass, cut_mass = _mass(layout), _mass(cut)
    mass_scale = float(mass.diagonal.mean())
    if not mass_scale > 0.0:
        raise AssemblyError('nothing that moves has mass', key='bodies')

    at = {point.name: point.at for point in mechanism.points}
    q = np.array([at[name] for name in sorted(order, key=order.__getitem__)], dtype=float)
    rows, cut_rows = _rows(mechanism, layout), _rows(mechanism, cut, joints=False)
    arrays, kernel_order = _row_arrays(rows, layout)
    arrays = _scaled(arrays, q, penalty, mass_scale)
    cut_arrays, cut_order = _row_arrays(cut_rows, cut)
    axes = [layout.basis(body.name) for body in mechanism.bodies]
    system = System(
        mass=mass,
        rows=arrays,
        pattern=_pattern(layout, mass, arrays),
        axes=np.array(axes, dtype=np.uint32).reshape(-1, 2),
        size=float(np.ptp(q, axis=0).max()),
        heaviest=float(mass.diagonal.max()),
    )
    row = np.argsort(kernel_order)
    named = {row.name: n for n, row in enumerate(rows)}
    model = Model(
        mechanism=mechanism,
        layout=layout,
        cut=cut,
        system=system,
        cut_system=replace(system, mass=cut_mass, rows=cut_arrays, pattern=_NO_PATTERN),
        penalty=penalty,
        q=q.ravel(),
        mass_scale=mass_scale,
        point_names=tuple(movable + fixed),
        point_block=np.array([order[name] for name in movable + fixed]),
        body_names=tuple(body.name for body in mechanism.bodies),
        joint_names=tuple(joint.name for joint in mechanism.joints),
        row_names=tuple(row.name for row in rows),
        row=row,
        cut_row=np.array([row[named[cut_rows[n].name]] for n in cut_order], dtype=np.int64),
        cut_source=_cut_source(layout, cut),
        reaction=_reactions(mechanism, cut),
    )
    _freeze(model)
    return model


def hold(model: Model, extra: Sequence[Row]) -> System:
    """The model's system with more linear rows, behind its own."""
    own = model.system.rows
    more, _ = _row_arrays(extra, model.layout)
    rows = replace(
        own,
        first=np.concatenate([own.first, own.first[-1] + more.first[1:]]).astype(np.uint32),
        movable=np.concatenate([own.movable, own.first[-1] + more.movable]).astype(np.uint32),
        block=np.concatenate([own.block, more.block]),
        b=np.concatenate([own.b, more.b]),
        first_term=np.concatenate(
            [own.first_term, own.first_term[-1] + more.first_term[1:]]
        ).astype(np.uint32),
        c=np.concatenate([own.c, more.c]),
    )
    q = model.q.reshape(-1, model.layout.dimension)
    rows = _scaled(rows, q, model.penalty, model.mass_scale)
    return replace(
        model.system, rows=rows, pattern=_pattern(model.layout, model.system.mass, rows)
    )


def allocate(model: Model, system: System, stages: int) -> Work:
    """The workspace of the kernel for a system and a method of so many stages."""
    D, n = model.layout.dimension, model.n
    rows, pattern, whole = system.rows, system.pattern, model.q.size
    columns = np.diff(pattern.first.astype(np.int64))
    m = rows.alpha.size
    sizes = {
        'diagonal': n * D,
        'off': pattern.row.size * D * D,
        'column': int(columns.max(initial=0)) * D * D,
        'g': rows.i.size * D,
        'g2': rows.block.size * D,
        'g2d': rows.block.size * D,
        'gf': rows.i.size * D,
        'g2f': rows.block.size * D,
        'q': whole,
        'qd': whole,
        'qdd': whole,
        'p': n,
        'Q': whole,
        'delta': whole,
        'r2': m,
        'y': m,
        'kq': (stages + 1) * n,
        'kp': (stages + 1) * n,
        'base': whole,
        'momenta': n,
        'sum_q': n,
        'sum_p': n,
        'bend': whole,
        'target': whole,
        'good_q': whole,
        'good_qd': whole,
    }
    return Work(
        evaluations=np.zeros(1, dtype=np.int64),
        good_turns=np.zeros(system.axes.shape[0], dtype=np.int64),
        **{name: np.zeros(size) for name, size in sizes.items()},
    )


# ------------------------------------------------------------------------------------ constraints


def _rows(mechanism: Mechanism, layout: Layout, joints: bool = True) -> list[Row]:
    """All constraint rows in the order of the file: bodies (rigidity), then joints."""
    rows = [row for body in mechanism.bodies for row in _rigidity(body, layout)]
    if joints:
        rows += [row for joint in mechanism.joints for row in _joint_rows(joint, layout)]
    return rows


def _rigidity(body: Body, layout: Layout) -> Iterable[Row]:
    """|P_1 - P_0| = L, and P_k = P_0 + a (P_1 - P_0) + b J (P_1 - P_0) for every further point."""
    blocks = layout.of_body[body.name]
    if len(blocks) > 1 and min(blocks[:2]) < layout.movable:
        i, j = sorted(blocks[:2])
        yield Row(f'{body.name}_length', ((i, ()), (j, ())), length=body.local[1][0])
    for name, local, block in list(zip(body.points, body.local, blocks, strict=True))[2:]:
        a, b = layout.coordinates(body.name, local)
        for axis, e in (('x', (1.0, 0.0)), ('y', (0.0, 1.0))):
            turned = (b * e[1], -b * e[0])  # eᵀ b J
            yield Row(
                f'{body.name}_{name}_{axis}',
                (
                    (block, e),
                    (blocks[0], (-(1.0 - a) * e[0] + turned[0], -(1.0 - a) * e[1] + turned[1])),
                    (blocks[1], (-a * e[0] - turned[0], -a * e[1] - turned[1])),
                ),
            )


def _joint_rows(joint: Joint, layout: Layout) -> Iterable[Row]:
    """Slider: n·(P - through) = 0, n = J direction. A revolute joint shares its point: no row."""
    if joint.kind == 'slider' and joint.direction is not None and joint.through is not None:
        normal = (-joint.direction[1], joint.direction[0])
        c = -(normal[0] * joint.through[0] + normal[1] * joint.through[1])
        yield Row(joint.name, ((layout.of_point[joint.point], normal),), c=c)


def _row_arrays(rows: Sequence[Row], layout: Layout) -> tuple[Rows, list[int]]:
    """The rows as the kernel wants them, and which row stands at each of its places."""
    D = layout.dimension
    distance = [n for n, row in enumerate(rows) if row.length is not None]
    both = [n for n in distance if rows[n].entries[1][0] < layout.movable]
    held = [n for n in distance if rows[n].entries[1][0] >= layout.movable]
    other = [n for n, row in enumerate(rows) if row.length is None]
    order = both + held + other
    first, movable, block, b = [0], [], [], []
    for n in other:
        entries = sorted(rows[n].entries, key=lambda entry: entry[0])  # fixed blocks come last
        block += [entry[0] for entry in entries]
        b += [value for entry in entries for value in entry[1]]
        movable.append(first[-1] + sum(entry[0] < layout.movable for entry in entries))
        first.append(first[-1] + len(entries))
    ends = [rows[n].entries for n in both + held]
    arrays = Rows(
        both=np.uint64(len(both)),
        i=_indices(entry[0][0] for entry in ends),
        j=_indices(entry[1][0] for entry in ends),
        length2=np.array([rows[n].length for n in both + held], dtype=float) ** 2,
        first=_indices(first),
        movable=_indices(movable),
        block=_indices(block),
        b=np.array(b, dtype=float),
        first_term=np.zeros(len(block) + 1, dtype=np.uint32),
        term_block=_indices(()),
        term=np.zeros(0 * D * D),
        c=np.array([rows[n].c for n in other], dtype=float),
        B=np.zeros(0),
        alpha=np.zeros(len(order)),
        scale=np.zeros(len(order)),
    )
    return arrays, order


def _scaled(rows: Rows, q: Floats, penalty: float, mass_scale: float) -> Rows:
    """The rows with scale 1 / |Φ_q,r|, as drawn, and α_r = penalty · mass scale · scale²."""
    D = q.shape[1]
    d = q[rows.i] - q[rows.j]
    square = (d**2).sum(axis=1)
    square[: int(rows.both)] *= 2.0
    b = rows.b.reshape(-1, D)
    linear = [(b[s:e] ** 2).sum() for s, e in zip(rows.first[:-1], rows.movable, strict=True)]
    scale = 1.0 / np.sqrt(np.concatenate([square, np.array(linear, dtype=float)]))
    alpha = penalty * mass_scale * scale**2
    return replace(rows, alpha=alpha, scale=scale)


# ----------------------------------------------------------------------------------- mass, pattern


def _mass(layout: Layout) -> Mass:
    """M in natural coordinates, from m, com and inertia of each body; constant (so Ṁ = 0)."""
    diagonal = np.zeros(layout.blocks)
    pairs: dict[tuple[int, int], list[float]] = {}
    for body in layout.bodies:
        i, j = layout.basis(body.name)
        if i == j:
            diagonal[i] += body.mass
            continue
        a, b = layout.coordinates(body.name, body.com)
        length = body.local[1][0]
        about_first = body.inertia / length**2 + body.mass * (a * a + b * b)
        diagonal[i] += body.mass * (1.0 - 2.0 * a) + about_first
        diagonal[j] += about_first
        k, w = body.mass * a - about_first, body.mass * b
        pair = pairs.setdefault((max(i, j), min(i, j)), [0.0, 0.0])
        pair[0] += k
        pair[1] += w if i > j else -w
    kept = {pair: value for pair, value in pairs.items() if max(pair) < layout.movable}
    values = np.array(list(kept.values()), dtype=float).reshape(-1, 2)
    skew = np.flatnonzero(values[:, 1])
    return Mass(
        diagonal=diagonal[: layout.movable].copy(),
        i=_indices(pair[0] for pair in kept),
        j=_indices(pair[1] for pair in kept),
        k=values[:, 0].copy(),
        skew=skew.astype(np.uint32),
        w=values[skew, 1].copy(),
    )


def _neighbours(layout: Layout, mass_pairs: Iterable[tuple[int, int]], rows: Sequence[Row]) -> Any:
    """Adjacency of the movable blocks in A, as a symmetric CSC matrix with a dominant diagonal."""
    i, j = [], []
    for pair in mass_pairs:
        i.append(pair[0])
        j.append(pair[1])
    for row in rows:
        blocks = [entry[0] for entry in row.entries if entry[0] < layout.movable]
        for n, block in enumerate(blocks):
            for other in blocks[:n]:
                i.append(block)
                j.append(other)
    n = layout.movable
    half = sparse.coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    whole = half + half.T
    whole.data[:] = -1.0
    return (whole + sparse.diags(np.asarray(-whole.sum(axis=1)).ravel() + 1.0)).tocsc()


def _elimination_order(layout: Layout, rows: Sequence[Row]) -> list[int]:
    """New place of every movable block: SuperLU's symmetric minimum degree order."""
    mass = _mass(layout)
    graph = _neighbours(layout, zip(mass.i.tolist(), mass.j.tolist(), strict=True), rows)
    options = {'SymmetricMode': True}
    factor = splu(graph, permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0, options=options)
    return [int(place) for place in factor.perm_c]


def _pattern(layout: Layout, mass: Mass, rows: Rows) -> Pattern:
    """Symbolic factorisation: the fill, and where the product of two blocks of a column goes."""
    D, n = layout.dimension, layout.movable
    below: list[set[int]] = [set() for _ in range(n)]
    both = int(rows.both)
    ends = [*zip(mass.i, mass.j, strict=True), *zip(rows.i[:both], rows.j[:both], strict=True)]
    for i, j in ends:
        below[min(i, j)].add(int(max(i, j)))
    entry_pairs = []
    for r in range(rows.c.size):
        entries = range(rows.first[r], rows.movable[r])
        for e in entries:
            for f in entries:
                if rows.block[e] > rows.block[f]:
                    below[rows.block[f]].add(int(rows.block[e]))
                    entry_pairs.append((e, f, r))
    columns: list[list[int]] = []
    for k in range(n):  # a column's pattern goes on to its parent in the elimination tree
        column = sorted(below[k])
        columns.append(column)
        if column:
            below[column[0]].update(column[1:])
    first = np.concatenate([[0], np.cumsum([len(column) for column in columns])])
    place = {
        (i, k): first[k] + s for k, column in enumerate(columns) for s, i in enumerate(column)
    }
    target = [
        place[column[s], column[r]]
        for column in columns
        for s in range(len(column))
        for r in range(s)
    ]
    diagonal = np.zeros((n, D, D))
    off = np.zeros((int(first[-1]), D, D))
    diagonal[:] = mass.diagonal[:, None, None] * np.eye(D)
    for i, j, k in zip(mass.i, mass.j, mass.k, strict=True):
        off[place[i, j]] = k * np.eye(D)
    for s, w in zip(mass.skew, mass.w, strict=True):
        off[place[mass.i[s], mass.j[s]]] += w * np.array([[0.0, -1.0], [1.0, 0.0]])
    return Pattern(
        first=_indices(first),
        row=_indices(i for column in columns for i in column),
        target=_indices(target),
        mass_diagonal=diagonal.ravel(),
        mass_off=off.ravel(),
        distance=_indices(
            place[max(i, j), min(i, j)] for i, j in zip(rows.i[:both], rows.j[:both], strict=True)
        ),
        pair=np.array(
            [
                (e, f, place[rows.block[e], rows.block[f]], rows.i.size + r)
                for e, f, r in entry_pairs
            ],
            dtype=np.uint32,
        ).reshape(-1, 4),
    )


_NONE = np.zeros(0, dtype=np.uint32)
_NO_PATTERN = Pattern(
    _NONE, _NONE, _NONE, np.zeros(0), np.zeros(0), _NONE, np.zeros((0, 4), dtype=np.uint32)
)


# -------------------------------------------------------------------------------------- reactions


def _cut_source(layout: Layout, cut: Layout) -> Integers:
    source = np.zeros(cut.blocks, dtype=np.int64)
    for point, block in cut.of_point.items():
        source[block] = layout.of_point[point]
    for body in layout.bodies:
        source[list(cut.of_body[body.name])] = layout.of_body[body.name]
    return source


def _reactions(mechanism: Mechanism, cut: Layout) -> Any:
    """Which cut blocks to sum for the force of parent on child in every joint.

    At a pin the bodies (and the ground) form a tree of joints: cutting one leaves the child's
    side, and the joint carries the sum of what its bodies need.
    """
    at: dict[str, list[Joint]] = {}
    for joint in mechanism.joints:
        at.setdefault(joint.point, []).append(joint)
    i: list[int] = []
    j: list[int] = []
    signs: list[float] = []
    number = {joint.name: n for n, joint in enumerate(mechanism.joints)}
    for point, joints in at.items():
        neighbours: dict[str, list[tuple[str, str]]] = {}
        for joint in joints:
            neighbours.setdefault(joint.parent, []).append((joint.child, joint.name))
            neighbours.setdefault(joint.child, []).append((joint.parent, joint.name))
        for joint in joints:
            seen, waiting = {joint.child}, [joint.child]
            while waiting:
                for other, through in neighbours[waiting.pop()]:
                    if through != joint.name and other not in seen:
                        seen.add(other)
                        waiting.append(other)
            sign = 1.0
            if (
                GROUND in seen
            ):  # the ground is never summed: take the other side, with the other sign
                seen, sign = set(neighbours) - seen, -1.0
            for body in seen:
                i.append(number[joint.name])
                j.append(cut.of_body[body][cut.body[body].points.index(point)])
                signs.append(sign)
    return sparse.csr_matrix((signs, (i, j)), shape=(len(mechanism.joints), cut.blocks))


# ------------------------------------------------------------------------------------- small helps


def _indices(values: Iterable[Any]) -> Indices:
    return np.fromiter((int(value) for value in values), dtype=np.uint32)


def _freeze(model: Model) -> None:
    for system in (model.system, model.cut_system):
        for part in (system.mass, system.rows, system.pattern):
            for array in vars(part).values():
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
    model.q.flags.writeable = False
