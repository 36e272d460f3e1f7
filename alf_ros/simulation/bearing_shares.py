"""Shares of redundant reactions: the stiff limit of elastic bearings.

Where rows depend on one another, λ + Nᵀ z balances for every z: N are the left null vectors of
Φ_q, states of self-stress. Elastic bearings choose the reactions of least complementary energy

    Σ F² / 2 k + T² / 2 κ   over all joints,

with the stiffness k (N/m) of a bearing against translation and κ (N m/rad) against rotation.
Bodies do not deform. As all stiffnesses grow together, the reactions stay as they are, and the
deflections vanish: the motion is the one of rigid bodies, and shares depend on ratios only.

Source: Castigliano's theorem; for constraint forces of multibody systems F. González, J. Kövecses,
Use of penalty formulations in dynamic simulation and analysis of redundantly constrained multibody
systems, Multibody System Dynamics 29 (2013) 57-76.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import CutWork, Work
from alf_ros.mechanism import Bearing
from alf_ros.model.compile import Model
from alf_ros.model.null_spaces import dependent_rows
from alf_ros.simulation.reactions import Reactions

_NOTHING = 1e-13  # of the largest, from which down an elastic energy counts as zero
_OPEN = 1e-6  # part of a self-stress, from which on it changes a component


def has_bearings(model: Model) -> bool:
    """Whether a joint has a stiffness."""
    return any(joint.bearing is not None for joint in model.mechanism.joints)


class BearingShares:
    """The stiffness of all joints of a model; rigid joints have no compliance."""

    def __init__(self, model: Model, reactions: Reactions) -> None:
        self._model, self._reactions = model, reactions
        D = model.layout.dimension
        spins = 1 if D == 2 else 3
        self._shape = len(model.joint_names), D, spins
        compliance = []
        for joint in model.mechanism.joints:
            bearing = joint.bearing or Bearing(math.inf, math.inf)
            compliance.append([1.0 / bearing.translation] * D + [1.0 / bearing.rotation] * spins)
        self._compliance = np.array(compliance).reshape(len(compliance), D + spins)

    def apply(self, work: Work, there: CutWork) -> None:
        """Change λ in `work` (in y, as the kernel has it) to the shares of the bearings.

        work: q̈ and λ of an instant, Φ_q and the factor. there: of the cut mechanism, with Q on its
        blocks; to write in.
        """
        rows, wrenches = self._self_stresses(work, there)
        if not len(rows):
            return
        weighted = self._compliance.ravel() * wrenches
        energy = weighted @ wrenches.T
        now = self._wrenches(work, there).ravel()
        z = -np.linalg.pinv(energy, rcond=_NOTHING, hermitian=True) @ (weighted @ now)
        work.y[:] += z @ rows

    def open_components(self, work: Work, there: CutWork) -> NDArray[np.bool_]:
        """(joints, D + 1 or 3) whether rigid bodies and these bearings leave a component of force
        or torque undetermined."""
        rows, wrenches = self._self_stresses(work, there)
        joints, D, spins = self._shape
        if not len(rows):
            return np.zeros((joints, D + spins), dtype=bool)
        left = np.abs(self._loose(wrenches).T @ wrenches).max(axis=0, initial=0.0)
        return np.asarray((left > _OPEN).reshape(joints, D + spins))

    def open_rows(self, work: Work, there: CutWork) -> Floats:
        """(k, rows) changes of λ that these bearings leave open: no bearing yields under them."""
        rows, _sigma = dependent_rows(self._model, work)
        return np.asarray(self._loose(self._wrenches_of(rows, work, there)).T @ rows)

    def _loose(self, wrenches: Floats) -> Floats:
        """(k, loose) sums of k self-stresses that have no elastic energy."""
        energy = (self._compliance.ravel() * wrenches) @ wrenches.T
        values, vectors = np.linalg.eigh(energy)
        return vectors[:, values <= _NOTHING * max(values.max(initial=0.0), 1e-300)]

    def _self_stresses(self, work: Work, there: CutWork) -> tuple[Floats, Floats]:
        """Left null vectors (k, rows), and the wrenches of all joints that belong to them (k,
        joints times (D + 1 or 3)), each of size 1."""
        rows, _sigma = dependent_rows(self._model, work)
        wrenches = self._wrenches_of(rows, work, there)
        sizes = np.abs(wrenches).max(axis=1, initial=0.0)
        felt = sizes > 0.0
        return rows[felt] / sizes[felt, None], wrenches[felt] / sizes[felt, None]

    def _wrenches_of(self, rows: Floats, work: Work, there: CutWork) -> Floats:
        """(k, joints times (D + 1 or 3)) of changes of λ (k, rows)."""
        kept, Q, qdd = work.y.copy(), there.Q.copy(), work.qdd.copy()
        there.Q[:], work.qdd[:] = 0.0, 0.0
        wrenches = np.zeros((len(rows), self._compliance.size))
        for row, wrench in zip(rows, wrenches, strict=True):
            work.y[:] = row
            wrench[:] = self._wrenches(work, there).ravel()
        work.y[:], there.Q[:], work.qdd[:] = kept, Q, qdd
        return wrenches

    def _wrenches(self, work: Work, there: CutWork) -> Floats:
        """(joints, D + 1 or 3)"""
        joints, D, spins = self._shape
        force, torque = np.empty(joints * D), np.empty(joints * spins)
        kernel.joint_wrenches(self._model.unit, self._reactions.arrays, there, work, force, torque)
        return np.column_stack([force.reshape(-1, D), torque.reshape(-1, spins)])
