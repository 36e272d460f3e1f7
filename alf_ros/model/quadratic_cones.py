"""Where quadratic forms are zero together: a cone, in most mechanisms a few subspaces.

A form that is a product of two linear ones is zero on two hyperplanes, and a semidefinite one on
its null space. On each of these the other forms are looked at again: conditions that concern a
few directions each, as of loops side by side, are split one after the other, however many there
are. What does not split is solved by Newton's method from many places, in up to 7 dimensions.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import NOTHING

CROSSING = 'crossing'  # branches cross
TOUCHING = 'touching'  # branches have one tangent: to second order they do not differ
SHAKY = 'shaky'  # infinitesimally mobile: no motion begins in the directions gained
CURVED = 'curved'  # the cone is no union of subspaces
MANY = 'many'  # too many directions gained to look for branches
SMOOTH = 'smooth'  # nothing is gained, or all that is gained is free

SAME = 1e-5  # between directions of one branch
_MOST = 7  # dimensions in which Newton's method looks for lines: 64 at most
_LOOKS = 5000  # subspaces looked at, at most
_ROUNDED = 1e-13  # part of a form that is rounding
_STARTS, _ROUNDS = 24, 60  # of Newton's method for each line that there may be


def echelon(rows: Floats, columns: int, least: float = 0.0) -> tuple[Floats, list[int]]:
    """Combinations of the rows (k, …) by Gauss and Jordan with pivots above `least` among the
    first columns, and the columns of these: combinations that concern few columns each, where
    there are such."""
    found, left, pivots = rows.copy(), np.ones(columns), list[int]()
    for k in range(len(found)):
        size = np.abs(found[k:, :columns]) * left
        if not size.max(initial=0.0) > least:
            return found[:k], pivots
        row, at = divmod(int(np.argmax(size)), columns)
        found[[k, k + row]] = found[[k + row, k]]
        found[k] /= found[k, at]
        others = np.arange(len(found)) != k
        found[others] -= np.outer(found[others, at], found[k])
        left[at] = 0.0
        pivots.append(at)
    return found, pivots


def subspaces(forms: Floats, noise: float, local: Floats) -> tuple[str, list[Floats]]:
    """The subspaces, each with an orthonormal basis (dimension, r), in which quadratic forms
    (k, r, r) are zero, but for `noise`; and CROSSING, SHAKY, CURVED or MANY. None for the last
    two. `local` (r, r): a basis in which a form concerns few directions, as far as there is one.
    """
    search = _Search(noise)
    forms = forms / np.abs(forms).max(axis=(1, 2), keepdims=True)
    local = local / np.linalg.norm(local, axis=1, keepdims=True)
    kind = search.look_at(local, local @ forms @ local.T, np.zeros((0, len(local))))
    if kind:
        return kind, []
    # a subspace within another is no branch of its own
    branches: list[Floats] = []
    for piece in sorted(search.found, key=len, reverse=True):
        if len(piece) and not any(_is_within(piece, other) for other in branches):
            branches.append(piece)
    return (CROSSING, branches) if branches else (SHAKY, [np.zeros((0, forms.shape[1]))])


class _Search:
    """Subspaces in which quadratic forms are zero, found by splitting one after the other."""

    def __init__(self, noise: float) -> None:
        self.found: list[Floats] = []
        self._noise, self._looks = noise, 0

    def look_at(self, basis: Floats, forms: Floats, other: Floats) -> str:
        """Find those in the subspace with a basis (d, r), on which the forms are (k, d, d).

        Not those in which one of the linear forms `other` (…, d) is zero too: they are found
        elsewhere. Returns CURVED or MANY if that fails.
        """
        self._looks += 1
        if self._looks > _LOOKS:
            return MANY
        if (np.linalg.norm(other, axis=1) < SAME).any():
            return ''
        forms = forms[np.abs(forms).max(axis=(1, 2), initial=0.0) > self._noise]
        apart = _apart(forms, self._noise)
        parts = _split(np.concatenate([apart, forms]), self._noise, other)
        if not len(forms):
            self.found.append(np.linalg.qr(basis.T)[0].T)
        elif parts is None:
            triangle = np.linalg.qr(basis.T)[1]
            turned = np.linalg.solve(triangle.T, np.eye(len(triangle)))
            kind, lines = _unsplit(turned @ forms @ turned.T, self._noise)
            self.found += [line @ turned @ basis for line in lines]
            return kind
        for part, more in parts or ():
            further = np.vstack([other, more]) @ part.T
            kind = self.look_at(part @ basis, part @ forms @ part.T, further)
            if kind:
                return kind
        return ''


def _is_within(basis: Floats, other: Floats) -> bool:
    if len(basis) > len(other):
        return False
    return bool(np.abs(basis - basis @ other.T @ other).max(initial=0.0) < SAME)


def _apart(forms: Floats, noise: float) -> Floats:
    """Combinations of the forms (k, d, d) that concern few pairs of directions each; without those
    that are zero."""
    d = forms.shape[1]
    above = np.triu_indices(d)
    rows = forms[:, above[0], above[1]]
    felt = np.flatnonzero(np.abs(rows).max(axis=0, initial=0.0) > _ROUNDED)
    rows, _ = echelon(rows[:, felt], len(felt), noise)
    found = np.zeros((len(rows), d, d))
    at = above[0][felt], above[1][felt]
    found[:, at[0], at[1]] = found[:, at[1], at[0]] = rows
    return found


def _split(forms: Floats, noise: float, other: Floats) -> list[tuple[Floats, Floats]] | None:
    """The subspaces where one of the forms (k, d, d) is zero, and linear forms (…, d) that are
    also not zero there; preferably of a form with one subspace. `other` (…, d): linear forms that
    are not zero. None if no form splits."""
    two: list[tuple[Floats, Floats]] | None = None
    for form in forms:
        felt = np.flatnonzero(np.abs(form).max(axis=1) > _ROUNDED)
        values, vectors = np.linalg.eigh(form[np.ix_(felt, felt)])
        factors = np.zeros((2, len(form)))
        above, below = values > noise, values < -noise
        if not above.any() or not below.any():
            normals = np.zeros((int((above | below).sum()), len(form)))
            normals[:, felt] = vectors[:, above | below].T
            return [(_zeros_of(normals), factors[:0])]
        if above.sum() == below.sum() == 1 and two is None:
            one = np.sqrt(values[-1]) * vectors[:, -1]
            minus = np.sqrt(-values[0]) * vectors[:, 0]
            factors[:, felt] = one + minus, one - minus
            factors /= np.linalg.norm(factors, axis=1, keepdims=True)
            known = [_is_among(factor, other) for factor in factors]
            parts = [_zeros_of(factor[None]) for factor in factors]
            if any(known):
                return [(parts[int(known[0])], factors[:0])]
            two = [(parts[0], factors[:0]), (parts[1], factors[:1])]
    return two


def _is_among(factor: Floats, others: Floats) -> bool:
    others = others / np.linalg.norm(others, axis=1, keepdims=True)
    return bool((np.abs(np.abs(others @ factor) - 1.0) < SAME**2).any())


def _zeros_of(normals: Floats) -> Floats:
    """(d - k, d) a basis of what linear forms (k, d) are zero on, of few directions each."""
    normals, pivots = echelon(normals, normals.shape[1])
    basis = np.eye(normals.shape[1])
    basis[:, pivots] -= normals.T
    basis = np.delete(basis, pivots, axis=0)
    return np.asarray(basis / np.linalg.norm(basis, axis=1, keepdims=True))


def _unsplit(forms: Floats, noise: float) -> tuple[str, list[Floats]]:
    """The same of forms (k, d, d) of which none splits."""
    d = forms.shape[1]
    _, s, Vt = np.linalg.svd(forms.reshape(-1, d))
    relevant = int((s > noise * s.max()).sum())
    inner, outer = Vt[:relevant], Vt[relevant:]
    if relevant > _MOST:
        return MANY, []
    seen = inner @ forms @ inner.T
    _, s, Vt = np.linalg.svd(seen.reshape(len(seen), -1), full_matrices=False)
    kept = s > noise * s.max()
    if kept.sum() == 1:
        return CURVED, []
    kind, lines = _lines(Vt[kept].reshape(-1, relevant, relevant), noise)
    return kind, [np.vstack([line @ inner, outer]) for line in lines]


def _lines(forms: Floats, noise: float) -> tuple[str, list[Floats]]:
    """By Newton's method: the subspaces in which forms (k, r, r) that depend on all of r are
    zero."""
    r = forms.shape[1]
    forms = forms / np.abs(forms).max(axis=(1, 2), keepdims=True)
    found: list[Floats] = []
    for t in _zeros(forms):
        tangents = np.linalg.svd(forms @ t)
        rank = int((tangents[1] > 10.0 * noise).sum())
        basis = tangents[2][rank:]
        if np.abs(basis @ forms @ basis.T).max() > noise:
            basis = _double(forms, t, tangents[0][:, rank:])[None, :]
        projector = basis.T @ basis
        if all(np.abs(projector - b.T @ b).max() > SAME for b in found):
            found.append(basis)
        if len(found) > 2 ** (r - 1):  # of a curve there is no end
            return CURVED, []
    return '', found


def _double(forms: Floats, t: Floats, combinations: Floats) -> Floats:
    """The double zero near t (r,), where the gradients of `combinations` (k, …) of the forms are
    zero too: without them it is known to half of the digits only."""
    for _ in range(4):
        flat = np.einsum('kc,kij->cij', combinations, forms) @ t
        J = forms @ t
        gradients = np.vstack(
            [2.0 * J, np.einsum('kc,kij->cij', combinations, forms).reshape(-1, t.size)]
        )
        values = np.concatenate([J @ t, flat.ravel()])
        t = t - np.linalg.lstsq(gradients, values, rcond=1e-6)[0]
        t /= np.linalg.norm(t)
        combinations = np.linalg.svd(forms @ t)[0][:, -combinations.shape[1] :]
    return t


def _zeros(forms: Floats) -> Floats:
    """Common zeros t (…, r) of the forms, of length 1, as Newton's method finds them from many
    places: each line again and again."""
    r = forms.shape[1]
    starts = _STARTS * 2 ** (r - 1)
    t = np.random.default_rng(0).standard_normal((starts, r))
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    for _ in range(_ROUNDS):
        J = np.einsum('kij,sj->ski', forms, t)
        value = np.einsum('ski,si->sk', J, t)
        step = np.einsum('sik,sk->si', np.linalg.pinv(2.0 * J, rcond=1e-10), value)
        size = np.linalg.norm(step, axis=1, keepdims=True)
        t -= step * np.minimum(1.0, 0.5 / np.maximum(size, NOTHING))
        t /= np.maximum(np.linalg.norm(t, axis=1, keepdims=True), NOTHING)
    missed = np.abs(np.einsum('kij,si,sj->sk', forms, t, t)).max(axis=1)
    return np.asarray(t[missed < 1e-12])
