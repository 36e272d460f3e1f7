"""Branches of the motion through a singular position.

In a singular position left null vectors n appear, nᵀ Φ_q = 0: the rows lose a direction, and the
mechanism gains a freedom of velocity. But Φ̈ = Φ_q q̈ + c = 0, with c = Φ̇_q q̇ + Φ_q,s s̈, needs
nᵀ c = 0 for every n: the second-order condition. c is quadratic in q̇, since rows are quadratic in
q. So the velocities that begin a motion form a cone, in most mechanisms a few subspaces: one for
each branch. Null vectors of rows that are redundant everywhere fulfil the condition by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel.data import NOTHING
from alf_ros.model import assembly, branch_order, branch_words
from alf_ros.model.assembly import Given
from alf_ros.model.compile import Model, allocate
from alf_ros.model.null_spaces import convective, dependent_rows, free_directions, linearise
from alf_ros.model.prescribed import prescribe
from alf_ros.model.quadratic_cones import (
    CROSSING,
    CURVED,
    MANY,
    SAME,
    SHAKY,
    SMOOTH,
    TOUCHING,
    echelon,
    subspaces,
)

__all__ = ('CROSSING', 'CURVED', 'MANY', 'SHAKY', 'SMOOTH', 'TOUCHING')

# σ over its ordinary value, from which down a position is taken for the singular one. Φ is open by
# ε, which turns the direction of a row by ε / x²; the branch turns by x: equal at x = ε^(1/3).
IN = 5e-6
WIDE = 60  # freedoms, from which on branches are not looked for
_NONE = 1e-9  # part of its terms, from which down a sum counts as zero
_SMALL = 1e-3  # part of the largest term of all rows that the terms of a sum are, at least
_STRAIGHT = 1e-3  # of the squared speed over the size, an acceleration of next to no curvature
_TYPED = 1e-6  # part of the terms by which velocities given may miss the second-order condition
_TIE = 1e-6  # part by which one branch must be steeper than the others


@dataclass(frozen=True, eq=False)
class Branch:
    """Velocities that begin a motion on one branch: `drift` + Σ w_k `directions`_k.

    `directions` (dimension, blocks D), m/s, orthonormal in the metric of M. `drift` (blocks D),
    m/s: what drives ask for on this branch, of least kinetic energy; 0 if they are at rest.
    """

    directions: Floats
    drift: Floats

    @property
    def dimension(self) -> int:
        """Freedoms of velocity on the branch."""
        return len(self.directions)

    def off(self, qd: Floats) -> float:
        """By how much (m/s) q̇ (blocks D, m/s) misses the velocities on the branch."""
        apart = qd - self.drift
        weights = np.linalg.lstsq(self.directions.T, apart, rcond=None)[0]
        return float(np.abs(apart - weights @ self.directions).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Position:
    """A position of a mechanism, to second order.

    `q` (blocks D, m) at `t` (s); `free` (freedoms, blocks D): directions with Φ_q v = 0,
    orthonormal in the metric of M; `lost` (k, rows): left null vectors, in the kernel's order of
    rows; `x`: the largest singular value that counts as zero, over the ordinary one; `drift`
    (blocks D): velocities that drives require, of least kinetic energy; `pushed` (rows,): Φ_q,s
    s̈.
    """

    model: Model
    q: Floats
    t: float
    free: Floats
    lost: Floats
    x: float
    drift: Floats
    pushed: Floats

    @property
    def is_driven(self) -> bool:
        """Whether drives move or accelerate."""
        return bool(self.drift.any() or self.pushed.any())

    @property
    def kind(self) -> str:
        """CROSSING, TOUCHING, SHAKY, CURVED, MANY or SMOOTH."""
        return self._found[0]

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches in the order of their numbers, 1, 2 ...; none if CURVED or MANY, where they
        are not enumerated."""
        return self._found[1]

    def number(self, branch: Branch) -> int:
        """The number of one of the branches."""
        return 1 + [each is branch for each in self.branches].index(True)

    def miss(self, qd: Floats) -> float:
        """By how much q̇ (blocks D, m/s) misses nᵀ c = 0, as a part of the terms of the sum."""
        c = convective(self.model, qd) + self.pushed
        return float(np.max(np.abs(self.lost @ c) / self._size(c, qd), initial=0.0))

    def can_begin(self, qd: Floats) -> bool:
        """Whether a motion may begin with q̇ (blocks D, m/s), for which Φ_q q̇ + Φ_t = 0."""
        return self.miss(qd) <= _TYPED + 100.0 * self.x

    def may_continue(self, qd: Floats, qdd: Floats) -> bool:
        """Whether a motion that begins with q̇ (blocks D, m/s) may have q̈ (blocks D, m/s²), found
        without the lost rows: nᵀ of the third and fourth derivative of Φ, as far as q̇ and q̈ tell.

        Left null vectors whose condition is void ask for nothing.
        """
        felt = replace(self, lost=self.split()[0], pushed=np.zeros_like(self.pushed))
        size = np.abs(qdd).max(initial=0.0)
        if not len(felt.lost) or not size > 0.0:
            return True
        even = qdd * (np.abs(qd).max(initial=0.0) / size)  # as fast as q̇
        return all(felt.can_begin(v) for v in (even, qd + even, qd - even))

    def pull(self, Q: Floats) -> Floats:
        """(freedoms,) what forces Q (blocks D, N) do to a mechanism at rest, along `free`; 0 if it
        is no more than where the position lies beside the singular one."""
        n = self.model.n
        pull = self.free[:, :n] @ Q[:n]
        hardest = np.abs(Q[:n]).max(initial=0.0) / np.sqrt(self.model.system.mean)
        nothing = max(_NONE, 100.0 * self.x) * hardest
        return np.asarray(np.where(np.abs(pull).max(initial=0.0) > nothing, pull, 0.0))

    def departure(self, Q: Floats) -> Branch | None:
        """The branch on which forces Q (blocks D, N) start the mechanism from rest; None if they
        do no work, or if branches are not enumerated.

        By Gauss's principle of least constraint: the branch that lets the mechanism accelerate
        most nearly as it would without the lost rows. Raises AssemblyError if no branch lets it
        accelerate, or if two do it equally.
        """
        n, pull = self.model.n, self.pull(Q)
        if not pull.any() or self.kind in (SMOOTH, CURVED, MANY):
            return None
        works = [float(np.linalg.norm(each.directions[:, :n] @ Q[:n])) for each in self.branches]
        order = np.argsort(works)[::-1]
        if not works or works[order[0]] <= max(_NONE, 100.0 * self.x) * np.linalg.norm(pull):
            raise AssemblyError(branch_words.shaky(self.model, self.free), key='initial.positions')
        if len(works) > 1 and works[order[1]] > (1.0 - _TIE) * works[order[0]]:
            raise AssemblyError(
                'at rest in a singular position where forces act equally on two branches: the '
                'motion'
                f' that begins is not unique; give velocities along {self.described()}',
                key='initial.velocities',
            )
        return self.branches[order[0]]

    def described(
        self, given: Given | None = None, branches: Sequence[Branch] | None = None
    ) -> str:
        """Branches of a position, or all: 'A: [-1, 0] with 1) B: [-2, 0], or 2) B: [0, 0]'.

        Of a branch that is a line its direction, scaled to `given`; of one with more freedoms how
        many. Before each its number, if there is more than one.
        """
        branches = self.branches if branches is None else branches
        lines = [branch for branch in branches if branch.dimension <= 1]
        velocities = self._alike(lines, given)
        several = len(branches) > 1
        numbers = [self.number(branch) for branch in lines] if several else []
        found = branch_words.listed(self.model, velocities, numbers) if velocities else ''
        wide = []
        for branch in [b for b in branches if b.dimension > 1][: branch_words.BRANCHES]:
            label = f'{self.number(branch)}) ' if several else ''
            wide.append(f'{label}a branch of {branch.dimension} freedoms')
        return ', or '.join(([found] if found else []) + wide)

    def split(self) -> tuple[Floats, Floats]:
        """The left null vectors (k, rows) in two parts: combinations n whose condition nᵀ c = 0
        rules velocities out; and those whose condition is void, as of rows that are redundant
        everywhere."""
        basis = np.vstack([self.free, self.drift]) if self.is_driven else self.free
        if not len(self.lost) or not len(basis):
            return self.lost[:0], self.lost
        forms, sizes = self._products(basis, self.pushed)
        U, s, _ = np.linalg.svd(forms.reshape(len(forms), -1))
        s = np.pad(s, (0, len(forms) - s.size))
        felt = s > self._noise * sizes.max(initial=0.0)
        return U.T[felt] @ self.lost, U.T[~felt] @ self.lost

    def _alike(self, lines: Sequence[Branch], given: Given | None = None) -> list[Floats]:
        """The velocities of branches that are lines, at a common speed of something that moves on
        all of them, as far as drives leave a choice."""
        if self.is_driven:
            return [branch.drift for branch in lines]
        at, values = components(self.model, given or {})
        directions = [branch.directions[0] for branch in lines if branch.dimension]
        return branch_words.alike(self.model, directions, at, values) if directions else []

    @cached_property
    def _found(self) -> tuple[str, tuple[Branch, ...]]:
        forms, rate = self._forms
        if not len(forms):
            return SMOOTH, (Branch(self.free, self.drift),)
        if len(self.free) > WIDE:
            return MANY, ()
        dimension = forms.shape[1]
        _, s, Vt = np.linalg.svd(forms.reshape(-1, dimension))
        relevant = int((s > self._noise * s.max()).sum())
        inner, outer = Vt[:relevant], Vt[relevant:]
        # a basis of motions of few points each
        moved = self.free
        if self.is_driven:  # τ too: where drives only accelerate they move nothing yet
            tau = np.eye(dimension)[:, -1:]
            moved = np.hstack([np.vstack([self.free, self.drift / rate]), tau])
        moved = inner @ moved
        local, _ = echelon(np.hstack([moved, np.eye(relevant)]), moved.shape[1])
        kind, cones = subspaces(inner @ forms @ inner.T, 100.0 * self._noise, local[:, -relevant:])
        if relevant == 1 and len(outer):  # a double zero
            kind = TOUCHING
        made = (self._branch(np.vstack([cone @ inner, outer]), rate) for cone in cones)
        return kind, self._ordered([branch for branch in made if branch is not None])

    def _ordered(self, branches: Sequence[Branch]) -> tuple[Branch, ...]:
        lines = [n for n, branch in enumerate(branches) if branch.dimension <= 1]
        velocities = self._alike([branches[n] for n in lines])
        speeds = dict(zip(lines, map(np.linalg.norm, velocities), strict=False))
        order = branch_order.order(
            [branch.directions for branch in branches],
            [float(speeds.get(n, 0.0)) for n in range(len(branches))],
            [branch.drift for branch in branches],
        )
        turned = list(branches)
        for n, velocity in zip(lines, velocities, strict=False):
            if not self.is_driven and velocity @ branches[n].directions[0] < 0.0:
                turned[n] = replace(branches[n], directions=-branches[n].directions)
        return tuple(turned[n] for n in order)

    def _branch(self, coordinates: Floats, rate: float) -> Branch | None:
        """The part of a subspace (dimension, freedoms + 1) of (z, τ) with τ = `rate`; None
        without."""
        if not self.is_driven:
            return Branch(coordinates @ self.free, self.drift)
        z, tau = coordinates[:, :-1], coordinates[:, -1]
        if np.abs(tau).max(initial=0.0) <= SAME:
            return None
        still = np.linalg.svd(tau[None, :])[2][1:] @ z
        first = rate * (tau @ z) / (tau @ tau)
        first -= (still @ first) @ still
        return Branch(still @ self.free, self.drift + first @ self.free)

    @cached_property
    def _forms(self) -> tuple[Floats, float]:
        """(conditions, d, d): nᵀ c as quadratic forms of (z, τ), q̇ = z `free` + τ/rate `drift`,
        and the rate; of z alone if nothing is driven."""
        basis, rate = self.free, 1.0
        if not len(basis) or not len(self.lost):
            return np.zeros((0, 0, 0)), rate
        forms, sizes = self._products(basis, np.zeros_like(self.pushed))
        if self.is_driven:
            asked = np.abs(self.lost @ self.pushed).max(initial=0.0)
            felt = asked > self._noise * self._size(self.pushed, basis[:0]).max(initial=0.0)
            pushed = self.pushed if felt else 0.0 * self.pushed
            # so that what drives do is as large as what the directions do
            square = self._energy
            if pushed.any():
                square += asked / max(np.abs(forms).max(initial=0.0), 1e-100)
            rate = float(np.sqrt(square)) or 1.0
            basis = np.vstack([self.free, self.drift / rate])
            forms, sizes = self._products(basis, pushed / rate**2)
        flat = forms.reshape(len(forms), -1)
        _, s, Vt = np.linalg.svd(flat, full_matrices=False)
        kept = s > self._noise * sizes.max(initial=0.0)
        return (s[kept, None] * Vt[kept]).reshape(-1, *forms.shape[1:]), rate

    def _size(self, c: Floats, v: Floats) -> Floats:
        """(k,) how large the terms of nᵀ c are, for c (rows,) of velocities v (…, blocks D)."""
        rows = self.model.system.rows
        least = straight(self.model, v) / rows.scale
        most = (np.sqrt(rows.alpha) * np.maximum(_SMALL * np.abs(c), least)).max(initial=NOTHING)
        return np.asarray(np.maximum(np.abs(self.lost) @ np.abs(c), most))

    @property
    def _noise(self) -> float:
        """Part of its terms from which down a sum counts as zero."""
        return max(_NONE, 10.0 * self.x)

    @property
    def _energy(self) -> float:
        """q̇ᵀ M q̇ of `drift`."""
        momenta = np.zeros(self.model.n)
        kernel.add_mass_times(self.model.unit, self.model.system.mass, 1.0, self.drift, momenta)
        return float(momenta @ self.drift[: self.model.n])

    def _products(self, basis: Floats, pushed: Floats) -> tuple[Floats, Floats]:
        """(k, d, d) nᵀ c of pairs of a basis (d, blocks D), and the size of the terms."""
        d = len(basis)
        forms, sizes = (np.zeros((len(self.lost), d, d)) for _ in range(2))
        for i in range(d):
            for j in range(i + 1):
                plus = convective(self.model, basis[i] + basis[j])
                both = 0.25 * (plus - convective(self.model, basis[i] - basis[j]))
                if i == j == len(self.free):
                    both += pushed
                forms[:, i, j] = forms[:, j, i] = self.lost @ both
                sizes[:, i, j] = sizes[:, j, i] = self._size(both, basis[[i, j]])
        return forms, sizes


def position(model: Model, q: Floats, t: float = 0.0) -> Position:
    """The position q (blocks D, m) at t (s), to second order.

    Raises AssemblyError if drives ask for velocities that Φ_q does not allow there, or if
    something that moves has neither mass nor constraint.
    """
    work, system = allocate(model, model.system, 0), model.system
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    work.q[:] = q
    prescribe(system, t, work.q, qd, qdd)
    linearise(model, system, work)
    free, sigmas = free_directions(model, system, work)
    lost, lost_sigmas = dependent_rows(model, work)
    usual = system.ordinary
    small, few = sigmas <= IN * usual, lost_sigmas <= IN * usual
    pushed = np.zeros(system.rows.alpha.size)
    kernel.times_jacobian(model.unit, system.rows, work.g, work.g2, qdd, pushed)
    x = float(max([0.0, *sigmas[small], *lost_sigmas[few]])) / usual
    drift = qd
    if qd.any():
        drift = assembly.complete(model, q, {}, t, tolerance=max(1e-9, 100.0 * x * usual))
        momenta = np.zeros(model.n)
        kernel.add_mass_times(model.unit, system.mass, 1.0, drift, momenta)
        drift = drift - (free[small, : model.n] @ momenta) @ free[small]
    return Position(model, q, t, free[small], lost[few], x, drift, pushed)


def straight(model: Model, v: Floats) -> float:
    """An acceleration, m/s²: that which rows ask for of velocities v (…, blocks D), m/s, is judged
    beside it at least. Where nothing turns, all that they ask for is rounding."""
    return _STRAIGHT * float(np.abs(v).max(initial=0.0)) ** 2 / model.size


def components(model: Model, given: Given) -> tuple[list[int], Floats]:
    """Which coordinates have velocities given, and these, m/s."""
    layout, D = model.layout, model.layout.dimension
    at, values = [], []
    for name, components in given.items():
        is_point = name in layout.of_point
        block = layout.of_point[name] if is_point else layout.of_vector[name]
        for axis, value in enumerate(components):
            if value is not None:
                at.append(block * D + axis)
                values.append(value * (1.0 if is_point else layout.length))
    return at, np.array(values, dtype=float)
