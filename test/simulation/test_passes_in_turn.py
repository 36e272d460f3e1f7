"""Passes of a motion that turns back behind a singular position, with steps that end in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.studies.exact import one_freedom
from support.thorough import combined

CHANGE = one_freedom.change_point_alone()
WHEN = 0.1  # s, of the pass in which a step ends


def rates(t: float, y: Floats) -> tuple[float, float]:
    return y[1], CHANGE.acceleration(y[0], y[1])


@pytest.mark.parametrize(
    ('aside', 'rate'), combined([0.0, 1e-9, -1e-9, 1e-5], [-0.0732, 0.0732, 0.3])
)
def test_both_passes_are_found(rate: float, aside: float) -> None:
    """It passes, falls back and passes again, in one long step or in some short ones."""
    start, falls = ((math.pi, rate), {'rtol': 1e-12, 'atol': 1e-13, 'dense_output': True})
    before = solve_ivp(rates, (0.0, -0.12), start, 'DOP853', **falls)
    after = solve_ivp(rates, (0.0, 0.2), start, 'DOP853', **falls)
    wanted = [WHEN + aside]
    for part in (before, after):
        t = np.linspace(part.t[0], part.t[-1], 20001)[1:]
        beside = part.sol(t)[0] - math.pi
        wanted += (WHEN + aside + t[1:][beside[1:] * beside[:-1] < 0.0]).tolist()
    theta, speed = before.sol(-WHEN - aside)
    at, velocities = (
        dict(zip('AB', values.reshape(-1, 2).tolist(), strict=True))
        for values in (CHANGE.position(theta), speed * CHANGE.tangent(theta))
    )
    scene = load_scene(
        {
            'mechanism': 'change_point',
            'effects': {'gravity': {'acceleration': [0, -one_freedom.GRAVITY]}},
            'initial': {'positions': at, 'velocities': velocities},
        }
    )
    assert len(wanted) == 2
    for integrator, step, tolerance in (
        ('rk4', 5e-3, None),
        ('dop853', 1e-2, None),
        ('dop853_adaptive', 0.1, 1e-9),
        ('esdirk43_adaptive', 0.1, 1e-7),
    ):
        sim = Simulation(scene, integrator=integrator, step=step, tolerance=tolerance, watch=True)
        sim.step(round(0.3 / step))
        found = [one.t for one in sim.passes]
        assert found == pytest.approx(sorted(wanted), abs=1e-5), integrator
