"""A table on parallel cranks of one length, drawn flat: more of them than two lose another row."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.inspection.soundness import examine
from alf_ros.simulation.side_by_side import SideBySide
from support.thorough import combined, thinned

G, CRANK, TABLE = 9.81, 1.0, 2.0  # m/s^2; kg of a crank, and of the table
TABLES = {  # where the cranks turn, m; their length, m; and the mass centre of the table, m
    'two': ([0.0, 1.0], 1.0, 0.1),
    'three': ([0.0, 1.0, 2.3], 1.0, 0.5),
    'a table that would turn': ([0.0, 1.0, 2.3], 1.0, 0.0),
    'four': ([0.0, 1.0, 2.3, 3.0], 1.0, 0.5),
    'two of six side by side': ([0.0, 0.045, 0.28, 0.51, 1.33, 1.97], 1.2, 1.5),
}
SHORT = {'five on short cranks': ([0.0, 0.9, 1.5, 2.3, 2.9], 0.5, 0.5)}
INTEGRATORS = 'rk4', 'dop853', 'dop853_adaptive', 'esdirk43'


def pin(one: str, other: str, at: str) -> dict[str, Any]:
    return {'type': 'revolute', 'between': [one, other], 'at': at}


def flat(name: str) -> dict[str, Any]:
    """The scene: all cranks point along x, and nothing moves yet."""
    feet, length, com = (TABLES | SHORT)[name]
    points: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    bodies: dict[str, Any] = {}
    for k, x in enumerate(feet):
        points[f'A{k}'] = {'at': [x, 0.0], 'fixed': True}
        points[f'B{k}'] = {'at': [x + length, 0.0]}
        bodies[f'crank{k}'] = {'points': [f'A{k}', f'B{k}'], 'mass': CRANK, 'inertia': 'rod'}
        joints[f'foot{k}'] = pin('ground', f'crank{k}', f'A{k}')
        joints[f'head{k}'] = pin(f'crank{k}', 'table', f'B{k}')
    bodies['table'] = {
        'points': [f'B{k}' for k in range(len(feet))],
        'mass': TABLE,
        'com': [com, 0.2],
        'inertia': {'about_com': 0.3},
    }
    mechanism = {'alf': 1, 'space': 'planar', 'points': points, 'bodies': bodies, 'joints': joints}
    return {'mechanism': mechanism, 'effects': {'gravity': {'acceleration': [0.0, -G]}}}


def pendulum(name: str) -> tuple[float, float]:
    """q̈ of the flat table, m/s^2, and its length, m: it moves without turning, as a pendulum."""
    feet, length, _ = (TABLES | SHORT)[name]
    n = len(feet)
    return -G * (n * CRANK / 2.0 + TABLE) / (n * CRANK / 3.0 + TABLE), length


@pytest.mark.parametrize(('name', 'integrator'), combined(TABLES, INTEGRATORS))
def test_it_falls_from_rest_as_the_pendulum_that_it_is(name: str, integrator: str) -> None:
    """The acceleration without the lost rows turns the table, but no branch does: projected from
    there, places were not on the branch. Runs ended at t = 0, or were off without a word."""
    rate, length = pendulum(name)

    def rates(t: float, y: Floats) -> tuple[float, float]:
        return y[1], rate / length * np.cos(y[0])

    simulation = Simulation(load_scene(flat(name)), step=1e-3, integrator=integrator)
    begun = simulation.sample().energy
    simulation.step(500)
    ended = simulation.sample()
    angle = solve_ivp(rates, (0.0, 0.5), (0.0, 0.0), 'DOP853', rtol=1e-12, atol=1e-13).y[0, -1]
    exact = length * np.array([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(ended.points['B0'], exact, atol=1e-7)
    assert ended.energy == pytest.approx(begun, abs=1e-6)
    assert not ended.diagnostics.trouble


@pytest.mark.parametrize('name', [*TABLES, *SHORT])
def test_a_sample_at_rest_tells_how_it_leaves(name: str) -> None:
    """It had accelerations of zero, or of a table that turns, and reactions that fit neither; or
    none, where places of a sample lay too wide apart for short cranks."""
    rate, _ = pendulum(name)
    sample = Simulation(load_scene(flat(name))).sample()
    count = len((TABLES | SHORT)[name][0])
    for k in range(count):
        np.testing.assert_allclose(sample.qdd[2 * k : 2 * k + 2], [0.0, rate], atol=1e-6)
    feet = [sample.reactions[f'foot{k}'].force[1] for k in range(count)]
    lifted = count * CRANK * (G + rate / 2.0) + TABLE * (G + rate)
    if count == 2:  # else how cranks share it is open
        assert sum(feet) == pytest.approx(lifted, abs=1e-5)


def test_a_sample_of_short_cranks_tells_how_it_leaves() -> None:
    """Places of a sample lie wide apart: their error looked as if the branch passed beside it,
    and accelerations were those without the lost row."""
    bars = {'near': ('A0', 'B0', 1.0), 'far': ('A1', 'B1', 4.0), 'table': ('B0', 'B1', 2.0)}
    hinges = ('ground', 'near', 'A0'), ('ground', 'far', 'A1')
    heads = ('near', 'table', 'B0'), ('far', 'table', 'B1')
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': {
            'A0': {'at': [0.0, 0.0], 'fixed': True},
            'A1': {'at': [1.0, 0.0], 'fixed': True},
            'B0': {'at': [0.5, 0.0]},
            'B1': {'at': [1.5, 0.0]},
        },
        'bodies': {
            name: {'points': [one, other], 'mass': mass, 'inertia': 'rod'}
            for name, (one, other, mass) in bars.items()
        },
        'joints': {
            f'pin{k}': {'type': 'revolute', 'between': [one, other], 'at': at}
            for k, (one, other, at) in enumerate([*hinges, *heads])
        },
    }
    scene = {'mechanism': mechanism, 'effects': {'gravity': {'acceleration': [0.0, -G]}}}
    sample = Simulation(load_scene(scene)).sample()
    rate = -G * (5.0 / 2.0 + 2.0) / (5.0 / 3.0 + 2.0)
    np.testing.assert_allclose(sample.qdd, [0.0, rate, 0.0, rate], atol=1e-8)
    feet = sample.reactions['pin0'].force[1] + sample.reactions['pin1'].force[1]
    assert feet == pytest.approx(5.0 * (G + rate / 2.0) + 2.0 * (G + rate), abs=1e-6)


@pytest.mark.parametrize('name', thinned(['four', 'two of six side by side'], keep=['four']))
def test_check_knows_one_freedom(name: str) -> None:
    """Places found around it lay so close that their σ was 1e-4 of an ordinary one."""
    scene = load_scene(flat(name))
    assert examine(scene).freedoms == 1
    simulation = Simulation(scene)
    assert simulation.model.system.ordinary > 3e-3
    # lengths agree: what a singular position leaves open was taken for a contradiction
    assert simulation.adjustment is None or max(simulation.adjustment.changes.values()) < 1e-14


@pytest.mark.parametrize(('name', 'integrator'), combined(TABLES, INTEGRATORS))
def test_a_force_that_begins_later_starts_it_as_from_the_start(name: str, integrator: str) -> None:
    """After steps at rest the lost rows were forgotten: it began to turn, or was refused."""
    scene = load_scene({'mechanism': flat(name)['mechanism']})
    ends, begun = [], []
    for rest in (0, 3):
        simulation = Simulation(scene, step=1e-3, integrator=integrator)
        simulation.step(rest)
        simulation.apply_wrench('B0', [1.0, 3.0])
        begun.append(simulation.sample().qdd)
        simulation.step(20)
        ends.append(simulation.state)
    np.testing.assert_allclose(begun[1], begun[0], atol=1e-8)
    np.testing.assert_allclose(ends[1].q, ends[0].q, atol=1e-10)
    np.testing.assert_allclose(ends[1].qd, ends[0].qd, atol=1e-8)


# ----------------------------------------------------------------------------------------- placed


def lifted(name: str) -> dict[str, Any]:
    """The same scene, where the cranks stand at 0.4 rad."""
    feet, length, _ = TABLES[name]
    head = length * np.array([np.cos(0.4), np.sin(0.4)])
    heads = {f'B{k}': [x + head[0], head[1]] for k, x in enumerate(feet)}
    return {**flat(name), 'initial': {'positions': heads}}


@pytest.mark.parametrize(('name', 'integrator'), combined(TABLES, INTEGRATORS))
def test_it_falls_from_where_it_is_placed_flat(name: str, integrator: str) -> None:
    """Branches were known where the scene starts only: accelerations were wrong or NaN without a
    word, and runs ended."""
    rate, length = pendulum(name)
    simulation = Simulation(load_scene(lifted(name)), step=1e-3, integrator=integrator)
    simulation.step(3)
    for angle in (0.0, np.pi):
        simulation.place('crank0', (0.0, 0.0, angle), (0.0, 0.0, 0.0))
        assert not simulation.state.qd.any()
        begun = simulation.sample()
        np.testing.assert_allclose(begun.qdd, len(TABLES[name][0]) * [0.0, rate], atol=1e-6)
        simulation.step(100)
        theta = solve_ivp(
            lambda t, y: (y[1], rate / length * np.cos(y[0])),
            (0.0, 0.1),
            (angle, 0.0),
            'DOP853',
            rtol=1e-12,
            atol=1e-13,
        ).y[0, -1]
        ended = simulation.sample()
        exact = length * np.array([np.cos(theta), np.sin(theta)])
        np.testing.assert_allclose(ended.points['B0'], exact, atol=1e-8)
        assert not ended.diagnostics.trouble


def test_whoever_goes_on_from_a_flat_table_leaves_as_it_does() -> None:
    """Copies, restored states, and members of lanes: bit for bit."""
    scene = load_scene(lifted('three'))
    placed = Simulation(scene, step=1e-3)
    placed.place('crank0', (0.0, 0.0, np.pi), (0.0, 0.0, 0.0))
    restored = Simulation(scene, step=1e-3)
    restored.restore(placed.state)
    every = [placed, restored, copy.copy(placed), pickle.loads(pickle.dumps(placed))]
    begun = [each.sample().qdd for each in every]
    np.testing.assert_allclose(begun[0], 3 * [0.0, pendulum('three')[0]], atol=1e-6)
    together = [copy.copy(placed), Simulation(scene, step=1e-3)]
    assert not SideBySide(together).step(50)
    for each in every:
        each.step(50)
    for each, rates in zip([*every, together[0]], [*begun, begun[0]], strict=True):
        np.testing.assert_array_equal(rates, begun[0])
        np.testing.assert_array_equal(each.state.q, placed.state.q)


def test_a_crank_that_is_stopped_where_it_lies_flat_stops_all() -> None:
    """Rows let the table turn there, but no motion begins so: it kept a velocity along no branch,
    and the run ended."""
    scene = {**flat('three'), 'initial': {'velocities': {'B0': [0.0, 1.0]}}}
    simulation = Simulation(load_scene(scene), step=1e-3)
    simulation.place('crank0', None, (0.0, 0.0, 0.0))
    assert not simulation.state.qd.any()
    simulation.place('crank0', None, (0.0, 0.0, 2.0))
    np.testing.assert_allclose(simulation.sample().qd, 3 * [0.0, 2.0], atol=1e-12)
    simulation.step(20)
    with pytest.raises(AssemblyError, match='cannot move like that'):
        simulation.place('table', None, (0.0, 0.0, 1.0))
    simulation.reset()
    with pytest.raises(AssemblyError, match=r'fit no branch.*B0: \[0, '):
        simulation.place('table', None, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(simulation.sample().qd, 3 * [0.0, 1.0], atol=1e-12)
