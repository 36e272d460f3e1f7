"""A mechanism at one instant, with all that acts on it: forces, tangents, free directions.

The admissible velocities are J q̇ = b, J = [Φ_q; N]. Z: the free velocities, J Z = 0. Y: the free
changes of position, which are more than Z if a row binds velocities only and cannot be integrated.
Both are orthonormal in the metric of M, so that their columns have the unit kg^-½.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.effects import held as packed_input
from alf_ros.effects.contract import EFFORT, EFFORT_OVER_TIME, WRENCH, Effect
from alf_ros.errors import InputError
from alf_ros.kernel import Effects
from alf_ros.model.compile import Model
from alf_ros.model.constraints.meshing import has_integral
from alf_ros.model.dense_linearisation import DEPENDENT, MASSLESS
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.input_values import Inputs
from alf_ros.simulation.reactions import ReactionsOf
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.statics.force_change import Force, ForceChange, dual_forces
from alf_ros.studies.statics.force_tangents import ForceTangents
from alf_ros.studies.statics.sparse_rows import Sparse, curvature, jacobian, mass_matrix, turning

Chosen = NDArray[np.bool_]  # rows
_IN_A_KINK = 1e-9  # of a typical length
DENSE = 1200  # coordinates, up to which dense matrices are used


class Loads:
    """The loads on a model: its effects, and the inputs held."""

    def __init__(
        self,
        simulation: Simulation,
        *,
        model: Model | None = None,
        effects: Sequence[Effect] | None = None,
        inputs: Inputs | None = None,
    ) -> None:
        """Of the present of a simulation, or with something else in its place.

        Raises InputError if an effect does not fit the model.
        """
        own = simulation.scene.effects
        self.model: Model = simulation.model if model is None else model
        self.inputs = simulation.state.inputs if inputs is None else inputs
        self.effects: tuple[Effect, ...] = tuple(own if effects is None else effects)
        self.applied = Applied(self.model, self.effects, self.inputs, ReactionsOf(self.model))

    @cached_property
    def tangents(self) -> ForceTangents:
        """Of all that acts."""
        return ForceTangents(self.model, [*self.effects, *self._held])

    @cached_property
    def M(self) -> Sparse:
        """(n, n) kg."""
        return mass_matrix(self.model)

    @cached_property
    def duals(self) -> Addresses:
        """(effects,) the addresses of the forces for dual numbers."""
        return dual_forces(self.applied.kinds)

    @property
    def _held(self) -> list[Effect]:
        axes = {each.name: each.freedom.alone for each in self.model.coordinates}
        wrenches = [packed_input(WRENCH, *each) for each in self.inputs.all_wrenches]
        efforts = []
        for name, what in self.inputs.efforts.items():
            steady = isinstance(what, float) and axes[name]
            efforts.append(packed_input(EFFORT if steady else EFFORT_OVER_TIME, name, what))
        return wrenches + efforts

    def with_inputs(self, inputs: Inputs) -> Effects:
        """The effects if other inputs were held."""
        return self.applied.holding(inputs).assembled.effects


def forces(
    effects: Effects, t: float, q: Floats, qd: Floats, near: Floats, rubbing: Floats
) -> Floats:
    """Q (blocks D,), N; `rubbing` (loads,) N: what loads the friction that depends on reactions,
    or (0,) without this friction."""
    Q = np.zeros_like(q)
    kernel.applied_forces(effects, t, q, qd, near, Q)
    if rubbing.size:
        kernel.add_friction(effects, t, q, qd, near, rubbing, Q)
    return Q


def angles(model: Model, q: Floats, turns: Integers) -> tuple[Floats, Floats]:
    """Each counted angle (angles,), rad: with its turns, and to a quarter turn."""
    rows = model.system.angles
    xy, near = np.zeros(rows.c.size), np.zeros(turns.size)
    kernel.violation(model.unit, rows, q, xy)
    kernel.nearby(xy, turns, near)
    return np.arctan2(xy[1::2], xy[::2]) + 2.0 * np.pi * turns, near


def counted(model: Model, before: Floats, turns: Integers, after: Floats) -> Integers:
    """The turns at q `after`, of those at q `before`: no angle has turned by half a turn."""
    was, _ = angles(model, before, turns)
    now, _ = angles(model, after, turns)
    return turns + np.rint((was - now) / (2.0 * np.pi)).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Instant:
    """Loads at t (s), q, q̇ (blocks D, m, m/s) and turns; drives are where they are at t.

    rubbing (loads,): the reactions that load friction, N, which are held; none at rest.
    """

    loads: Loads
    t: float
    q: Floats
    qd: Floats
    turns: Integers
    rubbing: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def model(self) -> Model:
        """The mechanism."""
        return self.loads.model

    @cached_property
    def near(self) -> Floats:
        """(angles,) rad: what effects unwrap angles by."""
        return angles(self.model, self.q, self.turns)[1]

    @property
    def force(self) -> Force:
        """Q(q, q̇) near this instant."""
        effects, t, near = self.loads.applied.assembled.effects, self.t, self.near
        return lambda q, qd: forces(effects, t, q, qd, near, self.rubbing)

    def change(self, label: str | None = None) -> ForceChange:
        """How the forces of all that acts change, or the forces of one effect of the scene."""
        applied, at = self.loads.applied, (self.t, self.q, self.qd, self.near)
        if label is None:
            return ForceChange(applied.assembled.effects, self.loads.duals, *at, self.rubbing)
        part = applied.each[label].effects
        kind = next(each.kind for each in self.loads.effects if each.label == label)
        return ForceChange(part, dual_forces(part.force.size * [kind]), *at, np.zeros(0))

    @property
    def is_kinked(self) -> bool:
        """Whether a force has a kink here, for free changes of position: K is of one side."""
        length = _IN_A_KINK * self.loads.tangents.length
        return self.change().has_kink(self.position_directions.T, length)

    @property
    def bends(self) -> bool:
        """Whether a force has a kink here, or begins without a slope: differences are inexact."""
        length = _IN_A_KINK * self.loads.tangents.length
        return self.change().bends(self.position_directions.T, length)

    @property
    def is_kinked_in_speed(self) -> bool:
        """Whether a force has a kink here for free changes of velocity: C is of one side."""
        speed = _IN_A_KINK * self.loads.tangents.length  # m/s
        return self.change().has_kink(self.velocity_directions.T, speed, in_speed=True)

    @cached_property
    def Q(self) -> Floats:
        """(blocks D,) N."""
        return self.force(self.q, self.qd)

    @property
    def M(self) -> Sparse:
        """(n, n) kg."""
        return self.loads.M

    @cached_property
    def J(self) -> Sparse:
        """(rows, blocks D), rows in the kernel's order."""
        return jacobian(self.model, self.q)

    @cached_property
    def J_of_movable(self) -> Sparse:
        """(rows, n) of J."""
        return self.J[:, : self.model.n].tocsr()

    @cached_property
    def K(self) -> Sparse:
        """(n, n) -∂Q/∂q, N/m."""
        return self.loads.tangents.stiffness(self.change())

    @cached_property
    def C(self) -> Sparse:
        """(n, n) -∂Q/∂q̇, N s/m."""
        return self.loads.tangents.damping(self.change())

    def curvature(self, lam: Floats, *, sizes: bool = False) -> Sparse:
        """(n, n) ∂(Jᵀ λ)/∂q of λ (rows,): the stiffness that reactions give, N/m; `sizes`: how
        large the terms are that it is the sum of."""
        n = self.model.n
        return curvature(self.model, lam, sizes=sizes)[:n, :n]

    @cached_property
    def turning(self) -> Sparse:
        """(rows, n) ∂(J q̇)/∂q, 1/s."""
        return turning(self.model, self.qd)[:, : self.model.n]

    # ------------------------------------------------------------------------- dense, if small

    @cached_property
    def velocity_directions(self) -> Floats:
        """Z (n, f)."""
        return self._free(np.ones(self.model.system.rows.alpha.size, dtype=bool))

    @cached_property
    def position_directions(self) -> Floats:
        """Y (n, g)."""
        model = self.model
        binds = np.zeros(model.system.rows.alpha.size, dtype=bool)
        first = binds.size - model.system.rows.velocity
        rolls = has_integral(model.mechanism)
        for name, place in zip(model.row_names, model.row.tolist(), strict=True):
            binds[place] = place < first or name in rolls
        return self.velocity_directions if binds.all() else self._free(binds)

    @cached_property
    def rank(self) -> int:
        """Number of independent rows of J."""
        return self.model.n - self._null(np.ones(self.model.system.rows.alpha.size, bool)).shape[1]

    def _null(self, chosen: Chosen) -> Floats:
        model = self.model
        if model.n > DENSE:
            raise InputError(
                f'dense matrices are for {DENSE} coordinates at most',
                key='mechanism',
                value=f'{model.n} coordinates',
                expected='modes, which find the lowest ones of large mechanisms',
            )
        scaled = self.J[:, : model.n].multiply(model.system.rows.scale[:, None]).toarray()
        _, s, Vt = np.linalg.svd(scaled[chosen])
        rank = int((s > DEPENDENT * s.max(initial=1e-300)).sum())
        return np.asarray(Vt[rank:].T)

    def _free(self, chosen: Chosen) -> Floats:
        V = self._null(chosen)
        masses, turn = np.linalg.eigh(V.T @ (self.M @ V))
        if masses.size and masses[0] <= MASSLESS * self.model.system.mean:
            raise InputError(
                'a free motion has no mass: `check` names it', key='mechanism', expected='a mass'
            )
        Z = V @ turn / np.sqrt(masses)
        sign = np.sign(Z[np.argmax(np.abs(Z), axis=0), np.arange(Z.shape[1])])
        return np.asarray(Z * sign)
