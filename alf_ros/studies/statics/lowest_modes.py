"""The lowest natural frequencies of a large mechanism, by shift-invert Lanczos.

(K + L - σ M) x + Jᵀ y = M b, J x = 0 is solved with the order-n factor of the step, for the
iterations of ARPACK (scipy.sparse.linalg.eigsh). The factor exists only if the shift σ lies below
the lowest ω², which gives a bracket of it. Where Lanczos converges slowly, the bracket is halved
and the shift comes nearer, which sets neighbouring frequencies apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.instant import DENSE, Instant
from alf_ros.studies.statics.rest_stability import SYMMETRIC
from alf_ros.studies.statics.sparse_rows import Sparse

_LEAST = -1e-9  # the first shift, of the scale of ω²
_GROWTH = 8.0  # of the shift downwards, until there is a factor
_RESTARTS = (4, 4, 8, 30)  # of Lanczos, with one shift after the other
_HALVES = 10  # of the bracket of the lowest ω², from one shift to the next
_INVERSE = 6  # iterations to an upper bound
_SOLVED = 1e-11  # part of x that the last round of a solve may change
_FEW = 24  # least dimension of the Krylov space


def lowest(instant: Instant, lam: Floats, count: int) -> tuple[Floats, Floats]:
    """The `count` lowest ω² (1/s²), ascending, and their motions (count, n) of unit mass.

    lam (rows,): λ of the instant, at rest. Raises InputError if there are not so many free motions
    with mass, or Lanczos does not converge.
    """
    if count >= instant.model.n - 1:
        raise _not_found(count, 'there are not so many')
    pencil = _Pencil.of(instant, lam)
    start = pencil.inverse(pencil.M @ np.random.default_rng(0).standard_normal(instant.model.n))
    for restarts in _RESTARTS:
        try:
            squares, motions = pencil.lanczos(count, start, restarts)
            _refuse_without_potential(instant, motions)
            return squares, motions
        except ArpackNoConvergence:
            pencil.come_nearer(start)
        except ValueError as error:  # of ARPACK, for a count that is too large
            raise _not_found(count, str(error)) from None
    raise _not_found(count, 'Lanczos does not converge')


def _refuse_without_potential(instant: Instant, motions: Floats) -> None:
    """Lanczos needs a symmetric stiffness: raises InputError if the modes have another."""
    K = instant.K
    skew = motions @ ((K - K.T) @ motions.T)
    size = np.abs(motions) @ (abs(K) @ np.abs(motions).T)
    if np.abs(skew).max(initial=0.0) > SYMMETRIC * size.max(initial=0.0):
        raise InputError(
            f'loads without a potential: their modes are told of up to {DENSE} coordinates',
            key='modes',
        )


def _not_found(count: int, why: str) -> InputError:
    return InputError(
        f'the lowest modes were not found: {why}',
        key='count',
        value=count,
        expected='fewer, or no more than there are free motions',
    )


@dataclass
class _Pencil:
    """H - ω² M on the directions that J leaves free, with a shift below the lowest ω², 1/s²."""

    H: Sparse
    M: Sparse
    J: Sparse
    q: Floats
    solve: ConstrainedSolve
    shift: float = 0.0

    @classmethod
    def of(cls, instant: Instant, lam: Floats) -> _Pencil:
        """Raises InputError if a free motion has no mass."""
        model = instant.model
        H = instant.K + instant.curvature(lam)
        H = (0.5 * (H + H.T)).tocsr()
        solve = ConstrainedSolve(model, instant.loads.tangents.cliques)
        made = cls(H, instant.M, instant.J_of_movable, instant.q, solve)
        mass = instant.M.diagonal()
        mass = np.where(mass > 0.0, mass, model.system.mean)
        rate = float((np.abs(H.diagonal()) / mass).max(initial=0.0)) or 1.0
        shift = _LEAST * rate
        while not made.factorised(shift):
            shift *= _GROWTH
            if shift < -1e6 * rate:
                raise InputError('a free motion has no mass', key='mechanism', expected='a mass')
        return made

    def factorised(self, shift: float) -> bool:
        """Whether the shift lies below the lowest ω²; then it is the shift from now on."""
        found = self.solve.factorise((self.H - shift * self.M).tocsr(), self.J, self.q)
        if found:
            self.shift = shift
        return found

    def inverse(self, b: Floats) -> Floats:
        """x (n,) of b (n,)."""
        nothing = np.zeros(self.J.shape[0])
        return self.solve.solve(np.asarray(b, dtype=float).ravel(), nothing, _SOLVED)[0]

    def lanczos(self, count: int, start: Floats, restarts: int) -> tuple[Floats, Floats]:
        """The lowest ω² and their motions. Raises ArpackNoConvergence."""
        n = start.size
        shape = n, n
        squares, shapes = eigsh(
            LinearOperator(shape, matvec=lambda x: self.H @ x, dtype=float),
            k=count,
            M=LinearOperator(shape, matvec=lambda x: self.M @ x, dtype=float),
            sigma=self.shift,
            OPinv=LinearOperator(shape, matvec=self.inverse, dtype=float),
            v0=start,
            ncv=min(n - 1, max(2 * count + 1, _FEW)),
            maxiter=restarts,
            tol=1e-12,
        )
        order = np.argsort(squares)
        return squares[order], shapes.T[order]

    def come_nearer(self, x: Floats) -> None:
        """Bring the shift nearer to the lowest ω²; x (n,): a free motion to begin with."""
        for _ in range(_INVERSE):
            x = self.inverse(self.M @ x)
            x = x / np.abs(x).max()
        above = float(x @ (self.H @ x) / (x @ (self.M @ x)))
        good = self.shift
        for _ in range(_HALVES):
            trial = 0.5 * (good + above)
            if self.factorised(trial):
                good = trial
            else:
                above = trial
        self.factorised(good)
