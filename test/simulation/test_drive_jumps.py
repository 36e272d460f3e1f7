"""Drives with corners: a rate that jumps ends the run, an acceleration that jumps does not."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import alf_ros
from alf_ros import Scene, Simulation, StepError, gradient, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.scene import FORMULATIONS


def cart(motion: str, **more: Any) -> Scene:
    """A driven pivot, from which a rod of 1 m hangs aside."""
    return load_scene(
        {
            'mechanism': {
                'alf': 1,
                'parameters': {'k': 5.0},
                'points': {'P': {'at': [0, 0]}, 'A': {'at': [0.8, -0.6]}},
                'bodies': {'rod': {'points': ['P', 'A'], 'mass': 1, 'inertia': 'rod'}},
            },
            'drives': {'cart': {'point': 'P', 'at': [motion, '0*t']}},
            'solver': {'step': 1e-3, 'integrator': 'dop853', **more},
        }
    )


def angle(acceleration: Callable[[float], float], begins: float, ends: float) -> float:
    """Of the rod, rad, on a pivot that accelerates (m/s²) from an instant on: at rest before."""

    def rates(t: float, y: Floats) -> Floats:
        return np.array([y[1], 1.5 * np.sin(y[0]) * acceleration(t)])

    first = [np.arctan2(-0.6, 0.8), 0.0]
    found = solve_ivp(rates, (begins, ends), first, rtol=1e-12, atol=1e-13, method='DOP853')
    return float(found.y[0, -1])


@pytest.mark.parametrize('t', [0.1, 0.10037, 0.2])
@pytest.mark.parametrize(
    'motion', ['2*max(t - {t}, 0)', 'abs(t - {t})', 'min(t, {t})', '-max({t}, t)']
)
@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive', 'esdirk43'])
def test_a_rate_that_jumps(t: float, motion: str, integrator: str) -> None:
    simulation = Simulation(cart(motion.format(t=t)), integrator=integrator)
    with pytest.raises(StepError, match=rf'the rate of cart jumps by [12] at t = {t:g} s') as told:
        simulation.step(300)
    assert told.value.t == simulation.t
    assert t - 1.001e-3 < simulation.t <= t
    with pytest.raises(StepError, match='jumps'):  # in the first step of a call
        simulation.step()


@pytest.mark.parametrize(
    'motion',
    [
        'sqrt((t - {t})**2)',
        '((t - {t})**2)**0.5',
        'hypot(t - {t}, 0)',
        'acos(cos(t - {t}))',
        'asin(sin(t - {t} + pi/2)) - pi/2',
        'sqrt(1 - cos(t - {t}))*sqrt(2)',
    ],
)
@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_corners_without_a_name(motion: str, integrator: str) -> None:
    """All are |t - 0.10037| beside that instant, where their rates are rounding."""
    simulation = Simulation(cart(motion.format(t=0.10037)), integrator=integrator)
    with pytest.raises(StepError, match='the rate of cart jumps by') as told:
        simulation.step(300)
    assert told.value.t == 0.1
    numbers = re.findall(r'jumps by (\S+) at t = (\S+) s', str(told.value))
    assert np.array(numbers[0], float) == pytest.approx([2.0, 0.10037], abs=0.01)


def test_roundings_at_a_corner_are_no_jump() -> None:
    """The rate begins at 1e-17 behind it."""
    simulation = Simulation(cart('5*max(sin(t) - sin(0.1), 0)**2'))
    simulation.step(300)

    def acceleration(t: float) -> float:
        return float(10.0 * (np.cos(t) ** 2 - (np.sin(t) - np.sin(0.1)) * np.sin(t)))

    at = simulation.sample().points
    off = at['A'] - at['P']
    assert np.arctan2(off[1], off[0]) == pytest.approx(angle(acceleration, 0.1, 0.3), abs=1e-7)


@pytest.mark.parametrize(
    'motion', ['hypot(sin(9*t), 0.5)', 'acos(0.9*cos(9*t))', '5*((t - 0.10037)**2)**1.5']
)
def test_rates_that_go_through_zero_are_no_jumps(motion: str) -> None:
    Simulation(cart(motion)).step(400)


@pytest.mark.parametrize('t', [0.1, 0.10037, 0.1 + 1e-15, 0.101 - 1e-14])
@pytest.mark.parametrize(
    ('integrator', 'off_by'),
    [('rk4', 1e-9), ('dop853', 2e-13), ('esdirk43', 1e-9), ('dop853_adaptive', 2e-13)],
)
def test_an_acceleration_that_jumps(integrator: str, off_by: float, t: float) -> None:
    """A step ends there: each method keeps its order, and a run in parts has its bits."""
    simulation, in_parts = (
        Simulation(cart(f'5*max(t - {t!r}, 0)**2'), integrator=integrator) for _ in range(2)
    )
    simulation.step(300)
    at = simulation.sample().points
    off = at['A'] - at['P']
    assert np.arctan2(off[1], off[0]) == pytest.approx(angle(lambda _: 10.0, t, 0.3), abs=off_by)
    for steps in (99, 1, 1, 1, 1, 197):
        in_parts.step(steps)
    assert simulation.state.q.tobytes() == in_parts.state.q.tobytes()


@pytest.mark.parametrize('integrator', ['dop853', 'dop853_adaptive'])
def test_derivatives_where_an_acceleration_jumps(integrator: str) -> None:
    """Steps end there also where tangents follow them, or the adjoint."""
    begins, ends, k, h = 0.10037, 0.3, 5.0, 1e-2
    scene = cart(f'k*max(t - {begins}, 0)**2', step=5e-3, integrator=integrator)
    by_adjoint = gradient(scene, 'final(points.A.x)', ['k'], ends)
    simulation = Simulation(scene, tangents=['k'])
    simulation.step(60)
    by_tangents = simulation.sample().tangents['k'].of('points.A.x')

    def at_end(factor: float) -> float:
        return angle(lambda _: 2.0 * factor, begins, ends)

    angles = [at_end(k + d * h) for d in (-2, -1, 1, 2)]
    slope = np.array([1.0, -8.0, 8.0, -1.0]) @ angles / (12.0 * h)
    exact = (ends - begins) ** 2 - np.sin(at_end(k)) * slope
    assert by_tangents == pytest.approx(exact, abs=1e-9)
    assert by_adjoint.by['k'] == pytest.approx(by_tangents, rel=1e-12)


def test_several_corners_in_one_step() -> None:
    """The first two have no jump."""
    smooth = '0.01*max(t - 0.1002, 0)**2 + 0.01*max(t - 0.1004, 0)**3'
    simulation = Simulation(cart(f'{smooth} + max(t - 0.1006, 0)'))
    with pytest.raises(StepError, match=r'jumps by 1 at t = 0\.1006 s'):
        simulation.step(300)
    Simulation(cart(smooth)).step(300)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_two_corners_of_one_function_in_one_step(integrator: str) -> None:
    """At the end of the step it is on the same branch as at the start."""
    twice = 'abs((t - 0.10037)**2 - 1e-8)'
    simulation = Simulation(cart(twice), integrator=integrator)
    with pytest.raises(StepError, match=r'jumps by 0\.0004 at t = 0\.10027 s') as told:
        simulation.step(300)
    assert told.value.t == 0.1
    Simulation(cart(twice.replace('- 1e-8', '+ 1e-8'))).step(300)


def test_a_corner_at_the_start_and_corners_of_constants() -> None:
    Simulation(cart('max(t, 0)')).step(10)
    Simulation(cart('max(1, 2)*t')).step(10)


def test_where_nothing_is_free_the_motion_is_known() -> None:
    """But the works of a jump are not."""
    turned = {'turn': {'joint': 'crank_pin', 'angle': 'max(t - 0.1, 0)'}}
    scene = load_scene({'mechanism': 'four_bar', 'drives': turned})
    simulation = Simulation(scene)
    before = simulation.sample().joints['crank_pin'].position
    simulation.step(300)
    assert simulation.sample().joints['crank_pin'].position - before == pytest.approx(
        simulation.t - 0.1, abs=1e-12
    )
    with pytest.raises(StepError, match=r'the rate of turn jumps by 1 at t = 0\.1 s'):
        Simulation(scene, ledger=True).step(300)


@pytest.mark.parametrize('formulation', [f for f in FORMULATIONS if f != 'independent'])
def test_every_formulation_tells(formulation: str) -> None:
    """Where the run is, and in a last step of its own that ends between two of the grid.

    (`independent` refuses drives.)
    """
    scene = cart('2*max(t - 0.1003, 0)', formulation=formulation, integrator='rk4')
    simulation = Simulation(scene)
    simulation.step(100)
    assert simulation._sample_at(0.1002).t == 0.1002
    for further in (lambda: simulation._sample_at(0.1006), simulation.step):
        with pytest.raises(StepError, match=r'the rate of cart jumps by 2 at t = 0\.1003 s'):
            further()
    assert simulation.t == 0.1


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_gradients_tell(integrator: str) -> None:
    simulation = Simulation(cart('2*max(t - 0.1, 0)'), integrator=integrator)
    found = gradient(simulation, 'final(points.A.x)', ['rod.mass'], duration=0.09)
    assert np.isfinite(found.value)
    with pytest.raises(StepError, match=r'the rate of cart jumps by 2 at t = 0\.1 s'):
        gradient(simulation, 'final(points.A.x)', ['rod.mass'], duration=0.2)


def test_members_tell_the_same() -> None:
    found = alf_ros.ensemble(
        cart('2*max(t - 0.1, 0)'),
        {'rod.mass': [1.0, 2.0]},
        sampling='table',
        outputs=['final(points.A.x)'],
        duration=0.2,
        workers=0,
    )
    assert all('the rate of cart jumps by 2' in reason for reason in found.reason.values)
