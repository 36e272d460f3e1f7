"""Scenes of optimisations: four-bars with closed-form positions, and a driven bob."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from alf_ros.arrays import Floats

BARS = {'a': 0.1, 'b': 0.3, 'c': 0.25, 'd': 0.3, 'u': 0.15, 'v': 0.1, 'x': 0.0, 'y': 0.0, 'g': 0.0}


def four_bar(
    numbers: Mapping[str, float] | None = None, driven: bool = True, step: float = 1 / 36
) -> dict[str, Any]:
    """A four-bar of sizes a, b, c, d on a ground at (x, y), turned by g; P is at (u, v) of the
    coupler. It turns once in a second, or falls freely from 10 rad/s."""
    first = ['x + a*cos(g + theta)', 'y + a*sin(g + theta)']
    pins: dict[str, Mapping[str, Any]] = {
        'O': {'at': ['x', 'y'], 'fixed': True},
        'C': {'at': ['x + d*cos(g)', 'y + d*sin(g)'], 'fixed': True},
        'A': {'at': first},
        'B': {'at': [f'{first[0]} + b*cos(beta)', f'{first[1]} + b*sin(beta)']},
        'P': {
            'at': [
                f'{first[0]} + u*cos(beta) - v*sin(beta)',
                f'{first[1]} + u*sin(beta) + v*cos(beta)',
            ]
        },
    }
    joints = {
        'crank_pin': ('ground', 'crank', 'O'),
        'knee': ('crank', 'coupler', 'A'),
        'wrist': ('coupler', 'rocker', 'B'),
        'rocker_pin': ('ground', 'rocker', 'C'),
    }
    scene: dict[str, Any] = {
        'name': 'linkage',
        'mechanism': {
            'alf': 1,
            'space': 'planar',
            'parameters': {
                **BARS,
                **(numbers or {}),
                'theta': 'pi/3',
                'diagonal': 'hypot(d - a*cos(theta), a*sin(theta))',
                'beta': 'g + atan2(-a*sin(theta), d - a*cos(theta))'
                ' + acos((diagonal**2 + b**2 - c**2)/(2*diagonal*b))',
            },
            'points': pins,
            'bodies': {
                'crank': {'points': ['O', 'A'], 'mass': 0.2, 'inertia': 'rod'},
                'coupler': {
                    'points': ['A', 'B', 'P'],
                    'mass': 1.0,
                    'com': [0.1, 0.02],
                    'inertia': {'about_com': 0.01},
                },
                'rocker': {'points': ['C', 'B'], 'mass': 0.5, 'inertia': 'rod'},
            },
            'joints': {
                name: {'type': 'revolute', 'between': [parent, child], 'at': at}
                for name, (parent, child, at) in joints.items()
            },
        },
        'effects': {'gravity': {'acceleration': [0, -9.81]}},
        'solver': {'step': step, 'integrator': 'rk4'},
    }
    if driven:
        scene['drives'] = {'motor': {'joint': 'crank_pin', 'angle': 'g + theta + 2*pi*t'}}
    else:
        scene['effects']['joint_friction'] = {'pin': {'joint': 'crank_pin', 'viscous': 0.1}}
        scene['initial'] = {'velocities': {'A': ['-10*a*sin(theta)', '10*a*cos(theta)']}}
    return scene


def coupler_point(numbers: Mapping[str, float], t: Floats) -> Floats:
    """(N, 2) the place of P at t (s), by the law of cosines."""
    a, b, c, d, u, v, x, y, g = ({**BARS, **numbers}[name] for name in BARS)
    theta = np.pi / 3 + 2.0 * np.pi * t
    A = a * np.stack([np.cos(theta), np.sin(theta)])
    gap = np.array([[d], [0.0]]) - A
    length = np.hypot(*gap)
    beta = np.arctan2(gap[1], gap[0]) + np.arccos((length**2 + b**2 - c**2) / (2 * length * b))
    place = A + np.stack(
        [u * np.cos(beta) - v * np.sin(beta), u * np.sin(beta) + v * np.cos(beta)]
    )
    turn = np.array([[np.cos(g), -np.sin(g)], [np.sin(g), np.cos(g)]])
    return np.asarray((turn @ place).T + [x, y])


def whirled_bob() -> dict[str, Any]:
    """A bob of 2 kg on a bar without mass, driven at 5 rad/s through its highest place and its
    lowest one; L is the length of the bar."""
    return {
        'name': 'bob',
        'mechanism': {
            'alf': 1,
            'space': 'planar',
            'parameters': {'L': 0.5},
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'B': {'at': ['L', 0]}},
            'bodies': {
                'bar': {'points': ['O', 'B'], 'mass': 2.0, 'com': ['L', 0], 'inertia': 'point'}
            },
            'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
        },
        'drives': {'motor': {'joint': 'pin', 'angle': '5*t'}},
        'effects': {'gravity': {'acceleration': [0, -9.81]}},
        'solver': {'step': 0.02, 'integrator': 'rk4'},
    }


def sprung_block() -> dict[str, Any]:
    """A block of 2 kg on a rail, released 0.4 m away from where its spring of k N/m is slack."""
    return {
        'name': 'block',
        'mechanism': {
            'alf': 1,
            'space': 'planar',
            'points': {'B': {'at': [0.4, 0]}},
            'bodies': {'block': {'points': ['B'], 'mass': 2.0, 'inertia': 'point'}},
            'joints': {
                'rail': {
                    'type': 'slider',
                    'point': 'B',
                    'on': {'through': [0, 0], 'direction': [1, 0]},
                }
            },
        },
        'effects': {
            'spring': {
                'main': {
                    'between': ['B', 'ground'],
                    'at': [None, [-2, 0]],
                    'stiffness': 50.0,
                    'free_length': 2.0,
                }
            }
        },
        'solver': {'step': 1e-3, 'integrator': 'rk4'},
    }
