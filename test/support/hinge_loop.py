"""A loop of six hinges in space, one rod from each to the next, two of them on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alf_ros.arrays import Floats


def hinge_loop(
    places: Floats,
    axes: Floats,
    down: Sequence[float],
    masses: Sequence[float] = (1.0,) * 5,
    **numbers: Any,
) -> dict[str, Any]:
    """A scene with hinges at places (6, 3), m, with axes (6, 3). down: gravity, m/s^2; masses: of
    the rods, kg; numbers: what else all rods have, `inertia: rod` if nothing."""
    ground = [{'fixed': True} if k in (0, 5) else {} for k in range(6)]
    sides = ['ground', *(f'rod{k}' for k in range(5)), 'ground']
    between = [*(sides[k : k + 2] for k in range(5)), ['ground', 'rod4']]
    return {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {f'P{k}': {'at': places[k].tolist(), **ground[k]} for k in range(6)},
            'vectors': {f'u{k}': {'along': axes[k].tolist(), **ground[k]} for k in range(6)},
            'bodies': {
                f'rod{k}': {
                    'points': [f'P{k}', f'P{k + 1}'],
                    'vectors': [f'u{k}', f'u{k + 1}'],
                    'mass': masses[k],
                    **(numbers or {'inertia': 'rod'}),
                }
                for k in range(5)
            },
            'joints': {
                f'j{k}': {
                    'type': 'revolute',
                    'between': between[k],
                    'at': f'P{k}',
                    'axis': f'u{k}',
                }
                for k in range(6)
            },
        },
        'effects': {'gravity': {'acceleration': [float(x) for x in down]}},
    }


def about_a_line(places: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Three hinges, and the same turned by half a turn about the z axis: a linkage of Bricard that
    moves, although six hinges that stand anywhere do not."""
    half_turn = np.diag([-1.0, -1.0, 1.0])
    return np.vstack([places, places @ half_turn]), np.vstack([axes, axes @ half_turn])
