"""A five-bar whose cranks have equal gears: one freedom, and a closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

A, B, D = 0.2, 0.35, 0.5  # m: cranks, rods, ground
START = math.radians(70.0)
_REVOLUTE = {'type': 'revolute'}
_ROD = {'mass': 1, 'inertia': 'rod'}


def geared_five_bar(guided: bool) -> dict[str, Any]:
    """Two cranks with equal gears that turn against each other, and two rods that meet in P.

    The gears keep P on x = D/2; `guided`: a slider keeps it there too.
    """
    x, y = A * math.cos(START), A * math.sin(START)
    joints: dict[str, Any] = {
        'left': {**_REVOLUTE, 'between': ['ground', 'one'], 'at': 'O'},
        'right': {**_REVOLUTE, 'between': ['ground', 'two'], 'at': 'C'},
        'elbow': {**_REVOLUTE, 'between': ['one', 'first_rod'], 'at': 'P1'},
        'knee': {**_REVOLUTE, 'between': ['two', 'second_rod'], 'at': 'P2'},
        'mesh': {
            'type': 'gear',
            'between': ['one', 'two'],
            'centres': ['O', 'C'],
            'radii': [D / 2, D / 2],
        },
        'tip': {**_REVOLUTE, 'between': ['first_rod', 'second_rod'], 'at': 'P'},
    }
    if guided:
        joints['guide'] = {
            'type': 'slider',
            'between': ['ground', 'first_rod'],
            'point': 'P',
            'on': {'through': [D / 2, 0], 'direction': [0, 1]},
        }
    return {
        'alf': 1,
        'space': 'planar',
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'C': {'at': [D, 0], 'fixed': True},
            'P1': {'at': [x, y]},
            'P2': {'at': [D - x, y]},
            'P': {'at': [D / 2, float(height(START))]},
        },
        'bodies': {
            'one': {'points': ['O', 'P1'], **_ROD},
            'two': {'points': ['C', 'P2'], **_ROD},
            'first_rod': {'points': ['P1', 'P'], **_ROD},
            'second_rod': {'points': ['P2', 'P'], **_ROD},
        },
        'joints': joints,
    }


def height(angle: Any) -> Any:
    """y of P (m) at the angle of the left crank (rad)."""
    return A * np.sin(angle) + np.sqrt(B**2 - (D / 2 - A * np.cos(angle)) ** 2)
