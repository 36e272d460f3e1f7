"""Branches of the motion through a singular position, and starts in one.

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
from typing import NoReturn

import numpy as np
from scipy.linalg import eigh

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel import System, Work
from alf_ros.kernel.data import NOTHING
from alf_ros.model import assembly
from alf_ros.model.assembly import Given
from alf_ros.model.compile import Model, allocate, hold
from alf_ros.model.prescribed import prescribe
from alf_ros.model.rank import effective_rank

CROSSING = 'crossing'  # branches cross
TOUCHING = 'touching'  # branches have one tangent: to second order they cannot be told apart
SHAKY = 'shaky'  # infinitesimally mobile: no motion begins in the directions gained
CURVED = 'curved'  # the cone is no union of subspaces
MANY = 'many'  # too many directions gained to look for branches
SMOOTH = 'smooth'  # nothing is gained, or all that is gained is free

# σ over its ordinary value, from which down a position is taken for the singular one. Φ is open by
# ε, which turns the direction of a row by ε / x²; the branch turns by x: equal at x = ε^(1/3).
IN = 5e-6
_PASSES = 3  # of the projection onto a null space
_MORE = 2  # vectors beyond those expected
_NONE = 1e-9  # part of its terms, from which down a sum counts as zero
_SMALL = 1e-3  # part of the largest term of all rows that the terms of a sum are, at least
_TYPED = 1e-6  # part of the terms by which velocities given may miss the second-order condition
_MOST = 7  # dimensions of a cone whose branches are looked for: 64 branches at most
_STARTS, _ROUNDS = 24, 60  # of Newton's method for each branch that there may be
_SAME = 1e-5  # between directions of one branch
_POINTS, _BRANCHES = 3, 4  # named in a message
_WIDE = 60  # freedoms, from which on null spaces are not looked at
_NOT_ENUMERATED = (
    'a singular position whose branches are not enumerated: velocities are not completed there; '
    'give those of more points'
)
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


@dataclass(frozen=True, eq=False)
class Position:
    """A position of a mechanism, to second order.

    `q` (blocks D, m) at `t` (s); `free` (freedoms, blocks D): directions with Φ_q v = 0,
    orthonormal in the metric of M; `lost` (k, rows): left null vectors, in the kernel's order of
    rows; `x`: the largest singular value that was taken for zero, over the ordinary one; `drift`
    (blocks D): velocities that drives ask for, of least kinetic energy; `pushed` (rows,): Φ_q,s s̈.
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
        """The branches; none if CURVED or MANY, where they are not enumerated."""
        return self._found[1]

    def miss(self, qd: Floats) -> float:
        """By how much q̇ (blocks D, m/s) misses nᵀ c = 0, as a part of the terms of the sum."""
        c = _convective(self.model, qd) + self.pushed
        return float(np.max(np.abs(self.lost @ c) / self._size(c), initial=0.0))

    def can_begin(self, qd: Floats) -> bool:
        """Whether a motion may begin with q̇ (blocks D, m/s), for which Φ_q q̇ + Φ_t = 0."""
        return self.miss(qd) <= _TYPED + 100.0 * self.x

    def pull(self, Q: Floats) -> Floats:
        """(freedoms,) what forces Q (blocks D, N) do to a mechanism at rest, along `free`; 0 if it
        is no more than where the position lies beside the singular one."""
        n = self.model.n
        pull = self.free[:, :n] @ Q[:n]
        hardest = np.abs(Q[:n]).max(initial=0.0) / np.sqrt(self.model.system.mean)
        nothing = max(_NONE, 100.0 * self.x) * hardest
        return np.asarray(np.where(np.abs(pull).max(initial=0.0) > nothing, pull, 0.0))

    def departure(self, Q: Floats) -> Branch | None:
        """The branch on which forces Q (blocks D, N) set the mechanism going from rest; None if
        they do nothing, or if branches are not enumerated.

        By Gauss's principle of least constraint: the branch that lets the mechanism accelerate
        most nearly as it would without the rows that are lost. Raises AssemblyError if no branch
        lets it accelerate, or if two do it alike.
        """
        n, pull = self.model.n, self.pull(Q)
        if not pull.any() or self.kind in (SMOOTH, CURVED, MANY):
            return None
        works = [float(np.linalg.norm(each.directions[:, :n] @ Q[:n])) for each in self.branches]
        order = np.argsort(works)[::-1]
        if not works or works[order[0]] <= max(_NONE, 100.0 * self.x) * np.linalg.norm(pull):
            raise AssemblyError(_shaky(self), key='initial.positions')
        if len(works) > 1 and works[order[1]] > (1.0 - _TIE) * works[order[0]]:
            raise AssemblyError(
                'at rest in a singular position where forces act alike on two branches: the motion'
                f' that begins is not unique; give velocities along {described(self)}',
                key='initial.velocities',
            )
        return self.branches[order[0]]

    @cached_property
    def _found(self) -> tuple[str, tuple[Branch, ...]]:
        forms, rate = self._forms
        if not len(forms):
            return SMOOTH, (Branch(self.free, self.drift),)
        dimension = forms.shape[1]
        _, s, Vt = np.linalg.svd(forms.reshape(-1, dimension))
        relevant = int((s > self._noise * s.max()).sum())
        inner, outer = Vt[:relevant], Vt[relevant:]
        if relevant > _MOST:
            return MANY, ()
        seen = np.einsum('ai,kij,bj->kab', inner, forms, inner)
        kind, cones = _subspaces(seen, 100.0 * self._noise)
        if relevant == 1 and len(outer):  # a double zero
            kind = TOUCHING
        made = (self._branch(np.vstack([cone @ inner, outer]), rate) for cone in cones)
        return kind, tuple(branch for branch in made if branch is not None)

    def _branch(self, coordinates: Floats, rate: float) -> Branch | None:
        """Of a subspace (dimension, freedoms + 1) of (z, τ): what has τ = `rate`; None without."""
        if not self.is_driven:
            return Branch(coordinates @ self.free, self.drift)
        z, tau = coordinates[:, :-1], coordinates[:, -1]
        if np.abs(tau).max(initial=0.0) <= _SAME:
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
            felt = asked > self._noise * self._size(self.pushed).max(initial=0.0)
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

    def _size(self, c: Floats) -> Floats:
        """(k,) how large the terms of nᵀ c are, for c (rows,)."""
        largest = np.abs(np.sqrt(self.model.system.rows.alpha) * c).max(initial=NOTHING)
        return np.asarray(np.maximum(np.abs(self.lost) @ np.abs(c), _SMALL * largest))

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
                plus = _convective(self.model, basis[i] + basis[j])
                both = 0.25 * (plus - _convective(self.model, basis[i] - basis[j]))
                if i == j == len(self.free):
                    both += pushed
                forms[:, i, j] = forms[:, j, i] = self.lost @ both
                sizes[:, i, j] = sizes[:, j, i] = self._size(both)
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
    _linearise(model, system, work)
    free, sigmas = _null(model, system, work)
    lost, lost_sigmas = _left_null(model, work)
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


# ----------------------------------------------------------------------------------------- starts


def start(
    model: Model, q: Floats, given: Given, dependent: int, near: bool, t: float = 0.0
) -> tuple[Floats, Position | None]:
    """Velocities q̇ (blocks D, m/s) of a start at q (blocks D, m), completed from those given; and
    the position, if it is a singular one where not too many freedoms are gained to look at.

    In an ordinary position as `assembly.complete` does. In a singular one all that is given must
    fit one branch, and what is free on it gets the least kinetic energy. `dependent`: rows that
    depend on others in ordinary positions; `near`: whether q is `assembly.within` a singular one.

    Raises AssemblyError if nothing fits, naming the constraints or the branches, and if several
    branches fit with different velocities.
    """
    if near and _freedoms(model, q) > _WIDE:
        return _start_of_many(model, q, given, t), None
    here = position(model, q, t) if near or (dependent and _is_tight(model, q, t)) else None
    if here is None or (len(here.lost) <= dependent and here.kind == SMOOTH):
        return assembly.complete(model, q, given, t, beside=near), None
    moving = any(value for values in given.values() for value in values)
    if not moving and not here.is_driven:
        return np.zeros_like(q), here
    if not moving and not here.drift.any():
        _check_setting_off(here)
    if not _freedoms_left(here, given):
        tolerance = 1e-9 + 100.0 * here.x
        qd = assembly.complete(model, q, given, t, None, tolerance, beside=True)
        if not here.can_begin(qd):
            _refuse(here, given, [])
        return qd, here
    if here.kind in (CURVED, MANY):
        raise AssemblyError(_NOT_ENUMERATED, key='initial.velocities')
    fitting = _fitting(here, given)
    if len(fitting) != 1:
        _refuse(here, given, fitting)
    return fitting[0], here


def _start_of_many(model: Model, q: Floats, given: Given, t: float) -> Floats:
    """The same in a singular position with so many freedoms that no null space is looked at."""
    qd = assembly.complete(model, q, given, t)
    if not qd.any():
        return qd
    held, _, _ = hold(model, assembly.held(model, given), velocities=True)
    if _freedoms(replace(model, system=held), q):
        raise AssemblyError(_NOT_ENUMERATED, key='initial.velocities')
    if _accelerated(model, q, qd, t)[1] > _TYPED:
        raise AssemblyError(
            'a singular position: no motion begins there with the velocities given; its branches '
            'are not enumerated',
            key='initial.velocities',
        )
    return qd


def _freedoms(model: Model, q: Floats) -> int:
    """Freedoms of velocity at q (blocks D, m), as the penalty tells."""
    work = allocate(model, model.system, 0)
    work.q[:] = q
    _linearise(model, model.system, work)
    return round(model.n - effective_rank(model, work))


def _check_setting_off(here: Position) -> None:
    """Raise AssemblyError if drives set a mechanism at rest going on more branches than one.

    From rest q̈ takes the place of q̇: Φ⁗ = 0 asks of it what Φ̈ = 0 asks of q̇.
    """
    qdd, _ = _accelerated(here.model, here.q, np.zeros_like(here.q), here.t)
    going = replace(here, drift=qdd, pushed=np.zeros_like(here.pushed))
    if here.can_begin(np.zeros_like(here.q)) and len(going.branches) != 1:
        where = f': {described(going)} m/s²' if going.branches else ''
        raise AssemblyError(
            'drives begin at rest in a singular position, and accelerate: the motion that begins '
            f'is not unique{where}; let them begin with a speed, or elsewhere',
            key='drives',
        )


def _freedoms_left(here: Position, given: Given) -> int:
    """How many of the directions that are free move nothing whose velocity is given."""
    at, _ = _components(here.model, given)
    s = np.linalg.svd(here.free[:, at], compute_uv=False) if len(here.free) else np.zeros(0)
    least = max(1e-6, 100.0 * here.x) * np.abs(here.free).max(initial=0.0)
    return len(here.free) - int((s > least).sum())


def _components(model: Model, given: Given) -> tuple[list[int], Floats]:
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


def _on(here: Position, branch: Branch, given: Given) -> Floats | None:
    """The velocities of least kinetic energy on a branch with those given; None if none fit."""
    at, values = _components(here.model, given)
    picked, wanted = branch.directions[:, at], values - branch.drift[at]
    U, s, Vt = np.linalg.svd(picked, full_matrices=False)
    told = s > max(1e-6, 100.0 * here.x) * np.abs(branch.directions).max(initial=0.0)
    weights = U[:, told] @ ((Vt[told] @ wanted) / s[told])
    left = wanted - weights @ picked
    size = max(np.abs(values).max(initial=0.0), np.abs(branch.drift).max(initial=0.0))
    if np.abs(left).max(initial=0.0) > (1e-9 + 100.0 * here.x) * size:
        return None
    return np.asarray(branch.drift + weights @ branch.directions)


def _fitting(here: Position, given: Given) -> list[Floats]:
    """The velocities with those given on each branch where some fit; once those that are alike."""
    found: list[Floats] = []
    for branch in here.branches:
        qd = _on(here, branch, given)
        if qd is not None:
            nearest = min((np.abs(qd - other).max() for other in found), default=np.inf)
            if nearest > _SAME * np.abs(qd).max():
                found.append(qd)
    return found


def _is_tight(model: Model, q: Floats, t: float) -> bool:
    """Whether rows that depend on others keep some velocity from beginning a motion, which they do
    not do in a mechanism: for positions that are not singular."""
    random = np.zeros_like(q)
    random[: model.n] = np.random.default_rng(0).standard_normal(model.n)
    try:
        qd = assembly.complete(model, q, {}, t, near=random)
    except AssemblyError:
        return False  # it is said where velocities are completed
    return _accelerated(model, q, qd, t)[1] > _TYPED


def _accelerated(model: Model, q: Floats, qd: Floats, t: float) -> tuple[Floats, float]:
    """The least q̈ (blocks D, m/s²) in the metric of M with Φ_q q̈ + c = 0 at t (s), for positions
    that are not singular; and what it leaves of that, as a part."""
    work, rows = allocate(model, model.system, 0), model.system.rows
    work.q[:] = q
    rates, x = np.zeros_like(q), np.zeros_like(q)
    prescribe(model.system, t, work.q, rates, x)
    _linearise(model, model.system, work)
    kernel.times_jacobian(model.unit, rows, work.g, work.g2, x, work.r2)
    work.r2[:] = -_convective(model, qd) - work.r2
    size = float(np.max(np.abs(work.r2) * rows.scale, initial=0.0))
    kernel.augmented(model.unit, model.system, work, work.p, x, 100, 1e-12, 1.0)
    left = float(np.max(np.abs(work.r2) * rows.scale, initial=0.0))
    return x, left / max(size, NOTHING)


def _refuse(here: Position, given: Given, fitting: Sequence[Floats]) -> NoReturn:
    if len(fitting) > 1:
        raise AssemblyError(
            f'a singular position: the velocities given fit {len(fitting)} branches, '
            f'{_listed(here.model, _fastest_first(fitting))} m/s; give more of them',
            key='initial.velocities',
        )
    if here.kind == SHAKY and not any(branch.dimension for branch in here.branches):
        raise AssemblyError(_shaky(here), key='initial.velocities')
    if not any(value for values in given.values() for value in values):
        raise AssemblyError(
            'a singular position: no motion begins there with what drives ask for',
            key='drives',
        )
    where = 'its branches are not enumerated'
    if here.branches:
        where = f'its branches go {described(here, given)} m/s'
    raise AssemblyError(
        f'a singular position: no motion begins there with the velocities given; {where}',
        key='initial.velocities',
    )


def _shaky(here: Position) -> str:
    names = ', '.join(_moving(here.model, here.free)[:6])
    return f'infinitesimally mobile only (shaky): no motion begins here, though {names} may yield'


# ------------------------------------------------------------------------------------------ words


def described(
    here: Position, given: Given | None = None, branches: Sequence[Branch] | None = None
) -> str:
    """Branches of a position, or all, in words: 'A: [-1, 0] with B: [-2, 0], or B: [0, 0]'.

    Of a branch that is a line its direction, as fast as what is `given` says; of one with more
    freedoms only how many there are.
    """
    branches = here.branches if branches is None else branches
    lines = [branch for branch in branches if branch.dimension <= 1]
    velocities = []
    for branch in lines:
        velocities.append(branch.drift if here.is_driven else branch.directions[0])
    at, values = _components(here.model, given or {})
    velocities = _alike(here.model, velocities, at, values) if not here.is_driven else velocities
    parts = [_listed(here.model, _fastest_first(velocities))] if velocities else []
    wide = [f'a branch of {b.dimension} freedoms' for b in branches if b.dimension > 1]
    return ', or '.join(parts + wide[:_BRANCHES])


def _alike(
    model: Model, velocities: Sequence[Floats], at: Sequence[int], values: Floats
) -> list[Floats]:
    """Directions at the speed of the first component that all of them move: one of those given, or
    1 m/s of a point."""
    n = model.n
    wanted = [(place, value) for place, value in zip(at, values, strict=True) if value]
    D = model.layout.dimension
    points = [block * D + axis for block in model.layout.of_point.values() for axis in range(D)]
    wanted += [(place, 1.0) for place in points if place < n]
    for place, value in wanted:
        if all(abs(v[place]) > 0.1 * np.abs(v[:n]).max() for v in velocities):
            return [v * (value / v[place]) for v in velocities]
    return [v / v[np.argmax(np.abs(v[:n]))] for v in velocities]


def _fastest_first(velocities: Sequence[Floats]) -> list[Floats]:
    return sorted(velocities, key=lambda v: -round(float(np.linalg.norm(v)), 6))


def _listed(model: Model, velocities: Sequence[Floats]) -> str:
    """What moves alike, then what does not, alternative by alternative."""
    shown = [_by_name(model, v) for v in velocities[:_BRANCHES]]
    names = list(shown[0])
    common = [n for n in names if len({each[n] for each in shown}) == 1]
    moving = [n for n in common if shown[0][n].strip('[]0, ')]
    apart = [n for n in names if n not in common][:_POINTS]
    first = ', '.join(f'{n}: {shown[0][n]}' for n in moving[: 1 if apart else _POINTS])
    more = [', '.join(f'{n}: {each[n]}' for n in apart) for each in shown] if apart else []
    text = ', or '.join(more)
    if len(velocities) > _BRANCHES:
        text += f', or {len(velocities) - _BRANCHES} others'
    return f'{first} with {text}' if first and text else first or text


def _by_name(model: Model, v: Floats) -> dict[str, str]:
    """Velocities of what moves, by name, in words: m/s, of vectors 1/s."""
    layout, D = model.layout, model.layout.dimension
    fastest = np.abs(v).max(initial=NOTHING)
    found = {}
    for items, blocks, unit in (
        (model.mechanism.points, layout.of_point, 1.0),
        (model.mechanism.vectors, layout.of_vector, layout.length),
    ):
        for item in items:
            if not item.fixed:
                rate = v[blocks[item.name] * D : (blocks[item.name] + 1) * D]
                rounded = np.where(np.abs(rate) > 1e-5 * fastest, rate / unit, 0.0)
                found[item.name] = f'[{", ".join(f"{x:.4g}" for x in rounded)}]'
    return found


def _moving(model: Model, directions: Floats) -> list[str]:
    """Names of the points and vectors that move in any of the directions."""
    fastest = np.abs(directions).max(axis=0, initial=0.0)
    return [name for name, text in _by_name(model, fastest).items() if text.strip('[]0, ')]


# ------------------------------------------------------------------------------------ null spaces


def _linearise(model: Model, system: System, work: Work) -> None:
    if not kernel.linearise(model.unit, system, work, work.q):
        raise AssemblyError('a point that moves has neither mass nor constraint', key='points')


def _null(model: Model, system: System, work: Work) -> tuple[Floats, Floats]:
    """Directions (d, blocks D), orthonormal in the metric of M, and the singular value σ of each:
    those with s² = penalty σ² < 1.

    A⁻¹M = 1 - A⁻¹ Φ_qᵀ α Φ_q leaves a part 1 / (1 + s²) of each mode: of random vectors it leaves
    what is wanted. In this form rounding falls with what is still to go.
    """
    n, rows, unit = model.n, system.rows, model.unit
    expected = n - effective_rank(replace(model, system=system), work)
    count = min(n, int(np.ceil(expected)) + _MORE)
    X = np.zeros((count, model.q.size))
    X[:, :n] = np.random.default_rng(0).standard_normal((count, n))
    rate, forms = np.zeros(rows.alpha.size), np.zeros((count, rows.alpha.size))
    for _ in range(_PASSES):
        for x in X:
            kernel.times_jacobian(unit, rows, work.g, work.g2, x, rate)
            x[:n] -= _held(model, system, work, rows.alpha * rate)[:n]
        X[:, :n] = np.linalg.qr(X[:, :n].T)[0].T
    momenta = np.zeros((count, n))
    for x, p, form in zip(X, momenta, forms, strict=True):
        kernel.add_mass_times(unit, system.mass, 1.0, x, p)
        kernel.times_jacobian(unit, rows, work.g, work.g2, x, form)
    stiff = (forms * rows.alpha) @ forms.T
    share, vectors = eigh(stiff, stiff + X[:, :n] @ momenta.T)  # s² / (1 + s²)
    kept = share < 0.5
    share = np.clip(share[kept], 0.0, None)
    directions = (vectors[:, kept] / np.sqrt(1.0 - share)).T @ X
    return directions, np.sqrt(share / (1.0 - share) / system.penalty)


def _left_null(model: Model, work: Work) -> tuple[Floats, Floats]:
    """Vectors n (k, rows) and the σ of each, in the same way from 1 - α^½ Φ_q A⁻¹ Φ_qᵀ α^½."""
    system, unit = model.system, model.unit
    rows, root = system.rows, np.sqrt(system.rows.alpha)
    m = root.size
    expected = m - effective_rank(model, work)
    count = min(m, int(np.ceil(expected)) + _MORE)
    Y = np.random.default_rng(0).standard_normal((count, m))
    rate = np.zeros(m)
    for _ in range(_PASSES):
        for y in Y:
            x = _held(model, system, work, root * y)
            kernel.times_jacobian(unit, rows, work.g, work.g2, x, rate)
            y -= root * rate
        Y = np.linalg.qr(Y.T)[0].T
    G = np.zeros((count, model.q.size))
    for y, g in zip(Y, G, strict=True):
        kernel.add_transposed(unit, rows, work.g, work.g2, root * y, g)
    solved = np.array([_held(model, system, work, root * y) for y in Y]).reshape(G.shape)
    share, vectors = np.linalg.eigh(G[:, : model.n] @ solved[:, : model.n].T)
    kept = share < 0.5
    share = np.clip(share[kept], 0.0, None)
    return (vectors[:, kept].T @ Y) * root, np.sqrt(share / (1.0 - share) / system.penalty)


def _held(model: Model, system: System, work: Work, y: Floats) -> Floats:
    """(blocks D,) A⁻¹ Φ_qᵀ y, 0 for what does not move."""
    x = np.zeros(model.q.size)
    kernel.add_transposed(model.unit, system.rows, work.g, work.g2, y, x)
    x[model.n :] = 0.0
    kernel.solve(model.unit, system.pattern, work.diagonal, work.off, x)
    return x


def _convective(model: Model, qd: Floats) -> Floats:
    """(rows,) Φ̇_q q̇ of q̇ (blocks D, m/s)."""
    rows = model.system.rows
    rate, out = np.zeros(rows.b.size), np.zeros(rows.alpha.size)
    kernel.jacobian_rate(model.unit, rows, qd, rate)
    kernel.convective(model.unit, rows, rate, qd, out)
    return out


# ------------------------------------------------------------------------------------------ cones


def _subspaces(forms: Floats, noise: float) -> tuple[str, list[Floats]]:
    """The subspaces, each with an orthonormal basis (dimension, r), in which quadratic forms
    (k, r, r) that depend on all of r are zero, but for `noise`; and what kind of cone they make.
    """
    if len(forms) == 1:
        return _of_one(forms[0])
    r = forms.shape[1]
    forms = forms / np.abs(forms).max(axis=(1, 2), keepdims=True)
    found: list[Floats] = []
    for t in _zeros(forms):
        tangents = np.linalg.svd(forms @ t)
        rank = int((tangents[1] > 10.0 * noise).sum())
        basis = tangents[2][rank:]
        if np.abs(np.einsum('ai,kij,bj->kab', basis, forms, basis)).max() > noise:
            basis = _double(forms, t, tangents[0][:, rank:])[None, :]
        projector = basis.T @ basis
        if all(np.abs(projector - b.T @ b).max() > _SAME for b in found):
            found.append(basis)
        if len(found) > 2 ** (r - 1):  # of a curve there is no end
            return CURVED, []
    # a subspace within another is no branch of its own
    found = [b for b in found if not any(_is_within(b, other) for other in found)]
    return (CROSSING, found) if found else (SHAKY, [np.zeros((0, r))])


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


def _of_one(form: Floats) -> tuple[str, list[Floats]]:
    """Of one form that depends on all of r: zero on two hyperplanes, on one, or nowhere else."""
    values, vectors = np.linalg.eigh(form)
    r = len(values)
    if r == 1:
        return SHAKY, [np.zeros((0, 1))]
    if values[0] * values[-1] > 0.0:  # definite
        return SHAKY, [np.zeros((0, r))]
    if r > 2:
        return CURVED, []
    along, across = np.sqrt(-values[0]) * vectors[:, 0], np.sqrt(values[1]) * vectors[:, 1]
    normals = (along + across, along - across)
    return CROSSING, [np.array([[-b, a]]) / np.hypot(a, b) for a, b in normals]


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


def _is_within(basis: Floats, other: Floats) -> bool:
    if len(basis) >= len(other):
        return False
    return bool(np.abs(basis - basis @ other.T @ other).max() < _SAME)
