"""The solve for q̈, λ and the loads of friction, called through a function pointer."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from alf_ros.kernel.applied_forces import add_friction
from alf_ros.kernel.augmented_solve import has_dependent, solved_anew
from alf_ros.kernel.data import Problem
from alf_ros.kernel.numba_ext.block import block, dot
from alf_ros.kernel.numba_ext.jit import by_address, inner
from alf_ros.kernel.numba_ext.vectors import copy, largest
from alf_ros.kernel.reaction_friction.anderson_mixing import mix
from alf_ros.kernel.reaction_friction.cut_reactions import place_cut, reactions
from alf_ros.kernel.reaction_friction.least_share import take_least_share
from alf_ros.kernel.reaction_friction.load_newton import balance, continuation, nearest_balance
from alf_ros.kernel.reaction_friction.load_response import respond, subtract_friction
from alf_ros.kernel.reaction_friction.singular_side import find_softest, side

_PASSES = 30
_CALM = 0.5  # ratio of the gaps of two passes up to which gains are small
_AGREED = 1e-12  # part of the largest load to which both sides agree; of forces, a load is zero
_ROUNDED = 1e-10  # the same, where passes do not come closer
_ENOUGH = 1e-8  # the same, where Newton's method does not come closer
_OFFSET = 1e-6  # part of the loads, by which the first trial of a step differs from them


@inner
def _solve(problem: Problem, t: float, exactly: bool) -> tuple[int, float]:
    """Solve for q̈, λ and the loads; Q of what does not depend on them stands in `work`.

    Returns what `solved` does; -1 iterations if the loads were not found.
    """
    unit, system, work = problem.unit, problem.system, problem.work
    cut = problem.forces.bearings
    copy(work.Q, cut.given)
    place_cut(problem, t)
    begins, cut.begins[0] = cut.begins[0] == 1, 0
    sense = np.int64(cut.force.size) - 1  # its place
    if begins:
        for n in range(cut.loads.size):
            R = block(unit, cut.force, n)
            cut.loads[n] = np.sqrt(dot(R, R))
    known = largest(cut.loads, cut.loads.size) > 0.0
    wanted, mixed, most, before = 0, True, 0, np.inf
    if begins:
        cut.branch[1] = 1.0
        find_softest(problem, exactly)
        # passes take a balance of the other sense for one of small gains where both meet
        mixed = cut.force[sense] >= 0.0
    else:
        here = side(problem, t, exactly)
        if here == 0:
            return 1, 0.0
        wanted = here if cut.branch[1] > 0.0 else -here
        mixed = wanted > 0 and here > 0
    for n in range(cut.loads.size):
        # from a balance itself the first pass would not show its gains, and so not its sense
        offset = _OFFSET * (1.0 + n % 3) if begins else 0.0
        cut.trial[n] = (1.0 + offset) * cut.loads[n]
    calm = True
    for count in range(1, _PASSES + 1):
        copy(cut.given, work.Q)
        add_friction(problem.forces.effects, t, work.q, work.qd, work.near, cut.trial, work.Q)
        iterated, sigma = solved_anew(problem, work.Q, work.qdd, exactly)  # (26)
        most = max(most, iterated)
        if sigma == 0.0 and not exactly:
            return most, sigma
        if has_dependent(system):
            take_least_share(problem)
        forces = reactions(problem, t, work.qdd, cut.trial, True)
        gap, size = 0.0, 0.0
        for n in range(cut.trial.size):
            gap = max(gap, abs(cut.answer[n] - cut.trial[n]))
            size = max(size, cut.answer[n])
        if not np.isfinite(gap):
            break
        calm = calm and gap <= _CALM * before
        near = _AGREED if calm else (_ROUNDED if mixed else _ENOUGH)
        if (mixed or count > 1) and gap <= max(near * size, _AGREED * forces):
            copy(cut.trial, cut.loads)
            copy(cut.reaction, cut.force)
            cut.force[sense] = cut.branch[1] if begins else wanted
            cut.passes[0] = count
            return most, sigma
        before = gap
        if mixed and calm:
            mix(cut, count)
            continue
        if mixed or count == 1:
            if not respond(problem, t, exactly):
                return most, 0.0
            mixed, calm, before = False, True, np.inf
            found = nearest_balance(unit, cut, wanted) if known else continuation(unit, cut)
            if not known:
                copy(cut.point, cut.best)
                if found == 0:
                    found = nearest_balance(unit, cut, 1)
            if begins:
                cut.branch[1] = found
            if found == 0:
                break
            copy(cut.best, cut.trial)
        else:
            subtract_friction(problem)
            copy(cut.trial, cut.point)
            if balance(unit, cut, 1.0) == 0:
                break
            copy(cut.point, cut.trial)
    cut.ended[0] = t
    return -1, 0.0


def _solve_by_address(problem: Problem, t: float, exactly: bool) -> float:
    count, sigma = _solve(problem, t, exactly)
    problem.forces.bearings.passes[1] = count
    return sigma


@cache
def settle(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Bearings` holds."""
    problem = Problem._numba_type(dimension)
    signature = types.float64(problem, types.float64, types.int64)
    return by_address(signature)(_solve_by_address)
