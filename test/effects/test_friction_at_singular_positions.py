"""Friction under the true reactions beside a singular position, where balances meet and end.

The slider-crank with two rods of 1 m and 1 kg, c = cos θ. With friction in the guide alone the
equations of Newton and Euler come down to c N + b |N| = c N₀ beside c = 0: one balance beyond
|c| = |b|, and within it two on one side of the position and none on the other.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from alf_ros import Simulation, StepError, load_scene
from alf_ros.simulation import state_vector
from alf_ros.simulation.saved_states import as_data, from_data
from support.effect_scenes import rubbing_pendulum
from support.thorough import combined

Floats = NDArray[np.float64]
G = 9.81
EPS = 1e-2  # slip speed
RUBBING: dict[str, dict[str, float]] = {
    # the guide alone: its reaction falls to zero at c = 0, where two balances meet and end
    'guide': {'guide': 0.01},
    # with the pin the balance goes on through c = 0, and ends after it
    'guide and pin': {'guide': 0.2, 'crank_pin': 0.03},
    'knee': {'knee': 0.005},
}


def slider_crank(friction: dict[str, float], **keywords: Any) -> Simulation:
    """friction: the coefficient, times a radius (m) of an angle, of each joint."""
    rubbing = {
        joint: {'joint': joint, 'dynamic': mu, 'slip': EPS}
        | ({} if joint == 'guide' else {'dynamic': 10 * mu, 'radius': 0.1})
        for joint, mu in friction.items()
    }
    scene = {
        'mechanism': 'slider_crank',
        'effects': {'gravity': {'acceleration': [0, -G]}, 'joint_friction': rubbing},
        'initial': {'velocities': {'B': [-4.0, 0]}},
    }
    return Simulation(load_scene(scene), **keywords)


def newton_euler(
    angle: float, rate: float, friction: dict[str, float]
) -> tuple[Floats, Floats, Floats]:
    """K x = r + F loads for x = (θ̈, force on the crank in O, on the coupler in A, in B along y);
    loads: magnitudes in the order guide, crank_pin, knee."""
    s, c = np.sin(angle), np.cos(angle)
    K, r, F = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 3))
    K[0], r[0] = [-0.5 * s, -1, 0, 1, 0, 0], 0.5 * rate**2 * c
    K[1], r[1] = [0.5 * c, 0, -1, 0, 1, 0], 0.5 * rate**2 * s - G
    K[2], r[2] = [1 / 3, 0, 0, -s, c, 0], -0.5 * G * c  # about O
    K[3], r[3] = [-1.5 * s, 0, 0, -1, 0, 0], 1.5 * rate**2 * c
    K[4], r[4] = [0.5 * c, 0, 0, 0, -1, -1], 0.5 * rate**2 * s - G
    K[5] = [-1 / 12, 0, 0, 0.5 * s, 0.5 * c, -0.5 * c]  # about the centre of the coupler

    def effort(joint: str, speed: float) -> float:
        return -friction.get(joint, 0.0) * speed / float(np.hypot(speed, EPS))

    guide, knee = effort('guide', -2 * s * rate), effort('knee', -2 * rate)
    F[3, 0], F[5, 0] = guide, 0.5 * s * guide
    F[2, 1] = effort('crank_pin', rate)
    F[2, 2], F[5, 2] = -knee, knee
    return K, r, F


def balances(angle: float, rate: float, friction: dict[str, float]) -> list[Floats]:
    """All x that agree with the magnitudes in them, of guides up to some kN.

    All but one of the equations are solved for all but the guide's reaction, where both pins are a
    contraction; the last one, a function of that reaction alone, is searched for all its zeros.
    """
    K, r, F = newton_euler(angle, rate, friction)
    inverse = np.linalg.inv(K[:5, :5])

    def magnitudes(x: Floats) -> Floats:
        """(k, 3) of (k, 6)."""
        of_pins = np.hypot(x[:, 1], x[:, 2]), np.hypot(x[:, 3], x[:, 4])
        return np.column_stack([np.abs(x[:, 5]), *of_pins])

    def rest(N: Floats) -> Floats:
        """(k, 6) x for reactions of the guide (k,)."""
        loads = np.column_stack([np.abs(N), np.ones((N.size, 2))])
        for _ in range(500):
            known = (r + loads @ F.T)[:, :5] - N[:, None] * K[:5, 5]
            x = np.column_stack([known @ inverse.T, N])
            new = magnitudes(x)
            if (np.abs(new - loads).max(axis=1) <= 1e-14 * new.max(axis=1)).all():
                break
            loads = new
        return x

    def gaps(u: NDArray[np.floating[Any]]) -> Floats:
        x = rest(np.sinh(u))
        return np.asarray((x @ K.T - r - magnitudes(x) @ F.T)[:, 5] / (1.0 + np.abs(x[:, 5])))

    def gap(u: float) -> float:
        return float(gaps(np.array([u]))[0])

    grid = np.linspace(-9.0, 9.0, 601, dtype=np.float64)
    values = gaps(grid)
    return [
        rest(np.sinh([brentq(gap, grid[k], grid[k + 1], xtol=1e-15)]))[0]
        for k in range(grid.size - 1)
        if values[k] * values[k + 1] < 0.0
    ]


def crank(sim: Simulation) -> tuple[float, float]:
    joint = sim.sample().joints['crank_pin']
    return joint.position, joint.velocity


@pytest.mark.parametrize(
    ('integrator', 'which'), combined(['rk4', 'dop853_adaptive', 'esdirk43'], RUBBING)
)
def test_the_balance_of_the_motion_is_kept_to_its_end(which: str, integrator: str) -> None:
    """Beside the position, step by step the balance next to the last one, of all there are."""
    friction = RUBBING[which]
    sim = slider_crank(friction, integrator=integrator, step=1e-3)
    while np.cos(crank(sim)[0]) > 0.06:
        sim.step()
    last, several = balances(*crank(sim), {})[0], 0
    with pytest.raises(StepError, match='Painlevé.*at t = '):
        while True:
            angle, rate = crank(sim)
            found = balances(angle, rate, friction)
            assert found
            several += len(found) > 1
            last = min(found, key=lambda x: float(np.abs(x - last).max()))
            sample = sim.sample()
            forces = [sample.reactions[name].force for name in ('crank_pin', 'knee', 'guide')]
            wanted = [last[1:3], last[3:5], [0.0, last[5]]]
            assert np.array(forces) == pytest.approx(np.array(wanted), abs=1e-6)
            sim.step()
    # where it stopped, what is next has no balance that the last one leads to
    angle, rate = crank(sim)
    ahead = [balances(angle + rate * k * 5e-4, rate, friction) for k in range(1, 5)]
    assert any(not found for found in ahead)
    assert several or which == 'knee'


@pytest.mark.parametrize('which', RUBBING)
def test_coarse_steps_do_not_leap_over_a_paradox(which: str) -> None:
    """On either side of it there is one balance."""
    friction = RUBBING[which]
    ends = []
    for integrator, step, tolerance in (
        ('dop853_adaptive', 1e-3, 1e-9),
        ('dop853_adaptive', 0.5, 1e-3),
        ('dop853_adaptive', 0.05, 1e-6),
        ('esdirk43_adaptive', 0.1, 1e-5),
        ('esdirk43', 1e-2, 1e-6),
    ):
        sim = slider_crank(friction, integrator=integrator, step=step, tolerance=tolerance)
        with pytest.raises(StepError, match='Painlevé') as told:
            sim.step(int(2.0 / step))
        ends.append(float(told.value.reason.split('at t = ')[1].split()[0]))
    assert ends == pytest.approx([ends[0]] * len(ends), abs=2e-4)
    for side in (-0.3, 0.3):
        assert len(balances(np.arccos(side), crank(sim)[1], friction)) == 1
    for integrator in ('rk4', 'dop853'):
        with pytest.raises(StepError, match='Painlevé'):
            slider_crank(friction, integrator=integrator, step=0.02).step(50)


@pytest.mark.parametrize('integrator', ['dop853_adaptive', 'esdirk43_adaptive'])
@pytest.mark.parametrize('joint', ['pin', 'wrist'])
def test_tight_tolerances_end_with_the_balance(joint: str, integrator: str) -> None:
    """A parallelogram of equal bars on the way to its flat position. The acceleration grows
    without limit as the balance ends, so that no step is small enough, not even before it."""
    angle, rate = -2.8, -6.0
    a = [np.cos(angle).item(), np.sin(angle).item()]
    v = [-a[1] * rate, a[0] * rate]
    bars = {'crank': ['O', 'A'], 'coupler': ['A', 'B'], 'rocker': ['C', 'B']}
    pins = {
        'pin': ('ground', 'crank', 'O'),
        'knee': ('crank', 'coupler', 'A'),
        'wrist': ('coupler', 'rocker', 'B'),
        'hip': ('ground', 'rocker', 'C'),
    }
    mechanism = {
        'alf': 1,
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'C': {'at': [1, 0], 'fixed': True},
            'A': {'at': a},
            'B': {'at': [1 + a[0], a[1]]},
        },
        'bodies': {
            name: {'points': points, 'mass': mass, 'inertia': 'rod'}
            for (name, points), mass in zip(bars.items(), (1.0, 2.0, 0.7), strict=True)
        },
        'joints': {
            name: {'type': 'revolute', 'between': [first, second], 'at': at}
            for name, (first, second, at) in pins.items()
        },
    }
    scene = {
        'mechanism': mechanism,
        'effects': {
            'gravity': {'acceleration': [0, -1]},
            'joint_friction': {'joint': joint, 'dynamic': 0.23, 'radius': 0.02},
        },
        'initial': {'velocities': {'A': v, 'B': v}},
    }
    ends = []
    for tolerance in (1e-6, 1e-9, 1e-12):
        sim = Simulation(load_scene(scene), step=1e-3, integrator=integrator, tolerance=tolerance)
        with pytest.raises(StepError, match='Painlevé') as told:
            sim.step(400)
        ends.append(float(told.value.reason.split('at t = ')[1].split()[0]))
    assert ends == pytest.approx([ends[-1]] * len(ends), abs=1e-6)


def test_of_several_balances_a_run_begins_with_that_of_growing_friction() -> None:
    """Drawn where there are two: that to which the one without friction leads."""
    c, rate, friction = 0.002, 3.0, {'guide': 0.01}
    s = float(np.sqrt(1.0 - c * c))
    rods = {'crank': ['O', 'A'], 'coupler': ['A', 'B']}
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {
                'O': {'at': [0, 0], 'fixed': True},
                'A': {'at': [c, s]},
                'B': {'at': [2 * c, 0]},
            },
            'bodies': {
                name: {'points': points, 'mass': 1.0, 'inertia': 'rod'}
                for name, points in rods.items()
            },
            'joints': {
                'crank_pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
                'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
                'guide': {
                    'type': 'slider',
                    'point': 'B',
                    'on': {'through': [0, 0], 'direction': [1, 0]},
                },
            },
        },
        'effects': {
            'gravity': {'acceleration': [0, -G]},
            'joint_friction': {'joint': 'guide', 'dynamic': 0.01, 'slip': EPS},
        },
        'initial': {'velocities': {'A': [-s * rate, c * rate]}},
    }
    sim = Simulation(load_scene(scene))
    reaction = balances(np.arccos(c), 3.0, {})[0][5]
    for part in np.linspace(0.0, 1.0, 41):
        found = balances(np.arccos(c), rate, {'guide': part * friction['guide']})
        reaction = min((x[5] for x in found), key=lambda N: abs(N - reaction))
    assert len(found) == 2
    assert sim.sample().reactions['guide'].force == pytest.approx([0.0, reaction], rel=1e-7)


def test_a_position_that_friction_does_not_feel_is_passed() -> None:
    """A pendulum beside the slider-crank, on a pin that rubs."""
    mechanism = {
        'alf': 1,
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': [0.5**0.5, 0.5**0.5]},
            'B': {'at': [2**0.5, 0]},
            'P': {'at': [3, 0], 'fixed': True},
            'Q': {'at': [4, 0]},
        },
        'bodies': {
            'crank': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'},
            'coupler': {'points': ['A', 'B'], 'mass': 1.0, 'inertia': 'rod'},
            'rod': {'points': ['P', 'Q'], 'mass': 2.0, 'inertia': 'rod'},
        },
        'joints': {
            'crank_pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
            'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
            'guide': {
                'type': 'slider',
                'point': 'B',
                'on': {'through': [0, 0], 'direction': [1, 0]},
            },
            'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'P'},
        },
    }
    friction = {'joint': 'pin', 'dynamic': 0.4, 'radius': 0.15, 'slip': 1e-2}
    scene = {
        'mechanism': mechanism,
        'effects': {'gravity': {'acceleration': [0, -G]}, 'joint_friction': friction},
        'initial': {'velocities': {'B': [-4.0, 0], 'Q': [0, -3.0]}},
    }
    methods: tuple[dict[str, Any], ...] = (
        {'integrator': 'dop853', 'step': 2e-3},
        {'integrator': 'dop853_adaptive', 'step': 0.1, 'tolerance': 1e-6},
        {'integrator': 'rk4', 'step': 1e-3},
    )
    for keywords in methods:
        sim = Simulation(load_scene(scene), **keywords)
        alone = rubbing_pendulum({**friction}, A=[None, -3.0])
        sim.step(round(1.0 / sim.h))
        alone.step(1000)
        here, there = sim.sample().joints['pin'], alone.sample().joints['pin']
        assert np.cos(crank(sim)[0]) < -0.5
        assert here.position == pytest.approx(there.position, abs=1e-4)


def test_a_run_repeats_beside_a_position_too() -> None:
    """Its balance is a part of the state, also of one that was written and read."""
    sim = slider_crank(RUBBING['guide and pin'], step=1e-3)
    sim.step(435)
    state = sim.state
    assert np.abs(state.loads).max() > 0.0
    sim.step(20)
    end = sim.state
    again = slider_crank(RUBBING['guide and pin'], step=1e-3)
    again.restore(from_data(json.loads(json.dumps(as_data(state))), again.state))
    again.sample().reactions['guide']
    again.step(11)
    again.sample().reactions['guide']
    again.step(9)
    assert np.cos(crank(again)[0]) < 0.0
    assert np.array_equal(again.state.q, end.q) and np.array_equal(again.state.qd, end.qd)
    assert np.array_equal(again.state.loads, end.loads)
    old = as_data(state)
    *reactions, sense = old.pop('loads')
    assert not from_data(old, again.state).loads.any()
    assert from_data({**old, 'loads': reactions}, again.state).loads.tolist() == [*reactions, 0.0]
    assert sense == 1.0
    numbers, rates = state_vector.values(sim.model, end)
    read = state_vector.state(sim.model, state, numbers, rates, end.inputs)
    assert np.array_equal(read.loads, end.loads) and read.step == end.step
    without = np.delete(numbers, -2)  # of a version that did not know the sense
    read = state_vector.state(sim.model, state, without, np.delete(rates, -2), end.inputs)
    assert read.loads.tolist() == [*end.loads[:-1], 0.0] and read.step == end.step
    numbers = np.append(numbers[: -1 - end.loads.size], numbers[-1])
    read = state_vector.state(sim.model, state, numbers, rates, end.inputs)
    assert not read.loads.any() and read.step == end.step
