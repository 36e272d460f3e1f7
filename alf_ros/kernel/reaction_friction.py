"""Friction under the reactions that it changes itself.

The effort of a joint that rubs depends on its reaction R, which comes out of the solve that needs
the effort. A balance is a set of loads N with N = |R(N)|; R is linear in N.

Where friction changes reactions little there is one balance. A few passes of the fixed point with
Anderson's mixing find it; each pass is a solve that goes on from the last one. Where friction
changes reactions much, which it does as 1/c at the distance c from a singular position, there may
be several balances or none (Painlevé's paradox). There R(N) is found whole, by one solve for each
load, and then Newton's method finds a root of N - |R(N)| without further solves. It begins with
the directions that R had: they tell apart balances that are close together.

The sense of a balance is the sign of det(1 - d|R|/dN). Without friction it is +. A balance that
changes continuously with the motion keeps c times that determinant off zero: where the product
vanishes, the balance meets another one and both end. So its sense stays, except that it changes
where c changes sign, if friction feels that singular position. A stage that finds no balance of
this sense lies beyond the end of the balance, also where a coarse step has leapt over the end.

The function is reached through its address, so a scene without such friction does not compile it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import add_friction, applied_forces
from alf_ros.kernel.augmented_solve import solved
from alf_ros.kernel.constraints import add_transposed, jacobian, times_jacobian
from alf_ros.kernel.data import Bearings, Forces, System, Work
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import block, dot, packed, put
from alf_ros.kernel.numba_ext.jit import ONE, by_address, inner
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero

MEMORY = 5  # passes that are mixed, at most
_PASSES = 30
_CALM = 0.5  # ratio of the gaps of two passes up to which gains are small
_AGREED = 1e-12  # part of the largest load to which both sides agree
_ROUNDED = 1e-10  # the same, where passes do not let them come closer
_ENOUGH = 1e-8  # and where Newton's method does not
_ASIDE = 1e-6  # part of the loads by which a step begins beside them
_NEWTON = 60  # its iterations
_SHORTEST = 1e-4  # part of a step of Newton's method; and of friction, while it is put on
_SOFTER = 2  # rounds of inverse iteration for the softest combination of rows
_NEAR = 0.3  # of its opening where the step begins: below it may have passed zero
_CLOSE = 0.2  # part of the loads by which a balance may be off without others being looked for
_LINE = 10  # powers of two
_COUPLED = 1e-9  # gain by a combination of rows that friction feels


@inner
def _reactions(
    unit: Unit, forces: Forces, work: Work, t: float, qdd: Floats, loads: Floats, whole: bool
) -> None:
    """R of each loaded joint (N) from q̈ and the λ in `work`, under these loads; `whole`: with what
    does not depend on loads."""
    cut = forces.bearings
    for b in range(cut.source.size):
        put(cut.qdd, b, block(unit, qdd, cut.source[b]))
    for r in range(cut.source_row.size):
        cut.y[r] = work.y[cut.source_row[r]]
    zero(cut.needed)
    add_friction(cut.effects, t, cut.q, cut.qd, work.near, loads, cut.needed)
    for i in range(cut.needed.size):
        cut.needed[i] = -cut.needed[i]
        if whole:
            cut.needed[i] -= cut.Q[i]
    add_mass_times(unit, cut.mass, 1.0, cut.qdd, cut.needed)
    add_transposed(unit, cut.rows, cut.g, cut.g2, cut.y, cut.needed)
    for n in range(cut.answer.size):
        R = packed(unit, 0.0, 0.0, 0.0)
        for m in range(cut.first[n], cut.first[n + ONE]):
            R = R + cut.sign[m] * block(unit, cut.needed, cut.block[m])
        for m in range(cut.first_entry[n], cut.first_entry[n + ONE]):
            R = R - work.y[cut.entry_row[m]] * block(unit, cut.g2, cut.entry[m])
        put(cut.reaction, n, R)
        cut.answer[n] = np.sqrt(dot(R, R))


@inner
def _place(unit: Unit, forces: Forces, work: Work, t: float) -> None:
    """The cut mechanism where the assembled one is."""
    cut = forces.bearings
    for b in range(cut.source.size):
        put(cut.q, b, block(unit, work.q, cut.source[b]))
        put(cut.qd, b, block(unit, work.qd, cut.source[b]))
    jacobian(unit, cut.rows, cut.q, cut.g, cut.g2)
    applied_forces(cut.effects, t, cut.q, cut.qd, work.near, cut.Q)


@inner
def _mixed(cut: Bearings, count: int) -> None:
    """The next trial loads, by Anderson's mixing of what `count` passes have told."""
    loads, room = np.int64(cut.trial.size), np.int64(cut.mix.size)
    memory = count - 1 if count - 1 < room else room
    for i in range(memory):  # normal equations: few unknowns, and a rough answer will do
        for j in range(i + 1):
            total = 0.0
            for n in range(loads):
                total += cut.past_gap[i * loads + n] * cut.past_gap[j * loads + n]
            cut.gram[i * room + j] = total
        total = 0.0
        for n in range(loads):
            total += cut.past_gap[i * loads + n] * (cut.answer[n] - cut.trial[n])
        cut.mix[i] = total
    for i in range(memory):  # Cholesky; what says nothing new is left out
        for j in range(i + 1):
            total = cut.gram[i * room + j]
            for m in range(j):
                total -= cut.gram[i * room + m] * cut.gram[j * room + m]
            if i > j:
                pivot = cut.gram[j * room + j]
                cut.gram[i * room + j] = total / pivot if pivot > 0.0 else 0.0
            else:
                whole = cut.gram[i * room + i]
                good = total > 1e-14 * whole
                cut.gram[i * room + i] = np.sqrt(total) if good else 0.0
        pivot = cut.gram[i * room + i]
        total = cut.mix[i]
        for m in range(i):
            total -= cut.gram[i * room + m] * cut.mix[m]
        cut.mix[i] = total / pivot if pivot > 0.0 else 0.0
    for back in range(memory):
        i = memory - 1 - back
        total = cut.mix[i]
        for m in range(i + 1, memory):
            total -= cut.gram[m * room + i] * cut.mix[m]
        pivot = cut.gram[i * room + i]
        cut.mix[i] = total / pivot if pivot > 0.0 else 0.0
    for n in range(loads):
        value = cut.answer[n]
        for i in range(memory):
            past = cut.past_trial[i * loads + n] + cut.past_gap[i * loads + n]
            value -= cut.mix[i] * past
        cut.next[n] = max(value, 0.0)


@inner
def _gap(unit: Unit, cut: Bearings, share: float, at: Floats) -> tuple[float, float]:
    """The largest of | |R| - N | at the loads `at`, with a share of friction, and of N."""
    loads, gap, size = np.int64(at.size), 0.0, 0.0
    for n in range(loads):
        R = block(unit, cut.reaction, n)
        for m in range(loads):
            R = R + (share * at[m]) * block(unit, cut.response, m * loads + n)
        gap, size = max(gap, abs(np.sqrt(dot(R, R)) - at[n])), max(size, abs(at[n]))
    return gap, size


@inner
def _newton(unit: Unit, cut: Bearings, share: float, given: bool) -> int:
    """change = the step of Newton's method at `point`; returns the sign of its determinant.

    `given`: as if R had the direction of `heading`. Where gains are large, a small error of a load
    turns R round, and Newton's method would go to another balance.
    """
    loads, slope, change, sign = np.int64(cut.point.size), cut.slope, cut.change, 1
    for n in range(loads):
        R = block(unit, cut.reaction, n)
        for m in range(loads):
            R = R + (share * cut.point[m]) * block(unit, cut.response, m * loads + n)
        along = block(unit, cut.heading, n) if given else R
        N = np.sqrt(dot(along, along))
        along = (1.0 / N if N > 0.0 else 0.0) * along
        change[n] = dot(along, R) - cut.point[n]
        for m in range(loads):
            each = share * dot(along, block(unit, cut.response, m * loads + n))
            slope[n * loads + m] = (1.0 if n == m else 0.0) - each
    for k in range(loads):  # elimination with row pivots
        most = k
        for n in range(k + 1, loads):
            if abs(slope[n * loads + k]) > abs(slope[most * loads + k]):
                most = n
        pivot = slope[most * loads + k]
        if not abs(pivot) > 0.0:
            return 0
        if most != k:
            sign = -sign
            for m in range(loads):
                i, j = k * loads + m, most * loads + m
                slope[i], slope[j] = slope[j], slope[i]
            change[k], change[most] = change[most], change[k]
        sign = sign if pivot > 0.0 else -sign
        for n in range(k + 1, loads):
            part = slope[n * loads + k] / pivot
            for m in range(k + 1, loads):
                slope[n * loads + m] -= part * slope[k * loads + m]
            change[n] -= part * change[k]
    for back in range(loads):
        n = loads - 1 - back
        for m in range(n + 1, loads):
            change[n] -= slope[n * loads + m] * change[m]
        change[n] /= slope[n * loads + n]
    return sign


@inner
def _balance(unit: Unit, cut: Bearings, share: float) -> int:
    """Newton's method for N = |R(N)| from `point`, with a share of friction. Returns the sense of
    the balance it ends at, 0 for none."""
    gap, size = _gap(unit, cut, share, cut.point)
    for _ in range(_NEWTON):
        sign = _newton(unit, cut, share, False)
        if sign == 0 or gap <= 1e-14 * size:
            return sign
        part, before, better = 1.0, gap, False
        while part > _SHORTEST and not better:
            for n in range(cut.point.size):
                cut.next[n] = cut.point[n] + part * cut.change[n]
            gap, size = _gap(unit, cut, share, cut.next)
            better = gap < (1.0 - 0.1 * part) * before
            part *= 0.5
        if not better:
            return sign if before <= _ROUNDED * size else 0
        copy(cut.next, cut.point)
    return 0


@inner
def _put_on(unit: Unit, cut: Bearings) -> int:
    """The balance to which the one without friction leads while friction grows, into `point`.

    Returns its sense, 0 if it ends before friction is whole.
    """
    for n in range(cut.point.size):
        cut.point[n] = 0.0
    share, more = 0.0, 1.0
    while share < 1.0:
        copy(cut.point, cut.best)
        further = min(1.0, share + more)
        if _balance(unit, cut, further) > 0:
            share, more = further, 2.0 * more
        else:
            more *= 0.5
            if more < _SHORTEST:
                return 0
            copy(cut.best, cut.point)
    return 1


@inner
def _try(unit: Unit, cut: Bearings, wanted: int, nearest: float) -> tuple[float, int]:
    """Newton's method from the directions in `heading`. The balance it finds goes into `best` if
    it has the sense `wanted` (0: any) and its R is nearer to the last one than `nearest` (N).

    Returns how near the best is, and the sense of a new one, else 0.
    """
    loads = np.int64(cut.point.size)
    copy(cut.loads, cut.point)
    if _newton(unit, cut, 1.0, True) != 0:
        for n in range(loads):
            cut.point[n] += cut.change[n]
    sense = _balance(unit, cut, 1.0)
    if sense == 0 or (wanted != 0 and sense != wanted):
        return nearest, 0
    away = 0.0
    for n in range(loads):
        R = block(unit, cut.reaction, n) - block(unit, cut.force, n)
        for m in range(loads):
            R = R + cut.point[m] * block(unit, cut.response, m * loads + n)
        away = max(away, np.sqrt(dot(R, R)))
    if not away < nearest:
        return nearest, 0
    copy(cut.point, cut.best)
    return away, sense


@inner
def _nearest(unit: Unit, cut: Bearings, wanted: int) -> int:
    """The balance of the sense `wanted` (0: any) nearest to the last one, into `best`.

    Returns its sense, 0 if none is found. If the first one is not near, Newton's method begins
    elsewhere too, along the line on which R moves under the load that moves it most.
    """
    loads = np.int64(cut.point.size)
    copy(cut.force, cut.heading)
    near, found = _try(unit, cut, wanted, np.inf)
    if found != 0 and near <= _CLOSE * largest(cut.loads, cut.loads.size):
        return found
    strongest, most = 0, 0.0
    size = max(largest(cut.loads, cut.loads.size), largest(cut.reaction, cut.reaction.size))
    for m in range(loads):
        total = 0.0
        for n in range(loads):
            R = block(unit, cut.response, m * loads + n)
            total += np.sqrt(dot(R, R))
        if total > most:
            strongest, most = m, total
    if not most > 0.0:
        return found
    for k in range(-_LINE, _LINE + 1):
        for way in range(2):
            along = (size / most) * 2.0**k * (1.0 if way == 0 else -1.0)
            for n in range(loads):
                R = block(unit, cut.force, n)
                put(cut.heading, n, R + along * block(unit, cut.response, strongest * loads + n))
            near, other = _try(unit, cut, wanted, near)
            if other != 0:
                found = other
    return found


@inner
def _rubs(cut: Bearings, m: int) -> bool:
    """Whether load m is a reaction."""
    shared = cut.first[m + ONE] > cut.first[m]
    return bool(shared or cut.first_entry[m + ONE] > cut.first_entry[m])


@inner
def _unit_friction(forces: Forces, work: Work, t: float, m: int) -> bool:
    """Q = the friction under a load m of 1 N, which goes into `next`; whether there is any."""
    cut = forces.bearings
    zero(cut.next)
    zero(work.Q)
    if _rubs(cut, m):
        cut.next[m] = 1.0
        add_friction(forces.effects, t, work.q, work.qd, work.near, cut.next, work.Q)
    return largest(work.Q, work.p.size) > 0.0


@inner
def _respond(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    exactly: bool,
) -> bool:
    """R(N): `response` to each load, and `reaction` without friction.

    A solve under the trial loads stands in `work`. Returns False where a solve is slow and not
    `exactly` wanted, as `solved` says.
    """
    cut, fine = forces.bearings, True
    loads = np.int64(cut.trial.size)
    copy(work.y, cut.kept_y)
    copy(work.r2, cut.kept_r2)
    zero(cut.response)
    for m in range(loads):
        if fine and _unit_friction(forces, work, t, m):
            zero(cut.qdd_of)
            zero(work.y)
            zero(work.r2)
            _, sigma = solved(unit, system, work, work.Q, cut.qdd_of, iterations, exactly, False)
            fine = sigma > 0.0 or exactly
            _reactions(unit, forces, work, t, cut.qdd_of, cut.next, False)
            for n in range(loads):
                put(cut.response, m * loads + n, block(unit, cut.reaction, n))
    copy(cut.kept_y, work.y)
    copy(cut.kept_r2, work.r2)
    _reactions(unit, forces, work, t, work.qdd, cut.trial, True)
    _without(unit, cut)
    return fine


@inner
def _without(unit: Unit, cut: Bearings) -> None:
    """`reaction` of the trial, less what friction does to it."""
    loads = np.int64(cut.trial.size)
    for n in range(loads):
        R = block(unit, cut.reaction, n)
        for m in range(loads):
            R = R - cut.trial[m] * block(unit, cut.response, m * loads + n)
        put(cut.reaction, n, R)


@inner
def _open(
    unit: Unit, system: System, work: Work, cut: Bearings, iterations: int, exactly: bool
) -> bool:
    """The least velocity that opens the rows by r2, in `qdd_of`, and its multipliers in `work.y`.

    Returns False as `_respond` does.
    """
    zero(work.Q)
    zero(cut.qdd_of)
    zero(work.y)
    _, sigma = solved(unit, system, work, work.Q, cut.qdd_of, iterations, exactly, False)
    return sigma > 0.0 or exactly


@inner
def _soften(
    unit: Unit, system: System, work: Work, cut: Bearings, iterations: int, exactly: bool
) -> None:
    """The combination of rows nearest to losing its direction, where a step begins.

    By inverse iteration, from a velocity that has a part in every mode.
    """
    rows, m = system.rows, system.rows.alpha.size
    cut.branch[0] = 0.0
    if m == 0:
        return
    copy(work.y, cut.kept_y)
    copy(work.r2, cut.kept_r2)
    zero(cut.across)
    for i in range(work.p.size):
        cut.across[i] = 0.3 + (i * 7919 % 1009) / 1009.0
    times_jacobian(unit, rows, work.g, work.g2, cut.across, work.r2)
    for _ in range(_SOFTER):
        size = largest(work.r2, m)
        for r in range(m):
            work.r2[r] /= size
            cut.softest[r] = rows.alpha[r] * work.r2[r]
        opened = 0.0
        for r in range(m):
            opened += cut.softest[r] * work.r2[r]
        _open(unit, system, work, cut, iterations, exactly)
        copy(cut.qdd_of, cut.across)
        cut.branch[0] = opened
        for r in range(m):
            work.r2[r] = -work.y[r] / rows.alpha[r]
    if not np.isfinite(largest(cut.across, work.p.size) * cut.branch[0]):
        cut.branch[0] = 0.0
    copy(cut.kept_y, work.y)
    copy(cut.kept_r2, work.r2)


@inner
def _beyond(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    exactly: bool,
) -> int:
    """Whether a singular position that friction feels lies between here and where the step began:
    -1 if so, else 1; 0 where `_respond` returns False.

    The combination of rows nearest to losing its direction is opened by a velocity. Beyond the
    position the same opening takes the opposite velocity.
    """
    cut, rows = forces.bearings, system.rows
    if not cut.branch[0] > 0.0:
        return 1
    times_jacobian(unit, rows, work.g, work.g2, cut.across, work.w)
    opened = 0.0
    for r in range(rows.alpha.size):
        opened += cut.softest[r] * work.w[r]
    if opened > _NEAR * cut.branch[0]:
        return 1
    copy(work.y, cut.kept_y)
    copy(work.r2, cut.kept_r2)
    for r in range(rows.alpha.size):
        work.r2[r] = cut.softest[r] / rows.alpha[r]
    side = 1 if _open(unit, system, work, cut, iterations, exactly) else 0
    zero(work.delta)
    add_mass_times(unit, system.mass, 1.0, cut.qdd_of, work.delta)
    same, norm, felt, power = 0.0, 0.0, 0.0, 0.0
    for i in range(work.p.size):
        same += work.delta[i] * cut.across[i]
        norm += work.delta[i] * cut.qdd_of[i]
    if side == 1 and same < 0.0:
        zero(cut.next)
        zero(work.Q)
        _reactions(unit, forces, work, t, work.Q, cut.next, False)
        felt = largest(cut.answer, cut.answer.size)
        for m in range(cut.trial.size):
            if _unit_friction(forces, work, t, m):
                total = 0.0
                for i in range(work.p.size):
                    total += work.Q[i] * cut.qdd_of[i]
                power = max(power, abs(total))
        if felt * power > _COUPLED * norm:
            side = -1
    copy(cut.kept_y, work.y)
    copy(cut.kept_r2, work.r2)
    return side


@inner
def _remember(cut: Bearings, count: int) -> None:
    """Pass number `count`, for those that follow, and the next trial loads."""
    loads, room = np.int64(cut.trial.size), np.int64(cut.mix.size)
    if count > 1:  # differences to the last pass, in the place of the oldest
        at = ((count - 2) % room) * loads
        for n in range(loads):
            cut.past_trial[at + n] += cut.trial[n]
            cut.past_gap[at + n] += cut.answer[n] - cut.trial[n]
    _mixed(cut, count)
    at = ((count - 1) % room) * loads
    for n in range(loads):
        cut.past_trial[at + n] = -cut.trial[n]
        cut.past_gap[at + n] = -(cut.answer[n] - cut.trial[n])
    copy(cut.next, cut.trial)


@inner
def _settled(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    exactly: bool,
) -> tuple[int, float]:
    """Solve for q̈, λ and the loads; Q of what does not depend on them stands in `work`.

    Returns what `solved` does; -1 iterations if the loads were not found.
    """
    cut = forces.bearings
    copy(work.Q, cut.given)
    _place(unit, forces, work, t)
    begins, cut.begins[0] = cut.begins[0] == 1, 0
    if begins:
        for n in range(cut.loads.size):
            R = block(unit, cut.force, n)
            cut.loads[n] = np.sqrt(dot(R, R))
    known = largest(cut.loads, cut.loads.size) > 0.0
    wanted, mixed, most, before = 0, True, 0, np.inf
    if begins:
        cut.branch[1] = 1.0
        _soften(unit, system, work, cut, iterations, exactly)
    else:
        side = _beyond(unit, system, forces, work, t, iterations, exactly)
        if side == 0:
            return 1, 0.0
        wanted = side if cut.branch[1] > 0.0 else -side
        mixed = wanted > 0 and side > 0
    for n in range(cut.loads.size):
        # what begins at a balance tells nothing of its gains, and so of its sense
        aside = _ASIDE * (1.0 + n % 3) if begins else 0.0
        cut.trial[n] = (1.0 + aside) * cut.loads[n]
    calm = True
    for count in range(1, _PASSES + 1):
        copy(cut.given, work.Q)
        add_friction(forces.effects, t, work.q, work.qd, work.near, cut.trial, work.Q)
        iterated, sigma = solved(unit, system, work, work.Q, work.qdd, iterations, exactly, False)
        most = max(most, iterated)
        if sigma == 0.0 and not exactly:
            return most, sigma
        _reactions(unit, forces, work, t, work.qdd, cut.trial, True)
        gap, size = 0.0, 0.0
        for n in range(cut.trial.size):
            gap = max(gap, abs(cut.answer[n] - cut.trial[n]))
            size = max(size, cut.answer[n])
        if not np.isfinite(gap):
            break
        calm = calm and gap <= _CALM * before
        if (mixed or count > 1) and (
            gap <= _AGREED * size or (not calm and gap <= (_ROUNDED if mixed else _ENOUGH) * size)
        ):
            copy(cut.trial, cut.loads)
            copy(cut.reaction, cut.force)
            cut.passes[0] = count
            return most, sigma
        before = gap
        if mixed and calm:
            _remember(cut, count)
            continue
        if mixed or count == 1:
            if not _respond(unit, system, forces, work, t, iterations, exactly):
                return most, 0.0
            mixed, calm, before = False, True, np.inf
            found = _nearest(unit, cut, wanted) if known else _put_on(unit, cut)
            if not known:
                copy(cut.point, cut.best)
                if found == 0:
                    found = _nearest(unit, cut, 1)
            if begins:
                cut.branch[1] = found
            if found == 0:
                break
            copy(cut.best, cut.trial)
        else:
            _without(unit, cut)
            copy(cut.trial, cut.point)
            if _balance(unit, cut, 1.0) == 0:
                break
            copy(cut.point, cut.trial)
    cut.ended[0] = t
    return -1, 0.0


def _in_plane(
    system: System, forces: Forces, work: Work, t: float, iterations: int, exactly: bool
) -> float:
    count, sigma = _settled((0.0, 0.0), system, forces, work, t, iterations, exactly)
    forces.bearings.passes[1] = count
    return sigma


def _in_space(
    system: System, forces: Forces, work: Work, t: float, iterations: int, exactly: bool
) -> float:
    count, sigma = _settled((0.0, 0.0, 0.0), system, forces, work, t, iterations, exactly)
    forces.bearings.passes[1] = count
    return sigma


@cache
def settle(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Bearings` holds."""
    structs = [each._numba_type() for each in (System, Forces, Work)]
    signature = types.float64(*structs, types.float64, types.int64, types.int64)
    return by_address(signature)(_in_plane if dimension == 2 else _in_space)
