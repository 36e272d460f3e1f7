"""Closing the loops of the drawn positions, and completing the velocities from the given ones.

Given values become linear rows in addition to the rows of the mechanism, so that the leading
matrix of the step serves both: positions move along M onto Φ = 0, velocities have the least
kinetic energy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, lstsq, solve_triangular

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel import System, Work
from alf_ros.kernel.data import NOTHING
from alf_ros.mechanism import affine
from alf_ros.model.closing_newton import opened, settle
from alf_ros.model.compile import Model, allocate, compile_model, hold
from alf_ros.model.constraints.drives import is_aligned
from alf_ros.model.constraints.meshing import Integral, integrals, slips
from alf_ros.model.constraints.row import Row, linear
from alf_ros.model.far_places import nearer
from alf_ros.model.massless_directions import no_mass
from alf_ros.model.prescribed import prescribe

LEAST, CLOSED = 1e-13, 1e-10  # of the size, to which rows are closed, and must be
AGREED = 1e-9  # of the largest velocity given, by which the others may miss it
_NODES = 6  # places that the next one is extrapolated from
_DENSE = 300  # coordinates up to which soft modes may be solved for with dense matrices
_DEPENDENT = 1e-13  # of the largest singular value: rows that depend on others
TO_ROUNDING = kernel.Until(iterations=100, tolerance=1e-15, patience=1.0)

# components of points and vectors by name; None leaves one free
Given = Mapping[str, Sequence[float | None]]


def close(
    model: Model,
    given: Given,
    start: Floats | None = None,
    least: float = LEAST,
    work: Work | None = None,
) -> Floats:
    """Positions q (blocks D, m) that satisfy Φ = 0 and the given ones, nearest to the drawing.

    `start` (blocks D, m) is where to begin instead of the drawing. They are closed to `least` of
    the size, or as far as rounding allows. Gears, racks, threads and couplings are in mesh as
    drawn, unless there is a `start`. `work`: memory for the rows of the model alone. Raises
    AssemblyError with the constraints that stay open.
    """
    rows = held(model, given)
    system, names, _ = hold(model, rows, velocities=False)
    if work is None or system is not model.system:
        work = allocate(model, system, 0)
    q = closed(model, system, names, work, start, least)
    mesh = _mesh(model, rows) if start is None and (rows or model.mechanism.drives) else None
    if mesh is not None:
        gap = _in_mesh(model, system, work, mesh, _as_drawn(model))
        _check(model, work, [*names, *mesh.names], gap, CLOSED)
        q = np.array(work.q)
    return q


def _as_drawn(model: Model) -> Floats:
    """The drawing q (blocks D, m), its loops closed, without drives and given positions."""
    if not model.mechanism.drives:
        return close(model, {})
    free = compile_model(replace(model.mechanism, drives=()), model.penalty)
    D = model.layout.dimension
    q, found = close(free, {}).reshape(-1, D), model.q.reshape(-1, D).copy()
    of, to = free.layout, model.layout
    for before, now in ((of.of_point, to.of_point), (of.of_vector, to.of_vector)):
        for name, block in now.items():
            found[block] = q[before[name]]
    return found.ravel()


def closed(
    model: Model,
    system: System,
    names: Sequence[str],
    work: Work,
    start: Floats | None,
    least: float = LEAST,
) -> Floats:
    """`close`, with the rows of `system`, which have `names`."""
    work.q[:] = model.q if start is None else start
    gap = _settle(model, system, work, least)
    _check(model, work, names, gap, CLOSED)
    return np.array(work.q)


def follow(
    model: Model, path: Sequence[tuple[float, Given]], start: Floats, tolerance: float
) -> list[Floats]:
    """Positions q (blocks D, m) where a path, given at some s > 0, leads from `start`, at s = 0.

    All of the path give the same components. Components that the constraints do not allow on the
    way are met as nearly as possible, at the end to `tolerance` of the size. Each begins at the
    extrapolation of those before it: so a path crosses singular positions, and stays on its
    branch. Other freedoms move as little as possible along M. Gears and racks stay in mesh, wheels
    may slip. Raises AssemblyError with the constraints that stay open.
    """
    rows = [held(model, given) for _, given in path]
    places = [0.0, *(s for s, _ in path)]
    system, names, _ = hold(model, rows[-1], velocities=False)
    mesh = _mesh(model, rows[-1])
    work = allocate(model, system, 1)
    work.q[:] = start
    found, guesses = [np.array(start)], [start, start]
    for k, given in enumerate(rows, 1):
        c = system.rows.c.copy()
        c[c.size - len(given) :] = [row.c for row in given]  # these stand last
        here = replace(system, rows=replace(system.rows, c=c))
        # near a singular position a residual e leaves the position undetermined by √e
        gap = _settle(model, here, work, 1e-15 if k < len(rows) else 0.0)
        if mesh is not None:
            gap = _in_mesh(model, here, work, mesh, found[-1])
        found.append(np.array(work.q))
        if k < len(rows):
            # a smooth way is met by many places, another one by the last two
            by_two, by_many = (float(np.abs(guess - found[-1]).max()) for guess in guesses)
            guesses = [_extrapolated(places[: k + 2], found, count) for count in (2, _NODES)]
            step = guesses[1 if by_many <= by_two else 0] - found[-1]
            work.q[: model.n] += _led(model, system, work, step, *found[-2:])[: model.n]
    _check(model, work, [*names, *(mesh.names if mesh else ())], gap, tolerance)
    return found[1:]


def displaced(model: Model, q: Floats, step: Floats) -> Floats:
    """q + step (blocks D, m) moved along M to where it is closed, with gears and racks in mesh as
    they are at q, and without slip of wheels on a line. Raises AssemblyError with the constraints
    that stay open."""
    system, names, _ = hold(model, [], velocities=False)
    mesh, work = _mesh(model, [], teeth=False), allocate(model, system, 1)
    work.q[:] = q + step
    gap = _settle(model, system, work, 1e-15)
    if mesh is not None:
        gap = _in_mesh(model, system, work, mesh, q)
    _check(model, work, [*names, *(mesh.names if mesh else ())], gap, 1e-10)
    return np.array(work.q)


def _extrapolated(places: Sequence[float], found: Sequence[Floats], count: int) -> Floats:
    """q at the last of the places, by the polynomial through so many of those found before."""
    last = places[-1]
    nodes = places[-min(count, len(found)) - 1 : -1]
    total = np.zeros_like(found[-1])
    for s, q in zip(nodes, found[-len(nodes) :], strict=True):
        others = [other for other in nodes if other != s]
        total += math.prod((last - other) / (s - other) for other in others) * q
    return total


def _led(
    model: Model, system: System, work: Work, step: Floats, before: Floats, now: Floats
) -> Floats:
    """A step, m, that follows places q, without the free motion, which would continue without end.

    A singular position has more freedoms than its neighbours: the smaller number counts.
    """
    found = []
    momenta = np.zeros(model.n)
    kernel.add_mass_times(model.unit, system.mass, 1.0, step, momenta)
    for place in (before, now):
        work.q[:] = place
        _linearised(model, system, work)
        free = np.zeros_like(work.q)
        work.r2[:] = 0.0
        kernel.augmented(model.unit, system, work, momenta, free, TO_ROUNDING)
        found.append(free)
    return np.asarray(step - min(found, key=lambda free: float(np.linalg.norm(free))))


def _check(model: Model, work: Work, names: Sequence[str], gap: Floats, tolerance: float) -> None:
    """Raise AssemblyError if a row is open by more than `tolerance` of the size."""
    if gap.size and not gap.max() <= tolerance * model.size:
        raise AssemblyError(
            f'the mechanism cannot be closed: {_worst(names, gap, "m")}',
            key='initial.positions',
            expected=nearer(model.size, work.q),
        )
    for drive in model.mechanism.drives:
        if not is_aligned(drive, model.layout, work.q):
            raise AssemblyError(
                f'drive {drive.name} begins more than a right angle from the drawing',
                key=f'drives.{drive.name}',
            )


def _settle(model: Model, system: System, work: Work, least: float) -> Floats:
    """Move work.q along M to where its rows are closed to `least` of the size, or as far as that
    goes; returns by how much each stays open, m."""
    phi, gap = np.zeros(system.rows.alpha.size), np.zeros(system.rows.alpha.size)
    least, best = float(least * model.size), np.array(work.q)
    if not settle(model.unit, system, work, least, best, phi, gap):
        raise no_mass(model, work.q)
    return gap


@dataclass(frozen=True)
class _Mesh:
    """The parts in mesh, and the system with their rows of velocities only."""

    integrals: tuple[Integral, ...]
    names: list[str]
    system: System
    rows: list[int]  # theirs, in the kernel's order


def _mesh(model: Model, given: list[Row], teeth: bool = True) -> _Mesh | None:
    """The correction that keeps teeth in mesh while the given rows are unchanged, or all that has
    an integral; None without any."""
    return _mesh_of(model, given, integrals(model.layout, teeth))


def _mesh_of(model: Model, given: list[Row], found: tuple[Integral, ...]) -> _Mesh | None:
    """The correction of these integrals while the given rows are unchanged; None without any."""
    if not found:
        return None
    system, names, _ = hold(model, [replace(row, c=0.0) for row in given], velocities=True)
    own = [each.name for each in found]
    first = len(names) - system.rows.velocity
    place = {name: first + n for n, name in enumerate(names[first:])}
    rows = [place[name] for name in own]
    alpha = system.rows.alpha.copy()
    alpha[[n for n in place.values() if n not in rows]] = 0.0  # the others may slip
    return _Mesh(found, own, replace(system, rows=replace(system.rows, alpha=alpha)), rows)


def _in_mesh(
    model: Model,
    system: System,
    work: Work,
    mesh: _Mesh,
    before: Floats,
    off: Floats | float = 0.0,
) -> Floats:
    """Move work.q to where no tooth has slipped since `before`, where each was `off` (m) already,
    or as far as that goes; returns by how much each row stays open, m, then each of the mesh."""
    moving = allocate(model, mesh.system, 1)
    gap, D = _gaps(model, system, work), model.layout.dimension
    for _ in range(20):
        slip = off + slips(mesh.integrals, D, before, work.q)
        if np.abs(slip).max() <= 1e-13 * model.size:
            break
        moving.q[:] = work.q
        _linearised(model, mesh.system, moving)
        x = np.zeros_like(work.q)
        moving.r2[:] = 0.0
        moving.r2[mesh.rows] = -slip
        kernel.augmented(model.unit, mesh.system, moving, moving.p, x, TO_ROUNDING)
        work.q[: model.n] += x[: model.n]
        gap = _settle(model, system, work, 1e-13)
    slip = off + slips(mesh.integrals, D, before, work.q)
    return np.concatenate([gap, np.abs(slip)])


def complete(
    model: Model,
    q: Floats,
    given: Given,
    t: float = 0.0,
    near: Floats | None = None,
    tolerance: float = AGREED,
    beside: bool = False,
) -> Floats:
    """Velocities q̇ (blocks D, m/s) with Φ_q q̇ = 0 at t (s) and the given ones, of least kinetic
    energy; or those that `near` (blocks D, m/s) become by an impulse, M q̇ + Φ_qᵀ y = M q̇_near.

    `beside` a singular position rows that are about to lose their direction count in full. Raises
    AssemblyError with the constraints that contradict the velocities given, by more than
    `tolerance` of the largest.
    """
    rows = held(model, given)
    values = np.array([-row.c for row in rows])
    rates = [replace(row, c=0.0) for row in rows]
    system, names, own = hold(model, rates, velocities=True)
    work = allocate(model, system, 1)
    work.q[:] = q
    prescribe(system, t, work.q, work.qd, work.qdd)
    _linearised(model, system, work)
    wanted, x = np.zeros(len(names)), np.array(work.qd)
    wanted[own] = values
    if near is not None:
        kernel.add_mass_times(model.unit, system.mass, 1.0, near, work.p)
    kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, x, work.r2)
    work.r2[:] = wanted - work.r2
    rate = np.zeros_like(wanted)
    count, slowest = kernel.augmented(model.unit, system, work, work.p, x, TO_ROUNDING)
    if beside and count == 100 and slowest > 0.5:
        x = _finished(model, system, work, x, wanted)
    kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, x, rate)
    wrong = np.abs(rate - wanted) * system.rows.scale
    speeds = [values, work.qd] if near is None else [values, work.qd, near]
    if wrong.size and wrong.max() > tolerance * max(
        NOTHING, *(np.abs(each).max(initial=0.0) for each in speeds)
    ):
        said = f'contradict each other: {_worst(names, wrong, "m/s")}'
        if model.mechanism.drives and not rows:
            raise AssemblyError(f'the rates of drives and constraints {said}', key='drives')
        raise AssemblyError(
            f'the given velocities {said}',
            key='initial.velocities',
            expected=_fewer(model, len(rows)) if near is None else None,
        )
    return x


def _fewer(model: Model, given: int) -> str | None:
    """How many components of velocities determine the others, if more are given."""
    freedoms = model.n - round(model.system.rank)
    if given <= freedoms:
        return None
    return f'at most {freedoms} of these {given} components: as many as freedoms; the rest follows'


def _finished(model: Model, system: System, work: Work, x: Floats, wanted: Floats) -> Floats:
    """Result of a solve for velocities that rounds alone do not end, as in `kernel.solved`; or x
    itself, where rows that contradict each other do not let it end."""
    y = np.array(x)
    for rest in range(3):
        if rest:
            kernel.augmented(model.unit, system, work, work.p, y, kernel.Until(1, 0.0, 1.0))
        kernel.finish(model.unit, system, work, y, kernel.SOLVED, kernel.EVERY_MODE)
    found = _nearer(model, system, work, wanted, x, y)
    if model.n > _DENSE:
        return found
    # several soft modes of unlike σ leave something open
    least = _least_correction(model, system, work, found, wanted)
    return _nearer(model, system, work, wanted, found, least)


def _nearer(
    model: Model, system: System, work: Work, wanted: Floats, one: Floats, other: Floats
) -> Floats:
    """Of two velocities those that leave the rows nearer to the speeds wanted."""
    rate, open_by = np.zeros_like(wanted), []
    for each in (one, other):
        kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, each, rate)
        open_by.append(np.max(np.abs(rate - wanted) * system.rows.scale, initial=0.0))
    return other if open_by[1] < open_by[0] else one


def _least_correction(
    model: Model, system: System, work: Work, x: Floats, wanted: Floats
) -> Floats:
    """x and the correction of least kinetic energy that gives the rows the speeds wanted, by a
    dense solve."""
    n, unit, rows = model.n, model.unit, system.rows
    J, M, rate = np.zeros((n, rows.alpha.size)), np.zeros((n, n)), np.zeros_like(wanted)
    one = np.zeros_like(x)
    for a in range(n):
        one[a] = 1.0
        kernel.times_jacobian(unit, rows, work.g, work.g2, one, J[a])
        kernel.add_mass_times(unit, system.mass, 1.0, one, M[a])
        one[a] = 0.0
    kernel.times_jacobian(unit, rows, work.g, work.g2, x, rate)
    try:
        root = cholesky(M, lower=True)
    except np.linalg.LinAlgError:  # points without mass
        return x
    scaled = rows.scale[:, None] * solve_triangular(root, J, lower=True).T
    least = lstsq(scaled, rows.scale * (wanted - rate), cond=_DEPENDENT)[0]
    found = np.array(x)
    found[:n] += solve_triangular(root, least, lower=True, trans='T')
    return found


def opening(model: Model, q: Floats, qd: Floats) -> float:
    """Largest speed (m/s) at which a constraint opens, with q, q̇ (blocks D, m, m/s)."""
    work = allocate(model, model.system, 1)
    work.q[:] = q
    _linearised(model, model.system, work)
    rate = np.zeros_like(work.r2)
    kernel.times_jacobian(model.unit, model.system.rows, work.g, work.g2, qd, rate)
    return float(np.max(np.abs(rate) * model.system.rows.scale, initial=0.0))


def brought_back(
    model: Model, q: Floats, qd: Floats, t: float, off: Mapping[str, float]
) -> tuple[Floats, Floats]:
    """Positions and velocities (blocks D, m, m/s) near these that satisfy the constraints at t.

    off: by how much the sums of some couplings miss their values at q, m, by name; they are met.
    Gears and others that have an integral mesh where they come to lie. Along M: the velocities are
    those after an impulse of the constraints, M q̇ + Φ_qᵀ y = p with p = M q̇ of the ones given.
    Raises AssemblyError with the constraints that stay open.
    """
    system, work, p = model.system, allocate(model, model.system, 1), np.zeros(model.n)
    work.q[:] = q
    prescribe(system, t, work.q, work.qd, work.qdd)
    work.q[:] = close(model, {}, work.q)
    found = tuple(each for each in integrals(model.layout) if each.name in off)
    mesh = _mesh_of(model, [], found)
    if mesh is not None:
        # at q, where loops are open, the coordinates are not yet what they become
        loops, names, _ = hold(model, [], velocities=False)
        missed = np.array([off[each.name] for each in found])
        gap = _in_mesh(model, loops, work, mesh, q, missed)
        _check(model, work, [*names, *mesh.names], gap, CLOSED)
    q = np.array(work.q)
    _linearised(model, system, work)
    kernel.add_mass_times(model.unit, system.mass, 1.0, qd, p)
    x = np.array(work.qd)
    kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, x, work.r2)
    work.r2[:] = -work.r2
    kernel.augmented(model.unit, system, work, p, x, TO_ROUNDING)
    return q, x


def held(model: Model, given: Given) -> list[Row]:
    """One more linear row for each component given; components of vectors are in their own
    length."""
    layout, D = model.layout, model.layout.dimension
    rows = []
    for name, components in given.items():
        is_point = name in layout.of_point
        block = layout.of_point[name] if is_point else layout.of_vector[name]
        unit = 1.0 if is_point else layout.length
        for axis, value in enumerate(components):
            if value is not None:
                row = f'{name} ({"xyz"[axis]} given)'
                rows.append(linear(row, np.eye(D)[axis], affine.of_block(block, D), unit * value))
    return rows


def _linearised(model: Model, system: System, work: Work) -> None:
    if not kernel.linearise(model.unit, system, work, work.q):
        raise no_mass(model, work.q)


def _gaps(model: Model, system: System, work: Work) -> Floats:
    """How far open each row is, m."""
    phi, gap = np.zeros(system.rows.alpha.size), np.zeros(system.rows.alpha.size)
    opened(model.unit, system, work, phi, gap)
    return gap


def _worst(names: Sequence[str], gap: Floats, unit: str) -> str:
    order = np.argsort(-gap, kind='stable')
    shown = [n for n in order[:6] if gap[n] > 0.05 * gap.max()]
    return ', '.join(f'{names[n]} is off by {gap[n]:.3g} {unit}' for n in shown)
