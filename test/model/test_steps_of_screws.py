"""Steps of a walk through positions of a thread, beside rows that depend on others."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros import load_scene
from alf_ros.model.compile import compile_model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.model.sure_step import sure_step

AXIS = np.array([0.36, 0.48, 0.8])  # of length 1


def spindle() -> dict[str, Any]:
    """A spindle in two hinges, one of which is redundant, lifts a nut that a guide holds."""
    along = {name: s * AXIS for name, s in (('A', 0.0), ('B', 0.9), ('N', 0.4))}
    points = {name: {'at': (at + [0.3, -0.2, 0.7]).tolist()} for name, at in along.items()}
    body = {'mass': 1.0, 'com': [0.0, 0.1, 0.0], 'inertia': {'about_com': [0.1, 0.2, 0.15]}}
    axis = AXIS.tolist()
    on_ground = {'between': ['ground', 'spindle'], 'axis': axis}
    return {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': points,
            'bodies': {
                'spindle': {'points': ['A', 'B'], **body},
                'nut': {'points': ['N'], **body},
            },
            'joints': {
                'low': {'type': 'revolute', 'at': 'A', **on_ground},
                'high': {'type': 'revolute', 'at': 'B', **on_ground},
                'thread': {
                    'type': 'screw',
                    'between': ['spindle', 'nut'],
                    'at': 'N',
                    'axis': axis,
                    'pitch': 0.2,
                },
                'guide': {
                    'type': 'prismatic',
                    'between': ['ground', 'nut'],
                    'at': 'N',
                    'axis': axis,
                },
            },
        },
        'effects': {'gravity': {'acceleration': [0.0, 0.0, -9.81]}},
    }


def test_a_step_of_the_walk_turns_the_spindle() -> None:
    """Rounding in the redundant rows counted as a slip of the thread, of metres: steps ended
    nowhere, unless they were a hundred thousandth as long."""
    model = compile_model(load_scene(spindle()).mechanism, penalty=1e8)
    start = Linearised(model, model.q)
    (direction,) = start.free.T
    longest = 0.1  # m
    ahead = sure_step(start, direction, longest, start.rank)
    assert ahead is not None
    assert np.linalg.norm((ahead.q - start.q)[: model.n]) > 0.5 * longest
