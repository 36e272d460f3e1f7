"""Four-bars that have a flat position, where their branches cross, with closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from alf_ros import Closure
from alf_ros.arrays import Floats

Bars = Callable[[float, float, float], Floats]  # A and B of two lengths, at a crank angle


def crossed(a: float, g: float, angle: float) -> Floats:
    """An antiparallelogram: crank and rocker a, ground and coupler g > a."""
    k = (g + a) / (g - a)
    c, s = math.cos(angle / 2), math.sin(angle / 2)
    n = c * c + (k * s) ** 2
    return np.array(
        [
            a * math.cos(angle),
            a * math.sin(angle),
            g + a * (c * c - (k * s) ** 2) / n,
            -2.0 * a * k * s * c / n,
        ]
    )


def parallel(a: float, g: float, angle: float) -> Floats:
    c, s = a * math.cos(angle), a * math.sin(angle)
    return np.array([c, s, g + c, s], dtype=np.float64)


def kite(a: float, b: float, angle: float) -> Floats:
    """Crank and ground a, coupler and rocker b > a: in its flat position B turns about A."""
    half = angle / 2
    r = a * math.cos(half) + math.sqrt(b * b - (a * math.sin(half)) ** 2)
    return np.array(
        [
            a * math.cos(angle),
            a * math.sin(angle),
            r * math.cos(half),
            r * math.sin(half),
        ]
    )


def closure_of(bars: Bars, a: float, b: float, angle: float) -> Closure:
    drawn = bars(a, b, angle).tolist()
    joined: dict[str, Any] = {'type': 'revolute'}
    rod: dict[str, Any] = {'mass': 1, 'inertia': 'rod'}
    return Closure(
        {
            'mechanism': {
                'alf': 1,
                'space': 'planar',
                'points': {
                    'O': {'at': [0, 0], 'fixed': True},
                    'C': {'at': [a if bars is kite else b, 0], 'fixed': True},
                    'A': {'at': drawn[:2]},
                    'B': {'at': drawn[2:]},
                },
                'bodies': {
                    'crank': {**rod, 'points': ['O', 'A']},
                    'coupler': {**rod, 'points': ['A', 'B']},
                    'rocker': {**rod, 'points': ['C', 'B']},
                },
                'joints': {
                    'pin': {**joined, 'between': ['ground', 'crank'], 'at': 'O'},
                    'knee': {**joined, 'between': ['crank', 'coupler'], 'at': 'A'},
                    'wrist': {**joined, 'between': ['coupler', 'rocker'], 'at': 'B'},
                    'hip': {**joined, 'between': ['ground', 'rocker'], 'at': 'C'},
                },
            }
        },
        ['pin'],
    )


def random_motion(random: np.random.Generator) -> tuple[Bars, float, float, Floats]:
    """Lengths, and crank angles through 0, at a random spacing that changes."""
    bars: Bars = (crossed, parallel, kite)[int(random.choice(3, p=[0.6, 0.2, 0.2]))]
    a, b = (random.uniform(0.3, 0.97), 1.0) if bars is crossed else (0.0, 0.0)
    while b - a < 0.02:
        a, b = np.sort(random.uniform(0.3, 1.5, 2)).tolist()
    spacing = math.exp(random.uniform(math.log(0.005), math.log(0.2)))
    count = max(4, round(random.uniform(0.3, 1.0) / spacing))
    steps = np.arange(-count, count + 1.0)
    wave = random.uniform(0.0, 0.3) * np.sin(random.uniform(0.1, 1.0) * steps)
    beside = random.choice([0.0, 1e-9, random.uniform(0.0, 1.0) * spacing])
    way = random.choice([-1.0, 1.0])
    return bars, float(a), float(b), way * spacing * (steps + wave) + beside
