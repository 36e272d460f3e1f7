"""Mechanism -> Model: flat read-only arrays for the kernel, and the names that go with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from typing import Any, TypeVar

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats, Integers, Unit
from alf_ros.errors import AssemblyError
from alf_ros.gc_pause import paused
from alf_ros.kernel import (
    Chart,
    Departures,
    Integrals,
    Prescribed,
    Rows,
    Soft,
    StepEnd,
    System,
    Trail,
    Watch,
    Work,
)
from alf_ros.kernel.data import EPS
from alf_ros.kernel.step_error import JUDGED
from alf_ros.mechanism import Coordinate, Mechanism, Point, Vector
from alf_ros.mechanism import natural_coordinates as layouts
from alf_ros.mechanism.form_of_rows import row_form
from alf_ros.mechanism.memory import ResultMemory, exactly
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.arm_tree import arms_of
from alf_ros.model.constraints import auxiliary
from alf_ros.model.constraints.carried_masses import carried
from alf_ros.model.constraints.couplings import coupling_row
from alf_ros.model.constraints.drives import drive_rows
from alf_ros.model.constraints.integrals import with_integrals
from alf_ros.model.constraints.joint_coordinates import counted, length_row
from alf_ros.model.constraints.packing import renumbered, rows_of, with_more
from alf_ros.model.constraints.rotors import rotor_rows
from alf_ros.model.constraints.row import Constraint, Row
from alf_ros.model.constraints.row_scales import scaled_rows
from alf_ros.model.constraints.rows import joint_rows, rigidity, unit_rows
from alf_ros.model.mass import mass_of
from alf_ros.model.mass import renumbered as renumbered_mass
from alf_ros.model.prescribed import prescribe, prescribed, reached, without_value
from alf_ros.model.struct_memory import StructMemory, changed, frozen, made
from alf_ros.model.symbolic_factor import elimination_order, pattern_of

T = TypeVar('T')

_ROWS, _MEASURES = ResultMemory(32), ResultMemory(32)  # by geometry
_PATIENCE = 1e-4  # of two rounds of a solve: the ratio that counts as slow; at least
_ROUNDED = 300.0  # times ε penalty: what rounding leaves of a round, at most
_USUAL = 10.0  # times what rounding and the softest mode leave of a round in ordinary positions
_NEAR = 0.05  # of the ratio at a place that is too close to a singular position
# arrays of a workspace, by their sizes
_OF_BLOCKS = tuple(
    'q qd qdd Q delta shift base given bend pull along target good_q good_qd'.split()
)
_OF_MOVABLE = ('p', 'before_q', 'before_qd', 'sum', 'sum_q', 'sum_qd', 'curve')
_OF_ROWS = ('r2', 'y', 'z', 'w', 'sigma')
_CLOSE = 5e-4  # distance to a singular position below which a stage is interpolated, at σ = 0.5


@dataclass(frozen=True, eq=False)
class Model:
    """A mechanism compiled for the kernel. All arrays are read-only."""

    mechanism: Mechanism
    layout: Layout
    system: System
    lengths: Rows  # of the joint coordinates that are lengths, m
    penalty: float  # α without dimension
    q: Floats  # (blocks D,) as drawn, fixed points and vectors included
    coordinates: tuple[Coordinate, ...]
    point_names: tuple[str, ...]  # movable points, then fixed ones, each in the order of the file
    point_block: Integers  # (points,) block of each named point
    coordinate_block: Integers  # (movable,) blocks of movable points, vectors, auxiliary ones
    row_names: tuple[str, ...]
    row: Integers  # (rows,) place in the kernel of each named row
    carried: Floats  # (movable,) diagonal of M, kg, with the masses that light blocks carry

    def __getstate__(self) -> dict[str, Any]:
        """Without the address of prescribed motions: it belongs to this process."""
        bare = replace(self.system.prescribed, program=np.zeros(0, dtype=np.uint64))
        return {**vars(self), 'system': replace(self.system, prescribed=bare)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)
        vars(self)['system'] = replace(self.system, prescribed=reached(self.system.prescribed))
        _freeze(self)

    def apart(self) -> Model:
        """The same, for use at the same time: it shares nothing that is written."""
        system = self.system
        if system.prescribed.program.size == 0:
            return self
        return replace(self, system=replace(system, prescribed=copy(system.prescribed)))

    def standing(self) -> Model:
        """The same, in which all that moves as a function of time stays where q has it."""
        return replace(self, system=replace(self.system, prescribed=Prescribed.empty()))

    @property
    def unit(self) -> Unit:
        """A tuple as long as space has dimensions: what tells the kernel its D."""
        return (0.0,) * self.layout.dimension

    @property
    def size(self) -> float:
        """Largest extent of the drawing, m."""
        return self.system.size

    @property
    def mass_scale(self) -> float:
        """Mean of the diagonal of M, kg."""
        return self.system.mean

    @property
    def n(self) -> int:
        """Number of natural coordinates (movable ones)."""
        return self.layout.movable * self.layout.dimension

    def accustomed(self, sigma: float, dependent_rows: int) -> Model:
        """The same, knowing the least singular value σ of its ordinary positions, and how many
        rows depend on the others there."""
        close = close_to(sigma)
        patience = patience_of(self.system.penalty, self.system.rounding, close, sigma)
        rank = float(len(self.row_names) - dependent_rows)
        system = changed(self.system, ordinary=sigma, rank=rank, close=close, patience=patience)
        return replace(self, system=system)

    def departing(
        self, q: Floats, branches: Sequence[Floats], part: Floats | None = None
    ) -> Model:
        """The same, at rest in a singular position q (blocks D, m), or hardly beside it, which it
        may leave on branches, each with directions (dimension, blocks D) orthonormal in the metric
        of M. part (blocks D,): 1 on what rests there, if other parts move."""
        departures = Departures(
            q=q[: self.n].copy(),
            branch=np.repeat(np.arange(len(branches)), [len(each) for each in branches]),
            directions=np.concatenate([each[:, : self.n].ravel() for each in branches]),
            part=np.zeros(0) if part is None else part[: self.n].copy(),
        )
        return self.leaving(departures)

    def leaving(self, departures: Departures) -> Model:
        """The same, with these ways to leave a singular position."""
        if departures is self.system.departures:
            return self
        return replace(self, system=changed(self.system, departures=departures))

    def with_penalty(self, penalty: float) -> Model:
        """The same with another penalty."""
        rows = self.system.rows
        alpha = rows.alpha * (penalty / self.penalty)
        alpha.flags.writeable = False
        rounding = self.system.rounding * (penalty / self.penalty)
        system = changed(self.system, rows=changed(rows, alpha=alpha), penalty=penalty)
        return replace(self, system=system, penalty=penalty).rounded(rounding)

    def rounded(self, rounding: float) -> Model:
        """The same, knowing what rounding leaves of a free motion."""
        own = self.system
        patience = patience_of(own.penalty, rounding, own.close, own.ordinary)
        return replace(self, system=changed(own, rounding=rounding, patience=patience))

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """Names of the bodies, in the order of the mechanism."""
        return tuple(body.name for body in self.mechanism.bodies)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the mechanism."""
        return tuple(joint.name for joint in self.mechanism.joints)

    @cached_property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the joint coordinates: of a joint that has one, its own."""
        return tuple(coordinate.name for coordinate in self.coordinates)


def constraints(mechanism: Mechanism, layout: Layout) -> list[Constraint]:
    """All rows: bodies as in the file, unit vectors, joints, drives, couplings, rotors."""
    rows: list[Constraint] = [row for body in mechanism.bodies for row in rigidity(body, layout)]
    rows += unit_rows(layout)
    rows += [row for joint in mechanism.joints for row in joint_rows(joint, layout)]
    rows += [row for drive in mechanism.drives for row in drive_rows(drive, layout)]
    rows += [coupling_row(coupling, layout) for coupling in mechanism.couplings]
    return rows + [row for rotor in mechanism.rotors for row in rotor_rows(rotor, layout)]


@paused()
def compile_model(mechanism: Mechanism, penalty: float) -> Model:
    """Analyse a mechanism once: coordinates, rows, mass matrix, elimination order, pattern of the
    factor.

    `penalty` is α without dimension, in masses that a row feels.
    Raises AssemblyError if nothing has mass, or nothing moves.
    """
    draft = _draft(mechanism)
    arrays, kernel_order, row_names = _of_geometry(_ROWS, mechanism, lambda: _rows(draft))
    mass = mass_of(draft)
    place = np.arange(draft.blocks)
    place[: draft.movable] = elimination_order(mass, arrays)
    layout = draft.renumbered(place.tolist())
    mass, arrays = renumbered_mass(mass, place), renumbered(arrays, place, layout.movable)
    velocities = [row_names[n] for n in kernel_order[arrays.i.size + arrays.c.size :]]
    if not mass.diagonal.sum() > 0.0:
        raise AssemblyError('nothing that moves has mass', key='bodies')
    q = drawn(layout)
    measures = _of_geometry(
        _MEASURES, mechanism, lambda: _measures(layout, velocities), place.tobytes()
    )
    angles, lengths, integrals = measures
    system = made(
        System,
        mass=mass,
        rows=arrays,
        pattern=pattern_of(layout, mass, arrays),
        soft=_not_soft(),
        departures=_no_departures(),
        prescribed=prescribed(layout),
        arms=arms_of(layout),
        angles=angles,
        integrals=integrals,
        size=layout.length,
        mean=float(mass.diagonal.mean()),
        penalty=penalty,
        rounding=EPS * penalty,
        ordinary=1.0,
        rank=0.0,
        close=0.0,
        patience=_PATIENCE,
    )
    unused = np.zeros_like(q)
    prescribe(system, 0.0, q, unused, unused)
    without = without_value(layout, system, 0.0)
    if without:
        text = 'this motion has no value, rate or acceleration at t = 0'
        belts = {joint.name for joint in mechanism.joints}
        key = 'joints' if without in belts else 'drives'
        raise AssemblyError(text, key=f'{key}.{without}')
    for name, n in layout.of_auxiliary.items():
        q.reshape(-1, layout.dimension)[n] = auxiliary.place(name, layout, q)
    block = {**layout.of_point, **layout.of_vector}
    points = sorted(mechanism.points, key=lambda point: point.fixed)
    felt = carried((0.0,) * layout.dimension, system, q)
    model = Model(
        mechanism=mechanism,
        layout=layout,
        system=changed(system, rows=scaled_rows(system, q, layout, penalty, felt)),
        lengths=lengths,
        penalty=penalty,
        q=q,
        coordinates=mechanism.coordinates,
        point_names=tuple(point.name for point in points),
        point_block=np.array([layout.of_point[point.name] for point in points]),
        coordinate_block=np.array(
            [block[item.name] for item in mechanism.blocks if not item.fixed]
            + list(layout.of_auxiliary.values())
        ),
        row_names=row_names,
        row=np.argsort(kernel_order),
        carried=felt,
    )
    _freeze(model)
    return model


def _of_geometry(
    memory: ResultMemory, mechanism: Mechanism, make: Callable[[], T], *more: bytes
) -> T:
    """The result of `make`, which the geometry of a mechanism and `more` determine."""
    key = mechanism.geometry
    if key is None:
        return make()
    return memory.found((key, exactly(tuple(row_form())), *more), make)


def _rows(draft: Layout) -> tuple[Rows, Integers, tuple[str, ...]]:
    """The rows of a mechanism without scales, which row stands at each place, and their names."""
    rows = constraints(draft.mechanism, draft)
    arrays, order = rows_of(rows, draft)
    return frozen(arrays), np.array(order, dtype=np.int64), tuple(row.name for row in rows)


def _measures(layout: Layout, velocities: Sequence[str]) -> tuple[Rows, Rows, Integrals]:
    """The rows of the angles whose turns are counted, and of the coordinates that are lengths; and
    the integrals of the rows of velocities of these names."""
    angles, sums = with_integrals(counted(layout), velocities, layout)
    return frozen(angles), frozen(rows_of(length_rows(layout), layout)[0]), frozen(sums)


def length_rows(layout: Layout) -> list[Row]:
    """The rows of the joint coordinates that are lengths."""
    each = layout.mechanism.coordinates
    return [length_row(one.joint, layout) for one in each if not one.is_angle]


@cache
def _no_departures() -> Departures:
    return Departures.empty()


@cache
def _not_soft() -> Soft:
    return Soft.empty()


@cache
def _no_integrals() -> Integrals:
    return Integrals.empty()


def _draft(mechanism: Mechanism) -> Layout:
    """The layout whose movable blocks stand in the order of the file."""
    items: list[tuple[int, Point | Vector]] = [(0, point) for point in mechanism.points]
    items += [(1, vector) for vector in mechanism.vectors]
    movable = [(kind, item.name) for kind, item in items if not item.fixed]
    movable += [(2, name) for name in mechanism.auxiliary]
    if not movable:
        raise AssemblyError('no point can move: all are fixed', key='points')
    at: tuple[dict[str, int], ...] = ({}, {}, {})
    fixed = ((kind, item.name) for kind, item in items if item.fixed)
    for block, (kind, name) in enumerate((*movable, *fixed)):
        at[kind][name] = block
    return layouts.assembled(mechanism, *at)


def drawn(layout: Layout) -> Floats:
    """(blocks D,) points and vectors as drawn; other blocks are zero."""
    q: list[Sequence[float]] = [[0.0] * layout.dimension for _ in range(layout.blocks)]
    for point in layout.mechanism.points:
        q[layout.of_point[point.name]] = point.at
    for vector in layout.mechanism.vectors:
        q[layout.of_vector[vector.name]] = [layout.length * x for x in vector.along]
    return np.asarray(columns.array(q).ravel())


def hold(model: Model, extra: Sequence[Row], velocities: bool) -> tuple[System, list[str], slice]:
    """The model's system with more rows; with or without those that bind velocities only.

    Returns the names of its rows in the kernel's order too, and where the additional ones stand.
    """
    own, order = model.system.rows, np.argsort(model.row)
    names = [model.row_names[n] for n in order]
    if not extra and (velocities or not own.velocity):
        return model.system, names, slice(0, 0)
    at = own.i.size + own.c.size
    names[at:] = [row.name for row in extra] + (names[at:] if velocities else [])
    rows = with_more(own, rows_of(extra, model.layout)[0], velocities)
    pattern = pattern_of(model.layout, model.system.mass, rows)
    kept = model.system.integrals if velocities else _no_integrals()
    system = changed(model.system, rows=rows, pattern=pattern, integrals=kept)
    drawn, layout, penalty = model.q, model.layout, model.penalty
    rows = scaled_rows(system, drawn, layout, penalty, model.carried)
    system = changed(system, rows=rows)
    return system, names, slice(at, at + len(extra))


def close_to(sigma: float) -> float:
    """`close` of a system whose ordinary positions have the least singular value σ.

    x = σ / ordinary is about the distance to a singular position. Rounding e on Φ turns a row
    by e / (ordinary x²), and q̈ by 1 / x more: so `close` goes with its cube root.
    """
    return _CLOSE * (0.5 / sigma) ** (1.0 / 3.0)


def patience_of(penalty: float, rounding: float, close: float, ordinary: float) -> float:
    """The convergence ratio above which a solve is slow. It is above what a round leaves in
    ordinary positions, and far below the ratio of a position too close to a singular one."""
    sigma = close * ordinary
    near = 1.0 / (1.0 + penalty * sigma**2)
    usual = max(_ROUNDED * EPS * penalty, _USUAL * rounding, _USUAL / (penalty * ordinary**2))
    return max(_PATIENCE, min(usual, _NEAR * near))


def allocate(model: Model, system: System, stages: int) -> Work:
    """The workspace of the kernel for a system and a method of so many stages; without stages
    only for solves at a place."""
    rows, first = system.rows, system.pattern.first
    work, chart, ended = _workspaces(
        model.layout.dimension,
        model.n,
        model.q.size,
        system.pattern.row.size,
        int((first[1:] - first[:-1]).max(initial=0)),
        (rows.i.size, rows.block.size, rows.alpha.size),
        (system.angles.c.size, system.integrals.angle.size, system.integrals.row.size),
        stages,
    )
    parts = {'chart': chart.zeros(), 'ended': ended.zeros()}
    return work.zeros(**parts, trail=_no_trail(), watch=_no_watch())


@cache
def _no_trail() -> Trail:
    return Trail.empty()


@cache
def _no_watch() -> Watch:
    return Watch.empty()


@lru_cache(maxsize=64)
def _workspaces(
    D: int,
    n: int,
    whole: int,
    off: int,
    longest: int,
    of_rows: tuple[int, int, int],
    measured: tuple[int, int, int],
    stages: int,
) -> tuple[StructMemory[Work], StructMemory[Chart], StructMemory[StepEnd]]:
    """The memory of a workspace. off: blocks of the factor below the diagonal, `longest` of them
    in a column; of_rows: distances, entries and rows; measured: x and y of angles, angles
    of sums, sums."""
    (bars, entries, m), (angles, turning, sums) = of_rows, measured
    sizes = {
        'pulse': 3,
        'caller': 4,
        'follow': 0,
        'companion': 0,
        'divider': 0,
        'interval': 3,
        'good_tangents': 0,
        'evaluations': 1,
        'rounded': 1,
        'aside': 2,
        'judged': JUDGED,
        'good_turns': angles // 2,
        'diagonal': n * D,
        'off': off * D * D,
        'inverse_det': 4,
        'good_within': 1,
        'inverse': n * D if stages else 0,
        'inverse_off': off * D * D if stages else 0,
        'column': longest * D * D,
        'g': bars * D,
        'g2': entries * D,
        'g2d': entries * D,
        'gf': bars * D,
        'g2f': entries * D,
        'k': stages * 3 * n,
        'total': 3 * n,
        'places': 16 * n if stages else 0,
        'place_step': 1,
        'place_shift': 1,
        'place_weights': 8,
        'place_x': 8,
        'nearest': 1,
        'crossing': 4,
        'trend': 2,
        'sides': 2,
        'angle': angles,
        'angle_before': angles,
        'near': angles // 2,
        'begun': turning,
        'measured': 2 * turning,
        'sums': sums,
        'search': n + 2 * m,
    }
    for names, size in ((_OF_BLOCKS, whole), (_OF_MOVABLE, n), (_OF_ROWS, m)):
        sizes |= dict.fromkeys(names, size)
    of_chart = dict.fromkeys(('t', 'n', 'rate', 'momentum', 'rest', 'w'), n)
    of_chart |= dict.fromkeys(('curvature', 'radius', 'sin', 'cos', 'rho', 'per_rho'), n // D)
    of_chart |= {'b': n if D == 3 else 0, 'first': whole, 'arcs': 1}
    of_end = dict.fromkeys(('q', 'qd'), whole if stages else 0)
    of_end |= dict.fromkeys(('xi', 'xid'), n if stages else 0)
    of_end |= dict.fromkeys(('sin', 'cos', 'rho'), n // D if stages else 0)
    return (
        StructMemory(Work, sizes),
        StructMemory(Chart, of_chart),
        StructMemory(StepEnd, of_end),
    )


def _freeze(model: Model) -> None:
    system = model.system
    for part in (system.mass, system.rows, system.pattern, system.angles, model.lengths):
        frozen(part)
    model.q.flags.writeable = False
