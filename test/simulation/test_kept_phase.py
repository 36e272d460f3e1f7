"""Gears, racks, threads and couplings keep their phase in runs, also where loops repeat them."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from support.geared_five_bar import START, A, D, geared_five_bar, height

G = 9.81
REVOLUTE = {'type': 'revolute'}
ROD = {'mass': 1, 'inertia': 'rod'}
INTEGRATORS = [('rk4', 1e-3), ('dop853', 5e-3), ('dop853_adaptive', 0.01), ('esdirk43', 1e-3)]


def inertia(angle: float) -> float:
    """dT / d(½ ω²) of two cranks, and of two rods that move with both ends."""
    h = 1e-30
    x, y = A * np.cos(angle + 1j * h), A * np.sin(angle + 1j * h)
    u, v = np.array([x.imag, y.imag]) / h, np.array([0.0, height(angle + 1j * h).imag]) / h
    return float(2.0 * A**2 / 3.0 + 2.0 * (u @ u + u @ v + v @ v) / 3.0)


@cache
def lifted(times: tuple[float, ...]) -> Floats:
    """The angle of the left crank (rad) under G upwards, from the equation of its one freedom."""

    def rates(_: float, y: Floats) -> list[float]:
        angle, speed, e = y[0], y[1], 1e-3
        slope = 8.0 * (inertia(angle + e) - inertia(angle - e))
        slope = (slope - inertia(angle + 2 * e) + inertia(angle - 2 * e)) / (12.0 * e)
        # A/2 sin for the centre of each crank, (y of its end + y of P) / 2 of each rod
        rise = 2.0 * A * math.cos(angle) + float(height(angle + 1e-30j).imag) / 1e-30
        return [speed, (G * rise - 0.5 * slope * speed**2) / inertia(angle)]

    start = [START, 0.0]
    found = solve_ivp(rates, (0.0, times[-1]), start, 'DOP853', times, rtol=1e-10, atol=1e-11)
    return np.asarray(found.y[0])


def simulated(mechanism: dict[str, Any], g: float, integrator: str, step: float) -> Simulation:
    gravity = {'gravity': {'acceleration': [0, g]}}
    scene = load_scene({'mechanism': mechanism, 'effects': gravity})
    return Simulation(scene, integrator=integrator, step=step)


@pytest.mark.parametrize(('integrator', 'step'), INTEGRATORS)
def test_gears_that_repeat_what_a_guide_does(integrator: str, step: float) -> None:
    """The loop with gears and guide is redundant: with a phase that drifts it would jam."""
    simulation = simulated(geared_five_bar(True), G, integrator, step)
    times = tuple((np.arange(1, 9) * 0.25).tolist())
    samples = simulation.run(2.0, at=times)
    for sample, angle in zip(samples, lifted(times), strict=True):
        left, right = sample.joints['left'].position, sample.joints['right'].position
        assert left == pytest.approx(angle, abs=2e-7)
        assert left + right == pytest.approx(math.pi, abs=1e-14)
        assert np.abs(sample.phi).max() < 1e-15


@pytest.mark.parametrize(('integrator', 'step'), INTEGRATORS)
def test_they_pass_dead_points(integrator: str, step: float) -> None:
    """Under gravity P falls through the line of both rods."""
    simulation = simulated(geared_five_bar(True), -G, integrator, step)
    energy, lowest = simulation.sample().energy, 0.0
    for sample in simulation.run(5.0, every=max(1, round(0.05 / step))):
        assert sample.energy == pytest.approx(energy, abs=1e-5)
        assert abs(sample.points['P'][0] - D / 2) < 1e-14
        lowest = min(lowest, sample.points['P'][1])
    assert lowest < -A


def parallelogram(coupled: bool) -> dict[str, Any]:
    """A parallelogram of cranks (0.3 m) and coupler (1 m); `coupled`: both cranks turn alike."""
    couplings = {'alike': {'joints': {'left': 1, 'right': -1}}} if coupled else {}
    return {
        'alf': 1,
        'space': 'planar',
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'C': {'at': [1, 0], 'fixed': True},
            'P': {'at': [0, 0.3]},
            'Q': {'at': [1, 0.3]},
        },
        'bodies': {
            'one': {'points': ['O', 'P'], **ROD},
            'coupler': {'points': ['P', 'Q'], **ROD},
            'two': {'points': ['C', 'Q'], **ROD},
        },
        'joints': {
            'left': {**REVOLUTE, 'between': ['ground', 'one'], 'at': 'O'},
            'right': {**REVOLUTE, 'between': ['ground', 'two'], 'at': 'C'},
            'elbow': {**REVOLUTE, 'between': ['one', 'coupler'], 'at': 'P'},
            'knee': {**REVOLUTE, 'between': ['coupler', 'two'], 'at': 'Q'},
        },
        'couplings': couplings,
    }


@pytest.mark.parametrize(
    ('integrator', 'step'),
    [('rk4', 1e-2), ('dop853', 1e-2), ('dop853_adaptive', 1e-2), ('esdirk43', 1e-3)],
)
@pytest.mark.parametrize('speed', [2.0 * math.pi, 6.1])
def test_a_coupling_repeats_a_parallelogram_and_holds_it_when_flat(
    integrator: str, step: float, speed: float
) -> None:
    """One turn a second: steps end in the flat position, where only the coupling forbids that the
    cranks turn against each other. The motion is uniform."""
    scene = {
        'mechanism': parallelogram(True),
        'effects': {},
        'initial': {'velocities': {'P': [-0.3 * speed, 0]}},
    }
    simulation = Simulation(load_scene(scene), integrator=integrator, step=step)
    turns = 20.0 * 2.0 * math.pi / speed
    for sample in simulation.run(turns, every=round(0.07 / step)):
        left, right = sample.joints['left'].position, sample.joints['right'].position
        assert left == pytest.approx(0.5 * math.pi + speed * sample.t, abs=1e-9)
        assert left - right == pytest.approx(0.0, abs=3e-14)
        assert not sample.diagnostics.singular
    assert sample.joints['right'].velocity == pytest.approx(speed, rel=1e-11)


def pair(radii: tuple[float, float]) -> dict[str, Any]:
    """Two wheels in mesh on fixed centres."""
    wheel = {'mass': 1, 'inertia': {'about_com': 0.02}, 'com': [0, 0]}
    return {
        'alf': 1,
        'space': 'planar',
        'parameters': {'first': radii[0], 'second': radii[1]},
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'C': {'at': [sum(radii), 0], 'fixed': True},
            'A': {'at': [0.1, 0]},
            'B': {'at': [sum(radii) + 0.1, 0]},
        },
        'bodies': {'one': {'points': ['O', 'A'], **wheel}, 'two': {'points': ['C', 'B'], **wheel}},
        'joints': {
            'left': {**REVOLUTE, 'between': ['ground', 'one'], 'at': 'O'},
            'right': {**REVOLUTE, 'between': ['ground', 'two'], 'at': 'C'},
            'mesh': {
                'type': 'gear',
                'between': ['one', 'two'],
                'centres': ['O', 'C'],
                'radii': [*radii],
            },
        },
    }


def driven_pair(radii: tuple[float, float]) -> Simulation:
    """The wheels under an effort."""
    effects = {'joint_effort': {'joint': 'left', 'effort': 3.0}}
    return Simulation(load_scene({'mechanism': pair(radii), 'effects': effects}), step=0.02)


def test_the_phase_has_the_rounding_of_one_turn() -> None:
    """There are some hundred turns."""
    simulation = driven_pair((0.2, 0.3))
    simulation.place('one', (0, 0, 0.0), (0, 0, 60.0))
    for sample in simulation.run(15.0, every=100):
        left, right = sample.joints['left'].position, sample.joints['right'].position
        assert abs(2.0 * left + 3.0 * right) < 1e-15 * max(abs(left), 10.0)
        assert abs(sample.phi[sample.model.row_names.index('mesh')]) < 1e-15
    assert left > 100.0 * 2.0 * math.pi


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'esdirk43'])
@pytest.mark.parametrize('turned', [3.2, 3.6, 6.0, 40.0])
def test_steps_of_more_than_half_a_turn_are_right_or_say_so(
    integrator: str, turned: float
) -> None:
    """Turns cannot be counted then; after three and two whole turns the teeth meet again."""
    scene = load_scene({'mechanism': pair((0.2, 0.3)), 'effects': {}})
    simulation = Simulation(scene, integrator=integrator, step=turned / 60.0)
    simulation.place('one', (0, 0, 0.0), (0, 0, 60.0))
    energy = simulation.sample().energy
    try:
        simulation.step(50)
    except StepError as error:
        assert 'smaller step' in error.remedy
    else:
        right = simulation.sample().energy == pytest.approx(energy, rel=1e-9)
        assert right or simulation.resolution.too_long


def test_a_state_has_its_phase() -> None:
    """A restored run repeats bit for bit; a state of no phase meshes where it is."""
    simulation = driven_pair((0.2, 0.3))
    simulation.step(50)
    state = simulation.state
    simulation.step(50)
    there = simulation.state
    simulation.restore(state)
    simulation.step(50)
    for name in ('q', 'qd', 'sums'):
        assert getattr(simulation.state, name).tobytes() == getattr(there, name).tobytes()
    other = driven_pair((0.25, 0.25))
    moved = state.moved(state.q, np.zeros_like(state.q), state.turns)
    other.restore(moved)
    first = other.sample().joints
    other.step(100)
    last = other.sample().joints
    turned = [last[name].position - first[name].position for name in ('left', 'right')]
    assert abs(turned[0]) > 0.1
    # the rounding of angles of several turns, which are subtracted
    assert abs(turned[0] + turned[1]) < 1e-15 * max(abs(last['left'].position), 10.0)
