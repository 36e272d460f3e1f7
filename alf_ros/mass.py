"""The mass matrix in natural coordinates: constant, blocks k I, in the plane also w J.

A body r = P_0 + Σ c_k d_k has the kinetic energy ½ Σ M_ab q̇_a·q̇_b, M from its mass, the first and
the second moments of c: García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody
Systems (1994), ch. 4.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Mass
from alf_ros.layout import Layout, Shape
from alf_ros.mechanism import Numbers
from alf_ros.rotor import unit_of
from alf_ros.row_arrays import indices

_NOTHING = 1e-15  # of the largest of a body


def mass_of(layout: Layout) -> Mass:
    """M of the movable blocks."""
    diagonal = [0.0] * layout.blocks
    pairs: dict[tuple[int, int], list[float]] = {}
    for body in layout.bodies:
        shape, own = layout.shape(body.name), layout.of_body[body.name]
        blocks = (own[0], *(own[end] for end in shape.ends))
        matrix, skew = _of_body(shape, body.mass, body.com, body.inertia)
        for a, i in enumerate(blocks):
            diagonal[i] += matrix[a][a]
            for b, j in enumerate(blocks[:a]):
                pair = pairs.setdefault((max(i, j), min(i, j)), [0.0, 0.0])
                pair[0] += matrix[a][b]
                pair[1] += skew if j > i else -skew
    for rotor in layout.mechanism.rotors:
        unit = unit_of(layout.mechanism.coordinate[rotor.of], layout)
        diagonal[layout.of_auxiliary[rotor.name]] = rotor.inertia / unit**2
    kept = {
        pair: value for pair, value in pairs.items() if pair[0] < layout.movable and any(value)
    }
    values = np.array(list(kept.values()), dtype=float).reshape(-1, 2)
    turned = np.flatnonzero(values[:, 1])
    return Mass(
        diagonal=np.array(diagonal[: layout.movable]),
        i=indices(i for i, _ in kept),
        j=indices(j for _, j in kept),
        k=values[:, 0].copy(),
        skew=turned.astype(np.uint32),
        w=values[turned, 1].copy(),
    )


def renumbered(mass: Mass, place: Integers) -> Mass:
    """The same of other blocks that move: block n of it is `place[n]`."""
    diagonal, w = np.empty_like(mass.diagonal), mass.w.copy()
    diagonal[place[: diagonal.size]] = mass.diagonal
    i, j = place[mass.i], place[mass.j]
    w[(i < j)[mass.skew]] *= -1.0
    return replace(
        mass, diagonal=diagonal, i=indices(np.maximum(i, j)), j=indices(np.minimum(i, j)), w=w
    )


@lru_cache(maxsize=1024)
def _of_body(
    shape: Shape, m: float, com: Numbers, inertia: float | tuple[Numbers, ...]
) -> tuple[list[list[float]], float]:
    """M of a body on P_0 and the ends of what carries it (without the D equal axes); and w.

    Of all bodies of one shape at once: large mechanisms have many.
    """
    from_local, D = shape.inverse, shape.inverse.shape[1]
    c, second = from_local @ np.array(com), _second_moments(D, m, com, inertia, from_local)
    w = 0.0
    if D == 2 and c.size:  # J makes the second direction of the first
        second, w, c = second[:1, :1] + second[1:, 1:], m * float(c[1]), c[:1]
    moments = np.block([[np.array([[m]]), m * c[None, :]], [m * c[:, None], second]])
    # P_0 carries 1 - Σ c over the ends that are points
    ends = np.eye(1 + c.size)
    ends[0, 1:] = [-1.0 if point else 0.0 for point in shape.is_point]
    return (ends @ moments @ ends.T).tolist(), w


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
