"""A state at the very instant of a kink over time, such as a row of a table.

A run that is restored there continues bit for bit, and reads as the run that came there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Scene, Simulation, load_scene
from support.runs import bits

STEPS = 60
# rows of a drive on the grid of 0.01 s, of which some differ from k * 0.01 by rounding
ROWS = [[0, 0.785], [0.07, 0.8], [0.29, 1.1], [0.3, 1.2], [0.35, 1.15], [0.57, 1.0], [1.0, 0.5]]
LOAD = [[0, 0], [0.14, 2], [0.28, -1], [0.5, 0]]


def table_drive(**solver: Any) -> Scene:
    """A slider-crank that follows the rows, with an effort that follows others."""
    return load_scene(
        {
            'mechanism': 'slider_crank',
            'drives': {'motor': {'joint': 'crank_pin', 'angle': {'table': ROWS}}},
            'effects': {
                'gravity': {'acceleration': [0, -9.81]},
                'motor': {'push': {'joint': 'knee', 'effort': LOAD}},
            },
            'solver': {'step': 0.01, **solver},
        }
    )


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive', 'esdirk43_adaptive'])
def test_a_run_goes_on_from_every_state(integrator: str) -> None:
    scene = table_drive(integrator=integrator)
    run, again = Simulation(scene), Simulation(scene)
    before = run.state
    for _ in range(STEPS):
        run.step(1)
        again.restore(before)
        again.step(1)
        assert bits(again.state) == bits(run.state), run.t
        before = run.state


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_a_restored_state_reads_the_same(integrator: str) -> None:
    scene = table_drive(integrator=integrator)
    run, again = Simulation(scene), Simulation(scene)
    for _ in range(STEPS):
        run.step(1)
        again.restore(run.state)
        assert bits(again.state) == bits(run.state), run.t
        ours, theirs = run.sample(), again.sample()
        assert np.array_equal(ours.joint_positions, theirs.joint_positions), run.t
        assert ours.energy == theirs.energy, run.t
