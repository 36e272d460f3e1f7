"""Arrays after renumbering or joining equal arrays made in that order; the fill of the factor."""

from __future__ import annotations

import gc
from dataclasses import fields

import numpy as np
import pytest

from alf_ros import InputError, kernel, load_scene, resources
from alf_ros.arrays import Floats
from alf_ros.kernel import Mass, Rows
from alf_ros.mechanism import affine
from alf_ros.model.compile import Model, compile_model, constraints, hold
from alf_ros.model.constraints.joint_coordinates import counted
from alf_ros.model.constraints.packing import rows_of
from alf_ros.model.constraints.row import linear
from alf_ros.model.mass import mass_of

SCENES = sorted(resources.library('scenes'))


def model_of(scene: str) -> Model:
    return compile_model(load_scene(scene).mechanism, 1e8)


def same(
    a: Rows | Mass, b: Rows | Mass, apart: tuple[str, ...] = ('alpha', 'scale', 'bend')
) -> None:
    for name in (field.name for field in fields(a) if field.name not in apart):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.mark.parametrize('scene', SCENES)
def test_renumbered_is_made_in_that_order(scene: str) -> None:
    model = model_of(scene)
    rows, order = rows_of(constraints(model.mechanism, model.layout), model.layout)
    same(model.system.rows, rows)
    assert np.argsort(order).tolist() == model.row.tolist()
    same(model.system.mass, mass_of(model.layout))


@pytest.mark.parametrize('scene', SCENES)
def test_gradients_are_products_with_whole_matrices(scene: str) -> None:
    model = model_of(scene)
    rows, D = model.system.rows, model.layout.dimension
    T = rows.term.reshape(-1, D, D)
    multiples = (T == T[:, :1, :1] * np.eye(D)).all(axis=(1, 2))
    np.testing.assert_array_equal(rows.full == 0, multiples if D == 3 else multiples & False)
    q = np.random.default_rng(1).normal(size=model.q.shape)
    wanted = rows.b.reshape(-1, D).copy()
    for e in range(rows.block.size):
        for s in range(int(rows.first_term[e]), int(rows.first_term[e + 1])):
            wanted[e] += T[s] @ q.reshape(-1, D)[rows.term_block[s]]
    g, g2 = np.zeros(rows.i.size * D), np.zeros(wanted.size)
    kernel.jacobian(model.unit, rows, q, g, g2)
    np.testing.assert_allclose(g2, wanted.ravel(), rtol=0.0, atol=1e-14 * np.abs(T).max(initial=1))


@pytest.mark.parametrize('velocities', [True, False])
@pytest.mark.parametrize('scene', ['coin', 'rack_and_pinion', 'stewart_platform', 'slider_crank'])
def test_what_is_held_joins_the_rows(scene: str, velocities: bool) -> None:
    model = model_of(scene)
    D, layout = model.layout.dimension, model.layout
    extra = [linear(f'held {n}', np.eye(D)[0], affine.of_block(n, D), 0.5) for n in (1, 0)]
    system, names, at = hold(model, extra, velocities)
    every = [*constraints(model.mechanism, layout), *extra]
    wanted = [row for row in every if velocities or not getattr(row, 'velocity', False)]
    rows, order = rows_of(wanted, layout)
    same(system.rows, rows)
    assert names == [wanted[n].name for n in order]
    assert names[at] == ['held 1', 'held 0']


@pytest.mark.parametrize('scene', ['four_bar', 'stewart_platform', 'scissor_lift'])
def test_the_pattern_is_that_of_the_factor(scene: str) -> None:
    model = model_of(scene)
    pattern, rows, mass = model.system.pattern, model.system.rows, model.system.mass
    n = model.layout.movable
    bound = {(int(i), int(j)) for i, j in zip(mass.i, mass.j, strict=True)}
    for row in constraints(model.mechanism, model.layout):
        ends = row[1:3] if isinstance(row, tuple) else row.blocks
        bound |= {(i, j) for i in ends for j in ends if j < i < n}
    below = [{i for i, j in bound if j == k} for k in range(n)]
    for k in range(n):  # what a column has below its first goes on to the column of that
        if below[k]:
            first = min(below[k])
            below[first] |= below[k] - {first}
    place: dict[tuple[int, int], int] = {}
    for k in range(n):
        start, end = int(pattern.first[k]), int(pattern.first[k + 1])
        assert pattern.row[start:end].tolist() == sorted(below[k])
        place |= {(int(i), k): start + s for s, i in enumerate(pattern.row[start:end])}
    wanted = []
    for k in range(n):
        column = sorted(below[k])
        wanted += [place[column[s], column[r]] for s in range(len(column)) for r in range(s)]
    assert pattern.target.tolist() == wanted
    for r in range(int(rows.both)):
        i, j = int(rows.i[r]), int(rows.j[r])
        assert pattern.distance[r] == place[max(i, j), min(i, j)]
    for e, f, at, _ in pattern.pair.tolist():
        assert at == place[int(rows.block[e]), int(rows.block[f])]


def test_angles_of_bodies_that_are_alike() -> None:
    model = model_of('n_four_bar')
    found = model.system.angles
    assert found.c.size == 2 * len(model.mechanism.bodies)
    g, places = np.zeros(found.b.size), model.q.reshape(-1, 2)
    g[:] = found.b
    xy: Floats = np.zeros(found.c.size)
    for r in range(found.c.size):
        for e in range(found.first[r], found.first[r + 1]):
            xy[r] += g[2 * e : 2 * e + 2] @ places[found.block[e]]
    for n, body in enumerate(model.mechanism.bodies):
        d = np.subtract(*(places[model.layout.of_point[p]] for p in body.points[::-1]))
        np.testing.assert_allclose(xy[2 * n : 2 * n + 2], d / np.linalg.norm(d), atol=1e-15)
    same(found, counted(model.layout), ())


def test_the_collector_goes_on_as_it_was() -> None:
    load_scene('pendulum')
    assert gc.isenabled()
    with pytest.raises(InputError, match='no such parameter'):
        load_scene('pendulum', {'nothing': 1.0})
    assert gc.isenabled()
    gc.disable()
    try:
        load_scene('pendulum')
        assert not gc.isenabled()
    finally:
        gc.enable()
