"""Gravity: a uniform acceleration g (m/s²) on the mass of every body.

Q = Σ_b m_b C_bᵀ g, with C_b the natural coordinates of the centre of mass: constant, so it is
summed once, and V = -Qᵀ q. García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody
Systems (1994), ch. 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.columns import concatenated, dot
from alf_ros.effects import contract
from alf_ros.mechanism.natural_coordinates import Layout, place

MULTIPLE = False
CONSTANT = True


@dataclass(frozen=True)
class Parameters:
    acceleration: tuple[float, ...] = field(
        metadata={
            'kind': 'vector',
            'unit': 'm/s^2',
            'doc': 'acceleration of free fall, world frame',
        }
    )


def free_fall(parameters: Parameters) -> tuple[float, ...]:
    """The acceleration (m/s²) that accelerometers do not feel."""
    return parameters.acceleration


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """slots: [length of Q]; params: Q itself."""
    (effect,) = effects
    g = np.asarray(effect.parameters.acceleration)
    Q: list[Floats] = [np.zeros(layout.dimension) for _ in range(layout.blocks)]
    shares: dict[tuple[object, ...], list[tuple[int, Floats]]] = {}  # of bodies that are alike
    for body in layout.bodies:
        own, alike = layout.of_body[body.name], (layout.shape(body.name), body.com, body.mass)
        if alike not in shares:
            centre = place(layout.shape(body.name), body.com)
            shares[alike] = [(n, dot(C.T, body.mass * g)) for n, C in centre.parts.items()]
        for n, force in shares[alike]:
            Q[own[n]] = Q[own[n]] + force
    params = concatenated(Q)
    return contract.Packed(np.array([params.size], dtype=np.int64), params)


@contract.force
def force(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    slots: Integers,
    params: Floats,
    Q: Floats,
) -> None:
    for a in range(slots[0]):
        Q[a] += params[a]


@contract.potential
def potential(t: float, q: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    energy = 0.0
    for a in range(slots[0]):
        energy -= params[a] * q[a]
    return energy
