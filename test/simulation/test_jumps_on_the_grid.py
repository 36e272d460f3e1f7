"""Forces that jump where fixed steps begin and end: each step has the value of its own side.

So the order of the method stays, whatever the rounding of the times."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from alf_ros import Ensemble, Scene, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.overrides import with_changes

J, GAIN, DAMPING, END = 2.0 / 3.0, 20.0, 5.0, 3.0
# 0.29, 0.57, 0.58 and 1.15 are not the products of steps and their numbers
TIMES = (0.0, 0.07, 0.29, 0.57, 0.58, 1.13, 1.15, 2.3, 3.29)
ANGLES = [0.5 * (-1) ** k for k in range(len(TIMES))]


def motor(integrator: str, step: float, **solver: Any) -> Scene:
    """A bar that follows a table with corners: the torque of the motor jumps at each."""
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'bar': {'points': ['O', 'A'], 'mass': 2.0, 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
    }
    table = [list(row) for row in zip(TIMES, ANGLES, strict=True)]
    gains = {'position_gain': GAIN, 'velocity_gain': DAMPING}
    effects = {'motor': {'joint': 'pin', 'position': table, **gains}}
    solver |= {'step': step, 'integrator': integrator}
    return load_scene({'mechanism': mechanism, 'effects': effects, 'solver': solver})


def exact(damping: float = DAMPING) -> Floats:
    """Angle and velocity at the end: linear equations, piece by piece."""
    state = np.array([0.0, 0.0])
    for (t, angle), (until, then) in pairwise(zip(TIMES, ANGLES, strict=True)):
        rate = (then - angle) / (until - t)
        # angle, velocity, the target and its velocity
        A = np.zeros((4, 4))
        A[0, 1] = A[2, 3] = 1.0
        A[1] = [-GAIN / J, -damping / J, GAIN / J, damping / J]
        moved = expm(A * (min(until, END) - t)) @ [*state, angle, rate]
        state = moved[:2]
    return np.asarray(state, dtype=float)


def error(scene: Scene) -> float:
    simulation = Simulation(scene)
    simulation.step(round(END / simulation.h))
    pin = simulation.sample().joints['pin']
    return float(np.abs([pin.position, pin.velocity] - exact()).max())


@pytest.mark.parametrize('step', [0.01, 0.005, 0.002, 0.001])
def test_exact_where_the_method_is(step: float) -> None:
    assert error(motor('dop853', step)) < 2e-14


@pytest.mark.parametrize('integrator', ['rk4', 'esdirk43'])
def test_the_order_stays(integrator: str) -> None:
    errors = [error(motor(integrator, step)) for step in (0.01, 0.005, 0.0025)]
    assert all(coarse > 12.0 * fine for coarse, fine in pairwise(errors))
    assert errors[0] < 1e-7


@pytest.mark.parametrize('integrator', ['dop853', 'esdirk43'])
def test_derivatives_too(integrator: str) -> None:
    """By the damping, against differences of the exact solution."""
    name = 'motor.velocity_gain'
    simulation = Simulation(motor(integrator, 0.002), tangents=[name])
    simulation.step(1500)
    found = simulation.sample().tangents[name].of('joints.pin.position')
    h = 1e-3
    ends = [exact(DAMPING + k * h)[0] for k in (-2, -1, 1, 2)]
    expected = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * h)
    assert found == pytest.approx(expected, rel=1e-10 if integrator == 'dop853' else 1e-7)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853'])
def test_members_have_the_bits_of_their_single_runs(integrator: str) -> None:
    gains = [18.0, 20.0, 23.0, 29.0, 31.0]
    scene = motor(integrator, 0.01)
    vary = {'motor.position_gain': gains}
    together = Ensemble(scene, vary=vary, sampling='grid', steps=300).step()
    for gain, row in zip(gains, together, strict=True):
        alone = Simulation(with_changes(scene, {'motor.position_gain': repr(gain)}))
        alone.step(300)
        pin = alone.sample().joints['pin']
        assert row.tolist() == [pin.position, pin.velocity]
