"""Velocities of a start in a singular position: completed on one branch, or refused by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel.data import NOTHING
from alf_ros.model import assembly, branch_words, softest_modes
from alf_ros.model.assembly import Given
from alf_ros.model.compile import Model, allocate, hold
from alf_ros.model.null_spaces import convective, linearise
from alf_ros.model.prescribed import prescribe
from alf_ros.model.quadratic_cones import CURVED, MANY, SAME, SHAKY, SMOOTH
from alf_ros.model.rank import effective_rank
from alf_ros.model.singular_branches import (
    WIDE,
    Branch,
    Position,
    components,
    position,
    straight,
)
from alf_ros.model.singular_location import located

_APART = 1e-9  # part of the velocity, by which what rests may move
_DIFFER = 1e-6  # part of a direction by which branches differ
_TYPED = 1e-6  # part of the terms by which velocities given may miss the second-order condition
_NOT_ENUMERATED = (
    'a singular position whose branches are not enumerated: velocities are not completed there; '
    'give velocities of more points'
)


def start(
    model: Model,
    q: Floats,
    given: Given,
    dependent: int,
    near: bool,
    t: float = 0.0,
    branch: int | None = None,
) -> tuple[Floats, Position | None]:
    """Velocities q̇ (blocks D, m/s) of a start at q (blocks D, m), completed from the given ones;
    and the position, if it is a singular one with few enough freedoms to be examined.

    In an ordinary position as `assembly.complete` does. In a singular one all given values must
    fit one branch, and the free velocities on it get the least kinetic energy. `dependent`: rows
    that depend on others in ordinary positions; `near`: whether q is near a singular one
    (`ordinary_positions.within`). branch: the number of the branch that the velocities must fit;
    None for any.

    Raises AssemblyError if no branch fits, naming the constraints or the branches, if several
    branches fit with different velocities, and if the branch asked for is none.
    """
    if branch is not None:
        return _start_on(model, q, given, dependent, t, branch)
    if near and _freedoms(model, q) > WIDE:
        return _start_of_many(model, q, given, t), None
    here = position(model, q, t) if near or (dependent and _is_tight(model, q, t)) else None
    if here is None or _is_ordinary(here, dependent):
        return assembly.complete(model, q, given, t, beside=True), None
    moving = any(value for values in given.values() for value in values)
    if not moving and not here.is_driven:
        return np.zeros_like(q), here
    if not moving and not here.drift.any():
        _check_setting_off(here)
    if not _freedoms_left(here, given):
        tolerance = 1e-9 + 100.0 * here.x
        qd = assembly.complete(model, q, given, t, None, tolerance, beside=True)
        if not here.can_begin(qd):
            _refuse(here, given, {})
        return qd, here
    if here.kind in (CURVED, MANY):
        raise AssemblyError(_NOT_ENUMERATED, key='initial.velocities')
    fitting = _fitting(here, given)
    if len(fitting) != 1:
        _refuse(here, given, fitting)
    return next(iter(fitting.values())), here


def resting(model: Model, q: Floats, dependent: int, t: float = 0.0) -> Position | None:
    """The singular position at rest in q (blocks D, m) at t (s), or hardly beside it; None if it
    has too many freedoms to be examined, and where drives move.

    `dependent`: rows that depend on others in ordinary positions.
    """
    here = _examined(model, q, dependent, t)
    return None if here is None or here.is_driven else here


def _examined(model: Model, q: Floats, dependent: int, t: float) -> Position | None:
    """The same, also where drives move."""
    if _freedoms(model, q) > WIDE:
        return None
    # a place beside the position lies on a branch, and the position itself on all of them
    try:
        here = position(model, located(model, q), t)
    except AssemblyError:  # no rest
        return None
    return None if _is_ordinary(here, dependent) else here


def departing(model: Model, here: Position | None) -> Model:
    """The model at rest in a position, knowing the branches on which it may leave; as it was where
    they are not enumerated."""
    if here is None or not here.branches:
        return model
    return model.departing(here.q, [branch.directions for branch in here.branches])


def leaving(model: Model, q: Floats, qd: Floats, dependent: int) -> Model:
    """The model that starts with q̇ (blocks D, m/s) at q (blocks D, m), in a singular position or
    beside it, knowing how what rests there may leave; as it was where that is not known.

    `dependent`: rows that depend on others in ordinary positions.
    """
    if qd.any() or model.mechanism.prescribed:  # drives may begin at rest, and move other parts
        found = _leaving_apart(model, q, qd, dependent)
        if qd.any() or found is not model:
            return found
    return departing(model, resting(model, q, dependent))


def _leaving_apart(model: Model, q: Floats, qd: Floats, dependent: int) -> Model:
    """The same of parts that rest while others move; as it was if there are none, if rows connect
    them with what moves, and if drives hold them."""
    here = _examined(model, q, dependent, 0.0)
    if here is None:
        return model
    least = _APART * np.abs(qd).max()
    fitting = [each.directions for each in here.branches if each.off(qd) <= least]
    if len(fitting) <= 1:
        return model
    part = _of_parts(model, _where_they_differ(fitting))
    open_ = _where_they_differ([each.directions for each in here.branches])
    if np.abs(part * qd).max() > least or (open_ > part).any():  # what moves is singular too
        return model
    if _is_driven(model, part):
        return model
    return model.departing(here.q, fitting, part)


def _where_they_differ(branches: Sequence[Floats]) -> Floats:
    """(blocks D,) 1 where a velocity on a branch has no part on the first one, or the other way
    round."""
    first, found = branches[0], np.zeros(branches[0].shape[1])
    for other in branches[1:]:
        for each, there in ((first, other), (other, first)):
            weights = np.linalg.lstsq(there.T, each.T, rcond=None)[0]
            rest = np.abs(each.T - there.T @ weights).max(axis=1)
            found[rest > _DIFFER * np.abs(each).max()] = 1.0
    return found


def _of_parts(model: Model, some: Floats) -> Floats:
    """(blocks D,) 1 on all movable blocks that rows or bodies connect with some coordinates that
    are 1, as the blocks of A show."""
    pattern, D, found = model.system.pattern, model.layout.dimension, np.zeros_like(some)
    column = np.repeat(np.arange(model.n // D), np.diff(pattern.first.astype(np.int64)))
    pairs = coo_array((np.ones(column.size), (pattern.row, column)), shape=(model.n // D,) * 2)
    _, label = connected_components(pairs, directed=False)
    of_some = label[np.flatnonzero(some[: model.n]) // D]
    found[: model.n] = np.repeat(np.isin(label, of_some), D)
    return found


def _is_driven(model: Model, part: Floats) -> bool:
    """Whether a drive moves something that a row binds to blocks of a part (blocks D,)."""
    rows = model.system.rows
    driven = [model.layout.of_prescribed[each.name] for each in model.mechanism.prescribed]
    row = np.repeat(np.arange(rows.c.size), np.diff(rows.first.astype(np.int64)))
    bound = row[part.reshape(-1, model.layout.dimension)[rows.block].any(axis=1)]
    return bool(np.isin(rows.block[np.isin(row, bound)], driven).any())


def _is_ordinary(here: Position, dependent: int) -> bool:
    """Whether no more rows depend on others than elsewhere, and rule nothing out."""
    return len(here.lost) <= dependent and here.kind == SMOOTH


def _start_on(
    model: Model, q: Floats, given: Given, dependent: int, t: float, number: int
) -> tuple[Floats, Position]:
    """The same on the branch with a number."""
    try:
        here = branching(model, q, dependent, t)
        branch = numbered(here, number)
        qd = on_branch(here, branch, given)
    except AssemblyError as error:
        raise AssemblyError(error.message, key='initial.branch') from None
    if not qd.any():
        raise AssemblyError(
            f'branch {number} is a direction, not a speed: give the velocity of something that '
            f'moves on it, {here.described(given, [branch])}',
            key='initial.branch',
        )
    return qd, here


def branching(model: Model, q: Floats, dependent: int, t: float = 0.0) -> Position:
    """The singular position at q (blocks D, m), with its branches.

    dependent: rows that depend on others in ordinary positions. Raises AssemblyError, with the
    distance, for a position that is not singular; and where branches are not enumerated.
    """
    here = position(model, q, t)
    if len(here.lost) <= dependent:
        raise AssemblyError(
            f'not in a singular position: its distance σ is {distance(model, q, dependent):.3g}',
            key='branch',
        )
    if here.kind in (CURVED, MANY):
        raise AssemblyError(f'{_NOT_ENUMERATED} ({here.kind})', key='branch')
    if not any(branch.dimension or branch.drift.any() for branch in here.branches):
        raise AssemblyError(branch_words.shaky(model, here.free), key='branch')
    return here


def distance(model: Model, q: Floats, dependent: int) -> float:
    """The least singular value σ at q (blocks D, m), of rows that are independent in ordinary
    positions; 1 if nothing is soft."""
    work = allocate(model, model.system, 0)
    work.q[:] = q
    linearise(model, model.system, work)
    modes = softest_modes.found(model, work, dependent)
    return 1.0 if modes is None else float(modes.sigma[0])


def numbered(here: Position, number: int) -> Branch:
    """The branch with a number. Raises AssemblyError for a number that no branch has."""
    if not 1 <= number <= len(here.branches):
        count = len(here.branches)
        raise AssemblyError(
            f'no branch {number}: the position has {count}, {here.described()}', key='branch'
        )
    return here.branches[number - 1]


def on_branch(here: Position, branch: Branch, given: Given) -> Floats:
    """The velocities q̇ (blocks D, m/s) of least kinetic energy on a branch with those given.
    Raises AssemblyError if none fit."""
    qd = _on(here, branch, given)
    if qd is None:
        raise AssemblyError(
            f'the given velocities do not fit branch {here.number(branch)}, '
            f'{here.described(given, [branch])} m/s',
            key='branch',
        )
    return qd


def unexamined(model: Model, q: Floats, here: Position | None, Q: Floats) -> str:
    """Positions that the rule for starts at rest does not cover, in words; empty if it covers all.

    q (blocks D, m) lies in a singular position, `here` as `start` returns it; Q (blocks D, N)
    acts.
    """
    if here is None and _freedoms(model, q) > WIDE and Q[: model.n].any():
        why = f'more than {WIDE} freedoms'
    elif here is not None and here.kind in (CURVED, MANY) and here.pull(Q).any():
        why = here.kind
    else:
        return ''
    return (
        f'at rest in a singular position whose branches are not enumerated ({why}): it leaves on '
        'the branch nearest to the acceleration by forces, which may not be the branch of least '
        'constraint; give velocities'
    )


def _start_of_many(model: Model, q: Floats, given: Given, t: float) -> Floats:
    """The same in a singular position with so many freedoms that no null space is looked at."""
    qd = assembly.complete(model, q, given, t)
    if not qd.any():
        return qd
    held, _, _ = hold(model, assembly.held(model, given), velocities=True)
    if _freedoms(replace(model, system=held), q):
        raise AssemblyError(_NOT_ENUMERATED, key='initial.velocities')
    if _accelerated(model, q, qd, t)[1] > _TYPED:
        raise AssemblyError(
            'a singular position: no motion begins there with the given velocities; its branches '
            'are not enumerated',
            key='initial.velocities',
        )
    return qd


def _freedoms(model: Model, q: Floats) -> int:
    """Freedoms of velocity at q (blocks D, m), as the penalty tells."""
    work = allocate(model, model.system, 0)
    work.q[:] = q
    linearise(model, model.system, work)
    return round(model.n - effective_rank(model, work))


def _check_setting_off(here: Position) -> None:
    """Raise AssemblyError if drives start a mechanism from rest on more than one branch.

    From rest q̈ takes the place of q̇: Φ⁗ = 0 is the condition for it, as Φ̈ = 0 is for q̇.
    """
    qdd, _ = _accelerated(here.model, here.q, np.zeros_like(here.q), here.t)
    going = replace(here, drift=qdd, pushed=np.zeros_like(here.pushed))
    if here.can_begin(np.zeros_like(here.q)) and not _sets_off_one_way(going):
        where = f': {going.described()} m/s²' if going.branches else ''
        raise AssemblyError(
            'drives begin at rest in a singular position, and accelerate: the motion that begins '
            f'is not unique{where}; let them begin with a speed, or elsewhere',
            key='drives',
        )


def _sets_off_one_way(going: Position) -> bool:
    """Whether drives start a mechanism from rest on one branch, but for parts that no row connects
    with them."""
    branches = going.branches
    if len(branches) <= 1:
        return bool(branches)
    least = SAME * np.abs(going.drift).max()
    if any(np.abs(each.drift - branches[0].drift).max() > least for each in branches):
        return False
    differing = _where_they_differ([each.directions for each in branches])
    return not _is_driven(going.model, _of_parts(going.model, differing))


def _freedoms_left(here: Position, given: Given) -> int:
    """How many of the directions that are free move nothing whose velocity is given."""
    at, _ = components(here.model, given)
    s = np.linalg.svd(here.free[:, at], compute_uv=False) if len(here.free) else np.zeros(0)
    least = max(1e-6, 100.0 * here.x) * np.abs(here.free).max(initial=0.0)
    return len(here.free) - int((s > least).sum())


def _on(here: Position, branch: Branch, given: Given) -> Floats | None:
    """The velocities of least kinetic energy on a branch with those given; None if none fit."""
    at, values = components(here.model, given)
    picked, wanted = branch.directions[:, at], values - branch.drift[at]
    U, s, Vt = np.linalg.svd(picked, full_matrices=False)
    told = s > max(1e-6, 100.0 * here.x) * np.abs(branch.directions).max(initial=0.0)
    weights = U[:, told] @ ((Vt[told] @ wanted) / s[told])
    left = wanted - weights @ picked
    size = max(np.abs(values).max(initial=0.0), np.abs(branch.drift).max(initial=0.0))
    if np.abs(left).max(initial=0.0) > (1e-9 + 100.0 * here.x) * size:
        return None
    return np.asarray(branch.drift + weights @ branch.directions)


def _fitting(here: Position, given: Given) -> dict[int, Floats]:
    """The velocities with those given on each branch where some fit, by its number; once those
    that are alike."""
    found: dict[int, Floats] = {}
    for number, branch in enumerate(here.branches, 1):
        qd = _on(here, branch, given)
        if qd is not None:
            nearest = min((np.abs(qd - other).max() for other in found.values()), default=np.inf)
            if nearest > SAME * np.abs(qd).max():
                found[number] = qd
    return found


def _is_tight(model: Model, q: Floats, t: float) -> bool:
    """Whether rows that depend on others keep some velocity from beginning a motion, which they do
    not do in a mechanism: for positions that are not singular."""
    random = np.zeros_like(q)
    random[: model.n] = np.random.default_rng(0).standard_normal(model.n)
    try:
        qd = assembly.complete(model, q, {}, t, near=random)
    except AssemblyError:
        return False  # the completion of velocities reports it
    return _accelerated(model, q, qd, t)[1] > _TYPED


def _accelerated(model: Model, q: Floats, qd: Floats, t: float) -> tuple[Floats, float]:
    """The least q̈ (blocks D, m/s²) in the metric of M with Φ_q q̈ + c = 0 at t (s), for positions
    that are not singular; and what it leaves of that, as a part."""
    work, rows = allocate(model, model.system, 0), model.system.rows
    work.q[:] = q
    rates, x = np.zeros_like(q), np.zeros_like(q)
    prescribe(model.system, t, work.q, rates, x)
    linearise(model, model.system, work)
    kernel.times_jacobian(model.unit, rows, work.g, work.g2, x, work.r2)
    work.r2[:] = -convective(model, qd) - work.r2
    size = max(straight(model, qd), float(np.max(np.abs(work.r2) * rows.scale, initial=0.0)))
    kernel.augmented(model.unit, model.system, work, work.p, x, kernel.Until(100, 1e-12, 1.0))
    left = float(np.max(np.abs(work.r2) * rows.scale, initial=0.0))
    return x, left / max(size, NOTHING)


def _refuse(here: Position, given: Given, fitting: Mapping[int, Floats]) -> NoReturn:
    if len(fitting) > 1:
        listed = branch_words.listed(here.model, list(fitting.values()), list(fitting))
        raise AssemblyError(
            f'a singular position: the given velocities fit {len(fitting)} branches, {listed} '
            'm/s; give more of them, or initial.branch',
            key='initial.velocities',
        )
    if here.kind == SHAKY and not any(branch.dimension for branch in here.branches):
        raise AssemblyError(branch_words.shaky(here.model, here.free), key='initial.velocities')
    if not any(value for values in given.values() for value in values):
        raise AssemblyError(
            'a singular position: no motion begins there with the given drives',
            key='drives',
        )
    where = 'its branches are not enumerated'
    if here.branches:
        where = f'its branches go {here.described(given)} m/s'
    raise AssemblyError(
        f'a singular position: no motion begins there with the given velocities; {where}',
        key='initial.velocities',
    )
