"""A number of a state, with its derivatives by the state and by the arrays of the problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.kernel import Rows
from alf_ros.model.compile import Model
from alf_ros.simulation.displaced_scenes import DisplacedScenes
from alf_ros.simulation.named_number import NamedNumber, named_number, number_of
from alf_ros.simulation.named_quantity import NamedQuantity
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.state import State
from alf_ros.studies.gradients.bars import Bars
from alf_ros.studies.gradients.free_directions import AlongFreeDirections


class Derivatives(Protocol):
    """Of the components of a quantity."""

    def add(self, sample: Sample, weights: Floats, to: Bars) -> None:
        """Add (components,) weights times the derivatives at a sample."""


@dataclass(frozen=True, eq=False)
class ObservedNumber:
    """A number by its name, and how the components of its quantity are differentiated."""

    named: NamedNumber
    _derivatives: Derivatives

    def value(self, sample: Sample) -> tuple[float, float]:
        """Its value in a sample, and the size of the values beside it (`read_beside`)."""
        found, size = self.named.quantity.read_beside(sample)
        return number_of(found, self.named.is_size), size

    def add(self, sample: Sample, weight: float, to: Bars) -> None:
        """Add `weight` times its derivatives at a sample. A magnitude has none where it is zero:
        raises InputError."""
        along: Floats = np.ones(1)
        if self.named.is_size:
            here = self.named.quantity.read(sample)
            size = number_of(here, is_size=True)
            if size == 0.0:
                where = f'zero at t = {sample.t:.6g} s'
                raise InputError(
                    f'no gradient of a magnitude that is {where}', value=self.named.text
                )
            along = here / size
        self._derivatives.add(sample, weight * along, to)


def observed_number(
    text: str, key: str, sample: Sample, beside: DisplacedScenes
) -> ObservedNumber:
    """The number of a text, as of `named_number`. `beside`: the scenes around this one. Raises
    InputError, which says `key`."""
    named = named_number(text, key, sample)
    return ObservedNumber(named, _derivatives(named.quantity, sample, beside))


def _derivatives(quantity: NamedQuantity, sample: Sample, beside: DisplacedScenes) -> Derivatives:
    """By formulas for places and joint coordinates; by differences along the free directions for
    all other quantities."""
    model, kind = sample.model, quantity.name.partition('.')[0]
    name = quantity.group.names[quantity.row].partition('.')[2]
    axes = range(len(quantity.group.components) or 1)
    if quantity.component is not None:
        axes = range(quantity.component, quantity.component + 1)
    if kind in ('points', 'velocities'):
        block = int(model.point_block[model.point_names.index(name)])
        D = model.layout.dimension
        return _Point([block * D + axis for axis in axes], kind == 'velocities')
    if kind == 'joints' and not name.endswith('.effort'):
        joint, _, what = name.rpartition('.')
        place = model.coordinate_names.index(joint)
        return _Joint(model, sample, place, what == 'velocity')
    return AlongFreeDirections(quantity, beside)


@dataclass(frozen=True, eq=False)
class _Point:
    at: Sequence[int]
    is_rate: bool

    def add(self, sample: Sample, weights: Floats, to: Bars) -> None:
        (to.qd if self.is_rate else to.q)[self.at] += weights


class _Joint:
    """A joint coordinate: atan2(y, x) of two quadratic forms, or a form; minus another one."""

    def __init__(self, model: Model, sample: Sample, n: int, is_rate: bool) -> None:
        joints = sample._instruments.coordinates
        self._model, self._is_rate = model, is_rate
        self._parts = [(int(joints.place[n]), 1.0)]
        if joints.less[n] >= 0:
            self._parts.append((int(joints.less[n]), -1.0))

    def add(self, sample: Sample, weights: Floats, to: Bars) -> None:
        model, state, weight = self._model, sample.state, float(weights[0])
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
