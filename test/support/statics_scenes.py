"""Scenes whose positions of rest and frequencies are known independently."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from alf_ros import load_scene
from alf_ros.scene.scene import Scene
from support.paths import ROOT

GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}
# made by the script beside the file
KNOWN: dict[str, list[dict[str, Any]]] = json.loads(
    (ROOT / 'test' / 'data' / 'statics_30_digits.json').read_text('utf-8')
)
_SPRINGS: dict[str, dict[str, Any]] = {
    'double_four_bar': {'between': ['A0', 'B1'], 'stiffness': 100.0, 'free_length': 1.0},
    'four_bar': {'between': ['A', 'C'], 'stiffness': 500.0, 'free_length': 0.2},
    'slider_crank': {
        'between': ['A', 'ground'],
        'at': [None, [0.5, 1.0]],
        'stiffness': 60.0,
        'free_length': 0.3,
    },
}


def sprung(mechanism: str, near: dict[str, list[float]] | None = None) -> Scene:
    """A mechanism of the library under gravity with the spring of the script in test/data, drawn
    near some positions."""
    effects = {**GRAVITY, 'spring': _SPRINGS[mechanism]}
    initial = {'positions': near} if near else {}
    return load_scene({'mechanism': mechanism, 'effects': effects, 'initial': initial})


def chain(masses: int, effects: dict[str, Any] | None = None) -> Scene:
    """Equal point masses (1 kg) on equal massless bars (1 m) that hang from a point, drawn askew.

    At rest ω² = 9.81 x with the zeros x of the Laguerre polynomial (Bernoulli, 1732).
    """
    slope = np.linspace(-1.2, -0.4, masses)
    ends = np.cumsum(np.stack([np.cos(slope), np.sin(slope)], 1), axis=0)
    points: dict[str, Any] = {'P0': {'at': [0, 0], 'fixed': True}}
    points |= {f'P{k + 1}': {'at': end.tolist()} for k, end in enumerate(ends)}
    bodies = {
        f'b{k}': {
            'points': [f'P{k}', f'P{k + 1}'],
            'length': 1.0,
            'mass': 1.0,
            'inertia': 'point',
            'com': [1.0, 0.0],
        }
        for k in range(masses)
    }
    joints = {
        f'j{k}': {
            'type': 'revolute',
            'between': [f'b{k - 1}' if k else 'ground', f'b{k}'],
            'at': f'P{k}',
        }
        for k in range(masses)
    }
    mechanism = {'alf': 1, 'space': 'planar', 'points': points, 'bodies': bodies, 'joints': joints}
    return load_scene({'mechanism': mechanism, 'effects': effects or GRAVITY})


def level_chain(links: int) -> Scene:
    """Rods (0.1 kg, 0.1 m) in a level row that hangs from its first end."""
    names = [f'P{k}' for k in range(links + 1)]
    points: dict[str, Any] = {name: {'at': [0.1 * k, 0.0]} for k, name in enumerate(names)}
    points['P0']['fixed'] = True
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    for k in range(links):
        bodies[f'b{k}'] = {'points': names[k : k + 2], 'mass': 0.1, 'inertia': 'rod'}
        parent = f'b{k - 1}' if k else 'ground'
        joints[f'j{k}'] = {'type': 'revolute', 'between': [parent, f'b{k}'], 'at': names[k]}
    mechanism = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    return load_scene({'mechanism': mechanism, 'effects': GRAVITY})


def redundant_parallelogram(angle: float = -1.2, effects: dict[str, Any] | None = None) -> Scene:
    """A rigid bar (2 m, 1 kg) on three equal upright cranks (1 m, 1 kg): one crank is redundant.

    V = 9.81 (3/2 + 1) sin θ, m = 3/3 + 1 kg m²: hanging, ω² = 9.81 · 2.5 / 2.
    """
    tip = np.array([np.cos(angle), np.sin(angle)])
    points: dict[str, Any] = {}
    for k in range(3):
        points[f'A{k}'] = {'at': [float(k), 0.0], 'fixed': True}
        points[f'B{k}'] = {'at': (tip + [k, 0.0]).tolist()}
    bodies: dict[str, Any] = {
        f'crank{k}': {'points': [f'A{k}', f'B{k}'], 'length': 1.0, 'mass': 1.0, 'inertia': 'rod'}
        for k in range(3)
    }
    bodies['bar'] = {
        'points': ['B0', 'B2', 'B1'],
        'mass': 1.0,
        'inertia': {'about_com': 1.0 / 3.0},
        'com': [1.0, 0.0],
    }
    joints = {
        name: {'type': 'revolute', 'between': [parent, f'crank{k}'], 'at': f'{end}{k}'}
        for k in range(3)
        for name, parent, end in ((f'pin{k}', 'ground', 'A'), (f'knee{k}', 'bar', 'B'))
    }
    mechanism = {'alf': 1, 'space': 'planar', 'points': points, 'bodies': bodies, 'joints': joints}
    return load_scene({'mechanism': mechanism, 'effects': effects or GRAVITY})


def pendulum_and_slider(force: float, angle: float, hung: bool = False) -> Scene:
    """A rod (1 m, 1 kg) at an angle to the vertical, and a mass on a slider with a spring that
    carries a force across its guide. The rod is apart from it, or hung from it."""
    tip = [float(np.sin(angle)), -float(np.cos(angle))]
    at = [0.0, 0.0] if hung else [2.0, 0.0]
    points: dict[str, Any] = {'P': {'at': at}, 'A': {'at': tip}}
    if not hung:
        points['O'] = {'at': [0.0, 0.0], 'fixed': True}
    top = 'P' if hung else 'O'
    parent = 'block' if hung else 'ground'
    guide = {'through': at, 'direction': [1.0, 0.0]}
    mechanism = {
        'alf': 1,
        'points': points,
        'bodies': {
            'block': {'points': ['P'], 'mass': 1.0, 'inertia': 'point'},
            'rod': {'points': [top, 'A'], 'mass': 1.0, 'inertia': 'rod'},
        },
        'joints': {
            'g': {'type': 'slider', 'point': 'P', 'between': ['ground', 'block'], 'on': guide},
            'j': {'type': 'revolute', 'between': [parent, 'rod'], 'at': top},
        },
    }
    effects = {
        **GRAVITY,
        'torsion_spring': {'joint': 'g', 'stiffness': 1000.0, 'free_position': 0.0},
        'constant_wrench': {'on': 'P', 'force': [0.0, force]},
    }
    return load_scene({'mechanism': mechanism, 'effects': effects})
