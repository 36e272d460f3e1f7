"""Small mechanisms with drives, or to be driven: a pendulum, an arm of two rods, a belt."""

from __future__ import annotations

from typing import Any

import numpy as np

G = 9.81
GRAVITY = {'gravity': {'acceleration': [0, -G]}}


def pendulum(**sections: Any) -> dict[str, Any]:
    """A rod of 1 m and 2 kg on a pin at the origin, drawn along x."""
    return {
        'mechanism': {
            'alf': 1,
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
            'bodies': {'rod': {'points': ['O', 'A'], 'mass': 2.0, 'inertia': 'rod'}},
            'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
            **sections,
        },
        'effects': GRAVITY,
    }


# an arm of two rods in the plane, the second drawn at an angle of START to the first
TWO = {
    'alf': 1,
    'points': {
        'O': {'at': [0, 0], 'fixed': True},
        'A': {'at': [1, 0]},
        'B': {'at': [1.6, 0.8]},
    },
    'bodies': {
        'upper': {'points': ['O', 'A'], 'mass': 2.0, 'inertia': 'rod'},
        'lower': {'points': ['A', 'B'], 'mass': 1.5, 'inertia': 'rod'},
    },
    'joints': {
        'shoulder': {'type': 'revolute', 'between': ['ground', 'upper'], 'at': 'O'},
        'elbow': {'type': 'revolute', 'between': ['upper', 'lower'], 'at': 'A'},
    },
}
START = np.arctan2(0.8, 0.6)
ARM = {
    **TWO,
    'drives': {
        'first': {'joint': 'shoulder', 'angle': 'sin(t)'},
        'second': {'joint': 'elbow', 'angle': f'{START} - 3*t'},
    },
}

# a wheel on a belt whose speed is t - sin(t)
BELT = {
    'mechanism': {
        'alf': 1,
        'points': {'C': {'at': [0, 0.5]}, 'S': {'at': [0.3, 0.5]}},
        'bodies': {
            'wheel': {
                'points': ['C', 'S'],
                'mass': 2.0,
                'inertia': {'about_com': 0.25},
                'com': [0, 0],
            }
        },
        'joints': {
            'rim': {
                'type': 'no_slip',
                'between': ['ground', 'wheel'],
                'at': 'C',
                'radius': 0.5,
                'on': {'through': [0, 0], 'direction': [1, 0], 'speed': 't - sin(t)'},
            }
        },
    }
}
