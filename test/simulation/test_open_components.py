"""Which components of reactions are one of many, where a door hangs on two balls on one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene

ALONG = [  # directions of the line on which the balls are
    ([0.0, 0.0, 1.0], [False, False, True]),
    ([5e-4, 0.0, 1.0], [True, False, True]),
    ([1e-5, 1e-5, 1.0], [True, True, True]),
]


def door(along: list[float], at: list[float]) -> dict[str, Any]:
    """The ground carries one ball and the door the other one, so rows join them."""
    lower, upper = np.array(at), np.array(at) + 0.7 * np.array(along)
    return {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {
                'A': {'at': lower.tolist(), 'fixed': True},
                'B': {'at': upper.tolist()},
                'C': {'at': (lower + [0.5, 0.3, 0.1]).tolist()},
            },
            'bodies': {
                'door': {
                    'points': ['B', 'C'],
                    'mass': 2.0,
                    'com': [0.1, 0.2, 0.1],
                    'inertia': {'about_com': [0.1, 0.2, 0.15]},
                }
            },
            'joints': {
                'low': {'type': 'spherical', 'between': ['ground', 'door'], 'at': 'A'},
                'high': {'type': 'spherical', 'between': ['ground', 'door'], 'at': 'B'},
            },
        },
        'effects': {'gravity': {'acceleration': [0.0, 9.81, 0.0]}},
    }


@pytest.mark.parametrize('at', [[0.1, 0.2, 0.3], [-53.9, 73.7, 142.8]], ids=['near', 'far'])
@pytest.mark.parametrize(('along', 'is_open'), ALONG, ids=['upright', 'slant', 'least'])
def test_force_along_the_line_alone_is_open(
    along: list[float], is_open: list[bool], at: list[float]
) -> None:
    """Also its smallest component, and no torque: a ball has none. Rounding in its torque was
    open, and components below a thousandth were not."""
    simulation = Simulation(load_scene(door(along, at)), step=1e-3)
    simulation.step(50)
    for reaction in simulation.sample().reactions.values():
        assert reaction.open_force.tolist() == is_open
        assert not reaction.open_torque.any()
        assert np.abs(reaction.torque).max() < 1e-10  # N m
