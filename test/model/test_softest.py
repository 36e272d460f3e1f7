"""The distance to singular positions against dense singular values, and no false alarm of a pass.

The reference is made apart from the package's iteration: σ are the generalised singular values of
α^½ Φ_q and M^½, from a QR decomposition of both, with penalty 1.
"""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros import Simulation, kernel, load_scene
from alf_ros.arrays import Floats
from alf_ros.kernel.data import EPS
from alf_ros.logs.report.singularity_distance import distances, passes
from alf_ros.model.compile import Model
from alf_ros.model.softest_modes import NIL
from alf_ros.resources import library
from alf_ros.simulation import state_vector
from support.some_scenes import SOME_SCENES
from support.thorough import thinned

SCENES = sorted(library('scenes'))
RPS = {
    'mechanism': {
        'alf': 1,
        'space': 'spatial',
        'parameters': {'rb': 1.0, 'rp': 0.6, 'H': 1.2},
        'points': {
            'B<k>': {
                'for': {'k': [0, 2]},
                'at': ['rb*cos(2*pi*k/3)', 'rb*sin(2*pi*k/3)', 0],
                'fixed': True,
            },
            'P<k>': {'for': {'k': [0, 2]}, 'at': ['rp*cos(2*pi*k/3)', 'rp*sin(2*pi*k/3)', 'H']},
            'C': {'at': [0, 0, 'H']},
        },
        'vectors': {
            'u<k>': {
                'for': {'k': [0, 2]},
                'along': ['(rp-rb)*cos(2*pi*k/3)', '(rp-rb)*sin(2*pi*k/3)', 'H'],
            },
        },
        'bodies': {
            'lower<k>': {
                'for': {'k': [0, 2]},
                'points': ['B<k>'],
                'vectors': ['u<k>'],
                'mass': 2,
                'inertia': {'about_com': [0.01, 0.1, 0.1]},
                'com': [0.4, 0, 0],
            },
            'upper<k>': {
                'for': {'k': [0, 2]},
                'points': ['P<k>'],
                'vectors': ['u<k>'],
                'mass': 2,
                'inertia': {'about_com': [0.01, 0.1, 0.1]},
                'com': [-0.4, 0, 0],
            },
            'top': {
                'points': ['C', 'P0', 'P1', 'P2'],
                'mass': 20,
                'inertia': {'about_com': [1.8, 1.8, 3.6]},
                'com': [0, 0, 0],
            },
        },
        'joints': {
            'base<k>': {
                'for': {'k': [0, 2]},
                'type': 'revolute',
                'between': ['ground', 'lower<k>'],
                'at': 'B<k>',
                'axis': ['-sin(2*pi*k/3)', 'cos(2*pi*k/3)', 0],
            },
            'leg<k>': {
                'for': {'k': [0, 2]},
                'type': 'prismatic',
                'between': ['lower<k>', 'upper<k>'],
                'at': 'P<k>',
                'axis': 'u<k>',
            },
            'ball<k>': {
                'for': {'k': [0, 2]},
                'type': 'spherical',
                'between': ['upper<k>', 'top'],
                'at': 'P<k>',
            },
        },
    },
    'effects': {
        'gravity': {'acceleration': [0, 0, -9.81]},
        'spring': {
            f'spring{k}': {'between': [f'B{k}', f'P{k}'], 'stiffness': 3000.0} for k in range(3)
        },
        'damper': {
            f'damper{k}': {'between': [f'B{k}', f'P{k}'], 'damping': 20.0} for k in range(3)
        },
    },
    'initial': {'velocities': {'P0': [None, None, 0.5]}},
    'solver': {'step': 1e-2, 'integrator': 'dop853'},
}


def dense(model: Model, q: Floats) -> tuple[Floats, Floats]:
    """Scaled Φ_q (rows, n) and M (n, n), column by column."""
    rows, D, unit = model.system.rows, model.layout.dimension, model.unit
    g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
    kernel.jacobian(unit, rows, q, g, g2)
    phi_q, M = np.zeros((rows.alpha.size, model.n)), np.zeros((model.n, model.n))
    for k in range(model.n):
        e, column, moved = np.zeros(q.size), np.zeros(rows.alpha.size), np.zeros(model.n)
        e[k] = 1.0
        kernel.times_jacobian(unit, rows, g, g2, e, column)
        kernel.add_mass_times(unit, model.system.mass, 1.0, e, moved)
        phi_q[:, k], M[:, k] = column, moved
    return np.sqrt(rows.alpha / model.penalty)[:, None] * phi_q, M


def least(model: Model, q: Floats, dependent: int) -> float:
    """Least σ of the independent rows: with B = Q1 R and M^½ = Q2 R it is the tangent of the
    least angle whose sine is a singular value of Q1, of as many as rows are independent."""
    B, M = dense(model, q)
    mass, V = np.linalg.eigh(M)
    mass[mass < 1e-13 * mass.max()] = 0.0  # what has no mass of its own
    Q, _ = np.linalg.qr(np.vstack([B, np.sqrt(mass)[:, None] * V.T]))
    s = np.linalg.svd(Q[: B.shape[0]], compute_uv=False)[len(model.row_names) - dependent - 1]
    return float(s / np.sqrt(max(1.0 - s * s, 1e-300)))


def compared(simulation: Simulation) -> None:
    """σ is within its error, which is small: largest where many σ are nearly the same."""
    model, found = simulation.model, simulation.sample().diagnostics
    wanted = least(model, simulation.state.q, simulation._start.dependent_rows)
    assert abs(found.distance - wanted) <= found.distance_error + 64.0 * EPS
    assert found.distance_error <= 3e-5 * wanted


@pytest.mark.parametrize('name', SCENES)
def test_distance_is_the_least_singular_value_of_independent_rows(name: str) -> None:
    simulation = Simulation(load_scene(name))
    if len(simulation.model.row_names) == simulation._start.dependent_rows:
        assert simulation.sample().diagnostics.distance == 1.0
        return
    for _ in range(6):
        compared(simulation)
        simulation.step(max(1, round(0.13 / simulation.h)))


@pytest.mark.parametrize(
    ('name', 'first'),
    [
        ('slider_crank', 0.391732),
        ('double_four_bar', 0.714356),  # two modes at once
        ('change_point', 0.501786),
        ('peaucellier', 0.207895),
        ('scissor_lift', 2.524700),  # 18 rows depend on the others everywhere
        ('n_four_bar', 0.720308),  # ten modes at once, at a penalty of 1e10
    ],
)
def test_distance_is_accurate_where_it_is_small(name: str, first: float) -> None:
    scene = load_scene(name)
    watched = Simulation(scene, watch=True)
    watched.step(round((first + 0.02) / watched.h))
    (event,) = watched.passes
    assert event.t == pytest.approx(first, abs=2e-6)
    simulation, seen = Simulation(scene), []
    simulation.step(int((first - 0.11) / simulation.h))
    for x in 10.0 ** -np.arange(1.0, 8.0):
        (sample,) = simulation.run(0.0, at=[event.t - x])
        wanted = least(simulation.model, sample.state.q, simulation._start.dependent_rows)
        found = sample.diagnostics
        if wanted < NIL:
            break
        assert found.distance == pytest.approx(wanted, rel=2e-7, abs=1e-15), x
        assert abs(found.distance - wanted) <= found.distance_error + 64.0 * EPS
        assert found.distance_error < 1e-5 * wanted
        seen.append(found.distance / x)
    assert np.ptp(seen[2:]) < 0.02 * seen[-1]  # it goes linearly


def true_passes(name: str, options: dict[str, object], end: float) -> list[float]:
    """Zeros of the dense σ on a run: each minimum of some instants, by golden section."""
    simulation = Simulation(load_scene(name), **options)  # type: ignore[arg-type]
    model, dependent = simulation.model, simulation._start.dependent_rows
    if len(model.row_names) == dependent:
        return []
    instants = 300 if model.n < 100 else 60  # dense matrices of a large one take long
    every = max(1, round(end / simulation.h / instants))
    states, sigma = [], []
    for sample in simulation.run(end, every=every):
        states.append(sample.state)
        sigma.append(least(model, sample.state.q, dependent))
    found, width = [], every * simulation.h

    def at(k: int, s: float) -> float:
        simulation.restore(states[k])
        *_, sample = simulation.run(2.0 * width, at=[simulation.t + s])
        return least(model, sample.state.q, dependent)

    for k in range(len(sigma) - 2):
        if not sigma[k] > sigma[k + 1] <= sigma[k + 2] or sigma[k + 1] > 0.5 * max(sigma):
            continue
        low, high = 0.0, 2.0 * width
        for _ in range(40):
            third = (high - low) * 0.382
            if at(k, low + third) < at(k, high - third):
                high -= third
            else:
                low += third
        if at(k, low) < 1e-6 * max(sigma):
            found.append(states[k].step * simulation.h + low)
    return found


@pytest.mark.parametrize(
    'name',
    thinned(
        SOME_SCENES,
        keep=['bricard', 'change_point', 'double_four_bar', 'scissor_lift', 'slider_crank'],
    ),
)
def test_passes_are_the_zeros_of_the_dense_distance(name: str) -> None:
    end = {'change_point': 3.9, 'bricard': 1.0}.get(name, 3.0)
    watched = Simulation(load_scene(name), watch=True)
    watched.step(round(end / watched.h))
    assert [event.t for event in watched.passes] == pytest.approx(
        true_passes(name, {}, end), abs=1e-6
    )


ROUGH = [
    {'integrator': 'dop853_adaptive', 'step': 1e-2, 'tolerance': 1e-3},
    {'integrator': 'dop853_adaptive', 'step': 1.0, 'tolerance': 1e-4},
    {'integrator': 'dop853', 'step': 2e-2},
    {'integrator': 'esdirk43_adaptive', 'step': 2e-2, 'tolerance': 1e-4},
]
COUNTS = {
    'slider_crank': 5,
    'double_four_bar': 4,
    'change_point': 5,
    'peaucellier': 5,
    'n_four_bar': 3,
    'scissor_lift': 1,
    'delta_robot': 0,
    'coin': 0,
    'differential_drive_cart': 0,
    'stewart_platform': 0,
    'bricard': 0,
    'jansen_leg': 0,
    'planetary_gear': 0,
}


@pytest.mark.parametrize(
    'options',
    thinned(ROUGH, keep=lambda options: options['step'] != 1.0),
    ids=lambda each: f'{each["integrator"]}-{each["step"]}',
)
def test_long_steps_and_loose_tolerances_miss_and_invent_no_pass(
    options: dict[str, object],
) -> None:
    few = {'slider_crank', 'change_point', 'coin'}  # implicit steps cost more
    names = few if 'esdirk' in str(options['integrator']) else COUNTS
    for name in names:
        count = COUNTS[name]
        watched = Simulation(load_scene(name), watch=True, **options)  # type: ignore[arg-type]
        watched.step(round((4.0 if count > 3 else 3.0) / watched.h))
        assert len(watched.passes) == count, name


def test_a_soft_mechanism_is_not_near_a_singular_position() -> None:
    """A 3-RPS swings by 1 % of a σ of 0.01, with a penalty of 1e10."""
    watched = Simulation(load_scene(RPS), watch=True)
    t, q, sigma = [], [], []
    for sample in watched.run(6.0):
        t.append(sample.t)
        q.append(state_vector.values(watched.model, sample.state)[0][: watched.model.n])
        sigma.append(sample.diagnostics.distance)
    assert watched.passes == ()
    assert 0.0097 < min(sigma) and max(sigma) < 0.0102
    compared(watched)
    found = distances(Simulation(load_scene(RPS)), np.array(t), np.array(q))
    assert passes(found) == []
    assert found.sigma == pytest.approx(sigma, rel=1e-5)
    assert np.abs(np.diff(found.sigma, 2)).max() < 3e-5  # no rounding is seen in it


def test_a_near_miss_is_told_once_and_only_if_it_is_near() -> None:
    """A slider-crank led along given angles: through at 1 s, or short of that by so much."""
    simulation = Simulation(load_scene('slider_crank'))
    model = simulation.model
    t = np.linspace(0.0, 2.0, 1001).astype(np.float64) + 1e-4
    for short, events in ((None, [True]), (0.1, []), (2e-3, [False]), (1e-6, [False])):
        away = 0.3 * (t - 1.0) if short is None else short + 0.3 * (t - 1.0) ** 2
        angle = 0.5 * np.pi - away
        places = {'A': (np.cos(angle), np.sin(angle)), 'B': (2.0 * np.cos(angle), 0.0 * t)}
        names = [name.split('.') for name in state_vector.names(model, simulation.state)]
        q = [places[name[0]]['xy'.index(name[1])] for name in names[: model.n]]
        found = passes(distances(simulation, t, np.column_stack(q)))
        assert [through for _, _, through in found] == events
        for instant, sigma, _ in found:
            assert instant == pytest.approx(1.0, abs=1e-6 if short is None else 1e-3)
            k = int(np.abs(t - 1.0).argmin())
            blocks = simulation.state.q
            blocks.reshape(-1, 2)[model.coordinate_block] = np.array(q)[:, k].reshape(-1, 2)
            assert sigma == pytest.approx(least(model, blocks, 0), rel=1e-6)


def test_a_step_that_ends_in_the_position_is_one_pass() -> None:
    """From upright backwards to where it came from: a grid of steps that meets the position."""
    rate = 2.0
    scene = {
        'mechanism': 'slider_crank',
        'initial': {
            'positions': {'A': [0, 1], 'B': [0, 0]},
            'velocities': {'A': [-rate, 0], 'B': [-2 * rate, 0]},
        },
    }
    back = Simulation(load_scene(scene), step=1e-3, integrator='dop853')
    back.step(200)
    state = back.sample().points
    speeds = back.sample().velocities
    names = ('A', 'B')
    turned = {
        **scene,
        'initial': {
            'positions': {name: state[name].tolist() for name in names},
            'velocities': {name: (-speeds[name]).tolist() for name in names},
        },
    }
    watched = Simulation(load_scene(turned), step=1e-3, integrator='dop853', watch=True)
    watched.step(200)
    assert watched.sample().diagnostics.distance < 1e-8
    watched.step(100)
    assert [event.t for event in watched.passes] == pytest.approx([0.2], abs=1e-8)


def test_in_the_position_itself_the_distance_is_zero_though_rows_are_redundant() -> None:
    """The scissor lift at the end of its pass: 18 rows depend on the others, now 19."""
    watched = Simulation(load_scene('scissor_lift'), watch=True)
    watched.step(round(2.6 / watched.h))
    (event,) = watched.passes
    simulation = Simulation(load_scene('scissor_lift'))
    simulation.step(round(2.4 / simulation.h))
    (sample,) = simulation.run(0.0, at=[event.t])
    assert sample.diagnostics.singular
    assert sample.diagnostics.distance < 1e-8
