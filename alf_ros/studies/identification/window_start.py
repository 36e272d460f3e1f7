"""The state with which a window begins, as free numbers.

At a reference q₀, Y spans the null space of Φ_q and Z the null space of J = [Φ_q; N], both
orthonormal in the metric of M. The free numbers s and ν (kg^½ m, kg^½ m/s) give the state of a
scene with any values of its numbers θ:

    Φ(q, θ) = 0,   Yᵀ M (q - q₀) = s      and      J q̇ = b,   Zᵀ M q̇ = ν

so that its derivatives by θ, s and ν are solutions of linear equations, and exact. Y, Z and M are
taken at q₀, and stay. A geared rotor is bound by rates alone, but no force depends on how far it
has turned: its turn is no free number, and stays as in q₀. The sums of gears, racks, threads and
couplings are rows of Φ too, with their values at q₀, unless the recorded joints tell these: then
they are free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag, lstsq

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import AssemblyError
from alf_ros.model.compile import Model
from alf_ros.model.constraints.meshing import integrals, slips
from alf_ros.model.constraints.rotors import rotor_blocks
from alf_ros.model.dense_linearisation import DEPENDENT
from alf_ros.model.prescribed import prescribe
from alf_ros.simulation.input_slopes import Slopes
from alf_ros.studies.statics.instant import Chosen
from alf_ros.studies.statics.sparse_rows import jacobian_blocks, mass_blocks, turning_blocks

_MOST = 60  # iterations
_CLOSED = 1e-10  # of the size: a start that stays open by more is none,
_ROUNDING = 2e-15  # and one that is open by less is closed
_TOLD = 1e-6  # of the largest singular value: what recorded joints see less of is rounding


@dataclass(frozen=True, eq=False)
class WindowStart:
    """q, qd (blocks D): a state; dq, dqd (K, blocks D): its derivatives."""

    q: Floats
    qd: Floats
    dq: Floats
    dqd: Floats


def least_change(A: Floats, off: Floats, rank: float | None = None) -> Floats:
    """The smallest x with the least |A x - off|. rank: the part of A that counts as zero, of the
    whole; None for rounding."""
    x, *_ = lstsq(A, off, rank, lapack_driver='gelsy', check_finite=False)
    return np.asarray(x)


class DenseRows:
    """Φ and J of a model as dense arrays, each row in its scale; at t (s)."""

    def __init__(self, model: Model, t: float) -> None:
        self.model, self.t = model, t
        rows = model.system.rows
        self._scale = rows.scale
        self.binds = np.arange(rows.alpha.size) < rows.alpha.size - rows.velocity
        self._integrals = integrals(model.layout)
        place = dict(zip(model.row_names, model.row.tolist(), strict=True))
        self._meshes = [place[each.name] for each in self._integrals]

    def placed(self, q: Floats) -> tuple[Floats, Floats]:
        """q with the fixed and driven blocks of the model, and q̇ with those alone."""
        model, n = self.model, self.model.n
        whole, rates = np.concatenate([q[:n], model.q[n:]]), np.zeros_like(q)
        prescribe(model.system, self.t, whole, rates, np.zeros_like(q))
        return whole, rates

    def gaps(self, q: Floats) -> Floats:
        """Φ (rows,); 0 for rows that bind velocities only."""
        found = np.zeros(self._scale.size)
        kernel.violation(self.model.unit, self.model.system.rows, q, found)
        return found * self._scale

    def unmeshed(self, before: Floats, q: Floats) -> tuple[Floats, Floats]:
        """(meshes,) by how much gears and others have slipped from `before` to q, by less than
        half a turn, and the gradient (meshes, n) of that."""
        slip = slips(self._integrals, self.model.layout.dimension, before, q)
        return slip * self._scale[self._meshes], self._meshing(q)

    def _meshing(self, q: Floats) -> Floats:
        return np.asarray(self.jacobian(q)[self._meshes, : self.model.n])

    def jacobian(self, q: Floats) -> Floats:
        """J (rows, blocks D)."""
        return jacobian_blocks(self.model, q).dense() * self._scale[:, None]

    def turning(self, v: Floats) -> Floats:
        """∂(J v)/∂q (rows, blocks D)."""
        return turning_blocks(self.model, v).dense() * self._scale[:, None]

    def opening(self, slopes: Slopes, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """∂Φ/∂θ and ∂(J v)/∂θ (rows,) of a number θ, with the free blocks of q and v held."""
        model, of, rows = self.model, slopes.arrays, self.model.system.rows
        own = replace(rows, b=of['b'], term=of['term'], c=of['c'])
        none, g2 = np.zeros(rows.i.size * model.layout.dimension), np.zeros(rows.b.size)
        turned = np.zeros(rows.alpha.size)
        kernel.jacobian(model.unit, own, q, none.copy(), g2)
        kernel.times_jacobian(model.unit, own, none, g2, v, turned)
        return slopes.opening(model, q, self.t) * self._scale, turned * self._scale

    def null_space(self, q: Floats, rows: Chosen) -> Floats:
        """(n, freedoms) of the movable blocks, orthonormal in the metric of M."""
        return self._null_space(self.jacobian(q)[rows, : self.model.n])

    def motions(self, q: Floats) -> tuple[Floats, Floats]:
        """The null space of the rows that bind positions: (n, freedoms) with geared rotors that
        stay, and (n, rotors) of their turns."""
        J = self.jacobian(q)[self.binds, : self.model.n]
        D = self.model.layout.dimension
        turns = np.eye(self.model.n)[[D * block for block in rotor_blocks(self.model.layout)]]
        masses = np.diag(turns @ mass_blocks(self.model).dense() @ turns.T)
        return self._null_space(np.vstack([J, turns])), turns.T / np.sqrt(masses)

    def in_mesh(self, q: Floats, of: Floats, told: Floats) -> tuple[Floats, Floats]:
        """Of directions (n, k) of `motions` those that keep meshes, and those that do not.

        None of these if all directions change the recorded joints, with the gradient `told`
        (joints, n).
        """
        seen = told @ of
        least = _TOLD * float(np.linalg.norm(seen, 2)) if seen.size else 0.0
        if not self._meshes or np.linalg.matrix_rank(seen, least) == of.shape[1]:
            return of, of[:, :0]
        _, s, Vt = np.linalg.svd(self._meshing(q) @ of)
        rank = int((s > DEPENDENT * s.max(initial=1e-300)).sum())
        return np.asarray(of @ Vt[rank:].T), np.asarray(of @ Vt[:rank].T)

    def _null_space(self, J: Floats) -> Floats:
        _, s, Vt = np.linalg.svd(J)
        V = Vt[int((s > DEPENDENT * s.max(initial=1e-300)).sum()) :].T
        masses, turn = np.linalg.eigh(V.T @ mass_blocks(self.model).dense() @ V)
        least = self.model.system.mean * DEPENDENT
        return np.asarray(V @ turn / np.sqrt(np.maximum(masses, least)))


class StartChart:
    """The free numbers of a state beside q₀, q̇₀ (blocks D) at t (s); turns (angles,).

    moves, speeds (rows, n): priors; a displacement of q from q₀, and q̇, give normal numbers of
    deviation 1. at_rest: ν = 0, which is no free number then.
    """

    def __init__(
        self,
        model: Model,
        t: float,
        q: Floats,
        qd: Floats,
        turns: Integers,
        moves: Floats | None = None,
        speeds: Floats | None = None,
        at_rest: bool = False,
    ) -> None:
        rows, n = DenseRows(model, t), model.n
        self.t, self.q, self.turns = t, q, turns
        M = mass_blocks(model).dense()
        Y, still = rows.motions(q)
        if moves is not None:
            Y, unmeshing = rows.in_mesh(q, Y, moves)
        self._in_mesh = moves is not None and unmeshing.size > 0
        Z = rows.null_space(q, np.ones_like(rows.binds))
        self._still = still.shape[1]
        self._held, self._going = (
            np.asarray((M @ np.hstack([Y, still])).T),
            np.asarray((M @ Z).T),
        )
        self.positions, self.velocities = Y.shape[1], 0 if at_rest else Z.shape[1]
        nu = (self._going @ qd[:n])[: self.velocities]
        self.free = np.concatenate([np.zeros(self.positions), nu])
        nothing = np.zeros((0, n))
        near = (nothing if moves is None else moves) @ Y
        slow = (nothing if speeds is None or at_rest else speeds) @ Z[:, : self.velocities]
        self.known = block_diag(near, slow)  # (rows, free numbers): priors
        told = int(np.linalg.matrix_rank(near)) if near.size else 0
        self.is_told = moves is None or told == self.positions  # whether joints tell where it is

    def start(
        self, model: Model, free: Floats, slopes: Sequence[Slopes] | None = None
    ) -> WindowStart:
        """The state of the free numbers (s, ν) in a model; `slopes`: of the numbers θ of its
        derivatives, s and ν behind them; None for no derivatives. Raises AssemblyError where
        there is no such state."""
        rows, n = DenseRows(model, self.t), model.n
        s = np.concatenate([free[: self.positions], np.zeros(self._still)])
        nu = np.zeros(len(self._going))
        nu[: self.velocities] = free[self.positions :]
        q, rates = rows.placed(self.q)
        gap = np.inf
        for _ in range(_MOST):
            open_, A = rows.gaps(q)[rows.binds], rows.jacobian(q)[rows.binds, :n]
            if self._in_mesh:
                slip, turning = rows.unmeshed(rows.placed(self.q)[0], q)
                open_, A = np.concatenate([open_, slip]), np.vstack([A, turning])
            A = np.vstack([A, self._held])
            off = np.concatenate([open_, self._held @ (q - self.q)[:n] - s])
            before, gap = gap, float(np.abs(off).max(initial=0.0))
            least = _CLOSED if gap >= 0.5 * before else _ROUNDING
            if gap <= least * model.size:
                break
            q[:n] -= least_change(A, off)
        if not gap <= _CLOSED * model.size:
            raise AssemblyError(f'the mechanism cannot be closed at t = {self.t:.6g} s')
        J = rows.jacobian(q)
        still = J[:, n:] @ rates[n:]
        turned = np.vstack([J[:, :n], self._going])
        inverse = np.asarray(np.linalg.pinv(turned), dtype=float)
        qd = rates
        qd[:n] = inverse @ np.concatenate([-still, nu])
        return WindowStart(q, qd, *self._derivatives(rows, q, qd, slopes, A, J, inverse))

    def _derivatives(
        self,
        rows: DenseRows,
        q: Floats,
        qd: Floats,
        slopes: Sequence[Slopes] | None,
        A: Floats,
        J: Floats,
        inverse: Floats,
    ) -> tuple[Floats, Floats]:
        """By each number, then by s and ν: dq and dqd (K, blocks D)."""
        if slopes is None:
            return np.zeros((0, q.size)), np.zeros((0, q.size))
        n, P, g, f = rows.model.n, len(slopes), self.positions, self.velocities
        dq, dqd = np.zeros((P + g + f, q.size)), np.zeros((P + g + f, q.size))
        position, velocity = np.linalg.pinv(A), inverse
        binding = len(A) - len(self._held)
        bent, widened = rows.turning(qd), np.zeros((len(rows.binds), P + g + f))
        for k, each in enumerate(slopes):
            if each.changes_rows or each.changes_drives:
                opened, widened[:, k] = rows.opening(each, q, qd)
                placed, going = each.placed(rows.model, rows.t)
                dq[k, n:], dqd[k, n:] = placed[n:], going[n:]
                opened = opened[rows.binds]
                if self._in_mesh:
                    # a ratio that changes: of the order of q - q₀, which the fit makes small
                    opened = np.concatenate([opened, np.zeros(binding - opened.size)])
                dq[k, :n] = -position[:, :binding] @ opened
        dq[P : P + g, :n] = position[:, binding : binding + g].T
        open_velocities = bent @ dq.T + widened + J[:, n:] @ dqd[:, n:].T
        dqd[:, :n] = -(velocity[:, : len(rows.binds)] @ open_velocities).T
        dqd[P + g :, :n] += velocity[:, len(rows.binds) : len(rows.binds) + f].T
        return dq, dqd


@dataclass(frozen=True, eq=False)
class SceneStart:
    """The initial state of the scene, whatever its numbers: it has no free numbers."""

    free: Floats = field(default_factory=lambda: np.zeros(0))
    known: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    is_told: bool = True
