"""Generalised forces that are affine in the natural coordinates: Q = K q + k.

A place r = Σ C_b q_b + c takes a force F as Q_b = C_bᵀ F. A torque τ works on the directions d_k
that carry the body: in the plane Q_d = τ J d / |d|², in space Q_k = ½ τ × dᵏ with the dual
directions dᵏ, so that Σ d_k × Q_k = τ. Whatever turns with a body is a direction fixed in it,
hence linear in q, and so is dᵏ.
"""

from __future__ import annotations

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import TURN, Layout


class Affine:
    """Sums forces and torques, and packs them."""

    def __init__(self, dimension: int) -> None:
        self._dimension = dimension
        self._k: dict[int, Floats] = {}
        self._K: dict[tuple[int, int], Floats] = {}

    def add_force(self, place: Form, F: Form) -> None:
        """A force F (N, world frame) at a place."""
        for block, C in place.parts.items():
            self._add(block, F.times(C.T))

    def add_torque(self, layout: Layout, body: str, torque: Floats, turned: bool) -> None:
        """A torque (1 or 3,), N m, on a body, in its frame if `turned`, else in the world's."""
        shape, blocks = layout.shape(body), layout.of_body[body]
        for n, (end, is_point) in enumerate(zip(shape.ends, shape.is_point, strict=True)):
            dual = shape.inverse[n]  # in the body frame: its product with a local place is c_n
            if layout.dimension == 2:
                Q = layout.vector(body, tuple(columns.dot(torque[0] * TURN, dual)))
            elif turned:
                Q = layout.vector(body, tuple(0.5 * np.cross(torque, dual)))
            else:
                cross = columns.array(np.cross(torque, np.eye(3)).T)  # [τ]×
                Q = layout.direction(body, tuple(dual)).times(0.5 * cross)
            self._add(blocks[end], Q)
            if is_point:
                self._add(blocks[0], Q.times(-1.0))

    def _add(self, block: int, Q: Form) -> None:
        self._k[block] = self._k.get(block, 0.0) + Q.constant
        for other, matrix in Q.parts.items():
            self._K[block, other] = self._K.get((block, other), 0.0) + matrix

    def packed(self) -> contract.Packed:
        """slots: [D, constant parts, linear parts, b …, (b, m) …]; params: [k_b …, K_bm …]."""
        k, K = self._k, self._K
        blocks = [*k, *(block for pair in K for block in pair)]
        slots = np.array([self._dimension, len(k), len(K), *blocks], dtype=np.int64)
        numbers = [np.zeros(0), *k.values(), *(matrix.ravel() for matrix in K.values())]
        return contract.Packed(slots, np.concatenate(numbers))


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
    """Add K q + k to Q (blocks D,), N; `slots` and `params` come from `Affine.packed`."""
    D = slots[0]
    for n in range(slots[1]):
        at = slots[3 + n] * D
        for a in each(0, D):
            a = np.int64(a)
            Q[at + a] += params[n * D + a]
    for n in range(slots[2]):
        at = 3 + slots[1] + 2 * n
        b, m, K = slots[at] * D, slots[at + 1] * D, (slots[1] + n * D) * D
        x, y, z = q[m], q[m + 1], q[m + D - 1]
        for a in each(0, D):
            row = K + np.int64(a) * D
            total = plus_product(Q[b + np.int64(a)], params[row], x)
            total = plus_product(total, params[row + 1], y)
            if D == 3:
                total = plus_product(total, params[row + 2], z)
            Q[b + np.int64(a)] = total
