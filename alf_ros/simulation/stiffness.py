"""How stiff each effect makes a motion: the fastest rate that it alone gives to the free motion.

With K = -∂Q/∂q and C = -∂Q/∂q̇ of one effect, projected on the free directions at an instant,
λ² M + λ C + K = 0; |λ| is √(k/m) of a spring and c/m of a damper. An explicit method of stability
function R is stable for steps h with |R(h λ)| <= 1. Hairer & Wanner, Solving Ordinary Differential
Equations II (1996), IV.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.dense_linearisation import MASSLESS, Linearised
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.simulation.applied import Part
from alf_ros.simulation.dynamics import Dynamics

_DIFFERENCE = 1e-6  # of the size (m), and of it a second: above rounding, below where laws bend


@dataclass(frozen=True)
class Mode:
    """The eigenvalue λ, 1/s, that is farthest from zero; 0 of what gives no rate."""

    value: complex

    @property
    def rate(self) -> float:
        """|λ|, 1/s."""
        return abs(self.value)

    def step(self, integrator: str) -> float:
        """The longest step (s) with which a method is stable for it; inf if every one is."""
        return _radius(integrator, self.value) / self.rate if self.rate > 0.0 else math.inf


def stiffest(samples: Iterable[Dynamics], at_rest: bool = True) -> tuple[dict[str, Mode], Mode]:
    """Of each effect of the scene alone, and of all of them together: over all instants, as the
    mechanism moves and, if `at_rest`, as it would stand there, where dry friction is steepest."""
    alone: dict[str, Mode] = {}
    whole = Mode(0.0)
    for sample in samples:
        at = _Instant(sample)
        moving = sample.state.qd
        for qd in (moving, np.zeros_like(moving)) if at_rest else (moving,):
            total = np.zeros((2, at.free.shape[1], at.free.shape[1]))
            for label, part in sample._applied.each.items():
                matrices = at.matrices(part, qd)
                total += matrices
                alone[label] = _faster(alone.get(label, Mode(0.0)), _mode(*matrices))
            whole = _faster(whole, _mode(*total))
    return alone, whole


def _faster(one: Mode, other: Mode) -> Mode:
    return other if other.rate > one.rate else one


class _Instant:
    """The free directions at a sample, of unit mass."""

    def __init__(self, sample: Dynamics) -> None:
        self._sample, self._model = sample, sample.model

    @cached_property
    def free(self) -> Floats:
        """(all blocks D, freedoms) V with Vᵀ M V = 1, without those in which nothing has mass."""
        model = self._model
        along = Linearised(model, self._sample.state.q).free
        V = np.zeros((model.q.size, along.shape[1]))
        V[: model.n] = along
        MV = np.zeros_like(V)
        for v, column in zip(V.T, MV.T, strict=True):
            out = np.zeros(model.n)
            kernel.add_mass_times(model.unit, model.system.mass, 1.0, v.copy(), out)
            column[: model.n] = out
        masses, turn = np.linalg.eigh(V.T @ MV)
        kept = masses > MASSLESS * model.system.mean
        return np.asarray(V @ turn[:, kept] / np.sqrt(masses[kept]))

    def matrices(self, part: Part, qd: Floats) -> Floats:
        """(2, freedoms, freedoms) K (1/s²) and C (1/s) of some effects, by central differences.

        Loads of friction belong to this instant.
        """
        q, V = self._sample.state.q, self.free
        found = np.zeros((2, V.shape[1], V.shape[1]))
        for k, v in enumerate(V.T):
            d = _DIFFERENCE * self._model.size / np.abs(v).max() * v
            scale = 2.0 * _DIFFERENCE * self._model.size / np.abs(v).max()
            found[0][:, k] = V.T @ self._change(part, q, qd, d, 0.0 * d) / -scale
            found[1][:, k] = V.T @ self._change(part, q, qd, 0.0 * d, d) / -scale
        return found

    def _change(self, part: Part, q: Floats, qd: Floats, dq: Floats, dqd: Floats) -> Floats:
        ahead, behind = np.zeros(q.size), np.zeros(q.size)
        self._sample._act(part, q + dq, qd + dqd, ahead)
        self._sample._act(part, q - dq, qd - dqd, behind)
        return ahead - behind


def _mode(K: Floats, C: Floats) -> Mode:
    n = len(K)
    first = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    values = np.linalg.eigvals(first)
    return Mode(complex(values[np.argmax(np.abs(values))])) if n else Mode(0.0)


def _radius(integrator: str, value: complex) -> float:
    """Where |R| exceeds 1 along the ray of an eigenvalue; of one that grows, beside it on the
    imaginary axis. Nowhere for the implicit methods, which are L-stable."""
    if TABLEAUX[integrator].implicit:
        return math.inf
    a, b = TABLEAUX[integrator].a, TABLEAUX[integrator].b
    powers: Floats = np.ones(b.size)
    coefficients = [1.0]
    for _ in range(b.size):
        coefficients.append(float(b @ powers))
        powers = a @ powers
    ray = complex(min(value.real, 0.0), value.imag) or 1j * value.real
    far = np.arange(1e-3, 20.0, 1e-3)
    grown = np.abs(np.polyval(coefficients[::-1], far * ray / abs(ray))) > 1.0 + 1e-9
    return float(far[np.argmax(grown)])
