"""A delta robot without motors, thrown about: its three freedoms lead through singular positions.

Wherever the normals of its three parallelograms come to lie in a plane, another branch crosses on
which the platform turns. No force turns it, and nothing dissipates.

Five throws; ten with make thorough ARGS=test/simulation/test_tumbling.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from alf_ros import Simulation, StepError, load_scene
from support.paths import ROOT
from support.thorough import LONG, thinned

THROWS = 10 if LONG else 5
SETTINGS: list[dict[str, Any]] = [
    {'integrator': 'dop853_adaptive', 'step': 1e-2, 'tolerance': 1e-8},
    {'integrator': 'dop853', 'step': 1e-3},
]


def thrown(velocity: list[float]) -> dict[str, Any]:
    """The scene of the library with another velocity (m/s), and gravity alone."""
    scene = yaml.safe_load((ROOT / 'config/scenes/delta_robot.yaml').read_text('utf-8'))
    scene['initial']['velocities']['C'] = velocity
    del scene['effects']['joint_effort']
    return dict(scene)


@pytest.mark.parametrize(
    'settings',
    thinned(SETTINGS, keep=lambda settings: settings['integrator'] == 'dop853'),
    ids=lambda settings: settings['integrator'],
)
def test_it_passes_them_or_says_that_it_does_not(settings: dict[str, Any]) -> None:
    random, through, passed = np.random.default_rng(5), 0, 0
    for _ in range(THROWS):
        scene = load_scene(thrown((2.0 * random.uniform(-1.0, 1.0, 3)).tolist()))
        simulation = Simulation(scene, watch=True, **settings)
        first = simulation.sample()
        try:
            for _ in range(40):
                simulation.step(round(0.1 / simulation.h))
            through += 1
        except StepError as error:
            assert 'a singular position is near, at the distance' in str(error)
        last = simulation.sample()
        assert last.energy == pytest.approx(first.energy, abs=1e-5)
        for side in ('0', '1'):
            turned = last.points['Q' + side] - last.points['T' + side]
            turned -= first.points['Q' + side] - first.points['T' + side]
            assert np.abs(turned).max() < 1e-10
        passed += len(simulation.passes)
    assert through >= 0.4 * THROWS and passed >= 4 * THROWS
