"""Closing the loops of the drawn positions, and completing the velocities from those given.

What the user holds becomes linear rows beside the mechanism's own, so that the leading matrix of
the step does both: positions move along M onto Φ = 0, velocities are those of least kinetic
energy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel import System, Work
from alf_ros.model import Model, Row, allocate, hold
from alf_ros.rank import effective_rank

Given = Mapping[str, Sequence[float | None]]  # a point's components; None leaves one free


def close(model: Model, given: Given, start: Floats | None = None) -> Floats:
    """Positions q (blocks D, m) that satisfy Φ = 0 and the given ones, nearest to the drawing.

    `start` (blocks D, m) is where to begin instead of the drawing. Raises AssemblyError with the
    constraints that stay open.
    """
    system, names, values = _held(model, given)
    work = allocate(model, system, 1)
    q = np.array(model.q if start is None else start)
    if values.size:
        system.rows.c[-values.size :] = -values
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
    return np.array(work.q)


def complete(model: Model, q: Floats, given: Given) -> Floats:
    """Velocities q̇ (blocks D, m/s) with Φ_q q̇ = 0 and the given ones, of least kinetic energy.

    Raises AssemblyError with the constraints that contradict the velocities given.
    """
    system, names, values = _held(model, given)
    work = allocate(model, system, 1)
    work.q[:] = q
    _linearised(model, system, work)
    rows = system.rows
    x, r2 = np.zeros_like(model.q), np.zeros(rows.alpha.size)
    work.r2[r2.size - values.size :] = values
    kernel.augmented(model.unit, system, work, work.p, x, 100, 1e-15, False)
    kernel.times_jacobian(model.unit, rows, work.g, work.g2, x, r2)
    r2[r2.size - values.size :] -= values
    wrong = np.abs(r2) * rows.scale
    if wrong.size and wrong.max() > 1e-9 * max(1e-300, np.abs(values).max(initial=0.0)):
        raise AssemblyError(
            f'the velocities given contradict each other: {_worst(names, wrong, "m/s")}',
            key='initial.velocities',
        )
    return x


def dependent_rows(model: Model, q: Floats) -> int:
    """How many of the rows depend on the others at ordinary positions near q (blocks D, m).

    q itself may be a singular one, so that places around it are looked at too.
    """
    random = np.random.default_rng(0)
    work = allocate(model, model.system, 1)
    found = 0
    for distance in (0.0, 0.05, 0.05, 0.05):
        near = np.array(q)
        near[: model.n] += distance * model.size * random.standard_normal(model.n)
        try:
            near = close(model, {}, near)
        except AssemblyError:
            continue
        if kernel.linearise(model.unit, model.system, work, near):
            found = max(found, round(effective_rank(model, work)))
    return len(model.row_names) - found


def _held(model: Model, given: Given) -> tuple[System, list[str], Floats]:
    """The mechanism's system with one more linear row for each component given."""
    kernel_names = np.empty(len(model.row_names), dtype=object)
    kernel_names[model.row] = model.row_names
    if not given:
        return model.system, list(kernel_names), np.zeros(0)
    rows, names, values = [], [], []
    for point, components in given.items():
        for axis, value in enumerate(components):
            if value is not None:
                e = tuple(float(axis == a) for a in range(model.layout.dimension))
                name = f'{point} ({"xyz"[axis]} given)'
                rows.append(Row(name, ((model.layout.of_point[point], e),)))
                names.append(name)
                values.append(value)
    return hold(model, rows), [*kernel_names, *names], np.array(values, dtype=float)


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
