"""The least change of shapes with which all rows close at given places, to first order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, lsmr

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Work
from alf_ros.kernel.data import EPS
from alf_ros.mechanism import Mechanism
from alf_ros.mechanism.natural_coordinates import assembled
from alf_ros.model.compile import Model, allocate, constraints, drawn
from alf_ros.model.constraints.packing import rows_of
from alf_ros.model.shape_numbers import apart, numbers, touched

_DAMPING = 1e-4  # of changes that are hardly felt at any place
_DIFFERENCE = 1e-7  # of the size, for derivatives: rows are of low degree in the shapes


def fitted(model: Model, places: list[Floats], rounding: float) -> Mechanism:
    """The mechanism of `model` after that change, at places q (blocks D, m); to `rounding` (m)."""
    weight = np.sqrt(model.system.rows.alpha[model.row])
    before = [violation(model, q) for q in places]
    step, changes = _DIFFERENCE * model.size, list(numbers(model.mechanism, model.size))
    made_of, columns = touched(model), list[tuple[int, str]]()  # which change, of what
    rows: list[list[Floats]] = [[] for _ in places]
    for k, (kind, names, change) in enumerate(changes):
        for group in apart([(kind, name) for name in names], made_of):
            # no row is made of two of a group
            column = np.full(len(made_of), -1)
            for n, item in enumerate(group, len(columns)):
                column[[r for r, each in enumerate(made_of) if item in each]] = n
            columns += [(k, name) for _, name in group]
            other = _violations(model, change(model.mechanism, {name: step for _, name in group}))
            at = np.flatnonzero(column >= 0)
            for n, q in enumerate(places):
                slope = weight[at] * (other(q)[at] - before[n][at]) / step
                rows[n].append(np.stack([at.astype(float), column[at].astype(float), slope]))
    m, parts = len(model.row_names), []
    for each in rows:
        r, c, v = np.hstack(each) if each else np.zeros((3, 0))
        shape = (m, len(columns))
        parts.append(csr_array((v, (r.astype(np.int64), c.astype(np.int64))), shape=shape))
    projectors = [Projector(model, q) for q in places]

    def forth(x: Floats) -> Floats:
        return np.concatenate([P(B @ x) for P, B in zip(projectors, parts, strict=True)])

    def back(y: Floats) -> Floats:
        total = np.zeros(len(columns))
        for n, (P, B) in enumerate(zip(projectors, parts, strict=True)):
            total += B.T @ P(y[n * m : (n + 1) * m])
        return total

    operator = LinearOperator((m * len(places), len(columns)), matvec=forth, rmatvec=back)
    wanted = np.concatenate([-P(weight * phi) for P, phi in zip(projectors, before, strict=True)])
    # no further than rounding: a smaller remainder would need large changes without use
    of_metres = weight / model.system.rows.scale[model.row]
    heaviest, whole = float(of_metres.max()), float(np.linalg.norm(wanted))
    most = max(1e-6, 0.1 * rounding * np.sqrt(len(places)) * heaviest / whole)
    damp = _DAMPING * heaviest
    amounts = lsmr(operator, wanted, damp, 1e-8, most, conlim=0.0, maxiter=400)[0].tolist()
    found = model.mechanism
    for k, (_, _, change) in enumerate(changes):
        own = zip(columns, amounts, strict=True)
        found = change(found, {name: amount for (which, name), amount in own if which == k})
    return found


class Projector:
    """v -> the part of v, a value for each row times α^½, that no motion of q makes or takes."""

    def __init__(self, model: Model, q: Floats) -> None:
        self._model = model
        self._work: Work = allocate(model, model.system, 0)
        kernel.linearise(model.unit, model.system, self._work, q)
        self._weight = np.sqrt(model.system.rows.alpha)

    def __call__(self, v: Floats) -> Floats:
        model, work, rows = self._model, self._work, self._model.system.rows
        v_kernel = np.empty_like(v)
        v_kernel[model.row] = v
        for _ in range(3):  # a mode of σ becomes 1 / (1 + s²)³
            work.delta[:] = 0.0
            kernel.add_transposed(
                model.unit, rows, work.g, work.g2, self._weight * v_kernel, work.delta
            )
            work.delta[model.n :] = 0.0
            kernel.solve(model.unit, model.system.pattern, work.diagonal, work.off, work.delta)
            kernel.times_jacobian(model.unit, rows, work.g, work.g2, work.delta, work.r2)
            v_kernel = v_kernel - self._weight * work.r2
        return np.asarray(v_kernel[model.row])


def violation(model: Model, q: Floats) -> Floats:
    """Φ(q) in the order of `row_names`."""
    phi = np.zeros(len(model.row_names))
    kernel.violation(model.unit, model.system.rows, q, phi)
    return np.asarray(phi[model.row])


def rounded_violation(model: Model, q: Floats) -> Floats:
    """EPS |Φ_q| |q|: by how much Φ changes at most as q (blocks D, m) is rounded, in the order of
    `row_names`."""
    rows, D = model.system.rows, model.layout.dimension
    g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
    kernel.jacobian(model.unit, rows, q, g, g2)
    sizes = np.abs(q).reshape(-1, D)
    distances = (np.abs(g).reshape(-1, D) * (sizes[rows.i] + sizes[rows.j])).sum(axis=1)
    entries = (np.abs(g2).reshape(-1, D) * sizes[rows.block]).sum(axis=1)
    owner = np.repeat(np.arange(rows.movable.size), np.diff(rows.first.astype(np.int64)))
    forms = np.bincount(owner, entries, rows.movable.size)
    return np.asarray(EPS * np.concatenate([distances, forms])[model.row])


def _violations(model: Model, mechanism: Mechanism) -> Callable[[Floats], Floats]:
    """The same of a mechanism that differs from the mechanism of the model in its shapes only, at
    q of the model. Only its rows are made: they have the blocks of the model."""
    here = model.layout
    layout = assembled(mechanism, here.of_point, here.of_vector, here.of_auxiliary)
    made = [row for row in constraints(mechanism, layout) if row.name in set(model.row_names)]
    rows, order = rows_of(made, layout)
    place = {made[n].name: k for k, n in enumerate(order)}
    picked = [place[name] for name in model.row_names]
    there, D = drawn(layout), layout.dimension
    blocks = np.ones(layout.blocks)
    blocks[list(here.of_vector.values())] = layout.length / here.length
    unit = np.repeat(blocks, D)[: model.n]

    def found(q: Floats) -> Floats:
        there[: model.n] = unit * q[: model.n]
        phi = np.zeros(len(made))
        kernel.violation(model.unit, rows, there, phi)
        return np.asarray(phi[picked])

    return found
