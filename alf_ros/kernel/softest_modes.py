"""The softest modes of Φ_q: its least singular values, by iteration with the factor of A.

With B = α^½ Φ_q M^-½, singular values s, s² = penalty σ², the factor gives the product with
K = α^½ Φ_q A⁻¹ Φ_qᵀ α^½ = B Bᵀ (1 + B Bᵀ)⁻¹. Its eigenvalues are s² / (1 + s²): about 1 for stiff
modes, small for a mode that is about to vanish, and 0 for combinations of rows that depend on one
another. So 1 - K singles out the soft modes, K takes away the dependent combinations, and free
motions, which are no combination of rows, do not appear at all.

σ is not computed as a difference from 1. With z = (1 - K) y and w = K y, w = B Bᵀ z: so z·w / z·z
is the Rayleigh quotient of s², made of Φ_qᵀ z itself, which is as small as s. It is accurate where
σ is small, and never below the true one but for rounding.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import add_transposed, times_jacobian
from alf_ros.kernel.data import EPS, NOTHING, Modes, System, Work
from alf_ros.kernel.numba_ext.jit import ONE, ZERO, compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.triangular_solve import solve

_SWEEPS = 6  # of Jacobi's rotations, which converge quadratically
_FRESH = 0.1  # of all rows, mixed into the last mode
STIFF = 10.0  # σ of modes that do not vanish soon
_TWICE = 100.0  # s² of a mode that is very soft
ALL_SOFT = 4.0  # s² up to which 1 - K does not separate a mode from a softer one
_RIGID = 100.0  # σ above which, as of a mode that moves no mass, it is not told from rounding
_LITTLE = 1e-3  # of it, of which more than rounding depends on others
_NOTHING_LEFT = 1e-14  # of a combination of rows: what it comes to is rounding
_ROUNDING = 4.0  # times ε, and ε penalty σ: what rounding makes of σ


@compiled
def softest(
    unit: Unit, system: System, work: Work, modes: Modes, rounds: int, tolerance: float
) -> None:
    """Iterate the modes of the factor and the Φ_q in `work`, from the previous ones.

    So many rounds, or until σ of the first is known to `tolerance` of it, or to rounding. Changes
    delta and w of `work`.
    """
    count, m, whole = modes.s2.size, modes.root.size, work.delta.size
    first = (count - ONE) * m
    for r in range(m):  # a mode that nobody follows may be the softest now
        modes.z[first + r] += _FRESH * modes.fresh[r]
    if modes.redundant > ZERO:
        for i in range(count):
            if i + ONE == count or modes.s2[i] == 0.0:  # any combination of rows
                _clean(unit, system, work, modes, i * m)
    for _ in range(rounds):
        for i in range(count):
            _filter(unit, system, work, modes, i)
            _orthonormalise(modes, i, m, whole)
        _separate(modes, m, whole)
        if modes.error[0] <= tolerance * modes.sigma[0] + 2.0 * _rounded(modes, modes.sigma[0]):
            break
    copy(work.gf, modes.g)
    copy(work.g2f, modes.g2)


@compiled
def carried_over(
    unit: Unit, system: System, work: Work, modes: Modes, g: Floats, g2: Floats, i: int
) -> float:
    """The signed σ of mode i at another place, where Φ_q is g, g2, over the σ at its own position.

    It is z·B u with the B of the other position and the vectors of this one: below zero if the
    mode vanishes on the way. Both approximate the mode as long as its vectors turn little. With
    Φ̇_q in the place of Φ_q it is σ̇ / σ. Changes delta and w of `work`.
    """
    m, whole, s = modes.root.size, work.delta.size, 0.0
    of, at = np.uint64(i) * m, np.uint64(i) * whole
    for k in range(whole):
        work.delta[k] = modes.v[at + k]
    times_jacobian(unit, system.rows, g, g2, work.delta, work.w)
    for r in range(m):
        s += modes.z[of + r] * modes.root[r] * work.w[r]
    return s / (modes.s2[i] + NOTHING)


@inner
def _clean(unit: Unit, system: System, work: Work, modes: Modes, at: np.uint64) -> None:
    """z = K z, of unit length: without what depends on other rows."""
    m = modes.root.size
    for r in range(m):
        modes.x[r] = modes.z[at + r]
    _times(unit, system, work, modes)
    _scale(work.w, m)
    for r in range(m):
        modes.z[at + r] = work.w[r]


@inner
def _filter(unit: Unit, system: System, work: Work, modes: Modes, i: np.uint64) -> None:
    """y = (1 - K) z_i, of unit length, at right angles to the modes before it, and without what
    depends on other rows; then z_i = (1 - K) y, w_i = K y and v_i.

    Where rows depend on others y = K (1 - K) z_i; of a very soft mode K (1 - K)² z_i, as K is
    hardly larger for it than for what depends on others.
    """
    x, z, w, m = modes.x, modes.z, modes.w, modes.root.size
    at, v_at = i * m, i * work.delta.size
    for r in range(m):
        x[r] = z[at + r]
    left = 1.0
    for _ in range(2 if modes.redundant > ZERO and 0.0 < modes.s2[i] < _TWICE else 1):
        _times(unit, system, work, modes)
        for r in range(m):
            x[r] -= work.w[r]
        _leave_out(modes, i)
        _scale(x, m)
    if modes.redundant > ZERO:
        _times(unit, system, work, modes)
        copy(work.w, x)
        _leave_out(modes, i)
        left = _scale(x, m)
    if left < _NOTHING_LEFT:  # the other modes are stiff: any of them will do
        copy(modes.fresh, x)
        _times(unit, system, work, modes)
        copy(work.w, x)
        _leave_out(modes, i)
        _scale(x, m)
    _times(unit, system, work, modes)
    if left < _LITTLE and _dot(x, ZERO, work.w, ZERO, m) > 0.5:
        # 1 - K of something stiff leaves no more than rounding does of what depends on others
        copy(work.w, x)
        _leave_out(modes, i)
        _scale(x, m)
        _times(unit, system, work, modes)
    square = 0.0
    for r in range(m):
        w[at + r] = work.w[r]
        z[at + r] = x[r] - work.w[r]
        square += z[at + r] * z[at + r]
    least = max(64.0 * EPS, 1.0 / (modes.penalty * _RIGID * _RIGID))
    if square < least * least or left < _NOTHING_LEFT:
        for r in range(m):
            z[at + r] = least * x[r]
    for k in range(work.delta.size):
        modes.v[v_at + k] = work.delta[k]


@inner
def _leave_out(modes: Modes, i: np.uint64) -> None:
    """Make x stand at right angles to the y of the modes before i, which may be softer by far.

    Not to z = y - w: of what depends on other rows rounding leaves more in it.
    """
    x, z, w, m = modes.x, modes.z, modes.w, modes.root.size
    for _ in range(2):
        for j in range(i):
            s, square = 0.0, NOTHING
            for r in range(m):
                y = z[j * m + r] + w[j * m + r]
                s += x[r] * y
                square += y * y
            for r in range(m):
                x[r] -= s / square * (z[j * m + r] + w[j * m + r])


@inner
def _times(unit: Unit, system: System, work: Work, modes: Modes) -> None:
    """K x into w of `work`, with δ = A⁻¹ Φ_qᵀ α^½ x."""
    root, x, y, delta = modes.root, modes.x, work.w, work.delta
    for r in range(root.size):
        y[r] = root[r] * x[r]
    zero(delta)
    add_transposed(unit, system.rows, work.gf, work.g2f, y, delta)
    for i in range(work.p.size, delta.size):  # fixed blocks do not move
        delta[i] = 0.0
    solve(unit, system.pattern, work.diagonal, work.off, delta)
    times_jacobian(unit, system.rows, work.gf, work.g2f, delta, y)
    for r in range(root.size):
        y[r] *= root[r]


@inner
def _scale(x: Floats, m: np.uint64) -> float:
    """x of unit length; returns what it was."""
    square = NOTHING * NOTHING
    for r in range(m):
        square += x[r] * x[r]
    for r in range(m):
        x[r] /= np.sqrt(square)
    return float(np.sqrt(square))


@inner
def _dot(a: Floats, at: np.uint64, b: Floats, of: np.uint64, m: np.uint64) -> float:
    s = 0.0
    for r in range(m):
        s += a[at + r] * b[of + r]
    return s


@inner
def _add(s: float, a: Floats, at: np.uint64, to: np.uint64, m: np.uint64) -> None:
    for r in range(m):
        a[to + r] += s * a[at + r]


@inner
def _orthonormalise(modes: Modes, i: np.uint64, m: np.uint64, whole: np.uint64) -> None:
    """z_i of unit length, at right angles to those before it; w_i and v_i go along."""
    z, w, v = modes.z, modes.w, modes.v
    for _ in range(2):
        for j in range(i):
            s = -_dot(z, j * m, z, i * m, m)
            _add(s, z, j * m, i * m, m)
            _add(s, w, j * m, i * m, m)
            _add(s, v, j * whole, i * whole, whole)
        length = np.sqrt(_dot(z, i * m, z, i * m, m)) + NOTHING
        for r in range(m):
            z[i * m + r] /= length
            w[i * m + r] /= length
        for r in range(whole):
            v[i * whole + r] /= length


@inner
def _separate(modes: Modes, m: np.uint64, whole: np.uint64) -> None:
    """Turn the modes until w·z is diagonal, by Jacobi's rotations; then s², σ and its error."""
    z, w, v, gram, count = modes.z, modes.w, modes.v, modes.gram, modes.s2.size
    for i in range(count):
        for j in range(i + ONE):
            # of the two products the one of the shorter w, which is rounded less
            s = _dot(w, i * m, z, j * m, m)
            if i != j:
                other = _dot(w, j * m, z, i * m, m)
                if gram[j * count + j] < _dot(w, i * m, z, i * m, m):
                    s = other
            gram[i * count + j] = gram[j * count + i] = s
        if gram[i * count + i] <= 0.0:  # by rounding, of a mode that is too stiff
            gram[i * count + i] = np.sqrt(_dot(w, i * m, w, i * m, m))
    for _ in range(_SWEEPS):
        for i in range(ONE, count):
            for j in range(i):
                _rotate(modes, np.uint64(i), np.uint64(j), m, whole)
    for i in range(count):  # ascending
        k = i
        for j in range(i + ONE, count):
            if gram[j * count + j] < gram[k * count + k]:
                k = j
        if k != i:
            _swap(z, i * m, k * m, m)
            _swap(w, i * m, k * m, m)
            _swap(v, i * whole, k * whole, whole)
            gram[i * count + i], gram[k * count + k] = (
                gram[k * count + k],
                gram[i * count + i],
            )
        modes.s2[i] = max(gram[i * count + i], 0.0)
    _judge(modes, m)


@inner
def _swap(a: Floats, at: np.uint64, to: np.uint64, m: np.uint64) -> None:
    for r in range(m):
        a[at + r], a[to + r] = a[to + r], a[at + r]


@inner
def _rotate(modes: Modes, i: np.uint64, j: np.uint64, m: np.uint64, whole: np.uint64) -> None:
    gram, count = modes.gram, modes.s2.size
    a, b, c = gram[i * count + i], gram[j * count + j], gram[i * count + j]
    if c * c <= (EPS * EPS) * abs(a * b) or c == 0.0:
        return
    theta = 0.5 * (b - a) / c
    t = 1.0 / (abs(theta) + np.sqrt(1.0 + theta * theta))
    if theta < 0.0:
        t = -t
    cos = 1.0 / np.sqrt(1.0 + t * t)
    sin = t * cos
    for k in range(count):
        p, q = gram[k * count + i], gram[k * count + j]
        gram[k * count + i], gram[k * count + j] = cos * p - sin * q, sin * p + cos * q
    for k in range(count):
        p, q = gram[i * count + k], gram[j * count + k]
        gram[i * count + k], gram[j * count + k] = cos * p - sin * q, sin * p + cos * q
    # known without cancellation
    gram[i * count + i], gram[j * count + j] = a - t * c, b + t * c
    gram[i * count + j] = gram[j * count + i] = 0.0
    _turn(modes.z, cos, sin, i * m, j * m, m)
    _turn(modes.w, cos, sin, i * m, j * m, m)
    _turn(modes.v, cos, sin, i * whole, j * whole, whole)


@inner
def _turn(a: Floats, cos: float, sin: float, i: np.uint64, j: np.uint64, m: np.uint64) -> None:
    for r in range(m):
        p, q = a[i + r], a[j + r]
        a[i + r], a[j + r] = cos * p - sin * q, sin * p + cos * q


@inner
def _judge(modes: Modes, m: np.uint64) -> None:
    """σ, and its error bound: the residual of the eigenproblem, |w - s² z|, is the distance to
    some s², its square over the gap to the next one the error of s²; and rounding.

    If all the modes are soft, more may exist: then 1 - K does not identify the softest.
    """
    count = modes.s2.size
    penalty = modes.penalty
    for i in range(count):
        s2, left = modes.s2[i], 0.0
        for r in range(m):
            d = modes.w[i * m + r] - s2 * modes.z[i * m + r]
            left += d * d
        error = np.sqrt(left)
        if i + ONE < count and modes.s2[i + ONE] > s2:
            error = min(error, left / (modes.s2[i + ONE] - s2))
        sigma = np.sqrt(s2 / penalty)
        # √(s² + e) - s, without cancellation
        error = error / penalty / (np.sqrt(sigma * sigma + error / penalty) + sigma + NOTHING)
        modes.sigma[i] = sigma
        modes.error[i] = error + _rounded(modes, sigma)
    if modes.s2[count - ONE] < ALL_SOFT and count + modes.redundant < m:
        modes.error[0] += modes.sigma[0]


@inner
def _rounded(modes: Modes, sigma: float) -> float:
    return _ROUNDING * EPS * (1.0 + modes.penalty * sigma)
