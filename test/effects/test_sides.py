"""The sides of kinks, which adaptive steps ask for: another number beyond a kink."""

from __future__ import annotations

import ctypes
import math
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, kernel, load_scene
from alf_ros import effects as registry
from alf_ros.studies.exact import one_freedom

CRANK = one_freedom.slider_crank()
TABLE = [[-1.0, -3.0], [0.8, 1.0], [1.2, 4.0], [2.0, 10.0]]
LIMITED = {'joint': 'crank_pin', 'velocity': 0, 'velocity_gain': 10, 'limit': 5, 'free_speed': 4}

# effect, and (θ, θ̇, t): two on the same side, and one beyond a kink
CASES: list[tuple[str, dict[str, Any], list[tuple[float, float, float]]]] = [
    (
        'joint_stop',
        {'joint': 'crank_pin', 'upper': 1.0, 'lower': -1.0, 'stiffness': 10},
        [(0.3, 1.0, 0.0), (0.99, -1.0, 1.0), (1.01, 1.0, 0.0)],
    ),
    (
        'joint_stop',
        {'joint': 'crank_pin', 'upper': 1.0, 'lower': -1.0, 'stiffness': 10},
        [(0.3, 1.0, 0.0), (-0.99, 1.0, 0.0), (-1.01, 1.0, 0.0)],
    ),
    (  # losses would pull
        'joint_stop',
        {'joint': 'crank_pin', 'upper': 1.0, 'stiffness': 10, 'damping': 0.5},
        [(1.2, 1.0, 0.0), (1.3, -1.9, 0.0), (1.2, -2.1, 0.0)],
    ),
    (
        'ground_contact',
        {'on': 'A', 'through': [0, 0.5], 'stiffness': 10},
        [(0.6, 1.0, 0.0), (2.0, 1.0, 0.0), (0.4, 1.0, 0.0)],
    ),
    (
        'spring',
        {'between': ['A', 'ground'], 'at': [None, [1, 0]], 'table': TABLE, 'free_length': 0},
        [(0.7, 1.0, 0.0), (0.4, 1.0, 0.0), (1.0, 1.0, 0.0)],
    ),
    (
        'torsion_spring',
        {'joint': 'crank_pin', 'table': TABLE, 'free_position': 0},
        [(0.9, 1.0, 0.0), (1.1, 1.0, 0.0), (1.3, 1.0, 0.0)],
    ),
    (
        'damper',
        {'between': ['B', 'ground'], 'at': [None, [-9, 0]], 'table': TABLE},
        [(-0.5, 0.9, 0.0), (-0.5, 1.2, 0.0), (-0.5, 1.3, 0.0)],
    ),
    (  # a stop of a length that two joint coordinates make
        'tendon',
        {'joints': [['crank_pin', 2.0]], 'upper': 1.0, 'stop_stiffness': 10},
        [(0.3, 1.0, 0.0), (0.49, -1.0, 1.0), (0.51, 1.0, 0.0)],
    ),
    (
        'tendon',
        {'path': ['A', ['ground', [1, 0]]], 'table': TABLE, 'free_length': 0},
        [(0.7, 1.0, 0.0), (0.4, 1.0, 0.0), (1.0, 1.0, 0.0)],
    ),
    (
        'tendon',
        {'joints': [['crank_pin', -1.0]], 'velocity': 0, 'velocity_gain': 10, 'limit': 5},
        [(0.3, 0.1, 0.0), (0.3, -0.2, 0.0), (0.3, -1.0, 0.0)],
    ),
    ('motor', LIMITED, [(0.3, 0.1, 0.0), (0.3, -0.2, 0.0), (0.3, -1.0, 0.0)]),
    ('motor', LIMITED, [(0.3, 0.1, 0.0), (0.3, -0.2, 0.0), (0.3, 1.0, 0.0)]),
]


def side(
    kind: str, parameters: dict[str, Any], theta: float, rate: float, t: float, asked: bool = True
) -> float:
    """Of an effect that a run asks, or does not ask."""
    points, speeds = (
        dict(zip('AB', values.reshape(-1, 2).tolist(), strict=True))
        for values in (CRANK.position(theta), rate * CRANK.tangent(theta))
    )
    simulation = simulated(kind, parameters, positions=points, velocities=speeds)
    state, forces = simulation.state, simulation._run.applied.assembled.effects
    assert forces.side.size == int(asked)
    if not asked:
        address = np.array([registry.load(kind).side.address], dtype=np.uint64)
        forces = replace(forces, side=address)
    return float(kernel.sides(forces, t, state.q, state.qd, np.full(1, theta)))


def simulated(
    kind: str, parameters: dict[str, Any], integrator: str = 'dop853_adaptive', **initial: Any
) -> Simulation:
    scene = {'mechanism': 'slider_crank', 'effects': {kind: parameters}, 'initial': initial}
    return Simulation(load_scene(scene), integrator=integrator)


@pytest.mark.parametrize('kind, parameters, states', CASES)
def test_another_number_beyond_a_kink(
    kind: str, parameters: dict[str, Any], states: list[tuple[float, float, float]]
) -> None:
    here, same, beyond = (side(kind, parameters, *state) for state in states)
    assert here == same != beyond


@pytest.mark.parametrize(
    'kind, parameters',
    [
        ('spring', {'between': ['A', 'ground'], 'at': [None, [2, 0]], 'stiffness': 7}),
        ('torsion_spring', {'joint': 'crank_pin', 'stiffness': 7}),
        ('damper', {'between': ['A', 'ground'], 'at': [None, [2, 0]], 'damping': 7}),
        ('motor', {'joint': 'crank_pin', 'effort': 7}),
    ],
)
def test_a_straight_law_has_no_kink(kind: str, parameters: dict[str, Any]) -> None:
    """So no step asks it."""
    states = [(0.1, 1.0, 0.0), (1.5, -2.0, 1.0), (3.0, 0.0, 2.0), (-1.0, 0.5, 3.0)]
    assert len({side(kind, parameters, *state, asked=False) for state in states}) == 1


def interval(kind: str, parameters: dict[str, Any], theta: float, rate: float) -> list[float]:
    """x, ẋ and the ends of the interval, from its compiled function."""
    points, speeds = (
        dict(zip('AB', values.reshape(-1, 2).tolist(), strict=True))
        for values in (CRANK.position(theta), rate * CRANK.tangent(theta))
    )
    simulation = simulated(kind, parameters, positions=points, velocities=speeds)
    forces, state, out = simulation._run.applied.assembled, simulation.state, np.zeros(4)
    given = state.q, state.qd, np.full(1, theta), forces.effects.slots, forces.effects.params
    doubles, longs = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64)
    pointers = [
        each.ctypes.data_as(longs if each.dtype == np.int64 else doubles) for each in given
    ]
    kinds = ctypes.c_double, *(type(each) for each in pointers), ctypes.c_int64, doubles
    function = ctypes.CFUNCTYPE(None, *kinds)(int(forces.kinks.interval[0]))
    function(0.0, *pointers, 0, out.ctypes.data_as(doubles))
    return out.tolist()


PIN: dict[str, Any] = {'joint': 'crank_pin'}
AIM: dict[str, Any] = {'position': [[0, 0], [1, 1]], 'position_gain': 1}
CORD_OF_ONE: dict[str, Any] = {'joints': [['crank_pin', 1.0]]}


@pytest.mark.parametrize(
    ('kind', 'parameters', 'wanted'),
    [
        ('motor', {**PIN, 'effort': [[-1, 0], [0, 0], [0.5, 1], [1, 2], [2, 2]]}, [0, 1]),
        (
            'motor',
            {
                **PIN,
                'position': [[0, 0], [1, 1]],
                'position_gain': 1,
                'effort': [[0.5, 3], [2, 1]],
            },
            [0, 0.5, 1, 2],
        ),
        (
            'tendon',
            {**CORD_OF_ONE, 'velocity': [[0, 0], [1, 1]], 'velocity_gain': 1},
            [0, 1],
        ),
        ('tendon', {**CORD_OF_ONE, 'effort': [[0, 0], [1, 1], [2, 1]]}, [0, 1]),
        ('user_table', {**PIN, 'table': [[0, 5], [1, 5], [2, 4]]}, [1, 2]),
        (
            'user_table',
            {**PIN, 'table': [[0, 1], [1, 0], [9, 0]], 'interpolation': 'cubic'},
            [0, 1, 9],
        ),
    ],
)
def test_kinks_over_time_are_known_by_their_times(
    kind: str, parameters: dict[str, Any], wanted: list[float]
) -> None:
    for integrator in ('dop853_adaptive', 'rk4'):
        found = simulated(kind, parameters, integrator)
        assert found._run.applied.assembled.kinks.instants.tolist() == wanted


def test_every_effect_with_a_function_of_time_is_among_them() -> None:
    over_time = {
        kind
        for kind in registry.kinds()
        for each in fields(registry.load(kind).Parameters)
        if each.metadata.get('kind') == 'signal'
    }
    assert over_time == {'motor', 'tendon'}


INF = math.inf
STOP = {'joint': 'crank_pin', 'upper': 1.0, 'lower': -1.0, 'stiffness': 10}
CORD = {
    'joints': [['crank_pin', 3.0]],
    'table': [[0, 0], [0.5, 2], [1, 0]],
    'free_length': 0.0,
    'lower': 0.2,
    'upper': 0.95,
    'stop_stiffness': 1,
}
ROPE = {'joint': 'crank_pin', 'free_position': 0.5, 'table': [[0, 0], [0.1, 0], [0.3, 0], [1, 7]]}


@pytest.mark.parametrize(
    'kind, parameters, theta, wanted',
    [
        ('joint_stop', STOP, 0.3, (0.3, -1.0, 1.0)),
        ('joint_stop', STOP, 1.25, (1.25, 1.0, INF)),
        ('joint_stop', STOP, -1.25, (-1.25, -INF, -1.0)),
        ('ground_contact', CASES[3][1], 0.6, (math.sin(0.6) - 0.5, 0.0, INF)),
        ('ground_contact', CASES[3][1], 0.4, (math.sin(0.4) - 0.5, -INF, 0.0)),
        ('torsion_spring', ROPE, 0.55, (0.05, -INF, 0.3)),
        ('torsion_spring', ROPE, 0.75, (0.25, -INF, 0.3)),
        ('torsion_spring', ROPE, 0.9, (0.4, 0.3, INF)),
        ('torsion_spring', CASES[5][1], 1.1, (1.1, 0.8, 1.2)),
        ('tendon', CORD, 0.3, (0.9, 0.5, 0.95)),
        ('tendon', CORD, 0.33, (0.99, 0.95, INF)),
        ('tendon', CORD, 0.1, (0.3, 0.2, 0.5)),
        ('tendon', CORD, 0.0, (0.0, -INF, 0.2)),
    ],
)
def test_the_interval_without_a_kink(
    kind: str, parameters: dict[str, Any], theta: float, wanted: tuple[float, float, float]
) -> None:
    e = 1e-5
    x, rate, *ends = interval(kind, parameters, theta, 3.0)
    assert (x, *ends) == pytest.approx(wanted)
    over, under = (interval(kind, parameters, theta + each, 0.0)[0] for each in (e, -e))
    assert rate == pytest.approx(3.0 * (over - under) / (2.0 * e), abs=1e-8)


@pytest.mark.parametrize(
    'kind, parameters',
    [
        ('spring', {'between': ['A', 'ground'], 'at': [None, [2, 0]], 'stiffness': 7}),
        ('torsion_spring', {'joint': 'crank_pin', 'stiffness': 7}),
    ],
)
def test_nothing_is_searched_for_without_kinks(kind: str, parameters: dict[str, Any]) -> None:
    assert simulated(kind, parameters)._run.applied.assembled.kinks.search.size == 0


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'esdirk43', 'esdirk43_adaptive'])
def test_sides_are_for_explicit_adaptive_steps_and_intervals_for_all(integrator: str) -> None:
    forces = simulated(*CASES[0][:2], integrator)._run.applied.assembled
    assert forces.effects.side.size == 0
    assert forces.kinks.search.size == 1
