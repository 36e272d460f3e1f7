"""Where a scene starts: its mechanism closed, its velocities completed, its lengths consistent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel import Work
from alf_ros.model import assembly, ordinary_positions, singular_start
from alf_ros.model.compile import Model, allocate, compile_model
from alf_ros.model.consistency import Adjustment, made_consistent
from alf_ros.model.handedness import check_hands
from alf_ros.model.penalty import LEAST_PENALTY, fitted
from alf_ros.model.singular_branches import Position
from alf_ros.scene.scene import Scene, Solver

_STANDS = 1e-9  # of the size: what goes no further in a step is at rest


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a scene.

    q (blocks D, m) and qd (m/s): all blocks in the kernel's order. dependent_rows: the number of
    rows that depend on others in ordinary positions. `ordinary` (blocks D, m): an ordinary
    position nearby. singular: the position, to second order, if it is a singular one; near:
    whether it is too near to one for the solves to notice. adjustment: of redundant lengths, if
    any. unexamined: the parts of a start at rest that were not examined; empty if all were.
    """

    model: Model
    q: Floats
    qd: Floats
    dependent_rows: int
    ordinary: Floats
    singular: Position | None
    near: bool
    adjustment: Adjustment | None
    unexamined: str = ''


@dataclass(frozen=True, eq=False)
class Assembled:
    """The position where a scene starts, before its velocities; fields as in `Start`."""

    model: Model
    q: Floats
    dependent_rows: int
    ordinary: Floats
    near: bool
    adjustment: Adjustment | None


@dataclass(frozen=True, eq=False)
class Rest:
    """A state at rest near a singular position, to which a run is set: q (blocks D, m) at t (s).
    position: the singular one, to second order, if it was examined."""

    q: Floats
    t: float
    position: Position | None

    def unexamined(self, model: Model, Q: Floats) -> str:
        """Why it is open how forces Q (blocks D, N) set it in motion, in words; empty if it is
        not."""
        here = self.position
        try:
            if here is not None:
                here.departure(Q)
        except AssemblyError as error:
            return error.message
        return singular_start.unexamined(model, self.q, here, Q)


def started(scene: Scene, solver: Solver) -> Start:
    """The start of a scene for a solver. Raises AssemblyError, naming the file of the scene."""
    at = assembled(scene, solver)
    try:
        qd, singular = singular_start.start(
            at.model, at.q, scene.velocities, at.dependent_rows, at.near, branch=scene.branch
        )
    except AssemblyError as error:
        raise AssemblyError(
            error.message, file=scene.file, key=error.key, expected=error.expected
        ) from None
    model = at.model
    if singular is not None or at.near:
        model = singular_start.leaving(model, at.q, qd, at.dependent_rows)
    return Start(model, at.q, qd, at.dependent_rows, at.ordinary, singular, at.near, at.adjustment)


def rest_at(start: Start, q: Floats, qd: Floats, t: float, h: float) -> Rest | None:
    """The rest at q (blocks D, m) and q̇ (m/s) at t (s), to which a run from a start is set; None
    if it moves in steps of h (s), by more than rounding, if it is where the scene starts, and if
    no singular position is near."""
    model, dependent = start.model, start.dependent_rows
    if h * np.abs(qd).max() > _STANDS * model.size or np.array_equal(q, start.q):
        return None
    if not ordinary_positions.within(model, q, dependent):
        return None
    return Rest(q, t, singular_start.resting(model, q, dependent, t))


def assembled(scene: Scene, solver: Solver) -> Assembled:
    """The closed mechanism of a scene for a solver. Raises AssemblyError, naming its file."""
    alf2 = solver.formulation == 'alf2'
    least = LEAST_PENALTY if alf2 else 0.0
    model = compile_model(scene.mechanism, max(solver.penalty, least))
    adjustment, work = None, allocate(model, model.system, 0)
    try:
        model, q, dependent, ordinary = _assembled(scene, model, work)
        consistent = made_consistent(model, q, dependent)
        if consistent is not None:
            mechanism, adjustment = consistent
            model = compile_model(mechanism, model.penalty)
            work = allocate(model, model.system, 0)
            model, q, dependent, ordinary = _assembled(scene, model, work)
        if alf2:
            model = fitted(model, ordinary, work, dependent)
        near = ordinary_positions.within(model, q, dependent, work)
        if near:
            q = assembly.close(model, scene.positions, q, least=0.0)
    except AssemblyError as error:
        raise AssemblyError(
            error.message, file=scene.file, key=error.key, expected=error.expected
        ) from None
    return Assembled(model, q, dependent, ordinary, near, adjustment)


def _assembled(scene: Scene, model: Model, work: Work) -> tuple[Model, Floats, int, Floats]:
    """The model with ordinary values near its closed position; that position q (blocks D, m); the
    number of dependent rows; and an ordinary position (blocks D, m)."""
    q = assembly.close(model, scene.positions, work=work)
    check_hands(model, q)
    dependent, ordinary, sigma = ordinary_positions.ordinary(model, q, work)
    return model.accustomed(sigma, dependent), q, dependent, ordinary
