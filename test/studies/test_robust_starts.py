"""identify with a loss that hardly feels far residuals, where windows begin far from their starts.

A smoothed encoder tells the speed of a fast crank so badly that its run leaves the recording.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import identify, load_scene
from support.recordings import Machine, changed
from support.thorough import thinned

NOISE = 1e-3  # rad
NAME, TRUE = 'push.effort.3.0', 2.07
FAST: dict[str, Any] = {
    'mechanism': 'four_bar',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'joint_friction': {'pin': {'joint': 'crank_pin', 'viscous': 4e-4}},
        'damper': {'oil': {'between': ['A', 'ground'], 'at': [None, [0.3, 0.4]], 'damping': 0.05}},
        'motor': {
            'push': {'joint': 'crank_pin', 'effort': [[0, 0], [0.5, 0.05], [1, -0.03], [2, 0.02]]}
        },
    },
    'initial': {'velocities': {'A': ['-20*a*sin(theta)', '20*a*cos(theta)']}},
    'solver': {'step': 2e-3, 'integrator': 'rk4'},
}


@pytest.mark.parametrize('hold_out', thinned([0.0, 0.5], keep=[0.5]))
def test_every_window_finds_its_start(hold_out: float) -> None:
    """Of the cost of `cauchy` one window of four stayed 1.7 rad away, and the fit ended there."""
    scene = load_scene(FAST)
    machine = Machine(changed(scene, {NAME: TRUE}), ['crank_pin'], 2.0)
    recording = machine.recording(NOISE, seed=3)
    options: dict[str, Any] = {'window': 0.5, 'hold_out': hold_out}
    found = identify(scene, recording, [NAME], loss='cauchy', **options)
    (channel,) = found.channels
    assert found.settled and channel.after < 1.2 * NOISE
    assert not hold_out or channel.held_out < 1.2 * NOISE
    off = np.abs(found.values - TRUE) / found.deviations
    assert (off < 4.0).all()
