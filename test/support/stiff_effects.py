"""Mechanisms with stiff effects, for implicit integrators, and numbers of theirs."""

from __future__ import annotations

from typing import Any

from alf_ros import load_scene
from alf_ros.scene.scene import Scene

GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}
STIFF: dict[str, tuple[dict[str, Any], list[str]]] = {
    'spring and damper': (
        {
            'spring': {
                'hold': {
                    'between': ['ground', 'coupler'],
                    'at': [[0.3, 1.0], None],
                    'stiffness': 1e5,
                    'free_length': 0.5,
                }
            },
            'damper': {
                'loss': {
                    'between': ['ground', 'coupler'],
                    'at': [[0.3, 1.0], None],
                    'damping': 200.0,
                }
            },
        },
        ['hold.stiffness', 'hold.free_length', 'loss.damping', 'coupler.mass'],
    ),
    'stop that is met': (
        {
            'joint_stop': {
                'end': {'joint': 'crank_pin', 'lower': 0.9, 'stiffness': 2e4, 'damping': 0.2}
            }
        },
        ['end.stiffness', 'end.lower', 'end.damping', 'coupler.mass'],
    ),
    'motor': (
        {
            'motor': {
                'm': {
                    'joint': 'crank_pin',
                    'position': 0.5,
                    'velocity': 0.0,
                    'position_gain': 500.0,
                    'velocity_gain': 20.0,
                }
            }
        },
        ['m.position_gain', 'm.velocity_gain', 'm.position', 'coupler.mass'],
    ),
    'friction': (
        {
            'joint_friction': {
                'f': {
                    'joint': 'crank_pin',
                    'viscous': 3.0,
                    'dynamic': 0.3,
                    'load': 10.0,
                    'slip': 0.01,
                }
            }
        },
        ['f.viscous', 'f.dynamic', 'f.slip', 'coupler.mass'],
    ),
}


def stiff_four_bar(kind: str, step: float = 5e-3) -> tuple[Scene, list[str]]:
    """A scene with gravity and the effects of a kind, in steps (s); names of its numbers."""
    effects, names = STIFF[kind]
    data = {'mechanism': 'four_bar', 'solver': {'step': step}, 'effects': {**GRAVITY, **effects}}
    return load_scene(data), [*names, 'gravity.acceleration.1']


def driven_rod() -> tuple[Scene, list[str]]:
    """A scene with a rod on a driven cart, and a stiff damper; names of its numbers."""
    scene = {
        'mechanism': {
            'alf': 1,
            'parameters': {'w': 2.0},
            'points': {'P': {'at': [0, 0]}, 'A': {'at': [0.8, -0.6]}},
            'bodies': {'rod': {'points': ['P', 'A'], 'mass': 1, 'inertia': 'rod'}},
        },
        'drives': {'cart': {'point': 'P', 'at': ['0.3*sin(w*t)', '0*t']}},
        'effects': {
            **GRAVITY,
            'damper': {
                'd': {'between': ['ground', 'rod'], 'at': [[0, -2], None], 'damping': 300.0}
            },
        },
        'solver': {'step': 1e-2},
    }
    return load_scene(scene), ['w', 'rod.mass', 'd.damping']
