"""A singular position to the last digits, from a position beside it.

Beside it some directions V nearly keep Φ = 0, and some combinations U of rows nearly depend on the
others: G = Uᵀ Φ_q V is small. In the singular position G = 0. Rows are quadratic in q, so that a
displacement V z changes G by Σ_j z_j Uᵀ Φ_q(v_j) V. Newton's method, with the loops closed after
each step, doubles the digits each time.
"""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model import assembly
from alf_ros.model.compile import Model, allocate
from alf_ros.model.null_spaces import convective, dependent_rows, free_directions, linearise

_SOFT = 1e-2  # σ over its ordinary value, from which down a direction takes part
_MOST = 12  # steps
_ENOUGH = 1e-12  # of the same, where it ends
_FURTHEST = 1e-3  # of the size, that the position is away
_DETERMINED = 1e-6  # part of the largest derivative, below which a displacement is not determined


def located(model: Model, q: Floats) -> Floats:
    """The singular position nearest to q (blocks D, m), or q itself if none is found beside it.

    `model` knows its ordinary σ (`Model.accustomed`).
    """
    # first with a penalty that leaves soft all that takes part, then with one that tells σ exactly
    weak = min(model.penalty, (_SOFT * model.system.ordinary) ** -2)
    for penalty in (weak, max(model.penalty, weak)):
        q = _improved(model.with_penalty(penalty), q)
    return q


def _improved(model: Model, q: Floats) -> Floats:
    best, least = q, _softness(model, q)
    at, soft = best, least
    for _ in range(_MOST):
        step = _step(model, at) if soft > _ENOUGH else None
        if step is None:
            break
        try:
            at = assembly.close(model, {}, at + step, least=0.0)
        except AssemblyError:
            break
        if np.abs(at - q).max() > _FURTHEST * model.size:
            break
        before, soft = soft, _softness(model, at)
        if soft < least:
            best, least = at, soft
        if soft > 0.5 * before:
            break
    return best


def _spaces(model: Model, q: Floats) -> tuple[Floats, Floats, float]:
    """V (d, blocks D), U (k, rows), and the largest σ of them over the ordinary one."""
    work = allocate(model, model.system, 0)
    work.q[:] = q
    linearise(model, model.system, work)
    free, sigmas = free_directions(model, model.system, work)
    lost, of_rows = dependent_rows(model, work)
    usual = model.system.ordinary
    soft, rows = sigmas <= _SOFT * usual, of_rows <= _SOFT * usual
    largest = max([0.0, *sigmas[soft], *of_rows[rows]]) / usual
    return free[soft], lost[rows], float(largest)


def _softness(model: Model, q: Floats) -> float:
    return _spaces(model, q)[2]


def _step(model: Model, q: Floats) -> Floats | None:
    """A displacement (blocks D,) m, along V; None if there is none that is determined."""
    V, U, _ = _spaces(model, q)
    d, k = len(V), len(U)
    if not d or not k:
        return None
    work = allocate(model, model.system, 0)
    work.q[:] = q
    linearise(model, model.system, work)
    rates = np.zeros((d, model.system.rows.alpha.size))
    for v, rate in zip(V, rates, strict=True):
        kernel.times_jacobian(model.unit, model.system.rows, work.g, work.g2, v, rate)
    G = U @ rates.T
    change = np.zeros((k, d, d))
    for i in range(d):
        for j in range(i + 1):
            plus, minus = (convective(model, V[i] + sign * V[j]) for sign in (1.0, -1.0))
            change[:, i, j] = change[:, j, i] = U @ (0.25 * (plus - minus))
    flat = change.reshape(k * d, d)
    if not np.abs(flat).max(initial=0.0) > 0.0:
        return None
    z = np.linalg.lstsq(flat, -G.ravel(), rcond=_DETERMINED)[0]
    return np.asarray(z @ V)
