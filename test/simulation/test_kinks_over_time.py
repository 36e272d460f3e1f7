"""Tables and trajectories over time: steps end at their kinks, so no pulse is missed.

A rotor of 0.5 kg m² under a given torque has a motion in closed form; with a controller, and under
a driven pivot, an ordinary differential equation of one freedom, which scipy integrates piece by
piece.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from alf_ros import Simulation
from alf_ros.effects.contract.piecewise import spline_instants
from alf_ros.effects.contract.trajectory import Curve, through
from alf_ros.scene.scene import scene_from_text
from support.effect_scenes import ROTOR

ADAPTIVE = ['dop853_adaptive', 'esdirk43_adaptive']
FIXED = ['rk4', 'dop853', 'esdirk43']
J, T, AREA, BEGIN = 0.5, 1.0, 0.25, 0.30371
GRIDS = [1e-3, 0.1, 0.5]


def rotor(effects: str, step: float, integrator: str, **settings: Any) -> Simulation:
    scene = scene_from_text(f'{ROTOR}\neffects: {{{effects}}}\n')
    options = {'tolerance': 1e-9, **settings}
    return Simulation(scene, integrator=integrator, step=step, **options)


def pulse(width: float) -> list[list[float]]:
    """A torque of area AREA (N m s), from BEGIN on."""
    return [[BEGIN, 0.0], [BEGIN + 0.5 * width, 2.0 * AREA / width], [BEGIN + width, 0.0]]


def end(sim: Simulation) -> tuple[float, float]:
    sim.step(round(T / sim.h))
    found = sim.sample().joints['pin']
    return found.position, found.velocity


@pytest.mark.parametrize(
    ('integrator', 'step'), [*product(ADAPTIVE, GRIDS), *product(FIXED, GRIDS[:2])]
)
@pytest.mark.parametrize('width', [1e-5, 1e-3])
@pytest.mark.parametrize('by', ['user_table', 'motor', 'trajectory'])
def test_a_pulse_between_two_stages_acts(
    by: str, width: float, step: float, integrator: str
) -> None:
    rows = pulse(width)
    if by == 'trajectory':
        sim = rotor('', step, integrator)
        sim.apply_effort('pin', through([t for t, _ in rows], [(f,) for _, f in rows]))
    elif by == 'motor':
        sim = rotor(f'motor: {{joint: pin, effort: {rows}}}', step, integrator)
    else:
        sim = rotor(f'user_table: {{joint: pin, table: {rows}}}', step, integrator)
    angle, speed = end(sim)
    assert speed == pytest.approx(AREA / J, abs=1e-7)
    assert angle == pytest.approx(AREA / J * (T - BEGIN - 0.5 * width), abs=1e-7)


@pytest.mark.parametrize('integrator', [*ADAPTIVE, 'dop853'])
@pytest.mark.parametrize('step', GRIDS)
@pytest.mark.parametrize('count', [20, 400])
def test_a_bump_of_a_spline_acts(count: int, step: float, integrator: str) -> None:
    """A spline through zeros, but for one row: a bump of two rows, with its echoes."""
    t = np.linspace(0.0, T, count + 1)
    f = np.where(np.arange(t.size) == round(0.37 * count), 0.2 * count, 0.0)
    rows = np.column_stack([t, f]).tolist()
    table = f'user_table: {{joint: pin, table: {rows}, interpolation: cubic}}'
    spline = CubicSpline(t, f, bc_type='natural')
    angle, speed = end(rotor(table, step, integrator))
    assert abs(spline.integrate(0.0, T)) > 0.05
    assert speed == pytest.approx(spline.antiderivative()(T) / J, abs=1e-7)
    assert angle == pytest.approx(spline.antiderivative(2)(T) / J, abs=1e-7)


@pytest.mark.parametrize('integrator', ADAPTIVE)
@pytest.mark.parametrize('step', GRIDS)
def test_a_target_whose_speed_jumps(step: float, integrator: str) -> None:
    """The torque of a controller jumps where the slope of its table does: each step has the slope
    of its own piece."""
    rows = [[0.0, 0.0], [0.2, 0.0], [0.2005, 0.4], [0.5, 0.1], [0.7, 0.1]]  # 0.5, 0.2: grid points
    gain, damping = 40.0, 2.0
    effects = (
        f'motor: {{joint: pin, position: {rows}, position_gain: {gain}, velocity_gain: {damping}}}'
    )
    y, knots = np.zeros(2), [t for t, _ in rows] + [T]
    for (t0, x0), (t1, x1), last in zip(
        rows, [*rows[1:], [T, rows[-1][1]]], knots[1:], strict=True
    ):
        slope = (x1 - x0) / (t1 - t0)

        def rate(t: float, y: Any, x0: float = x0, t0: float = t0, slope: float = slope) -> Any:
            target = x0 + slope * (t - t0)
            return [y[1], (gain * (target - y[0]) + damping * (slope - y[1])) / J]

        y = solve_ivp(rate, (t0, last), y, 'DOP853', rtol=1e-12, atol=1e-13).y[:, -1]
    assert end(rotor(effects, step, integrator)) == pytest.approx(y, abs=2e-7)


@pytest.mark.parametrize('integrator', ADAPTIVE)
@pytest.mark.parametrize('step', GRIDS)
def test_a_drive_that_jerks_between_two_stages(step: float, integrator: str) -> None:
    """A pendulum, a rod of 1 kg and 1 m, whose pivot is moved aside within 4 ms."""
    rows = [[0.0, 0.0], [0.3, 0.0], [0.302, 0.05], [0.304, 0.1], [1.0, 0.1]]
    text = f"""
mechanism:
  alf: 1
  points:
    P: {{at: [0, 0]}}
    B: {{at: [0, -1]}}
  bodies:
    rod: {{points: [P, B], mass: 1.0, inertia: rod}}
drives:
  pivot: {{point: P, at: {{table: {[[t, x, 0.0] for t, x in rows]}}}}}
effects:
  gravity: {{acceleration: [0, -9.81]}}
"""
    sim = Simulation(scene_from_text(text), integrator=integrator, step=step, tolerance=1e-9)
    sim.step(round(T / sim.h))
    found = sim.sample().points['B']
    t, x = np.array(rows).T
    moved = CubicSpline(t, x, bc_type='clamped').derivative(2)

    def rate(t: float, y: Any) -> Any:  # θ from below
        return [y[1], -1.5 * (9.81 * np.sin(y[0]) + float(moved(t)) * np.cos(y[0]))]

    y = np.zeros(2)
    for begin, last in zip(t, t[1:], strict=False):
        y = solve_ivp(rate, (begin, last), y, 'DOP853', rtol=1e-12, atol=1e-13).y[:, -1]
    assert abs(y[0]) > 0.05
    assert found == pytest.approx([0.1 + np.sin(y[0]), -np.cos(y[0])], abs=1e-6)


def test_rows_on_the_grid_take_no_steps_of_their_own() -> None:
    """Rounding of times makes no crumbs: one step between two grid points, for a long time."""
    count, step = 3000, 0.1
    times = np.arange(count + 1) * step
    rows = np.column_stack([times, 0.1 * (-1.0) ** np.arange(count + 1)]).tolist()
    sim = rotor(f'user_table: {{joint: pin, table: {rows}}}', step, 'dop853_adaptive')
    sim.step(count)
    assert sim.evaluations <= 12 * count + 24
    assert sim.sample().joints['pin'].velocity == pytest.approx(0.0, abs=1e-9)


def test_known_kinks_are_not_searched_for() -> None:
    """A table of many rows costs a step for each row and no attempts that fail."""
    rows = [[0.01 * k, float(np.sin(0.3 * k))] for k in range(101)]
    sim = rotor(f'user_table: {{joint: pin, table: {rows}}}', 0.5, 'dop853_adaptive')
    end(sim)
    assert sim.evaluations <= 12 * 102 + 24


def test_derivatives_follow_through_a_pulse() -> None:
    scene = scene_from_text(
        f'{ROTOR}\neffects: {{user_table: {{joint: pin, table: {pulse(1e-4)}}}}}'
    )
    sim = Simulation(
        scene,
        integrator='dop853_adaptive',
        step=0.5,
        tolerance=1e-9,
        tangents=['rotor.inertia.about_com'],
    )
    sim.step(2)
    found = sim.sample().tangents['rotor.inertia.about_com'].joints['pin']
    assert found.velocity == pytest.approx(-AREA / J**2, rel=1e-7)


@pytest.mark.parametrize(
    'x',
    [
        [0.0, 1.0],
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        [0.0, 5.0, 5.001, 5.002, 9.0],
        np.sort(np.random.default_rng(3).uniform(0.0, 1.0, 60)).tolist(),
        np.cumsum(np.random.default_rng(4).lognormal(0.0, 3.0, 60)).tolist(),
    ],
    ids=['two', 'even', 'bump', 'uniform', 'lognormal'],
)
def test_parts_of_a_spline_are_at_most_four_of_its_gaps(x: list[float]) -> None:
    found = spline_instants(CubicSpline(x, np.square(x), bc_type='not-a-knot')).tolist()
    assert found[0] == x[0] and found[-1] == x[-1] and set(found) <= set(x)
    for begin, last in zip(found, found[1:], strict=False):
        inside = [t for t in x if begin <= t <= last]
        assert last - begin <= 4.0 * np.diff(inside).min() * (1.0 + 1e-12)


def test_a_curve_has_its_knots() -> None:
    curve = Curve(((0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0), (0.7, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0)))
    sim = rotor('', 1.0, 'dop853_adaptive')
    sim.apply_effort('pin', curve)
    assert end(sim)[1] == pytest.approx((0.5 * 0.2**2 + 0.2 * 0.3) / J, abs=1e-8)
