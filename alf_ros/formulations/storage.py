"""What a formulation writes besides the kernel's Work, and the codes of what can go wrong in it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from alf_ros.arrays import Floats, Indices
from alf_ros.model import Model

SINGULAR, OPENED, FOLDED = 20, 21, 22  # beside the codes of the kernel

OMEGA, MU = 10.0, 1.0  # 1/s and 1: natural frequency and damping ratio of a constraint, as printed

_options: dict[str, Any] = {'nogil': True, 'error_model': 'numpy'}
compiled = njit(**_options, cache=True)  # called from Python
inner = njit(**_options, cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)  # from compiled code only
expanded = njit(**_options, inline='always')  # stands in the code that calls it


class Storage(NamedTuple):
    """Allocated once for a run. N is the order of the largest dense matrix, 0 without one."""

    omega: float  # Ω, 1/s
    mu: float  # μ
    mass_scale: float  # kg
    size: float  # m, of the mechanism
    y: Floats  # (size,) state of a stage
    k: Floats  # (stages size,) its rates, by stages
    f: Floats  # (all blocks D,) a vector of forces or momenta
    phi: Floats  # (rows,) Φ
    c: Floats  # (rows,) what is asked of the constraints
    sigma: Floats  # (rows,) σ
    gd: Floats  # (distance rows D,) Φ̇_q
    g2d: Floats  # (entries D,)
    matrix: Floats  # (N N,) a dense matrix by rows, then its LU factors
    swap: Indices  # (N,) which row came into the place of each
    right: Floats  # (N,) right-hand side, then solution
    order: Indices  # (n,) coordinates: dependent ones, then independent ones
    kept: Indices  # (dependent coordinates,) rows that determine them
    phi_q: Floats  # (rows n,) Φ_q, dense
    R: Floats  # (n independent ones,) q̇ = R ż
    MR: Floats  # (n independent ones,) M R


_NONE = np.zeros(0, dtype=np.uint32)


def allocate(
    model: Model,
    size: int,
    stages: int,
    omega: float,
    mu: float,
    dense: int = 0,
    order: Indices = _NONE,
    kept: Indices = _NONE,
) -> Storage:
    """Storage for a state of `size` numbers, and a dense matrix of the order `dense`."""
    D, rows, n = model.layout.dimension, model.system.rows, order.size
    m, free = rows.alpha.size, n - kept.size
    return Storage(
        omega=omega,
        mu=mu,
        mass_scale=model.mass_scale,
        size=model.size,
        y=np.zeros(size),
        k=np.zeros(stages * size),
        f=np.zeros(model.q.size),
        phi=np.zeros(m),
        c=np.zeros(m),
        sigma=np.zeros(m),
        gd=np.zeros(rows.i.size * D),
        g2d=np.zeros(rows.block.size * D),
        matrix=np.zeros(dense * dense),
        swap=np.zeros(dense, dtype=np.uint32),
        right=np.zeros(dense),
        order=order,
        kept=kept,
        phi_q=np.zeros(m * n),
        R=np.zeros(n * free),
        MR=np.zeros(n * free),
    )
