"""Families of constraint rows: what the kernel computes of their arrays, Φ, Φ_q q̇ and Φ̇_q q̇,
against the complex step of the family's own function.

The function runs as it is written, but what it calls to make a row (`linear`, `product`, `motion`,
…) computes the row's value instead. Families are found: every function of the model that makes
rows, and every type of joint. One without an example fails by its name.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
import pytest

import alf_ros.model
from alf_ros import kernel, load_scene
from alf_ros.arrays import Floats
from alf_ros.kernel import Rows
from alf_ros.mechanism import Coupling, Drive, Mechanism, Rotor, affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.mechanism.time_function import TIME
from alf_ros.model import joints, member_rows
from alf_ros.model.assembly import held
from alf_ros.model.compile import Model, compile_model
from alf_ros.model.constraints import ball_axes, row, rows
from alf_ros.model.constraints.meshing import integrals
from alf_ros.model.constraints.packing import rows_of
from alf_ros.model.constraints.velocity_integral import angle_between, rate_between
from alf_ros.model.joints.contract import JointType
from alf_ros.scene.mechanism_file import drives
from alf_ros.scene.scene import scene_from_text
from support import joint_cases
from support.ball_scene import BALLS
from support.complex_step import FUNCTIONS, Complex, H, Rebound, slope
from support.driven_mechanisms import BELT
from support.some_scenes import SOME_SCENES

EXACT = 3e-14  # of the row, or beside 1 m: a hundred roundings
Places = Any  # (blocks, D) real or complex


@dataclass(frozen=True)
class Written:
    """A row as its family writes it: its value at places, or its slip at places and rates."""

    name: str
    of: Callable[..., Any]
    velocity: bool = False

    def on(self, blocks: Sequence[int], name: str) -> Written:
        return Written(name, lambda q: self.of(q[list(blocks)]))


def _linear(name: str, along: Floats, f: Form, offset: float = 0.0) -> Written:
    return Written(name, lambda q: along @ f.value(q) - offset)


def _product(name: str, f: Form, g: Form, offset: float = 0.0) -> Written:
    return Written(name, lambda q: f.value(q) @ g.value(q) - offset)


def _motion(name: str, *pairs: tuple[Form, Form]) -> Written:
    def slip(q: Places, qd: Places) -> Any:
        return sum(f.value(q) @ (g.value(qd) - g.constant) for f, g in pairs)

    return Written(name, slip, velocity=True)


def _plus(name: str, *parts: Written) -> Written:
    return Written(name, lambda q: sum(part.of(q) for part in parts))


def _scaled(factor: float, one: Written) -> Written:
    return Written(one.name, lambda q: factor * one.of(q))


def _distance(one: row.Distance, q: Places) -> Any:
    gap = q[one.end] - q[one.start]
    return 0.5 * (gap @ gap - one.length**2)


def _written_type(kind: JointType) -> JointType:
    return replace(kind, rows=written(kind.rows), integral=written(kind.integral))


INSTEAD: dict[Any, Any] = {
    row.Row: Written,
    row.Distance: row.Distance,
    row.linear: _linear,
    row.product: _product,
    row.motion: _motion,
    row.plus: _plus,
    row.scaled: _scaled,
    rows._held: lambda one, movable: one,  # leaves out what is rounding
    joints.type_of: lambda joint: _written_type(joints.type_of(joint)),
}
written = Rebound(INSTEAD, ('alf_ros.model.',))


# ----------------------------------------------------------------------------------- the families


def _families() -> Iterator[tuple[str, Any]]:
    for info in pkgutil.walk_packages(alf_ros.model.__path__, 'alf_ros.model.'):
        module = importlib.import_module(info.name)
        for name, found in vars(module).items():
            own = isinstance(found, FunctionType) and found.__module__ == info.name
            if own and found not in INSTEAD:
                returned = str(found.__annotations__.get('return', ''))
                if re.search(r'\b(Row|Distance|Constraint|IntegralTerm)\b', returned):
                    yield f'{info.name.rpartition(".")[2]}.{name}', found


FAMILIES = dict(_families())
TYPES = [(D, kind) for D in (2, 3) for kind in joints.types(D)]

# ----------------------------------------------------------------------------------- the examples


def _driven(mechanism: Mechanism) -> Mechanism:
    """The same, with drives of all its joint coordinates, a point and a distance, and rotors."""
    D, found = mechanism.dimension, mechanism.coordinates
    alone = [each.name for each in found if each.freedom.alone]
    axes = (TIME, None, TIME)[:D]
    first, *_, last = [point.name for point in mechanism.points if not point.fixed]
    kinds = {True: 'angle', False: 'length'}
    drives = [Drive(f'{x.name}_drive', kinds[x.is_angle], (x.name,), (TIME,)) for x in found]
    drives.append(Drive('there', 'point', (first,), axes))
    drives.append(Drive('apart', 'distance', (first, last), (TIME,)))
    rotors = [Rotor(f'{x}.rotor', ((x, 1.0),), 0.1) for x in alone]
    if alone:
        rotors.append(Rotor('all.rotor', tuple((x, -0.7) for x in alone), 0.1))
    return replace(mechanism, drives=tuple(drives), rotors=tuple(rotors))


def _with_couplings(mechanism: Mechanism) -> Mechanism:
    """The same, with all coordinates of its joints coupled to the first coordinate."""
    first, *others = [each.name for each in mechanism.coordinates if each.freedom.alone]
    of = {name: ((first, 0.3), (name, -2.0)) for name in others}
    coupled = tuple(Coupling(f'{name}_coupling', pair) for name, pair in of.items())
    return replace(mechanism, couplings=coupled)


def _examples() -> Iterator[tuple[str, Mechanism]]:
    for dimension, kind in TYPES:
        if (dimension, kind) in joint_cases.CASES:
            mechanism = joint_cases.scene_of(dimension, kind).mechanism
            name = f'{kind}_{dimension}'
            yield name, mechanism
            yield f'{name}_driven', _driven(mechanism)
            if sum(each.freedom.alone for each in mechanism.coordinates) > 1:
                yield f'{name}_coupled', _with_couplings(mechanism)
    yield 'belt', load_scene(BELT).mechanism
    yield 'balls', scene_from_text(BALLS).mechanism
    for name in SOME_SCENES:
        yield name, load_scene(name).mechanism


EXAMPLES = dict(_examples())


@cache
def _model(name: str) -> Model:
    return compile_model(EXAMPLES[name], 1e6)


# ---------------------------------------------------------------------------------------- the rows


def _of(one: Any, q: Places) -> Any:
    return _distance(one, q) if isinstance(one, row.Distance) else one.of(q)


def _is_velocity(one: Any) -> bool:
    return isinstance(one, Written) and one.velocity


def _slope(one: Any, q: Floats, v: Floats) -> float:
    """Of a row of positions along v."""
    return slope(_of(one, q + 1j * H * v))


def _expected(found: Sequence[Any], q: Floats, v: Floats) -> Floats:
    """(3, rows) Φ, Φ_q v and the rate of that along v, with v constant; of a row of velocities 0,
    its slip, and the rate of that."""
    numbers = np.zeros((3, len(found)))
    for n, one in enumerate(found):
        if _is_velocity(one):
            numbers[1:, n] = one.of(q, v), slope(one.of(q + 1j * H * v, v))
        else:  # Φ is of second order: Φ_q differs by its rate at q + v
            here = _slope(one, q, v)
            numbers[:, n] = _of(one, q), here, _slope(one, q + v, v) - here
    return numbers


def _computed(arrays: Rows, q: Floats, v: Floats) -> Floats:
    """The same by the kernel."""
    D = q.shape[1]
    unit, at, along = (0.0,) * D, q.ravel(), v.ravel()
    numbers = np.zeros((3, arrays.alpha.size))
    g, g2, g2d = np.zeros(arrays.i.size * D), np.zeros(arrays.b.size), np.zeros(arrays.b.size)
    kernel.violation(unit, arrays, at, numbers[0])
    kernel.jacobian(unit, arrays, at, g, g2)
    kernel.times_jacobian(unit, arrays, g, g2, along, numbers[1])
    kernel.jacobian_rate(unit, arrays, along, g2d)
    kernel.convective(unit, arrays, g2d, along, numbers[2])
    return numbers


def _compare(found: Sequence[Any], arrays: Rows, place: Any, layout: Layout) -> None:
    """place (rows,): of each row in the arrays."""
    random = np.random.default_rng(3)
    q, v = random.normal(size=(2, layout.blocks, layout.dimension))
    expected, computed = _expected(found, q, v), _computed(arrays, q, v)[:, place]
    for n, one in enumerate(found):
        scale = max(1.0, float(np.abs(expected[:, n]).max()))
        error = float(np.abs(computed[:, n] - expected[:, n]).max())
        assert error <= EXACT * scale, f'{one.name}: off by {error:.1e} of {scale:.1e}'


def _given(layout: Layout) -> dict[str, tuple[float | None, ...]]:
    """A component of a point, and one of a vector."""
    names = [*layout.of_point][:1] + [*layout.of_vector][:1]
    components = (0.3, *(layout.dimension - 1) * (None,))
    return dict.fromkeys(names, components)


def _made(model: Model) -> Iterator[tuple[Sequence[Any], Rows, Any]]:
    """Rows as they are written, arrays of them, and the place of each there: of constraints, of
    counted angles, and of coordinates that are lengths, as the kernel has them; of all of these;
    of balls with angles; of positions that are given."""
    layout, system = model.layout, model.system
    constraints, counted, lengths = written(member_rows._parts)(layout)
    yield constraints, system.rows, model.row
    yield counted, system.angles, np.arange(len(counted))
    yield lengths, model.lengths, np.arange(len(lengths))
    balls = [joint for joint in model.mechanism.joints if joint.angles]
    others: list[tuple[Any, tuple[Any, ...]]] = [(member_rows._made, (layout,))]
    others += [(ball_axes._rows, (ball, layout)) for ball in balls]
    others.append((held, (model, _given(layout))))
    for function, arguments in others:
        arrays, order = rows_of(function(*arguments), layout)
        yield written(function)(*arguments), arrays, np.argsort(order)


@pytest.mark.parametrize('example', EXAMPLES)
def test_rows_have_their_derivatives(example: str) -> None:
    model = _model(example)
    constraints, *_ = checked = list(_made(model))
    assert len(constraints[0]) == len(model.row_names)
    for found, arrays, place in checked:
        _compare(found, arrays, place, model.layout)


@pytest.mark.parametrize('example', [name for name, of in EXAMPLES.items() if not of.drives])
def test_integrals_of_rows_of_velocities(example: str) -> None:
    """The slope of the sum of angles and lengths is the slip, along all motions of the blocks from
    where bodies are rigid, as the mechanism is drawn, also along those that deform bodies."""
    model = _model(example)
    found = written(integrals)(model.layout)
    of_joint = {joint.name: joint for joint in model.mechanism.joints}
    found = [one for one in found if one.name not in of_joint or not of_joint[one.name].motion]
    if not found:
        return
    q = model.q.reshape(model.layout.blocks, model.layout.dimension)
    v = np.zeros(q.size)
    v[: model.n] = np.random.default_rng(5).normal(size=model.n)
    slips = _computed(model.system.rows, q, v.reshape(q.shape))[1]
    moving = q + 1j * H * v.reshape(q.shape)
    for one in found:
        slip = slips[model.row[model.row_names.index(one.name)]]
        total, sizes = 0.0, [abs(slip)]
        for term in one.terms:
            parts = [Complex(complex(each.of(moving))) for each in term.rows]
            x = FUNCTIONS['atan2'](parts[1], parts[0]) if term.is_angle else parts[0]
            total += term.factor * slope(x)
            sizes.append(abs(term.factor * slope(x)))
        assert max(sizes) > 1e-3
        assert total == pytest.approx(slip, rel=0, abs=1e-12 * max(sizes)), one.name


@pytest.mark.parametrize('stands', [False, True])
@pytest.mark.parametrize('angle', [0.0, 0.7, -2.9])
def test_rate_of_an_angle(angle: float, stands: bool) -> None:
    """It is the gradient of the angle also where the four axes leave their plane and lengths."""
    random = np.random.default_rng(8)
    X, Y = np.linalg.qr(random.normal(size=(3, 3)))[0][:2]
    x, y = np.cos(angle) * X + np.sin(angle) * Y, np.cos(angle) * Y - np.sin(angle) * X
    q, v = np.array([x, y, X, Y]), random.normal(size=(4, 3))
    child, parent = ((affine.of_block(n, 3), affine.of_block(n + 1, 3)) for n in (0, 2))
    if stands:
        parent, v[2:] = (affine.constant(tuple(X)), affine.constant(tuple(Y))), 0.0
    rows = written(angle_between)(-0.4, parent, child).rows
    cosine, sine = (Complex(complex(row.of(q + 1j * H * v))) for row in rows)
    turning = _motion('', *rate_between(-0.4, parent, child)).of(q, v)
    assert FUNCTIONS['atan2'](sine, cosine).z.real == pytest.approx(angle, abs=1e-15)
    assert turning == pytest.approx(-0.4 * slope(FUNCTIONS['atan2'](sine, cosine)), rel=1e-13)
    assert abs(turning) > 1e-3


# ----------------------------------------------------------------------------------- none is left


@cache
def _reached() -> frozenset[Any]:
    """The families of which the examples have rows."""
    for model in map(_model, EXAMPLES):
        list(_made(model))
        written(integrals)(model.layout)
    return frozenset(written.called)


@pytest.mark.parametrize('family', FAMILIES)
def test_every_family_has_an_example(family: str) -> None:
    assert FAMILIES[family] in _reached(), f'{family}: no example has rows of it'


@pytest.mark.parametrize(('dimension', 'kind'), TYPES)
def test_every_type_of_joint_has_an_example(dimension: int, kind: str) -> None:
    assert (dimension, kind) in joint_cases.CASES, f'{kind}: no joint of it in {dimension} D'


def test_every_way_to_drive_has_an_example() -> None:
    ways = {(what, how) for what, each in drives.OF.items() for how in each}
    known = {'angle': ('joint', 'angle'), 'length': ('joint', 'length')}
    known |= {'point': ('point', 'at'), 'distance': ('points', 'length')}
    shown = {known[drive.kind] for each in EXAMPLES.values() for drive in each.drives}
    assert shown == ways
