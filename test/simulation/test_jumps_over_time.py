"""Forces that jump at known instants, at the ends of fixed steps or between them.

Steps end there, and each has the value of its own side. So the order of the method stays, whatever
the rounding of the times."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from alf_ros import Scene, Simulation, ensemble, gradient, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.overrides import with_changes
from alf_ros.simulation.side_by_side import SideBySide

J, GAIN, DAMPING, END = 2.0 / 3.0, 20.0, 5.0, 3.0
Times = tuple[float, ...]
# 0.29, 0.57, 0.58 and 1.15 are not the products of steps and their numbers
ON_GRID: Times = (0.0, 0.07, 0.29, 0.57, 0.58, 1.13, 1.15, 2.3, 3.29)
# three within one step of 10 ms, and one that is nearly on the grid
BETWEEN: Times = (0.0, 0.0701, 0.29 + 1e-9, 0.5712, 0.5737, 0.5791, 1.15 - 1e-6, 2.3071, 3.29)
ANGLES = [0.5 * (-1) ** k for k in range(len(ON_GRID))]
PLACES = pytest.mark.parametrize('times', [ON_GRID, BETWEEN], ids=['on_grid', 'between'])


def motor(integrator: str, step: float, times: Times, **solver: Any) -> Scene:
    """A bar that follows a table with corners: the torque of the motor jumps at each."""
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'bar': {'points': ['O', 'A'], 'mass': 2.0, 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
    }
    table = [list(row) for row in zip(times, ANGLES, strict=True)]
    gains = {'position_gain': GAIN, 'velocity_gain': DAMPING}
    effects = {'motor': {'joint': 'pin', 'position': table, **gains}}
    solver |= {'step': step, 'integrator': integrator}
    return load_scene({'mechanism': mechanism, 'effects': effects, 'solver': solver})


def exact(times: Times, damping: float = DAMPING) -> Floats:
    """Angle and velocity at the end: linear equations, piece by piece."""
    state = np.array([0.0, 0.0])
    for (t, angle), (until, then) in pairwise(zip(times, ANGLES, strict=True)):
        rate = (then - angle) / (until - t)
        # angle, velocity, the target and its velocity
        A = np.zeros((4, 4))
        A[0, 1] = A[2, 3] = 1.0
        A[1] = [-GAIN / J, -damping / J, GAIN / J, damping / J]
        moved = expm(A * (min(until, END) - t)) @ [*state, angle, rate]
        state = moved[:2]
    return np.asarray(state, dtype=float)


def error(scene: Scene, times: Times) -> float:
    simulation = Simulation(scene)
    simulation.step(round(END / simulation.h))
    pin = simulation.sample().joints['pin']
    return float(np.abs([pin.position, pin.velocity] - exact(times)).max())


@PLACES
@pytest.mark.parametrize('step', [0.01, 0.005, 0.002, 0.001])
def test_exact_where_the_method_is(step: float, times: Times) -> None:
    assert error(motor('dop853', step, times), times) < 2e-14


@PLACES
@pytest.mark.parametrize('integrator', ['rk4', 'esdirk43'])
def test_the_order_stays(integrator: str, times: Times) -> None:
    errors = [error(motor(integrator, step, times), times) for step in (0.01, 0.005, 0.0025)]
    assert errors[0] > 60.0 * errors[2]
    assert errors[0] < 1e-7


@PLACES
@pytest.mark.parametrize('integrator', ['dop853', 'esdirk43'])
def test_derivatives_too(integrator: str, times: Times) -> None:
    """By the damping, against differences of the exact solution."""
    name = 'motor.velocity_gain'
    simulation = Simulation(motor(integrator, 0.002, times), tangents=[name])
    simulation.step(1500)
    found = simulation.sample().tangents[name].of('joints.pin.position')
    h = 1e-3
    ends = [exact(times, DAMPING + k * h)[0] for k in (-2, -1, 1, 2)]
    expected = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * h)
    assert found == pytest.approx(expected, rel=1e-10 if integrator == 'dop853' else 1e-7)


def test_a_gradient_too() -> None:
    """The adjoint of the run, step by step through its pieces."""
    scene, name = motor('dop853', 0.01, BETWEEN), 'motor.velocity_gain'
    found = gradient(scene, 'final(pin.position)', [name], END)
    simulation = Simulation(scene, tangents=[name])
    simulation.step(300)
    by_tangents = simulation.sample().tangents[name].of('joints.pin.position')
    assert found.by[name] == pytest.approx(by_tangents, rel=1e-12)


def test_samples_between_grid_points() -> None:
    """A sample between two grid points, behind a jump in the same step."""
    t = 0.5745
    scene = motor('dop853', 0.01, BETWEEN)
    (sample,) = Simulation(scene).run(0.6, at=[t])
    (there,) = Simulation(with_changes(scene, {'solver.step': repr(t / 90)})).run(t, at=[t])
    for name in ('position', 'velocity'):
        pair = [getattr(each.joints['pin'], name) for each in (sample, there)]
        assert pair[0] == pytest.approx(pair[1], abs=1e-13)


@PLACES
@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'dop853_adaptive'])
def test_members_have_the_bits_of_their_single_runs(integrator: str, times: Times) -> None:
    """In lanes, with other gains and other times of rows; also with the same work."""
    gains = [18.0, 20.0, 23.0, 29.0, 31.0]
    scene = motor(integrator, 0.01, times)
    changes = [
        {'motor.position_gain': repr(gain), 'motor.position.3.0': repr(times[3] + 1e-4 * k)}
        for k, gain in enumerate(gains)
    ]
    members, alone = ([Simulation(with_changes(scene, c)) for c in changes] for _ in range(2))
    together = SideBySide(members)
    together.step(300)
    if integrator == 'dop853_adaptive':
        assert together.apart == 0
    for one, other in zip(members, alone, strict=True):
        other.step(300)
        assert one.state.q.tobytes() == other.state.q.tobytes()
        assert one.state.qd.tobytes() == other.state.qd.tobytes()
        assert one.evaluations == other.evaluations


@PLACES
@pytest.mark.parametrize('integrator', ['dop853', 'dop853_adaptive'])
def test_studies_too(integrator: str, times: Times) -> None:
    """Members that are made together, by numbers of the mechanism, of gains and of rows."""
    scene = motor(integrator, 0.01, times)
    kept = ['final(pin.position)', 'final(pin.velocity)']  # 'final_pin.position', …
    for name, values in (
        ('bar.mass', [1.5, 1.8, 2.1, 2.2]),
        ('motor.position.3.0', [times[3], times[3] + 1e-4, times[3] + 2e-4, times[3] + 3e-4]),
        ('motor.position.3.1', [-0.5, -0.3, 0.2, 0.4]),
    ):
        found = ensemble(scene, {name: values}, outputs=kept, sampling='grid', duration=END)
        for member, value in enumerate(values):
            alone = Simulation(with_changes(scene, {name: repr(value)}))
            alone.step(300)
            pin = alone.sample().joints['pin']
            row = [float(found[f'final_pin.{of}'][member]) for of in ('position', 'velocity')]
            assert row == [pin.position, pin.velocity]
