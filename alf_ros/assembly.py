"""Closing the loops of the drawn positions, and completing the velocities from those given.

What the user holds becomes linear rows beside the mechanism's own, so that the leading matrix of
the step does both: positions move along M onto Φ = 0, velocities are those of least kinetic
energy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alf_ros import form, kernel
from alf_ros.arrays import Floats
from alf_ros.driving import is_aligned
from alf_ros.errors import AssemblyError
from alf_ros.kernel import System, Work
from alf_ros.model import Model, allocate, hold
from alf_ros.prescribed import prescribe
from alf_ros.rank import distance, effective_rank
from alf_ros.row import Row, linear

# components of points and vectors by name; None leaves one free
Given = Mapping[str, Sequence[float | None]]


def close(model: Model, given: Given, start: Floats | None = None) -> Floats:
    """Positions q (blocks D, m) that satisfy Φ = 0 and the given ones, nearest to the drawing.

    `start` (blocks D, m) is where to begin instead of the drawing. Raises AssemblyError with the
    constraints that stay open.
    """
    system, names, _ = hold(model, _rows(model, given), velocities=False)
    work = allocate(model, system, 1)
    q = np.array(model.q if start is None else start)
    work.q[:] = q
    best = np.inf
    for _ in range(200):
        gap = _gaps(model, system, work)
        if not gap.size or gap.max() <= 1e-13 * model.size:
            break
        if gap.max() < best:
            best, q[:], fraction = gap.max(), work.q, 1.0
        else:  # the full step overshot: take half of it from the best place so far
            fraction *= 0.5
            if fraction < 1e-3:
                break
        work.q[:] = q
        _, violation = _linearised(model, system, work)
        work.delta[:] = 0.0
        rows = system.rows
        kernel.add_transposed(
            model.unit, rows, work.g, work.g2, -rows.alpha * violation, work.delta
        )
        kernel.solve(model.unit, system.pattern, work.diagonal, work.off, work.delta)
        work.q[: model.n] += fraction * work.delta[: model.n]
    gap = _gaps(model, system, work)
    if gap.size and gap.max() > 1e-10 * model.size:
        raise AssemblyError(
            f'the mechanism cannot be closed: {_worst(names, gap, "m")}', key='initial.positions'
        )
    for drive in model.mechanism.drives:
        if not is_aligned(drive, model.layout, work.q):
            raise AssemblyError(
                f'drive {drive.name} begins more than a right angle from the drawing',
                key=f'drives.{drive.name}',
            )
    return np.array(work.q)


def complete(model: Model, q: Floats, given: Given) -> Floats:
    """Velocities q̇ (blocks D, m/s) with Φ_q q̇ = 0 and the given ones, of least kinetic energy.

    Raises AssemblyError with the constraints that contradict the velocities given.
    """
    rows = _rows(model, given)
    values = np.array([-row.c for row in rows])
    rates = [replace(row, c=0.0) for row in rows]
    system, names, own = hold(model, rates, velocities=True)
    work = allocate(model, system, 1)
    work.q[:] = q
    _linearised(model, system, work)
    prescribe(system, 0.0, work.q, work.qd, work.qdd)
    wanted, x = np.zeros(len(names)), np.array(work.qd)
    wanted[own] = values
    kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, x, work.r2)
    work.r2[:] = wanted - work.r2
    rate = np.zeros_like(wanted)
    kernel.augmented(model.unit, system, work, work.p, x, 100, 1e-15, 1.0)
    kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, x, rate)
    wrong = np.abs(rate - wanted) * system.rows.scale
    if wrong.size and wrong.max() > 1e-9 * max(
        1e-300, np.abs(values).max(initial=0.0), np.abs(work.qd).max()
    ):
        raise AssemblyError(
            f'the velocities given contradict each other: {_worst(names, wrong, "m/s")}',
            key='initial.velocities',
        )
    return x


def brought_back(model: Model, q: Floats, qd: Floats, t: float) -> tuple[Floats, Floats]:
    """Positions and velocities (blocks D, m, m/s) near these that satisfy the constraints at t.

    Along M: the velocities are those after an impulse of the constraints, M q̇ + Φ_qᵀ y = p with
    p = M q̇ of the ones given. Raises AssemblyError with the constraints that stay open.
    """
    system, work, p = model.system, allocate(model, model.system, 1), np.zeros(model.n)
    work.q[:] = q
    prescribe(system, t, work.q, work.qd, work.qdd)
    work.q[:] = q = close(model, {}, work.q)
    _linearised(model, system, work)
    kernel.add_mass_times(model.unit, system.mass, 1.0, qd, p)
    x = np.array(work.qd)
    kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, x, work.r2)
    work.r2[:] = -work.r2
    kernel.augmented(model.unit, system, work, p, x, 100, 1e-15, 1.0)
    return q, x


def ordinary(model: Model, q: Floats) -> tuple[int, Floats, float]:
    """What is ordinary near q: how many rows depend on the others, a place, and its distance σ.

    q (blocks D, m) itself may be a singular position, so that places around it are looked at too.
    """
    random = np.random.default_rng(0)
    work = allocate(model, model.system, 1)
    best, place = -1.0, q
    for away in (0.0, 0.05, 0.05, 0.05):
        near = np.array(q)
        near[: model.n] += away * model.size * random.standard_normal(model.n)
        if away:
            try:
                near = close(model, {}, near)
            except AssemblyError:
                continue
        if kernel.linearise(model.unit, model.system, work, near):
            rank = effective_rank(model, work)
            if rank > best:
                best, place = rank, near
    rank = round(max(best, 0.0))
    return len(model.row_names) - rank, place, _softness(model, work, place, rank)


def within(model: Model, q: Floats, dependent_rows: int) -> bool:
    """Whether q (blocks D, m) is a singular position, as near as stages are not trusted there."""
    work = allocate(model, model.system, 1)
    if not kernel.linearise(model.unit, model.system, work, q):
        return False
    missing = len(model.row_names) - dependent_rows - effective_rank(model, work)
    sigma = distance(missing, model.penalty)
    return bool(sigma < model.system.close * model.system.ordinary)


def _softness(model: Model, work: Work, q: Floats, rank: int) -> float:
    """The distance σ at an ordinary place, with the smallest penalty that can tell it.

    With a large one what is missing from the rank would be lost in rounding.
    """
    for penalty in (1e4, 1e6, 1e8, 1e10):
        rows = model.system.rows
        system = replace(
            model.system, rows=replace(rows, alpha=rows.alpha * (penalty / model.penalty))
        )
        if not kernel.linearise(model.unit, system, work, q):
            break
        missing = rank - effective_rank(model, work)
        if missing < 0.5:
            return float(distance(missing, penalty))
    return 1e-5


def _rows(model: Model, given: Given) -> list[Row]:
    """One more linear row for each component given; those of vectors are in their own length."""
    layout, D = model.layout, model.layout.dimension
    rows = []
    for name, components in given.items():
        is_point = name in layout.of_point
        block = layout.of_point[name] if is_point else layout.of_vector[name]
        unit = 1.0 if is_point else layout.length
        for axis, value in enumerate(components):
            if value is not None:
                row = f'{name} ({"xyz"[axis]} given)'
                rows.append(linear(row, np.eye(D)[axis], form.of_block(block, D), unit * value))
    return rows


def _linearised(model: Model, system: System, work: Work) -> tuple[bool, Floats]:
    phi = np.zeros(system.rows.alpha.size)
    good = kernel.linearise(model.unit, system, work, work.q)
    if not good:
        raise AssemblyError('a point that moves has neither mass nor constraint', key='points')
    kernel.violation(model.unit, system.rows, work.q, phi)
    return good, phi


def _gaps(model: Model, system: System, work: Work) -> Floats:
    """How far open each row is, m."""
    phi = np.zeros(system.rows.alpha.size)
    kernel.violation(model.unit, system.rows, work.q, phi)
    return np.abs(phi) * system.rows.scale


def _worst(names: Sequence[str], gap: Floats, unit: str) -> str:
    order = np.argsort(-gap, kind='stable')
    shown = [n for n in order[:6] if gap[n] > 0.05 * gap.max()]
    return ', '.join(f'{names[n]} is off by {gap[n]:.3g} {unit}' for n in shown)
