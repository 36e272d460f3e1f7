"""Through singular positions at any step: no failure, no outlier, the order of the method kept."""

from __future__ import annotations

import json

import numpy as np
import pytest

from alf_ros import Scene, Simulation, load_scene
from alf_ros.arrays import Floats
from support.paths import DATA
from support.thorough import thinned

GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}


def test_change_point_four_bar_keeps_the_order_at_any_step() -> None:
    """4 s, 4 passages at about 12 rad/s; 24 odd steps, some of which land on the position."""
    scene = load_scene('change_point')
    finest = Simulation(scene, step=1e-4)
    finest.step(40000)
    turns = finest.sample().joints['crank_pin'].position
    for k in (1, 2, 5, 10):
        for odd in (0.0, 0.13, 0.26, 0.39, 0.52, 0.65):
            sim = Simulation(scene, step=5e-3 / (k + odd))
            first, last = sim.run(4.0, at=[0.0, 4.0])
            h = sim.h
            assert abs(last.energy - first.energy) < 2e6 * h**4 + 5e-8, h
            assert last.q == pytest.approx(finest.sample().q, abs=1e6 * h**4 + 5e-8), h
            assert last.joints['crank_pin'].position == pytest.approx(turns, abs=0.01)


@pytest.mark.parametrize(
    ('name', 'data'),
    [('slider_crank', 'slider_crank_6_2'), ('double_four_bar', 'n_fourbar_N2')],
)
def test_survival_sweep(name: str, data: str) -> None:
    """Some of the steps h = 0.01/k, 10 s; `hard_cases` runs all from k = 5 to 60."""
    path = DATA / f'{data}.json'
    wanted = json.loads(path.read_text())['samples']
    scene = load_scene(name)
    for k in (5, 8, 10, 13, 19, 31):
        sim = Simulation(scene, step=0.01 / k)
        worst = 0.0
        for sample, exact in zip(sim.run(10.0, every=10 * k), wanted, strict=True):
            points = sample.points
            error = points['A'] - exact['q'][:2] if 'q' in exact else points['B0'] - exact['B0']
            worst = max(worst, np.abs(error).max())
        # the truncation error of the method on the equation of one freedom, and no more
        assert worst < 1e-6 * (5 / k) ** 4 + 1e-9, k


@pytest.mark.parametrize('speed', [0.5, -2.0, 6.0])
def test_starting_exactly_in_the_singular_position(speed: float) -> None:
    """The slider-crank with its crank upright, against the equation of its one freedom."""
    from scipy.integrate import solve_ivp

    scene = load_scene(
        {
            'mechanism': 'slider_crank',
            'effects': GRAVITY,
            'initial': {
                'positions': {'A': [0, 1], 'B': [0, 0]},
                'velocities': {'A': [-speed, 0], 'B': [-2 * speed, 0]},
            },
        }
    )

    def one_freedom(t: float, y: Floats) -> list[float]:
        theta, rate = y
        top = -np.cos(theta) * (2 * np.sin(theta) * rate**2 + 9.81)
        return [rate, top / (2 / 3 + 2 * np.sin(theta) ** 2)]

    exact = solve_ivp(
        one_freedom, [0, 3], [np.pi / 2, speed], method='DOP853', rtol=1e-12, atol=1e-12
    ).y[0, -1]
    sim = Simulation(scene)
    assert sim.sample().diagnostics.singular
    sim.step(3000)
    sample = sim.sample()
    assert sample.points['A'] == pytest.approx([np.cos(exact), np.sin(exact)], abs=1e-7)
    assert sample.points['B'] == pytest.approx([2 * np.cos(exact), 0.0], abs=1e-7)


@pytest.mark.parametrize(
    ('name', 'data'),
    [('slider_crank', 'slider_crank_6_2'), ('double_four_bar', 'n_fourbar_N2')],
)
def test_adaptive_error_follows_the_tolerance_and_the_step_never_collapses(
    name: str, data: str
) -> None:
    path = DATA / f'{data}.json'
    wanted = json.loads(path.read_text())['samples'][::10]
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
        options = {'integrator': 'dop853_adaptive', 'tolerance': tolerance}
        sim = Simulation(load_scene(name), step=1.0, **options)  # type: ignore[arg-type]
        worst = 0.0
        for sample, exact in zip(sim.run(10.0), wanted, strict=True):
            points = sample.points
            error = points['A'] - exact['q'][:2] if 'q' in exact else points['B0'] - exact['B0']
            worst = max(worst, np.abs(error).max())
            assert sim.state.pace > 5e-3
        assert worst < 100 * tolerance
        errors.append(worst)
    assert errors == sorted(errors, reverse=True)


def test_adaptive_through_a_general_change_point() -> None:
    for tolerance in (1e-6, 1e-8, 1e-10, 1e-12):
        sim = Simulation(
            load_scene('change_point'), step=1.0, integrator='dop853_adaptive', tolerance=tolerance
        )
        energies = [sample.energy for sample in sim.run(4.0)]
        assert sim.state.pace > 1e-3
        assert np.ptp(energies) / energies[0] < max(tolerance, 1e-10)


@pytest.mark.parametrize(
    ('name', 'drift'),
    thinned([('slider_crank', 1e-9), ('double_four_bar', 1e-8)], keep=[('double_four_bar', 1e-8)]),
)
def test_one_simulated_hour(name: str, drift: float) -> None:
    """About 4,000 passages: no drift of the energy, and still on the branch it began on."""
    sim = Simulation(load_scene(name), step=1.0, integrator='dop853_adaptive', tolerance=1e-12)
    energy = sim.sample().energy
    for _ in range(60):
        sim.step(60)
        sample = sim.sample()
        assert abs(sample.energy - energy) < drift * energy
        points = sample.points
        if name == 'slider_crank':
            assert points['B'][0] == pytest.approx(2 * points['A'][0], abs=1e-12)
        else:
            assert points['B2'] - [2, 0] == pytest.approx(points['B0'], abs=1e-12)
    assert sim.t == 3600.0


@pytest.mark.parametrize(
    ('name', 'step', 'penalties', 'size'),
    [
        ('slider_crank', 4e-3, (1e4, 1e6, 1e7, 1e9, 1e10), 1e-10),
        ('double_four_bar', 4e-3, (1e4, 1e6, 1e7, 1e9, 1e10), 1e-9),
        ('change_point', 2e-3, (1e4, 1e6, 1e7, 1e9, 1e10), 1e-9),
        ('four_bar', 2.5e-4, (1e4, 1e5, 1e6, 1e7, 1e9, 1e10, 1e11), 1e-10),  # never singular
    ],
)
def test_the_answer_does_not_depend_on_the_penalty(
    name: str, step: float, penalties: tuple[float, ...], size: float
) -> None:
    def end(penalty: float) -> Floats:
        sim = Simulation(load_scene(name), step=step, integrator='dop853', penalty=penalty)
        sim.step(round({'four_bar': 2.0, 'change_point': 4.0}.get(name, 10.0) / step))
        return sim.sample().q

    usual = end(1e8)
    for penalty in penalties:
        assert end(penalty) == pytest.approx(usual, abs=size), penalty


def parallelogram(cranks: tuple[int, ...]) -> Scene:
    """A bar on parallel cranks; the third one depends on the other two everywhere."""
    points: dict[str, object] = {}
    bodies: dict[str, object] = {
        'bar': {
            'points': ['B0', 'B2', 'B1'],
            'mass': 2,
            'com': [1, 0],
            'inertia': {'about_com': 1},
        }
    }
    joints: dict[str, object] = {}
    for k in range(3):
        points |= {f'A{k}': {'at': [k, 0], 'fixed': True}, f'B{k}': {'at': [k, 1]}}
    for k in cranks:
        mass = 3.0 / len(cranks)
        bodies[f'crank{k}'] = {'points': [f'A{k}', f'B{k}'], 'mass': mass, 'inertia': 'rod'}
        for name, pair, point in (
            (f'foot{k}', ['ground', f'crank{k}'], f'A{k}'),
            (f'head{k}', [f'crank{k}', 'bar'], f'B{k}'),
        ):
            joints[name] = {'type': 'revolute', 'between': pair, 'at': point}
    return load_scene(
        {
            'mechanism': {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints},
            'effects': GRAVITY,
            'initial': {'velocities': {'B0': [1, 0]}},
        }
    )


def test_a_redundant_crank_changes_nothing_but_the_reactions() -> None:
    """5 s through the passages in which the parallelogram could fold: same motion, same energy."""
    samples = []
    for cranks in ((0, 2), (0, 1, 2)):
        sim = Simulation(parallelogram(cranks), step=4e-3, integrator='dop853')
        energy = sim.sample().energy
        sim.step(1250)
        samples.append(sim.sample())
        assert samples[-1].energy == pytest.approx(energy, abs=1e-9)
    minimal, redundant = samples
    assert redundant.q == pytest.approx(minimal.q, abs=1e-9)
    assert (minimal.diagnostics.redundant, redundant.diagnostics.redundant) == (0, 1)
    assert not redundant.diagnostics.singular
    assert not any(reaction.indeterminate for reaction in minimal.reactions.values())
    assert all(reaction.indeterminate for reaction in redundant.reactions.values())
