"""Edges of shapes for drawings of lines: a box, the rims of a cylinder, circles of a sphere."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import VisualShape

_TURNS = np.linspace(0.0, 2.0 * np.pi, 33)
_CIRCLE = np.column_stack([np.cos(_TURNS), np.sin(_TURNS), np.zeros(_TURNS.size)])
_SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]], dtype=float)
_UP = np.array([0.0, 0.0, 1.0])


def edges(shape: VisualShape) -> list[Floats]:
    """Lines (k, 3) in the frame of the body, m; of a mesh none (`mesh_lines`)."""
    lines: list[Floats] = []
    for part in shape.without_capsule:
        at = np.array(part.at)
        lines += [at + line @ part.turn.T for line in _own(part)]
    return lines


def _own(shape: VisualShape) -> list[Floats]:
    """In the axes of a shape that is no capsule."""
    if shape.kind == 'sphere':
        circle = shape.size[0] * _CIRCLE
        return [np.roll(circle, turn, axis=1) for turn in range(3)]
    if shape.kind == 'cylinder':
        radius, length = shape.size
        return _prism(radius * _CIRCLE, 0.5 * length, 8)
    if shape.kind == 'box':
        half = 0.5 * np.array(shape.size)
        return _prism(half * _SQUARE, half[2], 1)
    return []


def _prism(face: Floats, half: float, every: int) -> list[Floats]:
    """Both faces at ±half along z, and edges between them at some of their corners."""
    ends = [face + end * half * _UP for end in (-1.0, 1.0)]
    return ends + [np.array(pair) for pair in zip(*(end[:-1:every] for end in ends), strict=True)]
