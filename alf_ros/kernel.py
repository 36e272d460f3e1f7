"""The compiled maths of ALF2: Φ, Φ_q, A = M + Φ_qᵀαΦ_q, its LDLᵀ, the augmented solve, the step.

Equation numbers are those of Bayo & Avello, Nonlinear Dynamics 5 (1994); doc/method.md derives
what differs from the print. Everything the step calls stands in this one file, because the cache
of compiled code looks only at the file of the function that is called.

Conventions. Vectors are flat, block i at [i D, (i + 1) D); D, 2 or 3, is the length of the tuple
`unit` and so a constant when compiled. Movable blocks come first, in elimination order; fixed
blocks follow, with positions but no velocity. Indices are unsigned, which spares numba's test for
negative ones. Rows: distance rows between movable blocks, distance rows with a fixed end,
quadratic rows.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from alf_ros.arrays import Floats, Indices, Integers, Unit

OK, NOT_POSITIVE, NOT_FINITE, NOT_CLOSED, COLLAPSED = 0, 1, 2, 3, 4

SOLVED = 1e-12  # relative change at which a solve is finished
_SLOW = 0.1  # ratio of the augmented solve above which a stage is too close to a position
_SHARE = 0.05  # of the tolerance for one step: errors add up along a motion
_TURN = 0.1  # part of the momentum across the free directions from which on it is, too


_0, _1 = np.uint64(0), np.uint64(1)
_EPS = float(np.finfo(np.float64).eps)
_options: dict[str, Any] = {'cache': True, 'nogil': True, 'error_model': 'numpy'}
# called from compiled code only: without the code that takes all these arrays from Python objects
_bare = {'no_cpython_wrapper': True, 'no_cfunc_wrapper': True}
# Handing on tuples of arrays costs more than a small mechanism: most functions stand where they
# are called. Those that are called often and compiled slowly do not.
_compiled = njit(**_options)
_inlined = njit(**_options, forceinline=True)
_inner = njit(**_options, **_bare)
_inner_inlined = njit(**_options, **_bare, forceinline=True)


class Mass(NamedTuple):
    """M: diagonal blocks k I and pairs of off-diagonal blocks k I + w J (w only in the plane)."""

    diagonal: Floats  # (movable blocks,) kg
    i: Indices  # (pairs,) row block, i > j
    j: Indices  # (pairs,)
    k: Floats  # (pairs,) kg
    skew: Indices  # (skew pairs,) pairs that have a w
    w: Floats  # (skew pairs,) kg


class Rows(NamedTuple):
    """Φ(q): distance rows ½(|q_i - q_j|² - L²), then quadratic ones Σ ½(g + b)·q + c."""

    both: np.uint64  # number of distance rows whose two blocks move; they come first
    i: Indices  # (distance rows,) movable block
    j: Indices  # (distance rows,) the other block
    length2: Floats  # (distance rows,) L², m²
    first: Indices  # (quadratic rows + 1,) entries of a row: first[r] .. first[r + 1]
    movable: Indices  # (quadratic rows,) entries of movable blocks end here; fixed ones follow
    block: Indices  # (entries,)
    b: Floats  # (entries D,); the gradient is g = T q + b
    first_term: Indices  # (entries + 1,)
    term_block: Indices  # (terms,)
    term: Floats  # (terms D D,)
    c: Floats  # (quadratic rows,)
    alpha: Floats  # (rows,) penalty α of each row
    scale: Floats  # (rows,) 1 / |Φ_q,r| as drawn: scale Φ is a distance in metres


class Pattern(NamedTuple):
    """Pattern of A and of its factor, analysed once: blocks below the diagonal, by columns."""

    first: Indices  # (movable + 1,) blocks of column k: first[k] .. first[k + 1]
    row: Indices  # (blocks,) row of each off-diagonal block, ascending in a column
    target: Indices  # (updates,) where the update of a pair of blocks of one column goes
    mass_diagonal: Floats  # (movable D D,) M on the pattern
    mass_off: Floats  # (blocks D D,)
    distance: Indices  # (both,) off-diagonal block of a distance row
    pair: Indices  # (pairs of entries, 4) entry, entry, block, row of the quadratic rows


class Forces(NamedTuple):
    """The effects of a scene: addresses of compiled functions and the packed data of each."""

    force: Indices  # (effects,) address of force()
    potential: Indices  # (effects,) address of potential(), 0 where there is none
    slots: Integers  # (…,) all effects in a row
    params: Floats  # (…,)
    slots_at: Indices  # (effects,) where an effect's slots begin
    params_at: Indices  # (effects,)


class System(NamedTuple):
    """All the kernel reads and never writes."""

    mass: Mass
    rows: Rows
    pattern: Pattern


class Work(NamedTuple):
    """All the kernel writes in a step: allocated once by the caller, shape in the comment."""

    diagonal: Floats  # (movable D D,) factor: unit lower triangles, reciprocal pivots between
    off: Floats  # (blocks D D,) factor
    column: Floats  # (longest column D D,) one column before division by the pivots
    g: Floats  # (distance rows D,) q_i - q_j
    g2: Floats  # (entries D,) gradients of the quadratic rows
    g2d: Floats  # (entries D,) their time derivatives
    gf: Floats  # (distance rows D,) the same, of the place where A was factorised
    g2f: Floats  # (entries D,)
    q: Floats  # (all blocks D,) stage
    qd: Floats  # (all blocks D,)
    qdd: Floats  # (all blocks D,)
    p: Floats  # (movable D,) momenta p'
    Q: Floats  # (all blocks D,)
    delta: Floats  # (all blocks D,) right-hand side, then solution
    r2: Floats  # (rows,)
    sigma: Floats  # (rows,) σ'
    lam: Floats  # (rows,) λ
    rate: Floats  # (rows,) Φ_q times a velocity or a displacement
    kq: Floats  # ((stages + 1) movable D,) q̇ of the stages and of the end
    kp: Floats  # ((stages + 1) movable D,) ṗ' of the stages and of the end
    bend: Floats  # (all blocks D,) q̈ of the unforced mechanism: the curvature of its path
    target: Floats  # (all blocks D,) a stage as the method has it, before it is put on Φ = 0
    base: Floats  # (all blocks D,) that stage again, while places around it are tried
    momenta: Floats  # (movable D,) its p'
    sum_q: Floats  # (movable D,) what is interpolated from those places: q̇
    sum_p: Floats  # (movable D,) and ṗ'


# ------------------------------------------------------------------------------ arrays on loan


def _on_loan(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.Array):
        array = cgutils.create_struct_proxy(kind)(context, builder, value=value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        for n, part in enumerate(kind):
            item = _on_loan(context, builder, part, builder.extract_value(value, n))
            value = builder.insert_value(value, item, n)
    return value


@intrinsic
def on_loan(typing: Any, arrays: Any) -> Any:
    """The same arrays without their reference counts, which outlive the call anyway.

    Counting is atomic and happens for every array of a tuple that is handed on: for a small
    mechanism that costs several times the mechanics.
    """

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _on_loan(context, builder, sig.args[0], args[0])

    return arrays(arrays), code


# Assigning slices would do too, but its error messages take seconds to compile.


@_inner_inlined
def zero(to: Floats) -> None:
    """to = 0."""
    for i in range(np.uint64(to.size)):
        to[i] = 0.0


@_inner_inlined
def copy(of: Floats | Integers, to: Floats | Integers) -> None:
    """to = of, which is as long."""
    for i in range(np.uint64(to.size)):
        to[i] = of[i]


# ---------------------------------------------------------------------------------------- effects


def _call(context: Any, builder: Any, sig: Any, args: Any, returns: Any) -> Any:
    """Call a C function of a known signature at an address that is data."""
    values = []
    for kind, value in zip(sig.args[1:], args[1:], strict=True):
        if isinstance(kind, types.Array):
            data = cgutils.create_struct_proxy(kind)(context, builder, value=value).data
            values.append(data)
        elif isinstance(kind, types.Float):
            values.append(value)
        else:  # an offset: belongs to the pointer before it
            values[-1] = builder.gep(values[-1], [value])
    function = ir.FunctionType(returns, [value.type for value in values])
    pointer = builder.inttoptr(args[0], function.as_pointer())
    return builder.call(pointer, values)


@intrinsic
def _force(
    typing: Any, at: Any, t: Any, q: Any, qd: Any, slots: Any, i: Any, params: Any, j: Any, Q: Any
) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        _call(context, builder, sig, args, ir.VoidType())
        return context.get_dummy_value()

    return types.void(at, t, q, qd, slots, i, params, j, Q), code


@intrinsic
def _potential(
    typing: Any, at: Any, t: Any, q: Any, slots: Any, i: Any, params: Any, j: Any
) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(context, builder, sig, args, ir.DoubleType())

    return types.float64(at, t, q, slots, i, params, j), code


@_inlined
def applied_forces(forces: Forces, t: float, q: Floats, qd: Floats, Q: Floats) -> None:
    """Q(q, q̇, t): the sum of the effects the scene names; each adds its own."""
    zero(Q)
    for e in range(forces.force.size):
        _force(
            forces.force[e],
            t,
            q,
            qd,
            forces.slots,
            forces.slots_at[e],
            forces.params,
            forces.params_at[e],
            Q,
        )


@_inlined
def potential_energy(forces: Forces, t: float, q: Floats) -> float:
    """Potential energy of all effects that store some, J."""
    energy = 0.0
    for e in range(forces.force.size):
        if forces.potential[e] != 0:
            energy += _potential(
                forces.potential[e],
                t,
                q,
                forces.slots,
                forces.slots_at[e],
                forces.params,
                forces.params_at[e],
            )
    return energy


# ------------------------------------------------------------------------------------ constraints


@_inlined
def jacobian(unit: Unit, rows: Rows, q: Floats, g: Floats, g2: Floats) -> None:
    """Φ_q(q), as the differences of the distance rows and the entries of the quadratic rows."""
    D = np.uint64(len(unit))
    for r in range(np.uint64(rows.i.size)):
        i, j = rows.i[r] * D, rows.j[r] * D
        for a in range(D):
            g[r * D + a] = q[i + a] - q[j + a]
    for e in range(np.uint64(rows.block.size)):
        for a in range(D):
            g2[e * D + a] = rows.b[e * D + a]
        _add_terms(D, rows, e, q, g2)


@_inner_inlined
def _add_terms(D: np.uint64, rows: Rows, e: np.uint64, q: Floats, g2: Floats) -> None:
    for s in range(rows.first_term[e], rows.first_term[e + _1]):
        j = rows.term_block[s] * D
        for a in range(D):
            for c in range(D):
                g2[e * D + a] += rows.term[(s * D + a) * D + c] * q[j + c]


@_inlined
def jacobian_rate(unit: Unit, rows: Rows, qd: Floats, g2d: Floats) -> None:
    """Φ̇_q of the quadratic rows; that of a distance row is the difference of the velocities."""
    D = np.uint64(len(unit))
    for e in range(np.uint64(rows.block.size)):
        for a in range(D):
            g2d[e * D + a] = 0.0
        _add_terms(D, rows, e, qd, g2d)


@_inlined
def violation(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> None:
    """Φ(q)."""
    D = np.uint64(len(unit))
    m1 = np.uint64(rows.i.size)
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        s = -rows.length2[r]
        for a in range(D):
            s += (q[i + a] - q[j + a]) * (q[i + a] - q[j + a])
        phi[r] = 0.5 * s
    for r in range(np.uint64(rows.c.size)):
        s = rows.c[r]
        for e in range(rows.first[r], rows.first[r + _1]):
            i = rows.block[e] * D
            for a in range(D):
                s += rows.b[e * D + a] * q[i + a]
            for n in range(rows.first_term[e], rows.first_term[e + _1]):
                j = rows.term_block[n] * D
                for a in range(D):
                    for c in range(D):
                        s += 0.5 * q[i + a] * rows.term[(n * D + a) * D + c] * q[j + c]
        phi[m1 + r] = s


@_inlined
def times_jacobian(unit: Unit, rows: Rows, g: Floats, g2: Floats, v: Floats, out: Floats) -> None:
    """out = Φ_q v."""
    D = np.uint64(len(unit))
    m1 = np.uint64(rows.i.size)
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        s = 0.0
        for a in range(D):
            s += g[r * D + a] * (v[i + a] - v[j + a])
        out[r] = s
    for r in range(np.uint64(rows.c.size)):
        s = 0.0
        for e in range(rows.first[r], rows.first[r + _1]):
            i = rows.block[e] * D
            for a in range(D):
                s += g2[e * D + a] * v[i + a]
        out[m1 + r] = s


@_inlined
def add_transposed(unit: Unit, rows: Rows, g: Floats, g2: Floats, y: Floats, out: Floats) -> None:
    """out += Φ_qᵀ y, on fixed blocks too."""
    D = np.uint64(len(unit))
    m1 = np.uint64(rows.i.size)
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        for a in range(D):
            s = y[r] * g[r * D + a]
            out[i + a] += s
            out[j + a] -= s
    for r in range(np.uint64(rows.c.size)):
        for e in range(rows.first[r], rows.first[r + _1]):
            i = rows.block[e] * D
            for a in range(D):
                out[i + a] += y[m1 + r] * g2[e * D + a]


@_inlined
def convective(unit: Unit, rows: Rows, g2d: Floats, qd: Floats, out: Floats) -> None:
    """out = Φ̇_q q̇."""
    D = np.uint64(len(unit))
    m1 = np.uint64(rows.i.size)
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        s = 0.0
        for a in range(D):
            s += (qd[i + a] - qd[j + a]) * (qd[i + a] - qd[j + a])
        out[r] = s
    for r in range(np.uint64(rows.c.size)):
        s = 0.0
        for e in range(rows.first[r], rows.first[r + _1]):
            i = rows.block[e] * D
            for a in range(D):
                s += g2d[e * D + a] * qd[i + a]
        out[m1 + r] = s


@_inlined
def add_mass_times(unit: Unit, mass: Mass, s: float, v: Floats, out: Floats) -> None:
    """out += s M v on movable blocks."""
    D = np.uint64(len(unit))
    for i in range(np.uint64(mass.diagonal.size)):
        k = s * mass.diagonal[i]
        for a in range(D):
            out[i * D + a] += k * v[i * D + a]
    for n in range(np.uint64(mass.i.size)):
        i, j, k = mass.i[n] * D, mass.j[n] * D, s * mass.k[n]
        for a in range(D):
            out[i + a] += k * v[j + a]
            out[j + a] += k * v[i + a]
    for n in range(np.uint64(mass.skew.size)):
        i, j, w = mass.i[mass.skew[n]] * D, mass.j[mass.skew[n]] * D, s * mass.w[n]
        out[i] -= w * v[j + _1]
        out[i + _1] += w * v[j]
        out[j] += w * v[i + _1]
        out[j + _1] -= w * v[i]


# ------------------------------------------------------------------------------------- the factor


@_inner_inlined
def assemble(unit: Unit, system: System, work: Work) -> None:
    """A = M + Φ_qᵀ α Φ_q on the pattern, lower blocks, from the Jacobian in `work`."""
    D = np.uint64(len(unit))
    rows, pattern, g, g2 = system.rows, system.pattern, work.g, work.g2
    copy(pattern.mass_diagonal, work.diagonal)
    copy(pattern.mass_off, work.off)
    for r in range(np.uint64(rows.i.size)):
        i, j = rows.i[r] * D * D, rows.j[r] * D * D
        for a in range(D):
            s = rows.alpha[r] * g[r * D + a]
            for c in range(D):
                v = s * g[r * D + c]
                work.diagonal[i + a * D + c] += v
                if r < rows.both:
                    work.diagonal[j + a * D + c] += v
                    work.off[pattern.distance[r] * D * D + a * D + c] -= v
    m1 = np.uint64(rows.i.size)
    for r in range(np.uint64(rows.c.size)):
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * D * D
            for a in range(D):
                for c in range(D):
                    work.diagonal[i + a * D + c] += (
                        rows.alpha[m1 + r] * g2[e * D + a] * g2[e * D + c]
                    )
    for n in range(np.uint64(pattern.pair.shape[0])):
        e, f, at, r = (
            pattern.pair[n, 0],
            pattern.pair[n, 1],
            pattern.pair[n, 2],
            pattern.pair[n, 3],
        )
        for a in range(D):
            for c in range(D):
                work.off[at * D * D + a * D + c] += rows.alpha[r] * g2[e * D + a] * g2[f * D + c]


@_inner_inlined
def factorise(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, column: Floats) -> Any:
    """A = L D Lᵀ in place, right-looking by blocks; returns the number of columns that went well.

    Inside a block the elimination is by scalars: a 2x2 or 3x3 inverse would lose the digits that
    the spread between α and M needs.
    """
    D = np.uint64(len(unit))
    DD = D * D
    u = _0
    for k in range(np.uint64(pattern.first.size) - _1):
        kk = k * DD
        for c in range(D):
            pivot = diagonal[kk + c * D + c]
            if not pivot > 0.0:
                return k
            inverse = 1.0 / pivot
            diagonal[kk + c * D + c] = inverse  # D⁻¹
            for a in range(c + _1, D):
                for b in range(c + _1, a + _1):
                    diagonal[kk + a * D + b] -= (
                        diagonal[kk + a * D + c] * inverse * diagonal[kk + b * D + c]
                    )
            for a in range(c + _1, D):
                diagonal[kk + a * D + c] *= inverse
        start = pattern.first[k]
        for n in range(pattern.first[k + _1] - start):
            at, un = (start + n) * DD, n * DD
            for a in range(D):
                for c in range(D):
                    s = off[at + a * D + c]
                    for b in range(c):
                        s -= column[un + a * D + b] * diagonal[kk + c * D + b]
                    column[un + a * D + c] = s  # U = A_ik L_kk⁻ᵀ
                    off[at + a * D + c] = s * diagonal[kk + c * D + c]  # L_ik = U D⁻¹
            for m in range(n):
                to, um = pattern.target[u] * DD, m * DD
                u += _1
                for a in range(D):
                    for b in range(D):
                        s = 0.0
                        for c in range(D):
                            s += off[at + a * D + c] * column[um + b * D + c]
                        off[to + a * D + b] -= s  # A_ij -= L_ik U_jkᵀ
            to = pattern.row[start + n] * DD
            for a in range(D):
                for b in range(a + _1):
                    s = 0.0
                    for c in range(D):
                        s += off[at + a * D + c] * column[un + b * D + c]
                    diagonal[to + a * D + b] -= s
    return np.uint64(pattern.first.size) - _1


@_inlined
def solve(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, x: Floats) -> None:
    """x = A⁻¹ x."""
    D = np.uint64(len(unit))
    DD = D * D
    n = np.uint64(pattern.first.size) - _1
    for k in range(n):
        for a in range(_1, D):
            for c in range(a):
                x[k * D + a] -= diagonal[k * DD + a * D + c] * x[k * D + c]
        for at in range(pattern.first[k], pattern.first[k + _1]):
            i = pattern.row[at] * D
            for a in range(D):
                s = 0.0
                for c in range(D):
                    s += off[at * DD + a * D + c] * x[k * D + c]
                x[i + a] -= s
    for back in range(n):
        k = n - _1 - back
        for a in range(D):
            x[k * D + a] *= diagonal[k * DD + a * D + a]
        for at in range(pattern.first[k], pattern.first[k + _1]):
            i = pattern.row[at] * D
            for c in range(D):
                s = 0.0
                for a in range(D):
                    s += off[at * DD + a * D + c] * x[i + a]
                x[k * D + c] -= s
        for up in range(_1, D):
            c = D - _1 - up
            for a in range(c + _1, D):
                x[k * D + c] -= diagonal[k * DD + a * D + c] * x[k * D + a]


@_compiled
def linearise(unit: Unit, system: System, work: Work, q: Floats) -> bool:
    """Φ_q and the factor of A at q; returns whether A was positive definite."""
    jacobian(unit, system.rows, q, work.g, work.g2)
    copy(work.g, work.gf)
    copy(work.g2, work.g2f)
    assemble(unit, system, work)
    columns = factorise(unit, system.pattern, work.diagonal, work.off, work.column)
    return columns == np.uint64(system.pattern.first.size) - _1


# ----------------------------------------------------------------------------- the augmented solve


@_compiled
def augmented(
    unit: Unit,
    system: System,
    work: Work,
    f: Floats,
    x: Floats,
    y: Floats,
    r2: Floats,
    iterations: int,
    tolerance: float,
) -> tuple[int, float]:
    """Iterate to M x + Φ_qᵀ y = f, Φ_q x = -c with the one factor; returns how often, how slowly.

    On entry r2 = -c - Φ_q x and y is a first guess. (26), (33) in residual form:
    A δ = f - M x - Φ_qᵀ y + Φ_qᵀ α r2,  x += δ,  y += α (Φ_q δ - r2); so α costs no precision.
    Where α stands, Φ_q is that of the factor, and elsewhere that of the place: they may differ a
    little, and with the factor's in both they would converge to the wrong place, with the place's
    in both they would not converge. It ends when the next δ, foreseen from the ratio of the last
    two, would not matter beside x, or beside what f would do to the masses alone. A ratio that
    does is 1 / (1 + s²) of the mode of a singular position; the largest one is returned.
    """
    D = np.uint64(len(unit))
    rows, delta = system.rows, work.delta
    m1 = np.uint64(rows.i.size)
    n = np.uint64(system.mass.diagonal.size) * D
    before, slowest = 0.0, 0.0
    alone, heaviest = 0.0, 0.0
    for a in range(n):
        alone = max(alone, abs(f[a]))
        heaviest = max(heaviest, system.mass.diagonal[a // D])
    alone /= heaviest
    for count in range(1, iterations + 1):
        for a in range(n):
            delta[a] = f[a]
        add_mass_times(unit, system.mass, -1.0, x, delta)
        for r in range(m1):
            i, j = rows.i[r] * D, rows.j[r] * D
            s = rows.alpha[r] * r2[r]
            for a in range(D):
                v = s * work.gf[r * D + a] - y[r] * work.g[r * D + a]
                delta[i + a] += v
                if r < rows.both:
                    delta[j + a] -= v
        for r in range(np.uint64(rows.c.size)):
            s = rows.alpha[m1 + r] * r2[m1 + r]
            for e in range(rows.first[r], rows.movable[r]):
                for a in range(D):
                    delta[rows.block[e] * D + a] += (
                        s * work.g2f[e * D + a] - y[m1 + r] * work.g2[e * D + a]
                    )
        solve(unit, system.pattern, work.diagonal, work.off, delta)
        step, size = 0.0, alone
        for a in range(n):
            x[a] += delta[a]
            step = max(step, abs(delta[a]))
            size = max(size, abs(x[a]))
        for r in range(m1):
            i, j = rows.i[r] * D, rows.j[r] * D
            sf, s = 0.0, 0.0
            for a in range(D):
                v = delta[i + a]
                if r < rows.both:
                    v -= delta[j + a]
                sf += work.gf[r * D + a] * v
                s += work.g[r * D + a] * v
            y[r] += rows.alpha[r] * (sf - r2[r])
            r2[r] -= s
        for r in range(np.uint64(rows.c.size)):
            sf, s = 0.0, 0.0
            for e in range(rows.first[r], rows.movable[r]):
                for a in range(D):
                    v = delta[rows.block[e] * D + a]
                    sf += work.g2f[e * D + a] * v
                    s += work.g2[e * D + a] * v
            y[m1 + r] += rows.alpha[m1 + r] * (sf - r2[m1 + r])
            r2[m1 + r] -= s
        ratio = 1.0
        if count > 1:
            ratio = min(1.0, step / before)
            if step > 1e-6 * size:  # what is left of the other modes is less
                slowest = max(slowest, ratio)
        if step * ratio <= tolerance * size:
            return count, slowest
        before = step
    return iterations, slowest


@_inlined
def accelerate(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    tolerance: float,
) -> tuple[int, float]:
    """q̈ and λ at the stage in `work` from its factor, both from a cold start (24)-(27)."""
    rows = system.rows
    applied_forces(forces, t, work.q, work.qd, work.Q)
    jacobian_rate(unit, rows, work.qd, work.g2d)
    convective(unit, rows, work.g2d, work.qd, work.r2)
    for r in range(work.r2.size):
        work.r2[r] = -work.r2[r]
        work.lam[r] = 0.0
    zero(work.qdd)
    return augmented(
        unit, system, work, work.Q, work.qdd, work.lam, work.r2, iterations, tolerance
    )


@_inner_inlined
def velocities(
    unit: Unit, system: System, work: Work, iterations: int, tolerance: float
) -> tuple[int, float]:
    """q̇ and σ' from the momenta p' with the factor in `work` (33); q̇ there is a guess."""
    times_jacobian(unit, system.rows, work.g, work.g2, work.qd, work.r2)
    for r in range(work.r2.size):
        work.r2[r] = -work.r2[r]
        work.sigma[r] = 0.0
    return augmented(
        unit, system, work, work.p, work.qd, work.sigma, work.r2, iterations, tolerance
    )


# ---------------------------------------------------------------------------------- onto Φ = 0


@_inner_inlined
def opening(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> float:
    """Φ(q), and how far the widest row is open, m."""
    violation(unit, rows, q, phi)
    gap = 0.0
    for r in range(phi.size):
        gap = max(gap, abs(phi[r]) * rows.scale[r])
    return gap


@_inner_inlined
def correct(unit: Unit, system: System, work: Work, phi: Floats, q: Floats) -> None:
    """q -= A⁻¹ Φ_qᵀ α Φ with the Jacobian and the factor of one and the same place in `work`.

    Φ_q of another place would put α times the difference on the free directions.
    """
    delta = work.delta
    for r in range(phi.size):
        phi[r] *= -system.rows.alpha[r]
    zero(delta)
    add_transposed(unit, system.rows, work.gf, work.g2f, phi, delta)
    solve(unit, system.pattern, work.diagonal, work.off, delta)
    for a in range(np.uint64(system.mass.diagonal.size) * np.uint64(len(unit))):
        q[a] += delta[a]


@_inner_inlined
def project(unit: Unit, system: System, work: Work, size: float) -> int:
    """Bring q in `work` onto Φ = 0 along M, with Φ_q and factor of that place; returns the result.

    It begins with those of the last stage, which is near; where that converges slowly they are
    made anew. Very close to a singular position a row cannot tell how far off its point is, and
    what is left of the gap is let be.
    """
    before = np.inf
    fresh = False
    for _ in range(50):
        gap = opening(unit, system.rows, work.q, work.r2)
        closed = gap <= 4.0 * _EPS * size
        if closed or (fresh and gap > 0.5 * before and gap <= 1e-10 * size):
            return OK if linearise(unit, system, work, work.q) else NOT_CLOSED
        if gap > 0.1 * before:
            if not linearise(unit, system, work, work.q):
                return NOT_CLOSED
            fresh = True
        before = gap
        correct(unit, system, work, work.r2, work.q)
    return NOT_CLOSED


@_inner_inlined
def place(unit: Unit, system: System, work: Work, size: float, wholly: bool) -> int:
    """Put the stage `target` onto Φ = 0 by one correction, or `wholly`; Φ_q is that of the place.

    Off Φ = 0 by e and s from a singular position the free directions are turned by e / s: that,
    not α, is what breaks steps there. On it the equations go through the position smoothly. The
    correction is linearised at q, a guess that is nearer to Φ = 0 than the stage.
    """
    n = work.p.size
    if not linearise(unit, system, work, work.q):
        return NOT_POSITIVE
    violation(unit, system.rows, work.q, work.r2)
    zero(work.delta)
    for a in range(n):
        work.delta[a] = work.target[a] - work.q[a]
        work.q[a] = work.target[a]
    times_jacobian(unit, system.rows, work.g, work.g2, work.delta, work.rate)
    for r in range(work.r2.size):
        work.r2[r] += work.rate[r]
    correct(unit, system, work, work.r2, work.q)
    if wholly:
        before = np.inf
        for _ in range(3):
            gap = opening(unit, system.rows, work.q, work.r2)
            if gap <= 1e-13 * size or gap > 0.5 * before:
                break
            before = gap
            if not linearise(unit, system, work, work.q):
                return NOT_POSITIVE
            correct(unit, system, work, work.r2, work.q)
        if not linearise(unit, system, work, work.q):
            return NOT_POSITIVE
    else:
        jacobian(unit, system.rows, work.q, work.g, work.g2)
    return OK


# ---------------------------------------------------------------------------------- the step


@_inner_inlined
def momentum_rate(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    tolerance: float,
) -> tuple[int, float]:
    """ṗ' = M q̈ at the stage in `work`, into p; returns iterations and their slowest ratio.

    ṗ' = Q - Φ_qᵀ λ + Φ̇_qᵀ σ' (35) with λ fed forward, and Q - Φ_qᵀ λ = M q̈. What σ' is left is
    error of the integration over the distance to the singular position: the gauge is reset at
    every stage, and the last term is dropped.
    """
    count, slowest = accelerate(unit, system, forces, work, t, iterations, tolerance)
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.qdd, work.p)
    return count, slowest


@_inner_inlined
def stage(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    neighbour: bool,
    iterations: int,
    tolerance: float,
    size: float,
) -> tuple[int, bool]:
    """q̇ and ṗ' of a stage from q and p' in `work`; returns iterations (0: no factor), and whether
    it is clear of singular positions."""
    n = work.p.size
    if place(unit, system, work, size, neighbour) != OK:
        return 0, False
    count, slowest = velocities(unit, system, work, iterations, tolerance)
    if slowest > _SLOW and not neighbour:
        copy(work.q, work.target)
        if place(unit, system, work, size, True) != OK:
            return 0, False
        count, slowest = velocities(unit, system, work, iterations, tolerance)
    across, along = 0.0, 0.0
    for i in range(n):
        along = max(along, abs(work.p[i]))
    add_mass_times(unit, system.mass, -1.0, work.qd, work.p)
    for i in range(n):
        across = max(across, abs(work.p[i]))
    more, slower = momentum_rate(unit, system, forces, work, t, iterations, tolerance)
    clear = max(slowest, slower) <= _SLOW and across <= _TURN * along
    return max(count, more), clear


@_inner
def stage_between(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    qd: Floats,
    spacing: float,
    iterations: int,
    tolerance: float,
    size: float,
) -> int:
    """q̇ and ṗ' of a stage at a singular position, from three places on either side along q̇.

    The motion is smooth through the position, only its equations are not: what they give at
    ±1, ±2, ±3 times `spacing` (s) is interpolated, to sixth order. `base`, `momenta`: the stage.
    """
    n = work.p.size
    most = 0
    for _ in range(4):
        zero(work.sum_q)
        zero(work.sum_p)
        good = True
        for k in range(-3, 4):
            if k == 0:
                continue
            weight = 0.75 if abs(k) == 1 else (-0.3 if abs(k) == 2 else 0.05)
            for a in range(n):
                work.target[a] = work.base[a] + k * spacing * qd[a]
                work.q[a] = work.target[a] + 0.5 * (k * spacing) ** 2 * work.bend[a]
                work.p[a] = work.momenta[a]
            count, clear = stage(unit, system, forces, work, t, True, iterations, tolerance, size)
            if count == 0:
                return 0
            most = max(most, count)
            good = good and clear
            for a in range(n):
                work.sum_q[a] += weight * work.qd[a]
                work.sum_p[a] += weight * work.p[a]
        if good:
            break
        spacing *= 3.0
    for a in range(n):
        work.qd[a] = work.sum_q[a]
        work.p[a] = work.sum_p[a]
    return most


@njit(inline='always', error_model='numpy')  # one compilation less for those who step
def step(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    a: Floats,
    b: Floats,
    c: Floats,
    q: Floats,
    qd: Floats,
    t: float,
    h: float,
    iterations: int,
    tolerance: float,
    size: float,
) -> tuple[int, int]:
    """One explicit Runge-Kutta step (a, b, c) from q, q̇, whose Φ_q and factor stand in `work`.

    Leaves the new q, q̇ in `work`, with Φ_q and factor. Returns (result, most iterations).
    """
    n = work.p.size
    stages = np.uint64(b.size)
    kq, kp = work.kq, work.kp
    copy(qd, work.qd)
    jacobian_rate(unit, system.rows, work.qd, work.g2d)
    convective(unit, system.rows, work.g2d, work.qd, work.r2)
    for r in range(work.r2.size):
        work.r2[r] = -work.r2[r]
        work.lam[r] = 0.0
    zero(work.bend)
    zero(work.p)
    most, _ratio = augmented(
        unit, system, work, work.p, work.bend, work.lam, work.r2, iterations, 1e-3
    )
    fastest, hardest = 0.0, 0.0
    for s in range(stages + _1):
        for i in range(n):
            work.q[i] = 0.0
            work.p[i] = 0.0
        for m in range(s):
            weight = a[s, m] if s < stages else b[m]
            if weight != 0.0:
                for i in range(n):
                    work.q[i] += weight * kq[m * n + i]
                    work.p[i] += weight * kp[m * n + i]
        for i in range(n):
            work.q[i] = q[i] + h * work.q[i]
            work.p[i] *= h
        add_mass_times(unit, system.mass, 1.0, qd, work.p)
        copy(work.p, work.momenta)
        if s == stages:
            break
        copy(work.q, work.base)
        copy(work.q, work.target)
        lag = 0.5 * c[s] * c[s]  # of the stage behind the path, in h² of its curvature
        for m in range(s):
            lag -= a[s, m] * c[m]
        for i in range(n):
            work.q[i] += h * h * lag * work.bend[i]
        ts = t + c[s] * h
        if s == 0:
            count, slowest = momentum_rate(unit, system, forces, work, ts, iterations, tolerance)
            clear = slowest <= _SLOW
            for i in range(n):
                fastest = max(fastest, abs(qd[i]))
                hardest = max(hardest, abs(work.qdd[i]))
        else:
            count, clear = stage(
                unit, system, forces, work, ts, False, iterations, tolerance, size
            )
        if not clear and count > 0 and fastest > 0.0 and hardest > 0.0:
            moved = 0.0
            for i in range(n):
                moved = max(moved, abs(work.q[i] - work.base[i]))
            spacing = max(20.0 * moved / fastest, 3e-3 * fastest / hardest)
            count = stage_between(
                unit, system, forces, work, ts, qd, spacing, iterations, tolerance, size
            )
            if s == 0:
                copy(qd, work.qd)
        if count == 0:
            return NOT_CLOSED, most
        most = max(most, count)
        for i in range(n):
            kq[s * n + i] = work.qd[i]
            kp[s * n + i] = work.p[i]
    result = project(unit, system, work, size)
    if result == OK:
        copy(work.momenta, work.p)
        count, _slowest = velocities(unit, system, work, iterations, tolerance)
        most = max(most, count)
        check = 0.0
        for i in range(n):
            check += work.q[i] + work.qd[i]
        if not np.isfinite(check):
            result = NOT_FINITE
    return result, most


@_inner_inlined
def count_turns(axes: Indices, q: Floats, qn: Floats, turns: Integers) -> None:
    """Count the passages of each body's x axis over the negative x axis of the plane."""
    for n in range(np.uint64(turns.size)):
        i, j = np.uint64(axes[n, 0]) * np.uint64(2), np.uint64(axes[n, 1]) * np.uint64(2)
        y0, y1 = q[j + _1] - q[i + _1], qn[j + _1] - qn[i + _1]
        if (y0 < 0.0) != (y1 < 0.0):
            x0, x1 = q[j] - q[i], qn[j] - qn[i]
            if x0 * y1 - x1 * y0 > 0.0:  # counter-clockwise
                turns[n] += 1 if y1 < 0.0 else 0
            else:
                turns[n] -= 1 if y0 < 0.0 else 0


@_compiled
def advance(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    a: Floats,
    b: Floats,
    c: Floats,
    axes: Indices,
    q: Floats,
    qd: Floats,
    turns: Integers,
    t0: float,
    first: int,
    steps: int,
    h: float,
    iterations: int,
    tolerance: float,
    size: float,
) -> tuple[int, int, int]:
    """Take `steps` steps of h from step number `first`; returns (result, taken, most iterations).

    q, q̇ (all blocks D) and turns are the state, in and out; on failure they hold the last good
    step.
    """
    system, forces, work = on_loan(system), on_loan(forces), on_loan(work)
    most = 0
    copy(q, work.q)
    if not linearise(unit, system, work, work.q):
        return NOT_POSITIVE, 0, most
    for taken in range(steps):
        t = t0 + (first + taken) * h
        result, count = step(
            unit, system, forces, work, a, b, c, q, qd, t, h, iterations, tolerance, size
        )
        most = max(most, count)
        if result != OK:
            return result, taken, most
        count_turns(axes, q, work.q, turns)
        copy(work.q, q)
        copy(work.qd, qd)
    return OK, steps, most


@_inner_inlined
def error_norm(
    unit: Unit,
    system: System,
    work: Work,
    weights: Floats,
    qd: Floats,
    h: float,
    size: float,
) -> float:
    """An embedded error of q and p', relative to the motion; weights of the stages and the end.

    Only its part along the free directions counts, by the factor of the end of the step: what is
    across is removed by the projection, and is where a singular position is felt first.
    """
    n = work.p.size
    largest = 0.0
    for which in range(2):
        k = work.kq if which == 0 else work.kp
        for i in range(n):
            work.sum_q[i] = 0.0
        for s in range(np.uint64(weights.size)):
            if weights[s] != 0.0:
                for i in range(n):
                    work.sum_q[i] += h * weights[s] * k[s * n + i]
        if which == 0:
            for i in range(n):
                work.momenta[i] = 0.0
            add_mass_times(unit, system.mass, 1.0, work.sum_q, work.momenta)
            scale = size
        else:
            scale = 0.0
            for i in range(n):
                work.momenta[i] = work.sum_q[i]
                scale = max(scale, max(abs(qd[i]), abs(work.qd[i]), h * abs(work.qdd[i])))
        for r in range(work.r2.size):
            work.r2[r] = 0.0
            work.lam[r] = 0.0
        zero(work.bend)
        augmented(unit, system, work, work.momenta, work.bend, work.lam, work.r2, 3, 1e-3)
        for i in range(n):
            if abs(work.bend[i]) > largest * scale:
                largest = abs(work.bend[i]) / scale
    return largest


@_compiled
def advance_adaptively(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    a: Floats,
    b: Floats,
    c: Floats,
    embedded: Floats,
    axes: Indices,
    q: Floats,
    qd: Floats,
    turns: Integers,
    pace: Floats,
    t0: float,
    first: int,
    steps: int,
    h: float,
    wanted: float,
    iterations: int,
    tolerance: float,
    size: float,
) -> tuple[int, int, int]:
    """Like `advance`, each h in as many steps as an error of `wanted` (relative, a step) takes.

    `embedded` (2, stages + 1): weights of the two embedded errors, of order 5 and 3 for DOP853.
    `pace` (1,): the step it would like to take next, s; part of the state.
    """
    system, forces, work = on_loan(system), on_loan(forces), on_loan(work)
    n = work.p.size
    stages = np.uint64(b.size)
    good_q, good_qd, good_turns, good_pace = q.copy(), qd.copy(), turns.copy(), pace[0]
    most = 0
    copy(q, work.q)
    if not linearise(unit, system, work, work.q):
        return NOT_POSITIVE, 0, most
    for taken in range(steps):
        t = t0 + (first + taken) * h
        done = 0.0
        result = OK
        while done < h:
            left = h - done
            last = pace[0] > 0.999999 * left
            dt = pace[0]
            if last:
                dt = left
            elif dt > 0.5 * left:  # no crumb before the grid point
                dt = 0.5 * left
            result, count = step(
                unit,
                system,
                forces,
                work,
                a,
                b,
                c,
                q,
                qd,
                t + done,
                dt,
                iterations,
                tolerance,
                size,
            )
            most = max(most, count)
            error = np.inf
            if result == OK:
                momentum_rate(unit, system, forces, work, t + done + dt, iterations, tolerance)
                for i in range(n):
                    work.kq[stages * n + i] = work.qd[i]
                    work.kp[stages * n + i] = work.p[i]
                e5 = error_norm(unit, system, work, embedded[0], qd, dt, size) / (_SHARE * wanted)
                e3 = error_norm(unit, system, work, embedded[1], qd, dt, size) / (_SHARE * wanted)
                error = e5 * e5 / np.sqrt(e5 * e5 + 0.01 * e3 * e3) if e5 > 0.0 else 0.0
            factor = 0.5
            if np.isfinite(error):
                factor = min(5.0, max(0.2, 0.9 * error ** (-1.0 / 8.0))) if error > 0.0 else 5.0
            if error <= 1.0:
                count_turns(axes, q, work.q, turns)
                copy(work.q, q)
                copy(work.qd, qd)
                done = h if last else done + dt
                pace[0] = max(pace[0], factor * dt) if dt < pace[0] else factor * dt
            else:
                pace[0] = factor * dt
                if pace[0] < 1e-9 * h:
                    result = result if result != OK else COLLAPSED
                    break
                copy(q, work.q)
                linearise(unit, system, work, work.q)
        if done < h:
            copy(good_q, q)
            copy(good_qd, qd)
            copy(good_turns, turns)
            pace[0] = good_pace
            return result, taken, most
        copy(q, good_q)
        copy(qd, good_qd)
        copy(turns, good_turns)
        good_pace = pace[0]
    return OK, steps, most
