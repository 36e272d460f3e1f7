"""Redundant constraint rows that contradict each other by a little, as drawn by CAD.

A redundant mechanism moves only if its lengths fulfil conditions, such as equal cranks. Where the
lengths miss a condition by e, the rows are closed as drawn, but at no position nearby: strictly
the mechanism is a structure, and steps fail or lose energy. Up to 1e-8 of the size the
ideal mechanism is meant: shapes are adjusted by the least changes with which all rows agree, and
the changes are stated. What cannot be adjusted is refused.

A mechanism without redundant rows is not looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, lsmr

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel import Work
from alf_ros.kernel.data import EPS
from alf_ros.mechanism import GROUND, Body, Frame, Joint, Mechanism, Numbers
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.assembly import ordinary
from alf_ros.model.compile import Model, allocate, compile_model, hold
from alf_ros.model.constraints.rows import joint_rows, rigidity
from alf_ros.model.joints import type_of
from alf_ros.model.rank import distance, effective_rank

LARGEST = 1e-8  # gap, of the size: lengths that differ by more are not meant to be equal
_EXACT = 2.0  # rounding units of the coordinates: exact lengths leave less open than that
_GOOD = 16.0  # the same: what adjusted lengths may leave open
_PENALTY = 1e8  # tells σ above 1e-3 from those that a gap below LARGEST makes
_CLEAR = 0.1  # distance to a singular position, of the ordinary one, below which nothing counts
_ASTRAY = 1e-3  # gap, of the size, above which a way has lost the mechanism
_STEP = 0.1  # of the size, from place to place
_FEW, _MANY = 8, 48  # places on each way: to see whether rows agree, and to make them agree
_WAYS = 6  # at most; one freedom has two
_ROUNDS = 8  # of Gauss and Newton, at most
_DAMPING = 1e-4  # of changes that are hardly felt at any place
_DIFFERENCE = 1e-7  # of the size, for derivatives: rows are of low degree in the shapes


@dataclass(frozen=True)
class Adjustment:
    """By how much shapes were changed so that redundant rows agree.

    changes: the largest change (m) of each body, joint, fixed point or vector, by name; of a
    direction, times the size of the mechanism. gap: by how much rows were open before, m.
    """

    changes: Mapping[str, float]
    gap: float

    def __str__(self) -> str:
        largest = sorted(self.changes.items(), key=lambda each: -each[1])
        named = ', '.join(f'{name} by {change:.2g} m' for name, change in largest[:6])
        more = f' and {len(largest) - 6} more' if largest[6:] else ''
        return (
            f'redundant constraints contradict each other by {self.gap:.2g} m where the mechanism '
            f'moves; adjusted so that they agree: {named}{more}'
        )


def made_consistent(
    model: Model, q: Floats, dependent_rows: int
) -> tuple[Mechanism, Adjustment] | None:
    """The mechanism of `model` with shapes whose redundant rows agree; None if they do already.

    q (blocks D, m): a closed position, of which so many rows depend on others. Raises
    AssemblyError if rows contradict each other by more than 1e-8 of the size, or whatever
    the shapes.
    """
    if not dependent_rows:
        return None
    mechanism = model.mechanism
    if mechanism.drives or model.system.rows.velocity:  # free, so that all rows can be met
        free = _compiled(replace(mechanism, drives=()))
        q = _carried(model.layout, q, free)
        dependent_rows, _, sigma = ordinary(free, q)
        if not dependent_rows:
            return None
        model = free.accustomed(sigma, dependent_rows)
    model = model.with_penalty(_PENALTY)
    walk = _Walk(model, dependent_rows)
    gap = walk.gap(walk.places(q, _FEW))
    if gap <= _EXACT * walk.rounding:
        return None
    places = walk.places(q, _MANY)
    if not places:
        return None
    gap = walk.gap(places)
    if gap > LARGEST * model.size:
        raise _contradiction(walk, places)
    found = _fitted(walk, places)
    if found is model.mechanism:
        return None  # hardly above rounding, and no better otherwise
    changes = _changes(model.mechanism, found, model.size)
    changed = {name: amount for name, amount in changes if amount > 0.0}
    return replace(found, drives=mechanism.drives), Adjustment(changed, gap)


def _fitted(walk: _Walk, places: list[Floats]) -> Mechanism:
    """The mechanism whose rows agree at the places, by Gauss and Newton."""
    first, start, best, found = walk, places, walk.gap(places), walk.model.mechanism
    good = _GOOD * walk.rounding
    for n in range(_ROUNDS):
        mechanism = _stepped(walk, places)
        sigma = walk.model.system.ordinary
        model = _compiled(mechanism).accustomed(sigma, walk.dependent_rows)
        q = _carried(walk.model.layout, places[0], model)
        walk = _Walk(model, walk.dependent_rows)
        places = walk.places(q, _MANY, n + 1)  # others, so that what was found has to hold there
        if not places:
            break
        gap = walk.gap(places)
        before = best
        if gap < best:
            found, best = mechanism, gap
        if best <= good and gap > 0.5 * before:
            break
    if best > good:
        raise _contradiction(first, start)
    return found


def _contradiction(walk: _Walk, places: list[Floats]) -> AssemblyError:
    model = walk.model
    gaps = np.max([walk.gaps(q) for q in places], axis=0)
    order = np.argsort(-gaps, kind='stable')[:6]
    named = ', '.join(
        f'{model.row_names[n]} by {gaps[n]:.3g} m' for n in order if gaps[n] > 0.05 * gaps.max()
    )
    return AssemblyError(
        f'redundant constraints contradict each other where the mechanism moves: {named}; '
        'make the lengths agree, or leave redundant bodies or joints out',
        key='mechanism',
    )


# ----------------------------------------------------------------------------------------- places


class _Walk:
    """Positions along the free motion of a model, each closed as far as its rows agree."""

    def __init__(self, model: Model, dependent_rows: int) -> None:
        self.model, self.dependent_rows = model, dependent_rows
        self._work = allocate(model, model.system, 0)
        reach = max(model.size, float(np.abs(model.q).max()))
        self.rounding = EPS * reach  # m
        self._step = _STEP

    def places(self, q: Floats, count: int, seed: int = 0) -> list[Floats]:
        """Positions on ways from q, forth and back, so many on each if it goes as far."""
        model, random = self.model, np.random.default_rng(seed)
        self._step = _STEP * random.uniform(0.8, 1.0)
        freedoms = model.n - (len(model.row_names) - self.dependent_rows)
        found = [self.settled(q)]
        for _ in range(min(_WAYS, 2 * freedoms) // 2):
            direction = random.standard_normal(model.n)
            for sense in (1.0, -1.0):
                found += self._way(q, sense * direction, count)
        return [place for place in found if self.is_ordinary(place)]

    def _way(self, q: Floats, direction: Floats, count: int) -> Iterator[Floats]:
        model, at, longest = self.model, q, self._step * self.model.size
        for _ in range(count):
            along = self._free(at, direction)
            length = float(np.abs(along).max())
            if not length > 0.0:
                return
            step = longest
            for _ in range(4):  # a short crank takes shorter steps
                ahead = at.copy()
                ahead[: model.n] += step / length * along
                ahead = self.settled(ahead)
                gone = ahead[: model.n] - at[: model.n]
                if self.widest(ahead) <= _ASTRAY * model.size and gone @ along > 0.0:
                    break
                step *= 0.25
            else:
                return
            at, direction = ahead, gone
            yield at

    def _free(self, q: Floats, direction: Floats) -> Floats:
        """(n,) What the rows leave of a direction: in modes of σ it becomes 1 / (1 + s²)³."""
        model, work = self.model, self._work
        if not kernel.linearise(model.unit, model.system, work, q):
            return np.zeros(model.n)
        x = np.concatenate([direction, np.zeros(q.size - model.n)])
        for _ in range(3):
            work.p[:] = 0.0
            kernel.add_mass_times(model.unit, model.system.mass, 1.0, x, work.p)
            x[: model.n] = work.p
            kernel.solve(model.unit, model.system.pattern, work.diagonal, work.off, x)
        return np.asarray(x[: model.n])

    def settled(self, q: Floats) -> Floats:
        """The position near q (blocks D, m) at which only contradictions stay open.

        Newton's method along M. It leaves a contradiction alone: its σ is as small as its gap.
        """
        model, work, best, q = self.model, self._work, q, q.copy()
        rows, least = model.system.rows, np.inf
        for _ in range(30):
            gap = self.widest(q)
            if not gap < 0.5 * least:
                return best if least <= gap else q
            best, least = q.copy(), gap
            if not kernel.linearise(model.unit, model.system, work, q):
                return best
            kernel.violation(model.unit, rows, q, work.r2)
            work.delta[:] = 0.0
            kernel.add_transposed(
                model.unit, rows, work.g, work.g2, -rows.alpha * work.r2, work.delta
            )
            kernel.solve(model.unit, model.system.pattern, work.diagonal, work.off, work.delta)
            q[: model.n] += work.delta[: model.n]
        return best

    def is_ordinary(self, q: Floats) -> bool:
        """Whether what is open at q is a contradiction: it is not beside a singular position."""
        if self.widest(q) <= _EXACT * self.rounding:
            return True
        model, work = self.model, self._work
        if not kernel.linearise(model.unit, model.system, work, q):
            return False
        missing = len(model.row_names) - self.dependent_rows - effective_rank(model, work)
        if distance(missing, model.penalty) < _CLEAR * model.system.ordinary:
            return False
        phi = np.sqrt(model.system.rows.alpha[model.row]) * _violation(model, q)
        return bool(np.linalg.norm(_Projector(model, q)(phi)) > 0.5 * np.linalg.norm(phi))

    def gaps(self, q: Floats) -> Floats:
        """By how much each row is open, m, in the order of `row_names`."""
        return np.abs(_violation(self.model, q) * self.model.system.rows.scale[self.model.row])

    def widest(self, q: Floats) -> float:
        """The largest of them, m."""
        return float(self.gaps(q).max(initial=0.0))

    def gap(self, places: list[Floats]) -> float:
        """The largest at any of the places, m."""
        return max((self.widest(q) for q in places), default=0.0)


def _compiled(mechanism: Mechanism) -> Model:
    """A model with the rows that bind positions; those of velocities alone have no Φ."""
    model = compile_model(mechanism, _PENALTY)
    if not model.system.rows.velocity:
        return model
    system, names, _ = hold(model, (), velocities=False)
    return replace(model, system=system, row_names=tuple(names), row=np.arange(len(names)))


def _violation(model: Model, q: Floats) -> Floats:
    """Φ(q) in the order of `row_names`."""
    phi = np.zeros(len(model.row_names))
    kernel.violation(model.unit, model.system.rows, q, phi)
    return np.asarray(phi[model.row])


def _carried(layout: Layout, q: Floats, model: Model) -> Floats:
    """What moves of q (blocks D, m) as coordinates of another model of like mechanisms."""
    D, other = layout.dimension, model.layout
    found, places = model.q.copy().reshape(-1, D), q.reshape(-1, D)
    scale = other.length / layout.length  # of unit vectors
    for one, two, unit in (
        (layout.of_point, other.of_point, 1.0),
        (layout.of_vector, other.of_vector, scale),
        (layout.of_auxiliary, other.of_auxiliary, 1.0),
    ):
        for name, block in two.items():
            if block < other.movable and name in one:
                found[block] = unit * places[one[name]]
    return found.ravel()


# ----------------------------------------------------------------------------------------- shapes

# What has a shape: ('body' | 'joint' | 'ground', name); of the ground each fixed point or vector.
Item = tuple[str, str]
# The mechanism in which one number of the shape is larger by an amount (m), of each item given.
Change = Callable[[Mechanism, Mapping[str, float]], Mechanism]


def _stepped(walk: _Walk, places: list[Floats]) -> Mechanism:
    """The mechanism after the least change of shapes that closes all rows at the places, to first
    order."""
    model, touched = walk.model, _touched(walk.model)
    columns: list[tuple[int, str]] = []  # which change, of what
    entries: list[list[tuple[int, int, float]]] = [[] for _ in places]
    weight = np.sqrt(model.system.rows.alpha[model.row])
    before = [_violation(model, q) for q in places]
    step, changes = _DIFFERENCE * model.size, list(_numbers(model.mechanism, model.size))
    for k, (kind, names, change) in enumerate(changes):
        for group in _apart([(kind, name) for name in names], touched):
            first = {item: len(columns) + n for n, item in enumerate(group)}
            columns += [(k, name) for _, name in group]
            larger = change(model.mechanism, {name: step for _, name in group})
            other = _compiled(larger)
            for n, q in enumerate(places):
                slope = (_violation(other, _carried(model.layout, q, other)) - before[n]) / step
                for r in np.flatnonzero(slope).tolist():
                    for item in touched[r] & first.keys():  # one, or none
                        entries[n].append((r, first[item], float(weight[r] * slope[r])))
    m, parts = len(model.row_names), []
    for each in entries:
        r, c, v = np.array(each, dtype=float).reshape(-1, 3).T
        at = r.astype(np.int64), c.astype(np.int64)
        parts.append(csr_array((v, at), shape=(m, len(columns))))
    projectors = [_Projector(model, q) for q in places]

    def forth(x: Floats) -> Floats:
        return np.concatenate([P(B @ x) for P, B in zip(projectors, parts, strict=True)])

    def back(y: Floats) -> Floats:
        total = np.zeros(len(columns))
        for n, (P, B) in enumerate(zip(projectors, parts, strict=True)):
            total += B.T @ P(y[n * m : (n + 1) * m])
        return total

    operator = LinearOperator((m * len(places), len(columns)), matvec=forth, rmatvec=back)
    wanted = np.concatenate([-P(weight * phi) for P, phi in zip(projectors, before, strict=True)])
    # no further than rounding: what remains would ask for large changes that nothing needs
    heaviest, whole = float(weight.max()), float(np.linalg.norm(wanted))
    most = max(1e-6, 0.1 * walk.rounding * np.sqrt(len(places)) * heaviest / whole)
    damp = _DAMPING * heaviest
    amounts = lsmr(operator, wanted, damp, 1e-8, most, conlim=0.0, maxiter=400)[0]
    found = model.mechanism
    for k, (_, _, change) in enumerate(changes):
        own = zip(columns, amounts.tolist(), strict=True)
        found = change(found, {name: amount for (which, name), amount in own if which == k})
    return found


class _Projector:
    """v -> the part of v, a value for each row times α^½, that no motion of q makes or takes."""

    def __init__(self, model: Model, q: Floats) -> None:
        self._model = model
        self._work: Work = allocate(model, model.system, 0)
        kernel.linearise(model.unit, model.system, self._work, q)
        self._weight = np.sqrt(model.system.rows.alpha)

    def __call__(self, v: Floats) -> Floats:
        model, work, rows = self._model, self._work, self._model.system.rows
        v_kernel = np.empty_like(v)
        v_kernel[model.row] = v
        for _ in range(3):  # a mode of σ becomes 1 / (1 + s²)³
            work.delta[:] = 0.0
            kernel.add_transposed(
                model.unit, rows, work.g, work.g2, self._weight * v_kernel, work.delta
            )
            work.delta[model.n :] = 0.0
            kernel.solve(model.unit, model.system.pattern, work.diagonal, work.off, work.delta)
            kernel.times_jacobian(model.unit, rows, work.g, work.g2, work.delta, work.r2)
            v_kernel = v_kernel - self._weight * work.r2
        return np.asarray(v_kernel[model.row])


def _touched(model: Model) -> list[set[Item]]:
    """What each row is made of, by row."""
    layout, mechanism = model.layout, model.mechanism
    fixed = {item.name for item in mechanism.blocks if item.fixed}
    parts: dict[str, set[Item]] = {GROUND: set()}
    for body in mechanism.bodies:
        held = fixed.intersection((*body.points, *body.vectors))
        parts[body.name] = {('body', body.name), *(('ground', name) for name in held)}
    found = {name: set[Item]() for name in model.row_names}
    for body in mechanism.bodies:
        for each in rigidity(body, layout):
            found[each.name] |= parts[body.name]
    for joint in mechanism.joints:
        for row in joint_rows(joint, layout):
            found[row.name] |= {('joint', joint.name)}
            found[row.name] |= parts[joint.parent] | parts[joint.child]
    return list(found.values())


def _apart(items: list[Item], touched: list[set[Item]]) -> list[list[Item]]:
    """Those of the items that any row is made of, in groups of which no row is made of two."""
    rows: dict[Item, set[int]] = {item: set() for item in items}
    for r, each in enumerate(touched):
        for item in each & rows.keys():
            rows[item].add(r)
    groups: list[tuple[list[Item], set[int]]] = []
    for item, own in rows.items():
        if not own:
            continue
        fitting = next((group for group in groups if own.isdisjoint(group[1])), None)
        if fitting is None:
            groups.append(([item], set(own)))
        else:
            fitting[0].append(item)
            fitting[1].update(own)
    return [group for group, _ in groups]


def _numbers(mechanism: Mechanism, size: float) -> Iterator[tuple[str, list[str], Change]]:
    """The numbers of shapes: the kind and the names of the items that have one, and its change.

    A direction is turned, by an angle times the size (m).
    """
    D = mechanism.dimension
    turns = range(3) if D == 3 else range(2, 3)
    for n in range(1, max((len(body.local) for body in mechanism.bodies), default=0)):
        names = [body.name for body in mechanism.bodies if len(body.local) > n]
        for axis in range(1 if n == 1 else D):  # the x axis goes through the second point
            yield 'body', names, partial(_of_bodies, partial(_moved_point, n, axis))
    for n in range(max((len(body.axes) for body in mechanism.bodies), default=0)):
        names = [body.name for body in mechanism.bodies if len(body.axes) > n]
        for axis in turns:
            yield 'body', names, partial(_of_bodies, partial(_turned_vector, n, axis, size))
    names = [joint.name for joint in mechanism.joints]
    for side in (0, 1):
        for axis in range(D):
            yield 'joint', names, partial(_of_joints, partial(_moved_frame, side, axis))
        for axis in turns:
            yield 'joint', names, partial(_of_joints, partial(_turned_frame, side, axis, size))
    names = [joint.name for joint in mechanism.joints if type_of(joint).drawn_length]
    yield 'joint', names, partial(_of_joints, _lengthened)
    names = [point.name for point in mechanism.points if point.fixed]
    for axis in range(D):
        yield 'ground', names, partial(_of_points, axis)
    names = [vector.name for vector in mechanism.vectors if vector.fixed]
    for axis in turns if names else ():
        yield 'ground', names, partial(_of_vectors, axis, size)


def _of_bodies(
    change: Callable[[Body, float], Body], mechanism: Mechanism, by: Mapping[str, float]
) -> Mechanism:
    bodies = (change(b, by[b.name]) if b.name in by else b for b in mechanism.bodies)
    return replace(mechanism, bodies=tuple(bodies))


def _of_joints(
    change: Callable[[Joint, float], Joint], mechanism: Mechanism, by: Mapping[str, float]
) -> Mechanism:
    joints = (change(j, by[j.name]) if j.name in by else j for j in mechanism.joints)
    return replace(mechanism, joints=tuple(joints))


def _of_points(axis: int, mechanism: Mechanism, by: Mapping[str, float]) -> Mechanism:
    points = (
        replace(p, at=_plus(p.at, axis, by[p.name])) if p.name in by else p
        for p in mechanism.points
    )
    return replace(mechanism, points=tuple(points))


def _of_vectors(
    axis: int, size: float, mechanism: Mechanism, by: Mapping[str, float]
) -> Mechanism:
    vectors = (
        replace(v, along=_turned(v.along, axis, by[v.name] / size)) if v.name in by else v
        for v in mechanism.vectors
    )
    return replace(mechanism, vectors=tuple(vectors))


def _moved_point(n: int, axis: int, body: Body, amount: float) -> Body:
    local = _plus(body.local[n], axis, amount)
    return replace(body, local=(*body.local[:n], local, *body.local[n + 1 :]))


def _turned_vector(n: int, axis: int, size: float, body: Body, amount: float) -> Body:
    along = _turned(body.axes[n], axis, amount / size)
    return replace(body, axes=(*body.axes[:n], along, *body.axes[n + 1 :]))


def _moved_frame(side: int, axis: int, joint: Joint, amount: float) -> Joint:
    frame = joint.frames[side]
    return _framed(joint, side, replace(frame, origin=_plus(frame.origin, axis, amount)))


def _turned_frame(side: int, axis: int, size: float, joint: Joint, amount: float) -> Joint:
    frame = joint.frames[side]
    axes = tuple(_turned(along, axis, amount / size) for along in frame.axes)
    return _framed(joint, side, replace(frame, axes=axes))


def _framed(joint: Joint, side: int, frame: Frame) -> Joint:
    other = joint.frames[1 - side]
    return replace(joint, frames=(frame, other) if side == 0 else (other, frame))


def _lengthened(joint: Joint, amount: float) -> Joint:
    return replace(joint, value=joint.value + amount)


def _plus(numbers: Numbers, axis: int, amount: float) -> Numbers:
    return (*numbers[:axis], numbers[axis] + amount, *numbers[axis + 1 :])


def _turned(along: Numbers, axis: int, angle: float) -> Numbers:
    """A direction (D,) turned about an axis of space by a small angle (rad)."""
    v = np.pad(np.array(along, dtype=float), (0, 3 - len(along)))
    w = v + angle * np.cross(np.eye(3)[axis], v)
    return tuple((w * (np.linalg.norm(v) / np.linalg.norm(w)))[: len(along)].tolist())


def _changes(one: Mechanism, two: Mechanism, size: float) -> Iterator[tuple[str, float]]:
    """The items whose shapes differ, and the largest difference of a number of it, m."""
    for a, b in zip(one.bodies, two.bodies, strict=True):
        yield a.name, max(_off(a.local, b.local), size * _off(a.axes, b.axes))
    for c, d in zip(one.joints, two.joints, strict=True):
        pairs = list(zip(c.frames, d.frames, strict=True))
        moved = max(_off((f.origin,), (g.origin,)) for f, g in pairs)
        turned = size * max(_off(f.axes, g.axes) for f, g in pairs)
        yield c.name, max(moved, turned, abs(c.value - d.value))
    for p, q in zip(one.points, two.points, strict=True):
        yield p.name, _off((p.at,), (q.at,))
    for v, w in zip(one.vectors, two.vectors, strict=True):
        yield v.name, size * _off((v.along,), (w.along,))


def _off(one: tuple[Numbers, ...], two: tuple[Numbers, ...]) -> float:
    return max(
        (abs(x - y) for a, b in zip(one, two, strict=True) for x, y in zip(a, b, strict=True)),
        default=0.0,
    )
