"""States beside a singular position: a run that is restored there repeats bit for bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.studies.exact import one_freedom
from support.thorough import combined

CHANGE = one_freedom.change_point_alone()
LANDING = 0.1  # s
ASIDE = (1e-3, -3e-4, 2e-4, 1e-4, -1e-4, 5e-5, 1e-5, 1e-9, 0.0)  # s


@pytest.mark.parametrize(
    'integrator, step, rate',
    combined(
        [('rk4', 1e-2), ('dop853', 1e-2), ('esdirk43', 1e-2), ('dop853_adaptive', LANDING)],
        [0.1, 0.15, -1.0],
    ),
)
def test_the_next_steps_are_the_same(integrator: str, step: float, rate: float) -> None:
    course = solve_ivp(
        lambda t, y: (y[1], CHANGE.acceleration(y[0], y[1])),
        (0.0, -1.2 * LANDING),
        (math.pi, rate),
        'DOP853',
        rtol=1e-12,
        atol=1e-13,
        dense_output=True,
    ).sol
    for aside in ASIDE:
        theta, speed = course(-LANDING - aside)
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
        kept, restored = (Simulation(scene, integrator=integrator, step=step) for _ in range(2))
        kept.step(round(LANDING / step))
        restored.restore(kept.state)
        for sim in (kept, restored):
            sim.step(3)
        assert np.array_equal(kept.state.q, restored.state.q), aside
        assert np.array_equal(kept.state.qd, restored.state.qd), aside
