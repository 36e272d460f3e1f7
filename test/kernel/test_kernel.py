"""The compiled maths against dense linear algebra, finite differences and the paper's Table I."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from alf_ros import Simulation, kernel, load_scene
from alf_ros.arrays import Floats
from alf_ros.model.compile import Model, allocate, compile_model
from alf_ros.model.rank import effective_rank
from alf_ros.scene.scene import scene_from_text

# a truss of bars, with a body of four points and an off-axis centre of mass, a guide askew, fixed
# ends
TRUSS = """
alf: 1
space: planar
points:
  O: {at: [0, 0], fixed: true}
  P: {at: [0, 1], fixed: true}
  A: {at: [1, 0.1]}
  B: {at: [1.1, 1.2]}
  C: {at: [2.0, 0.3]}
  D: {at: [2.2, 1.1]}
  E: {at: [2.9, 0.6]}
bodies:
  floor: {points: [O, A], mass: 1.5, inertia: rod}
  roof: {points: [B, P], mass: 0.7, inertia: {about_com: 0.2}, com: [0.4, 0.15]}
  plate: {points: [A, B, C, D], mass: 2.0, inertia: {about_com: 0.9}, com: [0.3, -0.5]}
  arm: {points: [D, E], mass: 0.4, inertia: rod}
  puck: {points: [E], mass: 0.3, inertia: point}
joints:
  o: {type: revolute, between: [ground, floor], at: O}
  p: {type: revolute, between: [ground, roof], at: P}
  a: {type: revolute, between: [floor, plate], at: A}
  b: {type: revolute, between: [plate, roof], at: B}
  d: {type: revolute, between: [plate, arm], at: D}
  e: {type: revolute, between: [arm, puck], at: E}
  way: {type: slider, point: E, between: [ground, puck], on: {through: [2.9, 0.6], direction: [1,
  2]}}
"""


def truss() -> Model:
    text = 'mechanism:\n' + '\n'.join('  ' + line for line in TRUSS.splitlines())
    return compile_model(scene_from_text(text).mechanism, 1e4)


def dense_jacobian(model: Model, q: Floats) -> Floats:
    """Φ_q by the kernel's own product with unit vectors, (rows, n)."""
    work = allocate(model, model.system, 1)
    kernel.jacobian(model.unit, model.system.rows, q, work.g, work.g2)
    columns = []
    for n in range(model.n):
        v, out = np.zeros(model.q.size), np.zeros(work.r2.size)
        v[n] = 1.0
        kernel.times_jacobian(model.unit, model.system.rows, work.g, work.g2, v, out)
        columns.append(out)
    return np.array(columns).T


def dense_mass(model: Model) -> Floats:
    columns = []
    for n in range(model.n):
        v, out = np.zeros(model.q.size), np.zeros(model.n)
        v[n] = 1.0
        kernel.add_mass_times(model.unit, model.system.mass, 1.0, v, out)
        columns.append(out)
    return np.array(columns).T


def violation(model: Model, q: Floats) -> Floats:
    work = allocate(model, model.system, 1)
    kernel.violation(model.unit, model.system.rows, q, work.r2)
    return work.r2


def disturbed(model: Model) -> Floats:
    q = model.q.copy()
    q[: model.n] += 0.1 * np.random.default_rng(1).standard_normal(model.n)
    return q


def test_jacobian_is_the_derivative_of_the_constraints() -> None:
    model = truss()
    q, e = disturbed(model), 1e-5
    columns = []
    for n in range(model.n):
        step = np.zeros(q.size)
        step[n] = e
        columns.append((violation(model, q + step) - violation(model, q - step)) / (2 * e))
    # central differences are exact for quadratic forms, up to rounding
    assert dense_jacobian(model, q) == pytest.approx(np.array(columns).T, abs=1e-9)


def test_drawing_satisfies_the_constraints() -> None:
    model = truss()
    assert violation(model, model.q) == pytest.approx(0.0, abs=1e-14)


def test_transposed_product_and_rate_agree_with_the_jacobian() -> None:
    model = truss()
    random, rows, unit = np.random.default_rng(2), model.system.rows, model.unit
    q, work = disturbed(model), allocate(model, model.system, 1)
    phi_q = dense_jacobian(model, q)
    y, qd = random.standard_normal(phi_q.shape[0]), np.zeros(q.size)
    qd[: model.n] = random.standard_normal(model.n)
    kernel.jacobian(unit, rows, q, work.g, work.g2)
    kernel.add_transposed(unit, rows, work.g, work.g2, y, work.delta)
    assert work.delta[: model.n] == pytest.approx(phi_q.T @ y, abs=1e-13)
    e = 1e-4
    rate = (dense_jacobian(model, q + e * qd) - dense_jacobian(model, q - e * qd)) / (2 * e)
    kernel.jacobian_rate(unit, rows, qd, work.g2d)
    kernel.convective(unit, rows, work.g2d, qd, work.r2)
    assert work.r2 == pytest.approx(rate @ qd[: model.n], abs=1e-9)


def test_mass_matrix_gives_the_kinetic_energy_of_rigid_bodies() -> None:
    """½ q̇ᵀMq̇ against ½ m v² + ½ J ω² of each body, for velocities that keep the bodies rigid."""
    scene = load_scene('four_bar')
    sim = Simulation(scene)
    sim.step(137)
    sample, model = sim.sample(), sim.model
    expected = 0.0
    for body, spin in zip(scene.mechanism.bodies, sample._spins, strict=True):
        first, second = (sample.points[name] for name in body.points[:2])
        x = (second - first) / np.linalg.norm(second - first)
        com = body.com[0] * x + body.com[1] * np.array([-x[1], x[0]])
        v = sample.velocities[body.points[0]] + spin * np.array([-com[1], com[0]])
        assert isinstance(body.inertia, float)
        expected += 0.5 * body.mass * v @ v + 0.5 * body.inertia * spin**2
    qd = sim.state.qd[: model.n]
    assert 0.5 * qd @ dense_mass(model) @ qd == pytest.approx(expected, rel=1e-12)


def of_library(name: str, **parameters: float) -> Model:
    return compile_model(load_scene(name, parameters=parameters).mechanism, 1e6)


MODELS = {
    'truss': truss,
    'chain': lambda: compile_model(chain(12), 1e6),
    'one block': lambda: of_library('pendulum'),
    'in space': lambda: of_library('bricard'),
    'with fill': lambda: of_library('stewart_platform'),
    'four-bars': lambda: of_library('n_four_bar', N=9),
}


@pytest.mark.parametrize('name', MODELS)
def test_factor_solves_with_the_leading_matrix(name: str) -> None:
    model = MODELS[name]()
    q, work = disturbed(model), allocate(model, model.system, 1)
    assert kernel.linearise(model.unit, model.system, work, q)
    phi_q = dense_jacobian(model, q)
    A = dense_mass(model) + phi_q.T @ np.diag(model.system.rows.alpha) @ phi_q
    x = np.random.default_rng(3).standard_normal(model.n)
    work.delta[: model.n] = A @ x
    kernel.solve(model.unit, model.system.pattern, work.diagonal, work.off, work.delta)
    assert work.delta[: model.n] == pytest.approx(x, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize('make', [truss, lambda: compile_model(chain(12), 1e6)])
def test_rank_is_the_trace_of_the_dense_projector(make) -> None:
    model = make()
    q, work = disturbed(model), allocate(model, model.system, 1)
    assert kernel.linearise(model.unit, model.system, work, q)
    phi_q, M = dense_jacobian(model, q), dense_mass(model)
    A = M + phi_q.T @ np.diag(model.system.rows.alpha) @ phi_q
    expected = model.n - np.trace(np.linalg.solve(A, M))
    assert effective_rank(model, work) == pytest.approx(expected, abs=1e-9)
    assert round(expected) == np.linalg.matrix_rank(phi_q)


def test_factor_refuses_what_has_neither_mass_nor_constraint() -> None:
    model = truss()
    rows = replace(model.system.rows, alpha=np.zeros_like(model.system.rows.alpha))
    pattern = model.system.pattern
    hollow = replace(pattern, mass_diagonal=np.zeros_like(pattern.mass_diagonal))
    work = allocate(model, model.system, 1)
    system = replace(model.system, rows=rows, pattern=hollow)
    assert not kernel.linearise(model.unit, system, work, model.q)


def test_fill_of_a_chain_is_that_of_a_band() -> None:
    """Order n: eliminating an n-four-bar fills nothing that minimum degree could avoid."""
    for n in (10, 200):
        blocks = compile_model(chain(n), 1e6).system.pattern.row.size
        assert blocks == n  # as many as couplers: no fill at all


def chain(n: int):
    return load_scene('n_four_bar', parameters={'N': n}).mechanism


def table_one(penalty: float, count: int) -> Floats:
    """Errors |q̈ - exact| after each iteration at 6.1 (θ = 45°, ẋ2 = -2), by the iteration of the
    step.

    The paper has no y2; here the guide holds it, with a penalty so large that it is as good as
    gone.
    """
    scene = load_scene('slider_crank')
    model = compile_model(scene.mechanism, 1.0)
    alpha = np.where(model.system.rows.length2.size > np.arange(3), penalty, 1e16)
    system = replace(model.system, rows=replace(model.system.rows, alpha=alpha))
    work = allocate(model, system, 1)
    A, B = (2 * model.layout.of_point[name] for name in 'AB')
    work.q[:] = model.q
    work.qd[A : A + 2] = -1.0, 1.0
    work.qd[B] = -2.0
    Q = np.zeros(model.n)
    Q[A + 1], Q[B + 1] = -9.81, -0.5 * 9.81
    assert kernel.linearise(model.unit, system, work, work.q)
    kernel.convective(model.unit, system.rows, work.g2d, work.qd, work.r2)
    work.r2[:] *= -1.0
    x = np.zeros(model.q.size)
    M = np.array([[4.0, 0, 1], [0, 4, 0], [1, 0, 2]]) / 6.0
    s = np.sqrt(0.5)
    phi_q = np.array([[s, s, 0.0], [-s, s, s]])
    whole = np.block([[M, phi_q.T], [phi_q, np.zeros((2, 2))]])
    exact = np.linalg.solve(whole, np.array([0.0, -9.81, 0.0, -2.0, -2.0]))[:3]
    errors = []
    for _ in range(count):
        kernel.augmented(model.unit, system, work, Q, x, kernel.Until(1, 0.0, 1.0))
        errors.append(np.linalg.norm(x[[A, A + 1, B]] - exact))
    return np.array(errors)


def test_table_one_to_its_printed_digits() -> None:
    errors = table_one(1e4, 4)
    assert errors[:2] == pytest.approx([6.5792e-4, 4.3705e-8], rel=1e-5 / 4)
    assert errors[2] == pytest.approx(2.9206e-12, rel=1e-3)  # 2e-15 of rounding in 3e-12
    assert errors[3] < 1e-14


@pytest.mark.parametrize('penalty', [1e4, 1e6, 1e8, 1e10, 1e11])
def test_penalty_costs_no_precision(penalty: float) -> None:
    assert table_one(penalty, 4)[3] < 1e-14
