"""Numbers of the solver section at the ends of their ranges."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros import InputError, Simulation, load_scene
from alf_ros.scene.scene import Solver


@pytest.mark.parametrize('name', ['pendulum', 'four_bar', 'bricard'])
def test_the_largest_penalty_runs_and_changes_nothing(name: str) -> None:
    ends = []
    for penalty in (1e8, 1e12):
        simulation = Simulation(load_scene(name), step=1e-3, integrator='dop853', penalty=penalty)
        simulation.step(300)
        ends.append(simulation.sample().q)
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize('penalty', [1.001e12, 1e16, 1e20, 10**30])
def test_a_penalty_that_rounding_does_not_resolve_is_refused(penalty: float) -> None:
    with pytest.raises(InputError, match='penalty: not usable.*from 1e-60 to 1e12') as error:
        Simulation(load_scene('pendulum'), penalty=penalty)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('tolerance', [1, 1.0, 0.9])
@pytest.mark.parametrize('integrator', ['dop853_adaptive', 'esdirk43_adaptive'])
def test_the_largest_tolerance_runs(tolerance: float, integrator: str) -> None:
    """A whole number reached the compiled code as the bits of another one."""
    scene = load_scene('pendulum')
    exact = Simulation(scene, integrator=integrator, step=1e-3, tolerance=1e-12)
    coarse = Simulation(scene, integrator=integrator, step=1e-3, tolerance=tolerance)
    for simulation in (exact, coarse):
        simulation.step(200)
    np.testing.assert_allclose(coarse.sample().q, exact.sample().q, rtol=0.0, atol=1e-4)


def test_whole_numbers_become_the_numbers_that_compiled_code_takes() -> None:
    solver = Solver(step=1, penalty=10**6, tolerance=1, iterations=4, accuracy=1)
    for name in ('step', 'penalty', 'tolerance', 'accuracy'):
        assert type(getattr(solver, name)) is float
    assert type(solver.iterations) is int
