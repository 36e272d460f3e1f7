"""A mechanism at one position as dense matrices: Φ_q, its singular values, the free directions, M.

For questions that are asked once, such as in `check`; the step uses sparse methods. Rows are
scaled to length one as drawn, and every coordinate is a length: all numbers compare.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.model.constraints.meshing import has_integral

DEPENDENT = 1e-7  # singular value, of the largest, from which down rows count as dependent
_STALLED = 10  # iterations of Newton without half as much open
MASSLESS = 1e-12  # mass of a direction, of the largest, from which down it counts as none


def rank_of(rows: Floats) -> int:
    """Number of independent rows (m, n), each of length about one."""
    return _rank_by(np.asarray(np.linalg.svd(rows, compute_uv=False)))


def _rank_by(singular_values: Floats) -> int:
    return int((singular_values > DEPENDENT * singular_values.max(initial=1e-300)).sum())


@dataclass(frozen=True, eq=False)
class Linearised:
    """`model` at q (blocks D, m)."""

    model: Model
    q: Floats

    @cached_property
    def phi(self) -> Floats:
        """(rows,) Φ, m, in the order of `row_names`; 0 for rows that bind velocities only."""
        rows = self.model.system.rows
        phi = np.zeros(rows.alpha.size)
        kernel.violation(self.model.unit, rows, self.q, phi)
        return (phi * rows.scale)[self.model.row]

    @cached_property
    def jacobian(self) -> Floats:
        """(rows, n) Φ_q, and N of rows that bind velocities only."""
        model, rows, D = self.model, self.model.system.rows, self.model.layout.dimension
        g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
        kernel.jacobian(model.unit, rows, self.q, g, g2)
        held, m = rows.i.size, rows.alpha.size
        whole = np.zeros((m, model.layout.blocks, D))
        whole[np.arange(held), rows.i] += g.reshape(-1, D)
        whole[np.arange(held), rows.j] -= g.reshape(-1, D)
        owner = np.repeat(np.arange(held, m), rows.first[1:] - rows.first[:-1])
        whole[owner, rows.block] = g2.reshape(-1, D)
        scaled = whole[:, : model.layout.movable].reshape(m, model.n) * rows.scale[:, None]
        return np.asarray(scaled[model.row])

    @cached_property
    def _decomposed(self) -> tuple[Floats, Floats, Floats]:
        """U (rows, rows), singular values (n,) with zeros behind, Vᵀ (n, n)."""
        U, s, Vt = np.linalg.svd(self.jacobian)
        return U, np.concatenate([s, np.zeros(self.model.n - min(s.size, self.model.n))]), Vt

    @property
    def singular_values(self) -> Floats:
        """(n,) of the scaled Φ_q, descending, zeros behind if there are fewer rows."""
        return self._decomposed[1]

    @cached_property
    def rank(self) -> int:
        """Number of independent rows."""
        return _rank_by(self.singular_values)

    @cached_property
    def rank_of_positions(self) -> int:
        """Number of independent rows among those that bind positions.

        Gears, racks, wheels on a line, screws, couplings and the rotors of joints bind them too:
        their rows are of velocities, but can be integrated.
        """
        rolls = has_integral(self.model.mechanism)
        names = self.model.row_names
        first = len(names) - self.model.system.rows.velocity  # in the kernel's order
        places = self.model.row.tolist()
        kept = [n for n, name in enumerate(names) if places[n] < first or name in rolls]
        return rank_of(self.jacobian[kept])

    @cached_property
    def free(self) -> Floats:
        """(n, n - rank) orthonormal directions of the free motion."""
        return np.asarray(self._decomposed[2][self.rank :].T)

    @cached_property
    def dependent(self) -> list[int]:
        """Rows of which one may be left out without a change of the motion."""
        U = self._decomposed[0][:, self.rank :]
        return [int(r) for r in np.flatnonzero(np.linalg.norm(U, axis=1) > 1e-6)]

    @cached_property
    def _free_masses(self) -> tuple[Floats, Floats]:
        """(k,) masses of free directions, ascending, and these directions (n, k)."""
        model, V = self.model, self.free
        MV = np.zeros_like(V)
        for column in range(V.shape[1]):
            out = np.zeros(model.n)
            v = np.concatenate([V[:, column], np.zeros(model.q.size - model.n)])
            kernel.add_mass_times(model.unit, model.system.mass, 1.0, v, out)
            MV[:, column] = out
        masses, directions = np.linalg.eigh(V.T @ MV)
        return masses, np.asarray(V @ directions)

    @cached_property
    def massless(self) -> Floats:
        """(n, k) directions of the free motion in which nothing has mass."""
        return self.lighter_than(MASSLESS)

    def lighter_than(self, part: float) -> Floats:
        """(n, k) directions of the free motion with less than this part of the mean mass, the
        lightest first."""
        masses, directions = self._free_masses
        return np.asarray(directions[:, masses < part * self.model.system.mean])

    def across(self, gaps: Floats, rank: int) -> Floats:
        """(rank, k) displacements across the free motion that open gaps (rows, k) of the `rank`
        largest singular values, in the basis of these."""
        U, s, _ = self._decomposed
        return np.asarray((U[:, :rank].T @ gaps) / s[:rank, None])

    def _slip_of(self, phi: Floats, rank: int) -> Floats:
        """(rows,) slip of rolling rows that gaps `phi` of rows that depend on them go with: the
        combinations of rows that vanish have no gap then."""
        found = np.zeros_like(phi)
        rolling = self.model.row >= phi.size - self.model.system.rows.velocity
        lost = self._decomposed[0][:, rank:]
        if rolling.any() and lost.size:
            # combinations have length 1: a part as small as rounding is no part of one
            of, least = lost[rolling].T, 1e-6
            largest = float(np.linalg.norm(of, 2))
            if largest > least:
                found[rolling] = -np.linalg.lstsq(of, lost.T @ phi, rcond=least / largest)[0]
        return found

    def closed(self, step: Floats, rank: int) -> Linearised | None:
        """The position nearest to q + step (n, m) where Φ = 0, or None if it is not found.

        Of the singular values the `rank` largest are used: away from Φ = 0 rows that depend on the
        others look independent, and would pull back along the free motion. Small ones are
        regularised, so that the method works at singular positions too.
        """
        n, size = self.model.n, self.model.size
        q = self.q.copy()
        q[:n] += step
        at = tangent = Linearised(self.model, q)
        before, best, since = np.inf, np.inf, 0
        for _ in range(60):
            gap = float(np.abs(at.phi).max(initial=0.0))
            if gap < 1e-13 * size or gap > 1e3 * size:
                break
            if gap < 0.5 * best:
                best, since = gap, 0
            elif (since := since + 1) == _STALLED:
                break  # rows that are left out stay open
            if gap > 0.1 * before:  # the decomposition does not belong to this position any more
                tangent = at
            before = gap
            U, s, Vt = tangent._decomposed
            s = s[:rank]
            soft = s / (s**2 + (1e-8 * s.max(initial=0.0)) ** 2)
            q = at.q.copy()
            gaps = at.phi + tangent._slip_of(at.phi, rank)
            q[:n] -= Vt[:rank].T @ (soft * (U[:, :rank].T @ gaps))
            at = Linearised(self.model, q)
        return at if np.abs(at.phi).max(initial=0.0) < 1e-9 * size else None


def moving(model: Model, direction: Floats) -> list[str]:
    """Points and vectors that move in a direction (n,), by name, those that move most."""
    D = model.layout.dimension
    speed = np.linalg.norm(direction.reshape(-1, D), axis=1)
    layout = model.layout
    known = {**layout.of_auxiliary, **layout.of_vector, **layout.of_point}
    names = {b: n for n, b in known.items()}
    order = np.argsort(-speed, kind='stable')
    return [names[int(block)] for block in order if speed[block] > 0.1 * speed.max()]
