"""The coordinates of a step: what turns uniformly is exact, and their rates are what they say."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numba import njit

from alf_ros import Simulation, kernel, load_scene
from alf_ros.kernel import arc_coordinates as chart
from alf_ros.model.compile import allocate, compile_model
from alf_ros.scene.scene import scene_from_text
from support.thorough import thinned

ARM = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [0.6, 0.8]}
    B: {at: [1.4, 0.2]}
    C: {at: [1.5, 1.1]}
    L: {at: [3, 3]}
    M: {at: [4, 3]}
  bodies:
    upper: {points: [O, A], mass: 1.0, inertia: rod}
    fore: {points: [A, B, C], mass: 0.5, inertia: {about_com: 0.1}, com: [0.2, 0.1]}
    loose: {points: [L, M], mass: 0.2, inertia: rod}
  joints:
    shoulder: {type: revolute, between: [ground, upper], at: O}
    elbow: {type: revolute, between: [upper, fore], at: A}
"""

ARM_IN_SPACE = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [0.6, 0.8, 0.1]}
    B: {at: [1.4, 0.2, 0.5]}
  bodies:
    upper: {points: [O, A], mass: 1.0, inertia: {about_com: [0.1, 0.2, 0.15]}, com: [0.4, 0.1, 0]}
    fore: {points: [A, B], mass: 0.5, inertia: {about_com: [0.05, 0.06, 0.07]}, com: [0.3, 0, 0]}
  joints:
    shoulder: {type: spherical, between: [ground, upper], at: O}
    elbow: {type: revolute, between: [upper, fore], at: A, axis: [0, 0.6, 0.8]}
"""

SPUN = """
mechanism:
  alf: 1
  points: {O: {at: [0, 0], fixed: true}, A: {at: [0.6, 0.8]}, B: {at: [1.4, 0.2]}}
  bodies: {wheel: {points: [O, A, B], mass: 1.0, inertia: {about_com: 0.3}, com: [0, 0]}}
  joints: {axle: {type: revolute, between: [ground, wheel], at: O}}
initial: {velocities: {A: [-32.0, 24.0]}}
"""

SPUN_IN_SPACE = """
mechanism:
  alf: 1
  space: spatial
  points: {O: {at: [0, 0, 0], fixed: true}, A: {at: [0.3, 0.4, 0.5]}}
  bodies:
    wheel: {points: [O, A], mass: 1.0, inertia: {about_com: [0.1, 0.2, 0.25]}, com: [0, 0, 0]}
  joints: {axle: {type: revolute, between: [ground, wheel], at: O, axis: [0.6, 0, 0.8]}}
initial: {velocities: {A: [-12.8, -2.4, 9.6]}}
"""


@njit
def lay(unit, system, work, phase):
    arcs = chart.choose_arcs(unit, system, work, phase, 1.0)
    chart.begin_momenta(unit, system, work, phase, arcs)


@njit
def unfold(unit, system, work, phase):
    chart.unfold(unit, system, work, phase)


@njit
def fold(unit, system, work):
    chart.fold(unit, system, work, work.qd, work.qdd, np.uint64(0))


@njit
def straighten(unit, system, work):
    chart.straighten(unit, system.arms, work.chart, work.sum)


@njit
def straighten_momenta(unit, system, work):
    chart.straighten_momenta(unit, system.arms, work.chart, work.p)


class Laid:
    """A mechanism that moves, with the coordinates of a step chosen, and a path in them."""

    def __init__(self, text):
        self.model = model = compile_model(scene_from_text(text).mechanism, 1e7)
        self.work = allocate(model, model.system, 1)
        self.random, self.n = np.random.default_rng(3), model.n
        qd, empty = np.zeros(model.q.size), np.zeros(0)
        qd[: self.n] = self.random.normal(size=self.n)
        if model.layout.dimension == 3:  # all of it turns about one axis: there are arcs
            omega, places = self.random.normal(size=3), model.q.reshape(-1, 3)
            qd[: self.n] = np.cross(omega, places).ravel()[: self.n]
            self.work.pull[:] = np.cross(omega, np.cross(omega, places)).ravel()
        self.work.bend[: self.n] = self.random.normal(size=self.n)
        turns = np.zeros(0, dtype=np.int64)
        self.phase = kernel.Phase(model.q.copy(), qd, turns, np.ones(1), empty)
        self.every = model.unit, model.system, self.work
        lay(*self.every, self.phase)
        assert self.work.chart.curvature.any()
        self.path = 0.3 * self.random.normal(size=(3, self.n))

    def xi(self, t):
        """ξ and ξ̇ (n,) after t on the path, which begins as the step does."""
        rate = self.work.chart.rate
        powers = np.array([t**2, t**3, t**4]), np.array([2 * t, 3 * t**2, 4 * t**3])
        return rate * t + powers[0] @ self.path, rate + powers[1] @ self.path

    def unfolded(self, xi, rate, w=0.0):
        """q, q̇ and p (n,) of ξ, ξ̇, w."""
        work, n = self.work, self.n
        work.q[:n], work.qd[:n], work.p[:] = xi, rate, w
        unfold(*self.every, self.phase)
        return work.q[:n].copy(), work.qd[:n].copy(), work.p.copy()

    def momenta(self, t):
        """w = Jᵀ M q̇, with J column by column."""
        xi, rate = self.xi(t)
        J = np.array([self.unfolded(xi, e)[1] for e in np.eye(self.n)]).T
        p, qd = np.zeros(self.n), np.zeros(self.model.q.size)
        qd[: self.n] = J @ rate
        kernel.add_mass_times(self.model.unit, self.model.system.mass, 1.0, qd, p)
        return J.T @ p


@pytest.fixture(params=[ARM, ARM_IN_SPACE], ids=['plane', 'space'])
def laid(request):
    return Laid(request.param)


def test_a_step_begins_where_the_mechanism_is(laid):
    chart, n = laid.work.chart, laid.n
    q, qd, p = laid.unfolded(np.zeros(n), chart.rate, chart.momentum)
    assert q == pytest.approx(laid.phase.q[:n], abs=1e-14)
    assert qd == pytest.approx(laid.phase.qd[:n], abs=1e-13)
    wanted = np.zeros(n)
    kernel.add_mass_times(laid.model.unit, laid.model.system.mass, 1.0, laid.phase.qd, wanted)
    assert p == pytest.approx(wanted, abs=1e-13)
    assert chart.momentum == pytest.approx(laid.momenta(0.0), abs=1e-13)


def test_momenta_are_canonical(laid):
    """w·ξ̇ = p·q̇ whatever the rates."""
    xi, _ = laid.xi(0.13)
    for _ in range(5):
        rate, w = laid.random.normal(size=(2, laid.n))
        _, qd, p = laid.unfolded(xi, rate, w)
        assert p @ qd == pytest.approx(w @ rate, rel=1e-12)


def test_rates_are_derivatives(laid):
    t, d, n = 0.13, 1e-4, laid.n
    (before, before_qd, _), (after, after_qd, _) = (
        laid.unfolded(*laid.xi(at)) for at in (t - d, t + d)
    )
    momenta = [laid.momenta(at) for at in (t - d, t, t + d)]
    xi, rate = laid.xi(t)
    _, qd, _ = laid.unfolded(xi, rate, momenta[1])
    assert (after - before) / (2 * d) == pytest.approx(qd, abs=1e-6)
    laid.work.qdd[:n] = (after_qd - before_qd) / (2 * d)
    laid.work.chart.w[:] = momenta[1]
    fold(*laid.every)
    xi_d, xi_dd, w_d = laid.work.k.reshape(3, laid.n)
    assert xi_d == pytest.approx(rate, abs=1e-12)
    assert xi_dd == pytest.approx(np.array([2.0, 6 * t, 12 * t**2]) @ laid.path, abs=1e-5)
    assert w_d == pytest.approx((momenta[2] - momenta[0]) / (2 * d), abs=1e-5)


def test_small_differences_are_those_of_places_and_momenta(laid):
    t, d = 0.13, 1e-6
    xi, rate = laid.xi(t)
    w, *change = laid.random.normal(size=(3, laid.n))
    q, _, p = laid.unfolded(xi, rate, w)
    moved, _, _ = laid.unfolded(xi + d * change[0], rate, w)
    _, _, more = laid.unfolded(xi, rate, w + d * change[1])
    laid.work.sum[:], laid.work.p[:] = d * change[0], d * change[1]
    straighten(*laid.every)
    straighten_momenta(*laid.every)
    assert laid.work.sum == pytest.approx(moved - q, abs=1e-10)
    assert laid.work.p == pytest.approx(more - p, abs=1e-14)


def test_points_turn_about_their_neighbours():
    model = compile_model(scene_from_text(ARM).mechanism, 1e7)
    block, about = model.layout.of_point, model.system.arms.about
    assert about[block['A']] == block['O']
    assert about[block['B']] == about[block['C']] == block['A']
    ends = sorted(about[block[name]] for name in 'LM')  # a body that floats
    assert ends[0] == kernel.FREE and ends[1] in (block['L'], block['M'])
    order = model.system.arms.order.tolist()
    assert sorted(order) == list(range(model.layout.movable))
    for name in 'BC':
        assert order.index(block['A']) < order.index(block[name])
    model = compile_model(scene_from_text(ARM_IN_SPACE).mechanism, 1e7)
    vectors = [each for each in model.layout.of_vector.values() if each < model.layout.movable]
    assert all(model.system.arms.about[each] == kernel.ORIGIN for each in vectors)


def turned_in(simulation, t):
    start = simulation.sample().joint_positions[0]
    *_, last = simulation.run(t)
    return last.joint_positions[0] - start


@pytest.mark.parametrize(('text', 'error'), [(SPUN, 1e-11), (SPUN_IN_SPACE, 1e-8)])
@pytest.mark.parametrize(('integrator', 'step'), [('rk4', 0.02), ('dop853', 0.05)])
def test_what_turns_uniformly_is_exact_whatever_the_step(text, error, integrator, step):
    """0.8 rad and 2 rad a step, of which places would know the first digit; in space to what one
    solve tells of the axis."""
    simulation = Simulation(scene_from_text(text), integrator=integrator, step=step)
    assert turned_in(simulation, 1.0) == pytest.approx(40.0, abs=error)


@pytest.mark.parametrize('text', [SPUN, SPUN_IN_SPACE])
def test_adaptive_steps_stay_so_short_that_turns_are_counted(text):
    options: dict[str, Any] = {'integrator': 'dop853_adaptive', 'tolerance': 1e-3}
    simulation = Simulation(scene_from_text(text), step=1.0, **options)
    assert turned_in(simulation, 3.0) == pytest.approx(120.0, abs=1e-9)
    assert simulation.evaluations == pytest.approx(12 * 120 / 1.5, rel=0.1)


@pytest.mark.parametrize(
    'name', thinned(['slider_crank', 'double_four_bar'], keep=['slider_crank'])
)
def test_rounding_goes_no_way(name):
    """Frames rounded the same way in every step would gain 1e-16 of the energy in each."""
    simulation = Simulation(load_scene(name), integrator='dop853', step=2.5e-3)
    before = simulation.sample().energy
    simulation.step(240_000)
    assert simulation.sample().energy == pytest.approx(before, rel=5e-12)


@njit
def short_sine(x):
    return chart._short_sine(x)


def test_the_sine_of_a_short_turn_is_right_to_its_last_digit():
    """Against the series in rational numbers, whose error is below 1e-30."""
    for x in np.random.default_rng(2).uniform(-0.8, 0.8, 300).tolist():
        exact = term = Fraction(x)
        for k in range(1, 16):
            term *= -(Fraction(x) ** 2) / (2 * k * (2 * k + 1))
            exact += term
        assert abs(Fraction(short_sine(x)) - exact) <= Fraction(0.75 * math.ulp(float(exact)))
