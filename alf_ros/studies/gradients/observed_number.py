"""A number of a state, with its derivatives by the state and by the arrays of the problem."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.kernel import Rows
from alf_ros.model.compile import Model
from alf_ros.simulation.quantities import Group, full_name, groups
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.state import State
from alf_ros.studies.optimisation.design_quantity import CALL

_KINDS = ('points.', 'velocities.', 'joints.')


@dataclass(frozen=True, eq=False)
class Bars:
    """∂J/∂q and ∂J/∂q̇ (all blocks D,) of a state, and ∂J/∂ the arrays that joint coordinates
    depend on, by the names of `ParameterSlopes.arrays`."""

    q: Floats
    qd: Floats
    arrays: dict[str, Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, model: Model) -> Bars:
        """All zero."""
        rows = {'angle': model.system.angles, 'length': model.lengths}
        arrays = {
            f'{name}_{part}': np.zeros_like(getattr(of, part))
            for name, of in rows.items()
            for part in ('b', 'c', 'term')
        }
        return cls(np.zeros_like(model.q), np.zeros_like(model.q), arrays)


class _Component(Protocol):
    def add(self, state: State, weight: float, to: Bars) -> None:
        """Add `weight` times the derivatives at a state."""


@dataclass(frozen=True, eq=False)
class ObservedNumber:
    """`text` as it was given, its unit, and its components, of which the magnitude is taken if it
    `is_size`."""

    text: str
    unit: str
    is_size: bool
    _read: Callable[[Sample], Floats]
    _components: Sequence[_Component]

    def value(self, sample: Sample) -> float:
        """Its value in a sample."""
        return self._of(self._read(sample))

    def _of(self, components: Floats) -> float:
        return float(np.linalg.norm(components) if self.is_size else components[0])

    def add(self, sample: Sample, weight: float, to: Bars) -> None:
        """Add `weight` times its derivatives at a sample. A magnitude has none where it is zero:
        raises InputError."""
        here = self._read(sample)
        along: Floats = np.ones(1)
        if self.is_size:
            size = self._of(here)
            if size == 0.0:
                where = f'zero at t = {sample.t:.6g} s'
                raise InputError(f'no gradient of a magnitude that is {where}', value=self.text)
            along = here / size
        for component, part in zip(self._components, along.tolist(), strict=True):
            component.add(sample.state, weight * part, to)


def observed_number(given: object, key: str, sample: Sample) -> ObservedNumber:
    """The number of a text: a place or velocity of a point, a joint coordinate or its rate,
    `norm(…)` of a vector or `abs(…)` of a number. Raises InputError, which says `key`."""
    text = given.strip() if isinstance(given, str) else ''
    called = CALL.fullmatch(text)
    if called and called[1] not in ('norm', 'abs'):
        raise InputError('no such function', key=key, value=called[1], choices=('norm', 'abs'))
    inner = called[2].strip() if called else text
    known: dict[str, tuple[Group, int, int | None]] = {}
    for group in groups(sample):
        for row, name in enumerate(group.names):
            if name.startswith(_KINDS) and not name.endswith('.effort'):
                known[name] = group, row, None
                for c, axis in enumerate(group.components):
                    known[f'{name}.{axis}'] = group, row, c
    full = full_name(inner, tuple(known), key)
    group, row, component = known[full]
    if called is None and group.components and component is None:
        raise InputError(
            'not a single number', key=key, value=inner, expected=f'norm({inner}) or {inner}.x'
        )

    def read(sample: Sample) -> Floats:
        found = np.asarray(group.read(sample)[row], dtype=float)
        return np.atleast_1d(found if component is None else found[component])

    axes = range(len(group.components)) if component is None else (component,)
    kind, _, rest = full.partition('.')
    model = sample.model
    parts: list[_Component]
    if kind == 'joints':
        name, _, what = rest.rpartition('.')
        parts = [_JointPart(model, sample, model.coordinate_names.index(name), what == 'velocity')]
    else:
        name = group.names[row].partition('.')[2]
        block = int(model.point_block[model.point_names.index(name)])
        D = model.layout.dimension
        parts = [_PointPart(block * D + axis, kind == 'velocities') for axis in axes]
    return ObservedNumber(text, group.units[0], called is not None, read, parts)


@dataclass(frozen=True, eq=False)
class _PointPart:
    at: int
    is_rate: bool

    def add(self, state: State, weight: float, to: Bars) -> None:
        (to.qd if self.is_rate else to.q)[self.at] += weight


class _JointPart:
    """A joint coordinate: atan2(y, x) of two quadratic forms, or a form; minus another one."""

    def __init__(self, model: Model, sample: Sample, n: int, is_rate: bool) -> None:
        joints = sample._instruments.coordinates
        self._model, self._is_rate = model, is_rate
        self._parts = [(int(joints.place[n]), 1.0)]
        if joints.less[n] >= 0:
            self._parts.append((int(joints.less[n]), -1.0))

    def add(self, state: State, weight: float, to: Bars) -> None:
        model = self._model
        angles = model.system.angles.c.size // 2
        for which, sign in self._parts:
            if which < angles:
                self._add_angle(state, which, sign * weight, to)
                continue
            by = np.zeros(model.lengths.c.size)
            by[which - angles] = sign * weight
            none = np.zeros_like(by)
            values, rates = (none, by) if self._is_rate else (by, none)
            _add_forms(model, model.lengths, 'length', state, values, rates, to)

    def _add_angle(self, state: State, which: int, weight: float, to: Bars) -> None:
        rows, model = self._model.system.angles, self._model
        (x, y), (xd, yd) = (
            values[2 * which : 2 * which + 2] for values in _values(model, rows, state)
        )
        square = x * x + y * y
        around = np.array([-y, x]) * (weight / square)
        values, rates = np.zeros(rows.c.size), np.zeros(rows.c.size)
        of = slice(2 * which, 2 * which + 2)
        if self._is_rate:
            spin = (x * yd - y * xd) / square
            rates[of] = around
            values[of] = (np.array([yd, -xd]) - 2.0 * spin * np.array([x, y])) * weight / square
        else:
            values[of] = around
        _add_forms(model, rows, 'angle', state, values, rates, to)


def _values(model: Model, rows: Rows, state: State) -> tuple[Floats, Floats]:
    """(rows,) the values of forms, and their rates."""
    values, rates = np.zeros(rows.c.size), np.zeros(rows.c.size)
    g, g2 = np.zeros(0), np.zeros(rows.b.size)
    kernel.violation(model.unit, rows, state.q, values)
    kernel.jacobian(model.unit, rows, state.q, g, g2)
    kernel.times_jacobian(model.unit, rows, g, g2, state.qd, rates)
    return values, rates


def _add_forms(
    model: Model,
    rows: Rows,
    name: str,
    state: State,
    by_value: Floats,
    by_rate: Floats,
    to: Bars,
) -> None:
    """∂J/∂ the values of forms and ∂J/∂ their rates, into ∂J/∂ the state and ∂J/∂ the arrays of
    the forms."""
    unit, D = model.unit, model.layout.dimension
    g, g2, g2d = np.zeros(0), np.zeros(rows.b.size), np.zeros(rows.b.size)
    kernel.jacobian(unit, rows, state.q, g, g2)
    kernel.jacobian_rate(unit, rows, state.qd, g2d)
    kernel.add_transposed(unit, rows, g, g2, by_value, to.q)
    kernel.add_transposed(unit, rows, g, g2d, by_rate, to.q)
    kernel.add_transposed(unit, rows, g, g2, by_rate, to.qd)
    b, c, term = (to.arrays[f'{name}_{part}'] for part in ('b', 'c', 'term'))
    q, qd = state.q.reshape(-1, D), state.qd.reshape(-1, D)
    b, term = b.reshape(-1, D), term.reshape(-1, D, D)
    c += by_value
    for r in np.flatnonzero((by_value != 0.0) | (by_rate != 0.0)).tolist():
        for e in range(int(rows.first[r]), int(rows.first[r + 1])):
            at = int(rows.block[e])
            b[e] += by_value[r] * q[at] + by_rate[r] * qd[at]
            for s in range(int(rows.first_term[e]), int(rows.first_term[e + 1])):
                along = 0.5 * by_value[r] * q[at] + by_rate[r] * qd[at]
                term[s] += np.outer(along, q[int(rows.term_block[s])])
