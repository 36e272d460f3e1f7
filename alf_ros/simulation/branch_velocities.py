"""Velocities on a branch of a singular position, for a body that is placed there."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model import singular_start
from alf_ros.model.assembly import Given
from alf_ros.model.compile import Model
from alf_ros.model.singular_branches import Branch, components

_TOLD = 1e-6  # part of the largest singular value, from which down a direction moves nothing given


def on_branch(
    model: Model,
    q: Floats,
    t: float,
    dependent: int,
    number: int,
    given: Given | None,
    before: Floats,
) -> Floats:
    """q̇ (blocks D, m/s) at q (blocks D, m) and t (s) on the branch with a number.

    With velocities given: those, with the least kinetic energy. Without: what an impulse that
    leaves only motions of the branch makes of `before` (blocks D, m/s). dependent: rows that
    depend on others in ordinary positions. Raises AssemblyError if the position is not singular,
    if there is no such branch, and if the velocities given do not fit it.
    """
    here = singular_start.branching(model, q, dependent, t)
    branch = singular_start.numbered(here, number)
    if given is not None:
        return singular_start.on_branch(here, branch, given)
    qd = _projected(model, branch, before)
    assert qd is not None
    return qd


def on_nearest_branch(
    model: Model,
    q: Floats,
    t: float,
    dependent: int,
    given: Given | None,
    before: Floats,
    tolerance: float,
) -> Floats | None:
    """The same on the branch on which an impulse changes `before` (blocks D, m/s) least. None in a
    position that is not singular, or whose branches are not known.

    Raises AssemblyError, with the branches, if velocities given fit none to `tolerance` of the
    largest.
    """
    here = singular_start.resting(model, q, dependent, t)
    if here is None or not here.branches:
        return None
    tried = (_projected(model, branch, before, given, tolerance) for branch in here.branches)
    found = [qd for qd in tried if qd is not None]
    if not found:
        raise AssemblyError(
            f'the given velocities fit no branch of a singular position; they go '
            f'{here.described(given)} m/s'
        )
    return min(found, key=lambda qd: _energy(model, qd - before))


def _projected(
    model: Model,
    branch: Branch,
    qd: Floats,
    given: Given | None = None,
    tolerance: float = 0.0,
) -> Floats | None:
    """The motion of the branch that is nearest in the metric of M, of those with velocities given,
    if any; None without."""
    momenta = np.zeros(model.n)
    kernel.add_mass_times(model.unit, model.system.mass, 1.0, qd - branch.drift, momenta)
    weights = branch.directions[:, : model.n] @ momenta
    if given is not None:
        at, values = components(model, given)
        picked = branch.directions[:, at]
        missing = values - branch.drift[at] - weights @ picked
        change = np.linalg.lstsq(picked.T, missing, rcond=_TOLD)[0]
        fastest = max(np.abs(values).max(initial=0.0), np.abs(qd).max())
        if np.abs(missing - change @ picked).max(initial=0.0) > tolerance * fastest:
            return None
        weights = weights + change
    return np.asarray(branch.drift + weights @ branch.directions)


def _energy(model: Model, qd: Floats) -> float:
    """q̇ᵀ M q̇, J."""
    momenta = np.zeros(model.n)
    kernel.add_mass_times(model.unit, model.system.mass, 1.0, qd, momenta)
    return float(momenta @ qd[: model.n])
