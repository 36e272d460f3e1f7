"""The mass matrix in natural coordinates: constant, blocks k I, in the plane also w J.

A body r = P_0 + Σ c_k d_k has the kinetic energy ½ Σ M_ab q̇_a·q̇_b, M from its mass, the first and
the second moments of c: García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody
Systems (1994), ch. 4.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.coordinates import coordinate_of
from alf_ros.kernel import Mass
from alf_ros.layout import Layout
from alf_ros.mechanism import Numbers
from alf_ros.rotor import unit_of
from alf_ros.rows import indices

_NOTHING = 1e-15  # of the largest of a body


def mass_of(layout: Layout) -> Mass:
    """M of the movable blocks."""
    diagonal = np.zeros(layout.blocks)
    pairs: dict[tuple[int, int], list[float]] = {}
    for body in layout.bodies:
        basis = layout.basis(body.name)
        blocks = (basis.first, *basis.ends)
        inverse = tuple(map(tuple, basis.inverse.tolist()))
        shape = (body.com, body.inertia, basis.is_point, inverse)
        matrix, skew = _of_body(layout.dimension, body.mass, *shape)
        for a, i in enumerate(blocks):
            diagonal[i] += matrix[a, a]
            for b, j in enumerate(blocks[:a]):
                pair = pairs.setdefault((max(i, j), min(i, j)), [0.0, 0.0])
                pair[0] += matrix[a, b]
                pair[1] += skew if j > i else -skew
    for rotor in layout.mechanism.rotors:
        unit = unit_of(coordinate_of(rotor.of, layout), layout)
        diagonal[layout.of_auxiliary[rotor.name]] = rotor.inertia / unit**2
    kept = {
        pair: value for pair, value in pairs.items() if pair[0] < layout.movable and any(value)
    }
    values = np.array(list(kept.values()), dtype=float).reshape(-1, 2)
    turned = np.flatnonzero(values[:, 1])
    return Mass(
        diagonal=diagonal[: layout.movable].copy(),
        i=indices(i for i, _ in kept),
        j=indices(j for _, j in kept),
        k=values[:, 0].copy(),
        skew=turned.astype(np.uint32),
        w=values[turned, 1].copy(),
    )


@lru_cache(maxsize=1024)
def _of_body(
    D: int,
    m: float,
    com: Numbers,
    inertia: float | tuple[Numbers, ...],
    is_point: tuple[bool, ...],
    inverse: tuple[Numbers, ...],
) -> tuple[Floats, float]:
    """M of a body on P_0 and the ends of its basis (without the D equal axes); and w.

    Of all bodies of one shape at once: large mechanisms have many.
    """
    from_local = np.array(inverse).reshape(-1, D)
    c, second = from_local @ np.array(com), _second_moments(D, m, com, inertia, from_local)
    w = 0.0
    if D == 2 and c.size:  # J makes the second direction of the first
        second, w, c = second[:1, :1] + second[1:, 1:], m * float(c[1]), c[:1]
    moments = np.block([[np.array([[m]]), m * c[None, :]], [m * c[:, None], second]])
    # P_0 carries 1 - Σ c over the ends that are points
    ends = np.eye(1 + c.size)
    ends[0, 1:] = [-1.0 if point else 0.0 for point in is_point]
    return ends @ moments @ ends.T, w


def _second_moments(
    D: int, m: float, com: Numbers, inertia: float | tuple[Numbers, ...], from_local: Floats
) -> Floats:
    """∫ c cᵀ dm (k, k), c the weights of the basis."""
    if D == 2:
        # only the trace matters: split the moment of inertia evenly
        about = 0.5 * float(inertia) * np.eye(2)  # type: ignore[arg-type]
    else:
        about = 0.5 * np.trace(np.array(inertia)) * np.eye(3) - np.array(inertia)
    second = np.asarray(from_local @ (about + m * np.outer(com, com)) @ from_local.T)
    # a thin disk has none along its axle: not what rounding leaves of it
    second[np.abs(second) < _NOTHING * np.abs(second).max(initial=0.0)] = 0.0
    return second
