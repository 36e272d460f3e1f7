"""Velocities on a named branch of a singular position, for a body that is placed there."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model import singular_start
from alf_ros.model.assembly import Given
from alf_ros.model.compile import Model
from alf_ros.model.singular_branches import Branch


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
    return _projected(model, branch, before)


def _projected(model: Model, branch: Branch, qd: Floats) -> Floats:
    """The motion of the branch that is nearest in the metric of M."""
    momenta = np.zeros(model.n)
    kernel.add_mass_times(model.unit, model.system.mass, 1.0, qd - branch.drift, momenta)
    weights = branch.directions[:, : model.n] @ momenta
    return np.asarray(branch.drift + weights @ branch.directions)
