"""The mass matrix in natural coordinates: constant, blocks k I, in the plane also w J.

A body r = P_0 + Σ c_k d_k has the kinetic energy ½ Σ M_ab q̇_a·q̇_b, M from its mass, the first and
the second moments of c: García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody
Systems (1994), ch. 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats, Integers
from alf_ros.columns import array, dot, mapped, real
from alf_ros.kernel import Mass
from alf_ros.mechanism import Body, Numbers
from alf_ros.mechanism.form_of_rows import row_form
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout, Shape
from alf_ros.model.constraints.packing import indices
from alf_ros.model.constraints.rotors import unit_of
from alf_ros.model.struct_memory import changed, made

_EYE = {D: np.eye(D) for D in (2, 3)}
_NOTHING = 1e-15  # of the largest of a body


class BodyMasses(NamedTuple):
    """M of a body on blocks of the mechanism: diagonal `blocks` with their `masses`, and `pairs`
    (i, j) with i > j, with `bound` (k, w) of each."""

    blocks: tuple[int, ...]
    masses: tuple[float, ...]
    pairs: tuple[tuple[int, int], ...]
    bound: tuple[tuple[float, float], ...]


def masses_of(body: Body, layout: Layout, known: bool = True) -> BodyMasses:
    """M of a body; `known`: other bodies are likely to be like it."""
    own, shape = layout.of_body[body.name], layout.shape(body.name)
    find = _known_body if known else _of_body
    diagonal, below = find(shape, body.mass, body.com, body.inertia)
    pairs, bound = [], []
    for a, b, k, w in below:
        above = own[a] > own[b]
        pairs.append((own[a], own[b]) if above else (own[b], own[a]))
        bound.append((k, -w if above else w))
    blocks = tuple(own[n] for n, _ in diagonal)
    return BodyMasses(blocks, tuple(m for _, m in diagonal), tuple(pairs), tuple(bound))


def mass_of(layout: Layout) -> Mass:
    """M of the movable blocks."""
    bodies = [masses_of(body, layout) for body in layout.bodies]
    sums = MassSums(layout, bodies)
    total: Floats = np.zeros(layout.blocks)
    values: Floats = np.zeros((sums.i.size, 2))
    np.add.at(total, sums.blocks, [m for body in bodies for m in body.masses])
    bound = [each for body in bodies for each in body.bound]
    np.add.at(values, sums.place, np.array(bound).reshape(-1, 2))
    for rotor in layout.mechanism.rotors:
        total[layout.of_auxiliary[rotor.name]] = rotor.inertia / unit_of(rotor, layout) ** 2
    kept = sums.kept(values)
    values = values[kept]
    turns = np.full(len(values), layout.dimension == 2) if row_form().whole else values[:, 1]
    turned = np.flatnonzero(turns)
    return made(
        Mass,
        diagonal=total[: layout.movable].copy(),
        i=indices(sums.i[kept]),
        j=indices(sums.j[kept]),
        k=values[:, 0].copy(),
        skew=indices(turned),
        w=values[turned, 1].copy(),
    )


class MassSums:
    """Where the masses of bodies are added up: the same for all mechanisms of one structure."""

    def __init__(self, layout: Layout, bodies: Sequence[BodyMasses]) -> None:
        self._size, self._movable = layout.blocks, layout.movable
        self.blocks = [n for body in bodies for n in body.blocks]
        pairs = tuple(pair for body in bodies for pair in body.pairs)
        self.i, self.j, self.place = _each_once(pairs)

    def kept(self, values: Floats) -> NDArray[np.bool_]:
        """(..., pairs) the pairs that M has, of their sums (..., pairs, 2)."""
        return (self.i < self._movable) & (values.any(axis=-1) | row_form().whole)

    def of(self, masses: Floats, bound: Floats) -> tuple[Floats, Floats]:
        """(members, movable) diagonal and (members, pairs, 2) sums of many mechanisms; masses
        (members, ...), bound (members, ..., 2) of all bodies. In the order of `mass_of`: a sum is
        rounded as there."""
        total = np.zeros((len(masses), self._size))
        for n, block in enumerate(self.blocks):
            total[:, block] += masses[:, n]
        values = np.zeros((len(masses), self.i.size, 2))
        for n, pair in enumerate(self.place.tolist()):
            values[:, pair] += bound[:, n]
        return total[:, : self._movable], values


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


def _of_body(
    shape: Shape, m: float, com: Numbers, inertia: float | tuple[Numbers, ...]
) -> tuple[list[tuple[int, float]], list[tuple[int, int, float, float]]]:
    """M of a body, without the D equal axes: diagonal blocks; blocks below, with k and w; on the
    body's own blocks."""
    moments, skew = _of_bodies(shape, array([m]), com, array([inertia]))
    blocks, M, (w,) = (0, *shape.ends), moments[0].tolist(), skew.tolist()
    diagonal = [(n, M[a][a]) for a, n in enumerate(blocks)]
    below = [
        (n, other, M[a][b], w) for a, n in enumerate(blocks) for b, other in enumerate(blocks[:a])
    ]
    return diagonal, below


def _of_bodies(shape: Shape, m: Floats, com: Numbers, inertia: Floats) -> tuple[Floats, Floats]:
    """M (members, blocks, blocks) between the carrying blocks of bodies of one shape and centre of
    mass, and its skew part w (members,); m (members,) kg, inertia (members, ...) kg m²."""
    from_local, D, place = shape.inverse, shape.inverse.shape[1], np.array(com)
    c, second = dot(from_local, place), _second_moments(D, m, place, inertia, from_local)
    w: Floats = np.zeros(m.size)
    if D == 2 and c.size:  # J makes the second direction of the first
        second, w, c = second[:, :1, :1] + second[:, 1:, 1:], m * real(c[1]), c[:1]
    moments = np.empty((m.size, 1 + c.size, 1 + c.size), dtype=np.result_type(m, c, second))
    moments[:, 0, 0], moments[:, 1:, 1:] = m, second
    moments[:, 0, 1:] = moments[:, 1:, 0] = m[:, None] * c
    ends = _ends(shape.is_point, c.size)
    return dot(dot(ends, moments), ends.T), w


# of all bodies that are alike at once: large mechanisms have many
_known_body = remembered(1024)(_of_body)


@lru_cache(maxsize=1024)
def _ends(is_point: tuple[bool, ...], k: int) -> Floats:
    """P_0 carries 1 - Σ c over the ends that are points."""
    ends = np.eye(1 + k)
    ends[0, 1:] = [-1.0 if point else 0.0 for point in is_point]
    return ends


def _second_moments(D: int, m: Floats, com: Floats, inertia: Floats, from_local: Floats) -> Floats:
    """∫ c cᵀ dm (members, k, k), c the weights of the basis."""
    if D == 2:
        # only the trace matters: split the moment of inertia evenly
        about = (0.5 * inertia)[:, None, None] * _EYE[2]
    else:
        trace = inertia[:, 0, 0] + inertia[:, 1, 1] + inertia[:, 2, 2]
        about = (0.5 * trace)[:, None, None] * _EYE[3] - inertia
    place = about + m[:, None, None] * (com[:, None] * com)
    second = dot(dot(from_local, place), from_local.T)
    return np.asarray(mapped(_without_rounding, second))


def _without_rounding(second: Floats) -> Floats:
    """Moments (..., k, k) without what rounding leaves of those that are none, as of a thin disk
    along its axle."""
    size = np.abs(second)
    second[size < _NOTHING * size.max(axis=(-2, -1), initial=0.0)[..., None, None]] = 0.0
    return second
