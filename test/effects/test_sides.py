"""The sides of kinks, which adaptive steps ask for: another number beyond a kink."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, kernel, load_scene
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
    ('motor', LIMITED, [(0.3, 0.1, 0.0), (0.3, -0.2, 0.0), (0.3, -1.0, 0.0)]),
    ('motor', LIMITED, [(0.3, 0.1, 0.0), (0.3, -0.2, 0.0), (0.3, 1.0, 0.0)]),
    (
        'motor',
        {'joint': 'crank_pin', 'effort': TABLE},
        [(0.3, 0.1, 0.9), (1.3, 0.1, 1.1), (0.3, 0.1, 1.3)],
    ),
    (  # held behind the last row
        'user_table',
        {'joint': 'crank_pin', 'table': TABLE},
        [(0.3, 0.1, 1.5), (1.3, 0.1, 1.9), (0.3, 0.1, 2.1)],
    ),
    (
        'user_table',
        {'on': 'A', 'table': [[0, 0, 1], [1, 0, 2], [2, 0, 4]]},
        [(0.3, 0.1, 0.1), (1.3, 0.1, 0.9), (0.3, 0.1, 1.1)],
    ),
]


def side(kind: str, parameters: dict[str, Any], theta: float, rate: float, t: float) -> float:
    points, speeds = (
        dict(zip('AB', values.reshape(-1, 2).tolist(), strict=True))
        for values in (CRANK.position(theta), rate * CRANK.tangent(theta))
    )
    simulation = simulated(kind, parameters, positions=points, velocities=speeds)
    state, forces = simulation.state, simulation._applied.assembled.effects
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
    states = [(0.1, 1.0, 0.0), (1.5, -2.0, 1.0), (3.0, 0.0, 2.0), (-1.0, 0.5, 3.0)]
    assert len({side(kind, parameters, *state) for state in states}) == 1


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'esdirk43', 'esdirk43_adaptive'])
def test_methods_that_do_not_ask_call_nothing(integrator: str) -> None:
    simulation = simulated(*CASES[0][:2], integrator)
    assert simulation._applied.assembled.effects.side.size == 0
