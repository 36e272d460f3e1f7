"""Ordinary positions: how many rows depend on others there, and how far a position is from one."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from itertools import product

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel import Work
from alf_ros.mechanism.memory import remembered
from alf_ros.model import assembly
from alf_ros.model.compile import Model, allocate, hold
from alf_ros.model.constraints.carried_masses import are_small_and_light
from alf_ros.model.constraints.meshing import integrals
from alf_ros.model.dense_linearisation import Linearised, rank_of
from alf_ros.model.null_spaces import free_directions
from alf_ros.model.prescribed import prescribe
from alf_ros.model.rank import distance, effective_rank

NEAR_BY = 4  # places that each search for an ordinary position examines
_APART = 1e-6  # of the size: positions that are not the same
SOFT = 0.2  # σ below which a position may be beside a singular one
RESOLVING = 1e4, 1e6, 1e8, 1e10  # penalties: the smallest shows σ best
WHOLE = 0.02  # by which a rank may be off a whole number
NEAR = 0.05  # of the size: how far away positions around one are
_FIRMER = 4.0  # times this σ, that of an ordinary position somewhat further away
RISING = 1.5  # times this σ, that of positions nearby: a soft mechanism is soft everywhere
_FURTHER = 0.2  # of the size, or rad of a drive: how far away
_INSTANTS = 1e-2, 0.1, 1.0, 10.0  # s
_MOST = 600  # coordinates of a mechanism for which positions further away are examined


def ordinary(model: Model, q: Floats, work: Work | None = None) -> tuple[int, Floats, float]:
    """Ordinary values near q: the number of dependent rows, a position, and its distance σ.

    `work`: memory for the rows of the model. q (blocks D, m) itself may be a singular position, so
    that positions around it are examined too, and if rows depend on others there, places with
    drives elsewhere.
    """
    random = _Directions(model.n)
    places_only, names, _ = hold(model, [], velocities=False)
    work = work or allocate(model, model.system, 0)
    closing = work if places_only is model.system else allocate(model, places_only, 0)
    close = partial(assembly.closed, model, places_only, names, closing)
    ranks = _RanksBeside(model, work, q, close)
    narrow = min(model.size, _shortest(model))
    best = here = _rank(model, work, q)
    places, closed, stays = [q], 0, True  # whether drives stay in the places
    random.next()  # q itself is no step along the first one
    for turn in range(1, 12):
        if turn >= NEAR_BY and best == len(model.row_names):
            break
        away, by = NEAR * model.size, 0.0
        if NEAR_BY <= turn < 8:  # long chains may close nearer only
            if closed:
                continue
            away = NEAR * narrow
        if turn >= 8:  # with drives where they begin there may be no other place
            if not model.mechanism.prescribed:
                break
            by = 0.05 * random.generator.standard_normal()
        try:
            rank, near = ranks.at(away * random.next(), by, best, NEAR * narrow / away)
        except AssemblyError:
            continue
        closed += 1
        if rank > best:
            best, places, stays = rank, [], by == 0.0
        if rank == best:
            places.append(near)
    # many rows may be lost together, as where all cranks of a row lie flat: they are found again
    # where all points go the same way; far ones tell soft modes
    for axis, way in product(range(model.layout.dimension), (0.3, -0.3, 0.05, -0.05)):
        if best == len(model.row_names):
            break
        step = np.zeros(model.n)
        step[axis :: model.layout.dimension] = way * narrow
        try:
            rank, near = ranks.at(step, 0.0, best, NEAR / abs(way))
        except AssemblyError:
            continue
        if rank > best:
            best, places, stays = rank, [near], True
    if best > here:  # a loop of gears may depend on others only where they are in mesh
        best, places = _in_mesh(model, work, q, random) or (best, places)
    if best > here and (stays or not _moves(model, q)):
        # what is around may be a rigid assembly of a mechanism that moves
        own = _on_the_way(model, work, q, here, close)
        best, places = (here, own) if own else (best, places)
    rank = max(best, 0)
    place, sigma = places[0], _softness(model, work, places[0], rank)
    if sigma < SOFT:  # this is beside a singular position, or the mechanism is soft
        others = places[1:]
        values = [_softness(model, work, other, rank) for other in others]
        rising = best > here or max(values, default=0.0) > RISING * sigma
        if rising or model.mechanism.prescribed:
            more = _further(model, work, q, rank, close)
            others += more
            values += [_softness(model, work, other, rank) for other in more]
        if values and max(values) > _FIRMER * sigma:
            sigma = max(values)
            place = others[values.index(sigma)]
    return len(model.row_names) - rank, place, sigma


def _further(
    model: Model, work: Work, q: Floats, rank: int, close: Callable[[Floats], Floats]
) -> list[Floats]:
    """Positions of the same rank further away from q, with drives elsewhere: beside a singular
    position all positions nearby are soft. None for large mechanisms, and with gears, which would
    not be in mesh."""
    if model.n > _MOST or integrals(model.layout, teeth=True):
        return []
    random, found = np.random.default_rng(1), list[Floats]()
    for turn in range(NEAR_BY + model.layout.dimension):
        near = np.array(q)
        if model.mechanism.prescribed:
            _displace(model, near, _FURTHER * random.standard_normal())
        if turn < NEAR_BY:
            near[: model.n] += _FURTHER * model.size * random.standard_normal(model.n)
        else:  # all points go the same way
            near[turn - NEAR_BY : model.n : model.layout.dimension] += _FURTHER * model.size
        try:
            near = close(near)
            found.append(near)
            # rows that hold squares let what is off them creep back: the chord goes on
            chord = near - q
            chord *= _FURTHER * model.size / max(np.abs(chord).max(), _APART * model.size)
            found.append(close(q + chord))
        except AssemblyError:
            continue
    return [near for near in found if _rank(model, work, near) == rank]


def _on_the_way(
    model: Model, work: Work, q: Floats, rank: int, close: Callable[[Floats], Floats]
) -> list[Floats]:
    """Positions to which free directions at q lead, if all have the rank of q; else none.

    From a singular position they lead to positions of a higher rank, or nowhere. None for large
    mechanisms.
    """
    if model.n > _MOST or not kernel.linearise(model.unit, model.system, work, q):
        return []
    free = free_directions(model, model.system, work)[0][: model.n - rank, : model.n]
    random, found = np.random.default_rng(2), list[Floats]()
    for part in (1.0, -1.0, 0.3, -0.3):
        along = random.standard_normal(len(free)) @ free if len(free) > 1 else free.sum(axis=0)
        step = np.zeros_like(q)
        step[: model.n] = part * NEAR * model.size / np.abs(along).max() * along
        try:
            near = close(q + step)
        except AssemblyError:
            return []
        if np.linalg.norm(near - q) < 0.5 * np.linalg.norm(step):
            return []
        if _rank(model, work, near) != rank:
            return []
        found.append(near)
    return found


def _in_mesh(
    model: Model, work: Work, q: Floats, random: _Directions
) -> tuple[int, list[Floats]] | None:
    """The largest rank at positions around q that keep gears, threads and couplings in mesh, and
    where it was found; None without these, or without their rows as in a model of places only, or
    if q has no positions around it."""
    if not (model.system.rows.velocity and integrals(model.layout, teeth=True)):
        return None
    away, found = 0.05 * min(model.size, _shortest(model)), list[tuple[int, Floats]]()
    for turn in range(8):
        there = np.array(q)
        if turn >= 4 and model.mechanism.prescribed:
            _displace(model, there, 0.05 * random.generator.standard_normal())
        there[: model.n] += away * random.next()
        try:
            near = assembly.displaced(model, q, there - q)
        except AssemblyError:
            continue
        if np.abs(near - q).max() > _APART * model.size:
            found.append((_rank(model, work, near), near))
    if not found:
        return None
    best = max(rank for rank, _ in found)
    return best, [near for rank, near in found if rank == best]


class _RanksBeside:
    """The rank at places around q (blocks D, m) that `close` reaches from displaced ones."""

    def __init__(
        self, model: Model, work: Work, q: Floats, close: Callable[[Floats], Floats]
    ) -> None:
        self._model, self._work, self._q, self._close = model, work, q, close

    def at(self, step: Floats, by: float, best: int, part: float) -> tuple[int, Floats]:
        """The rank at the place that a `step` (n,) m, and drives moved `by`, lead to, and it.

        A step may lead to another assembly, as from a narrow parallelogram to the crossed one,
        which has a rank of its own. So a rank above `best` counts if a `part` of the step shows
        it too; else the nearer place stands for the further one. Raises AssemblyError.
        """
        rank, near = self._after(step, by)
        if rank > best and part < 1.0:
            nearer = self._after(part * step, part * by)
            return nearer if nearer[0] < rank else (rank, near)
        return rank, near

    def _after(self, step: Floats, by: float) -> tuple[int, Floats]:
        near = np.array(self._q)
        if by:
            _displace(self._model, near, by)
        near[: self._model.n] += step
        near = self._close(near)
        return _rank(self._model, self._work, near), near


class _Directions:
    """Random directions (n,), the same in every search, one after another."""

    def __init__(self, n: int) -> None:
        self._n, self._given = n, 0

    def next(self) -> Floats:
        """The next direction."""
        if self._given == NEAR_BY:
            return self.generator.standard_normal(self._n)
        self._given += 1
        return directions(self._n)[self._given - 1]

    @cached_property
    def generator(self) -> np.random.Generator:
        """The generator, which has given the first directions."""
        generator = np.random.default_rng(0)
        generator.standard_normal(self._given * self._n)
        return generator


@remembered(64)
def directions(n: int) -> Floats:
    """The first directions, which every search takes: to make a generator takes longer."""
    return np.random.default_rng(0).standard_normal((NEAR_BY, n))


def _shortest(model: Model) -> float:
    """The shortest distance that a row keeps, m."""
    return float(np.sqrt(model.system.rows.length2.min(initial=np.inf)))


def _moves(model: Model, q: Floats) -> bool:
    """Whether drives move a model, as far as some instants show."""
    begun, moved, rates = np.array(q), np.array(q), np.zeros((2, q.size))
    prescribe(model.system, 0.0, begun, *rates)
    for t in _INSTANTS:
        prescribe(model.system, t, moved, *rates)
        if (moved != begun).any():
            return True
    return False


def _displace(model: Model, q: Floats, by: float) -> None:
    """Move prescribed blocks of q (blocks D, m) in place, by so many radians or parts of the size:
    a mechanism that is driven into a singular position may have no other one there."""
    layout = model.layout
    places = q.reshape(-1, layout.dimension)
    for item in model.mechanism.prescribed:
        block = places[layout.of_prescribed[item.name]]
        if item.is_direction:
            x, y = block[:2]
            block[:2] = np.cos(by) * x - np.sin(by) * y, np.sin(by) * x + np.cos(by) * y
        else:
            driven = [component is not None for component in item.components]
            block[: len(driven)][driven] += by * model.size


def _rank(model: Model, work: Work, q: Floats) -> int:
    """The rank of Φ_q, -1 if A has no factor; with the penalty of the model, or with one that
    resolves the soft modes of chains of thousands of bars.

    Rows that hold a heavy body by a light one are soft in the metric of M. So where parts are
    light, the dense Φ_q says whether rows depend on others.
    """
    found, off = -1, 1.0
    for penalty in (model.penalty, 1e10):
        stiff = model if penalty == model.penalty else model.with_penalty(penalty)
        if not kernel.linearise(model.unit, stiff.system, work, q):
            break
        rank = effective_rank(stiff, work)
        away = abs(rank - np.rint(rank))  # not a number, for a penalty that overflows
        if away < off:  # a motion without mass counts as if rows held it
            found, off = min(round(rank), len(model.row_names)), away
        if off < WHOLE:
            break
    if found < len(model.row_names) and are_small_and_light(model.unit, model.system):
        return max(found, rank_of(Linearised(model, q).jacobian))
    return found


def within(model: Model, q: Floats, dependent_rows: int, work: Work | None = None) -> bool:
    """Whether q (blocks D, m) is a singular position, as near as stages are not trusted there.

    `work`: memory for the rows of the model.
    """
    work = work or allocate(model, model.system, 0)
    if not kernel.linearise(model.unit, model.system, work, q):
        return False
    missing = len(model.row_names) - dependent_rows - effective_rank(model, work)
    sigma = distance(missing, model.penalty)
    return bool(sigma < model.system.close * model.system.ordinary)


def _softness(model: Model, work: Work, q: Floats, rank: int) -> float:
    """The distance σ at an ordinary place, with the smallest penalty that resolves it.

    With a large one the deficit of the rank would be below rounding.
    """
    if rank == 0:
        return 1.0
    for penalty in RESOLVING:
        soft = model.with_penalty(penalty)
        if not kernel.linearise(model.unit, soft.system, work, q):
            break
        missing = rank - effective_rank(soft, work)
        if 0.0 < missing < 0.5:
            return float(distance(missing, penalty))
    return 1e-5
