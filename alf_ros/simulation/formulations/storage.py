"""Arrays of a formulation in addition to the kernel's Work, and its failures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats, Indices
from alf_ros.kernel.numba_ext.structs import Struct
from alf_ros.model.compile import Model


@dataclass(frozen=True)
class Settings:
    """iterations: at most, in one solve; Ω (1/s) and μ as the paper has them; stages of a step."""

    stages: int
    iterations: int
    omega: float
    mu: float


@dataclass(frozen=True, eq=False)
class Storage(Struct):
    """Allocated once for a run; N is the order of the largest dense matrix, 0 without one."""

    iterations: np.uint64
    omega: float  # Ω, 1/s
    mu: float  # μ
    mass_scale: float  # kg
    y: Floats  # (size,) state of a stage
    base: Floats  # (size,) state where a piece of a step begins
    k: Floats  # (stages size,) its rates, by stages
    f: Floats  # (all blocks D,) forces or momenta
    phi: Floats  # (rows,) Φ
    phi_d: Floats  # (rows,) Φ̇
    c: Floats  # (rows,) required value of Φ̈ or Φ̇
    sigma: Floats  # (rows,) σ or λ
    gd: Floats  # (distance rows D,) Φ̇_q
    g2d: Floats  # (entries D,)
    matrix: Floats  # (N N,) by rows, then its LU factors
    swap: Indices  # (N,) which row came into the place of each
    right: Floats  # (N,) right-hand side, then solution
    order: Indices  # (n,) coordinates: dependent ones, then independent ones
    kept: Indices  # (dependent coordinates,) rows that determine them
    phi_q: Floats  # (dependent coordinates n,) Φ_q of those rows, dense
    R: Floats  # (n independent ones,) q̇ = R ż
    MR: Floats  # (n independent ones,) M R


_NONE = np.zeros(0, dtype=np.uint32)


def allocate(
    model: Model,
    settings: Settings,
    size: int,
    dense: int = 0,
    order: Indices = _NONE,
    kept: Indices = _NONE,
) -> Storage:
    """Storage for a state of `size` numbers and a dense matrix of the order `dense`."""
    D, rows, n = model.layout.dimension, model.system.rows, order.size
    m, free = rows.alpha.size, n - kept.size
    return Storage(
        iterations=np.uint64(settings.iterations),
        omega=settings.omega,
        mu=settings.mu,
        mass_scale=model.mass_scale,
        y=np.zeros(size),
        base=np.zeros(size),
        k=np.zeros(settings.stages * size),
        f=np.zeros(model.q.size),
        phi=np.zeros(m),
        phi_d=np.zeros(m),
        c=np.zeros(m),
        sigma=np.zeros(m),
        gd=np.zeros(rows.i.size * D),
        g2d=np.zeros(rows.block.size * D),
        matrix=np.zeros(dense * dense),
        swap=np.zeros(dense, dtype=np.uint32),
        right=np.zeros(dense),
        order=order,
        kept=kept,
        phi_q=np.zeros(kept.size * n),
        R=np.zeros(n * free),
        MR=np.zeros(n * free),
    )
