"""The mass matrix in natural coordinates: constant, blocks k I, in the plane also w J.

A body r = P_0 + Σ c_k d_k has the kinetic energy ½ Σ M_ab q̇_a·q̇_b, M from its mass, the first and
the second moments of c: García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody
Systems (1994), ch. 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Mass
from alf_ros.mechanism import Numbers
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout, Shape
from alf_ros.model.constraints.packing import indices
from alf_ros.model.constraints.rotors import unit_of
from alf_ros.model.struct_memory import changed, made

_NOTHING = 1e-15  # of the largest of a body


def mass_of(layout: Layout) -> Mass:
    """M of the movable blocks."""
    blocks: list[int] = []
    masses: list[float] = []
    pairs: list[tuple[int, int]] = []
    bound: list[tuple[float, float]] = []
    for body in layout.bodies:
        own = layout.of_body[body.name]
        diagonal, below = _of_body(layout.shape(body.name), body.mass, body.com, body.inertia)
        for n, m in diagonal:
            blocks.append(own[n])
            masses.append(m)
        for a, b, k, w in below:
            above = own[a] > own[b]
            pairs.append((own[a], own[b]) if above else (own[b], own[a]))
            bound.append((k, -w if above else w))
    total = np.zeros(layout.blocks)
    np.add.at(total, np.array(blocks, dtype=np.int64), masses)
    for rotor in layout.mechanism.rotors:
        unit = unit_of(layout.mechanism.coordinate[rotor.of], layout)
        total[layout.of_auxiliary[rotor.name]] = rotor.inertia / unit**2
    i, j, values = _summed(pairs, bound)
    kept = (i < layout.movable) & values.any(axis=1)
    i, j, values = i[kept], j[kept], values[kept]
    turned = np.flatnonzero(values[:, 1])
    return made(
        Mass,
        diagonal=total[: layout.movable].copy(),
        i=indices(i),
        j=indices(j),
        k=values[:, 0].copy(),
        skew=indices(turned),
        w=values[turned, 1].copy(),
    )


def _summed(
    pairs: Sequence[tuple[int, int]], values: Sequence[tuple[float, float]]
) -> tuple[Integers, Integers, Floats]:
    """Pairs of blocks, each once, in the order in which they first come, and their sums."""
    i, j, place = _each_once(tuple(pairs))
    sums = np.zeros((i.size, 2))
    np.add.at(sums, place, np.array(values).reshape(-1, 2))
    return i, j, sums


@remembered(64)
def _each_once(pairs: tuple[tuple[int, int], ...]) -> tuple[Integers, Integers, Integers]:
    """Pairs of blocks, each once, in the order in which they first come; and which of these each
    pair is."""
    every = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    key = every[:, 0] * (every.max(initial=0) + 1) + every[:, 1]
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    place = np.argsort(np.argsort(first))
    i, j = every[np.sort(first)].T
    return i, j, place[which]


def renumbered(mass: Mass, place: Integers) -> Mass:
    """The same of other blocks that move: block n of it is `place[n]`."""
    diagonal, w = np.empty_like(mass.diagonal), mass.w.copy()
    diagonal[place[: diagonal.size]] = mass.diagonal
    i, j = place[mass.i], place[mass.j]
    w[(i < j)[mass.skew]] *= -1.0
    return changed(
        mass, diagonal=diagonal, i=indices(np.maximum(i, j)), j=indices(np.minimum(i, j)), w=w
    )


@remembered(1024)
def _of_body(
    shape: Shape, m: float, com: Numbers, inertia: float | tuple[Numbers, ...]
) -> tuple[list[tuple[int, float]], list[tuple[int, int, float, float]]]:
    """M of a body, without the D equal axes: diagonal blocks; blocks below, with k and w.

    On the body's own blocks, of all bodies that are alike at once: large mechanisms have many.
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
    M, blocks = (ends @ moments @ ends.T).tolist(), (0, *shape.ends)
    diagonal = [(n, M[a][a]) for a, n in enumerate(blocks)]
    below = [
        (n, other, M[a][b], w) for a, n in enumerate(blocks) for b, other in enumerate(blocks[:a])
    ]
    return diagonal, below


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
