"""A rod of 1 m that turns about one end."""

from __future__ import annotations

from typing import Any


def arm(mass: float) -> dict[str, Any]:
    """Its scene, without effects; mass in kg."""
    return {
        'name': 'arm',
        'mechanism': {
            'alf': 1,
            'space': 'planar',
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
            'bodies': {'bar': {'points': ['O', 'A'], 'mass': mass, 'inertia': 'rod'}},
            'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
        },
    }
