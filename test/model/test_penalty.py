"""The penalty fits the softest mode and what rounding leaves of free motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from alf_ros import Simulation, kernel, load_scene
from alf_ros.kernel.data import EPS
from alf_ros.kernel.solve_rounding import solve_rounding
from alf_ros.mechanism import Point
from alf_ros.model import penalty
from alf_ros.model.compile import Model, allocate
from alf_ros.model.dense_linearisation import Linearised


def measured(model: Model, of: float) -> float:
    """The part that rounding leaves at the drawn position with another penalty."""
    stiff = model.with_penalty(of)
    work = allocate(stiff, stiff.system, 0)
    return solve_rounding(stiff.unit, stiff.system, work, stiff.q, 0.0)


@pytest.mark.parametrize('name', ['slider_crank', 'stewart_platform', 'excavator', 'delta_robot'])
def test_without_light_parts_only_the_softest_mode_counts(name: str) -> None:
    model = Simulation(load_scene(name)).model
    sigma = model.system.ordinary
    assert model.penalty == (1e8 if sigma >= 0.05 else EPS**-0.5 / sigma)
    assert EPS * model.penalty <= model.system.rounding <= 10.0 * EPS * model.penalty


@pytest.mark.parametrize('of', [1e7, 1e10])
def test_it_is_what_a_solve_leaves_of_free_motions(of: float) -> None:
    """Against the worst of all free motions, of a coin that is small beside a drawing of 1 m, so
    that it turns lightly: solves with the same factor, in the basis of the null space of a dense
    Jacobian."""
    scene = load_scene('coin')
    far = Point('far', (1.0, 0.0, 0.0), fixed=True)
    drawing = replace(scene.mechanism, points=(*scene.mechanism.points, far))
    model = Simulation(replace(scene, mechanism=drawing)).model
    stiff = model.with_penalty(of)
    work = allocate(stiff, stiff.system, 1)
    assert kernel.linearise(stiff.unit, stiff.system, work, stiff.q)
    left = []
    for v in Linearised(stiff, stiff.q).free.T:
        whole = np.concatenate([v, np.zeros(stiff.q.size - stiff.n)])
        f, x = np.zeros_like(whole), np.zeros_like(whole)
        kernel.add_mass_times(stiff.unit, stiff.system.mass, 1.0, whole, f)
        work.y[:] = work.r2[:] = 0.0
        kernel.augmented(stiff.unit, stiff.system, work, f, x, kernel.Until(np.int64(1), 0.0, 1.0))
        left.append(float(np.abs(x - whole).max() / np.abs(v).max()))
    assert 0.01 * max(left) <= measured(model, of) <= 10.0 * max(left)
    assert measured(model, of) > 10.0 * EPS * of


def test_light_parts_have_a_smaller_one_and_never_one_that_makes_all_modes_slow() -> None:
    assert penalty.light_penalty(1e10, 0.05, 1e-6) == 1e10
    assert penalty.light_penalty(1e10, 0.05, 3e-4) == pytest.approx(1e8)
    assert penalty.light_penalty(1e10, 0.05, 0.9) == pytest.approx(1e3 / 0.05**2)
    assert penalty.light_penalty(1e8, 1e-4, 0.9) == 1e8
    assert penalty.rounding_of(1e8, 1e10, 3e-4) == pytest.approx(3e-6)
    assert penalty.rounding_of(1e8, 1e8, 0.0) == EPS * 1e8
