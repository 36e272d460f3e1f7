"""Positions of rest of a scene: `alf_ros.equilibrium` and `alf_ros.equilibria`."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from alf_ros import effects, kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.errors import AssemblyError, InputError
from alf_ros.logs.progress import Report, silent
from alf_ros.model import assembly, ordinary_positions
from alf_ros.model.compile import Model
from alf_ros.model.constraints.rotors import without_rotors
from alf_ros.model.dense_linearisation import moving
from alf_ros.model.handedness import Handedness
from alf_ros.model.prescribed import driven_angles, prescribe
from alf_ros.model.singular_branches import SMOOTH, position
from alf_ros.scene.scene import SceneSource, load_scene
from alf_ros.simulation.input_checks import number, truth, whole
from alf_ros.simulation.sample import JointState, Reaction, Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.descent import (
    FAR,
    LIMIT,
    STUCK,
    Landing,
    descended,
    moved,
    pushed,
)
from alf_ros.studies.statics.frozen_time import read_at, standing_still
from alf_ros.studies.statics.held_to_second_order import held_to_second_order
from alf_ros.studies.statics.instant import DENSE, Chosen, Instant, Loads, angles, counted
from alf_ros.studies.statics.newton_rest import nearest_rest
from alf_ros.studies.statics.rest_at_kink import ON_ONE_SIDE, UNDECIDED, with_both_sides
from alf_ros.studies.statics.rest_stability import (
    NEUTRAL,
    RestStability,
    reduced_stiffness,
    stability_of,
)
from alf_ros.studies.statics.turned_starts import counting, turned_starts

_SAME = 1e-6  # of the size, between positions that count as one
_TRIES, _SHORTER = 10, 0.6  # of a random displacement, each shorter by this factor
# of the acceleration without rows, from which down a singular position is looked for
_NEAR_SINGULAR = 1e-3
_NEARER = 'start nearer to one (`initial`), or take several starts (`equilibria`)'
_REASONS = {  # why a search ended without rest
    FAR: 'loads that never stop doing work have none',
    LIMIT: f'this is the limit of the search: {_NEARER}',
    STUCK: f'no step from there leads further down: {_NEARER}',
}
# of the size: how uncertain a position may be without a note, and with a verdict
_SHARP, _BLURRED = 1e-7, 1e-3
_DRIVEN = 0.05  # of the size that a drive moves in one step on the way to an instant


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A position of rest.

    simulation: one of its own, with the held inputs, in which drives stand still. sample: all
    quantities, at rest. state: what `Simulation.restore` takes. stability: 'stable', 'unstable',
    'neutral', or 'undecided' (in a singular position, or of a mechanism too large to tell).
    stiffness (f,): eigenvalues of the reduced Hessian in the metric of the mass, 1/s², ascending;
    the squares of the natural frequencies in rad/s if nothing damps; NaN of a pair that flutters.
    directions (f, n): their motions in the order of `q`, for a unit of mass. residual: the largest
    acceleration that is left, m/s². conservative: whether the loads have a potential here. notes:
    what a reader should know, a sentence each. steps: of the search.
    """

    simulation: Simulation
    sample: Sample
    state: State
    stability: str
    stiffness: Floats
    directions: Floats
    residual: float
    conservative: bool
    notes: tuple[str, ...]
    steps: int

    @property
    def t(self) -> float:
        """The instant at which drives, motors and tables are frozen, s."""
        return self.sample.t

    @property
    def q(self) -> Floats:
        """(n,) as `Sample.q`: points, m, then unit vectors."""
        return self.sample.q

    @property
    def points(self) -> Mapping[str, Floats]:
        """Position of each point (D,), m."""
        return self.sample.points

    @property
    def joints(self) -> Mapping[str, JointState]:
        """Position and effort of each joint coordinate."""
        return self.sample.joints

    @property
    def reactions(self) -> Mapping[str, Reaction]:
        """The reaction of each joint at rest."""
        return self.sample.reactions

    @property
    def frequencies(self) -> Floats:
        """(f,) natural frequencies without damping, Hz; NaN of a motion that falls or flutters."""
        squares = self.stiffness
        return np.sqrt(np.where(squares >= 0.0, squares, np.nan)) / (2.0 * math.pi)

    @property
    def has_stiffness(self) -> bool:
        """Whether `stiffness` is known, if only of one side of a kink."""
        sides = any(note.startswith(ON_ONE_SIDE) for note in self.notes)
        return self.stability != UNDECIDED or sides

    def __repr__(self) -> str:
        return f'<Equilibrium {self.stability}, {self.stiffness.size} freedoms, t = {self.t:g} s>'


def equilibrium(
    scene: SceneSource | Simulation, *, t: float | None = None, nearest: bool = False
) -> Equilibrium:
    """Where a scene rests under its effects, from where it starts; or a simulation, from its
    present, under its effects and held inputs.

    t (s): the instant at which drives, motors and tables are frozen; the present of a simulation,
    0 of a scene if absent. The search goes down the potential, so that it ends in a stable or
    neutral position, unless it starts in another one. With `nearest` it goes to a near position of
    rest of any kind, by Newton's method; where this ends without rest, down the potential.

    Raises InputError if none is found, or loads without a potential do not settle; AssemblyError
    if the mechanism cannot be closed.
    """
    nearest = truth(nearest, 'nearest')
    simulation, start = beginning(scene, t)
    landing = nearest_rest(start) if nearest else descended(start)
    if not landing.rests and not nearest and simulation.model.n <= DENSE:
        landing = _better(landing, start)
    return found_at(simulation, landing)


def equilibria(
    scene: SceneSource | Simulation,
    *,
    starts: int = 20,
    seed: int = 0,
    t: float | None = None,
    report: Report = silent,
) -> tuple[Equilibrium, ...]:
    """The positions of rest found from the start and from so many random positions (`seed`), down
    the potential and to the nearest one: stable ones first, then by energy.

    Where forces count turns, as torsion springs do, it also searches from the start a turn later
    and earlier about each such angle, and from random positions there; positions a turn apart are
    two. No body of a random position is mirrored or turned round in its joint: in space these lie
    nearer to the start. It is a search: more starts may find more. `report` takes the part of the
    searches that is done, 0 to 1. Raises as `equilibrium` if none is found.
    """
    simulation, start = beginning(scene, t)
    model, random = simulation.model, np.random.default_rng(whole(seed, 'seed', 0))
    hands = Handedness(model)
    found: list[Equilibrium] = []
    refused: InputError | None = None
    count, which = whole(starts, 'starts', 0), counting(start)
    turned = turned_starts(start, which)
    begins = [start, *turned]
    for k in range(count):
        away = 0.5 * model.size * random.standard_normal(model.n)
        for base in [start, *turned[k % max(len(turned), 1) :][:1]]:
            with suppress(AssemblyError):
                begins += _random_start(base, hands, away)
    for k, begin in enumerate(begins):
        report(k / len(begins))
        for search in (descended, nearest_rest):
            try:
                each = found_at(simulation, search(begin))
            except InputError as error:
                refused = refused or error
                continue
            if not any(_is_same(model.size, which, each, other) for other in found):
                found.append(each)
    if not found:
        raise refused or InputError('no position of rest was found', key='starts', value=starts)
    order = {'stable': 0, NEUTRAL: 1}
    return tuple(sorted(found, key=lambda e: (order.get(e.stability, 2), e.sample.energy)))


def _random_start(base: Instant, hands: Handedness, away: Floats) -> list[Instant]:
    """A position after a random displacement (n,) of the coordinates, m; or after a part of it, if
    loops close there only with a body mirrored or turned round in its joint; else none. Raises
    AssemblyError if they do not close."""
    for _ in range(_TRIES):
        begin = moved(base, away)  # gears stay in mesh
        if not hands.is_mirrored(begin.q):
            return [begin]
        away = _SHORTER * away
    return []


def _is_same(size: float, which: Chosen, one: Equilibrium, other: Equilibrium) -> bool:
    """Whether two are one; `which` (angles,) count turns."""
    model = one.sample.model
    apart = without_rotors(model.layout, one.state.q - other.state.q)
    if np.abs(apart).max(initial=0.0) > _SAME * size:
        return False
    counts = [angles(model, each.state.q, each.state.turns)[0][which] for each in (one, other)]
    return bool((np.abs(counts[0] - counts[1]) < math.pi).all())


def beginning(scene: SceneSource | Simulation, t: float | None) -> tuple[Simulation, Instant]:
    """A simulation of one's own, and its present at rest with drives at t (s)."""
    if isinstance(scene, Simulation):
        simulation = copy.copy(scene)
    else:
        simulation = Simulation(load_scene(scene).at_rest())
    state, now = simulation.state, simulation.t
    q, turns = state.q, state.turns
    if t is not None:
        q, turns = _driven(simulation, now, number(t, 't', 0.0))
        now = float(t)
    return simulation, Instant(Loads(simulation), now, q, np.zeros_like(q), turns)


def _driven(simulation: Simulation, start: float, end: float) -> tuple[Floats, Integers]:
    """q (blocks D, m) and turns with drives brought from one instant to another (s), bit by bit,
    with gears in mesh."""
    model, now, step = simulation.model, start, end - start
    q, turns = simulation.state.q, simulation.state.turns
    if not model.mechanism.prescribed:
        return q, turns
    rates = np.zeros((2, q.size))
    driven = partial(driven_angles, model.layout, model.system)
    while abs(end - now) > 0.0:
        step = math.copysign(min(abs(step), abs(end - now)), end - start)
        there = np.array(q)
        prescribe(model.system, now + step, there, *rates)
        apart = np.append(there - q, model.layout.length * (driven(now + step) - driven(now)))
        if np.abs(apart).max() > _DRIVEN * model.size and abs(step) > 1e-9 * abs(end - start):
            step *= 0.5
            continue
        there = assembly.displaced(model, q, there - q)
        q, turns = there, counted(model, q, turns, there)
        now, step = (end if abs(end - now - step) <= 1e-12 * abs(end) else now + step), 2.0 * step
    return q, turns


def _better(landing: Landing, start: Instant) -> Landing:
    """The landing of Newton's method if the descent did not end in rest; else the landing."""
    other = nearest_rest(landing.instant)
    return other if other.rests else landing


def found_at(simulation: Simulation, landing: Landing) -> Equilibrium:
    """Raises InputError if the landing is no position of rest, or holds parts as no assembly does:
    steps are long beside small bodies."""
    instant, model = landing.instant, simulation.model
    fault = Handedness(model).fault(instant.q)
    if fault:
        text = f'no position of rest is found: the search ends where {fault}; {_NEARER}'
        raise InputError(text, key='effects')
    singular = _singular(simulation, landing)
    if not landing.rests and not singular:
        raise InputError(_unrest(simulation, landing), key='effects')
    simulation = simulation._standing()  # else drives that accelerate would load the sample
    state = replace(
        simulation.state.moved(instant.q, np.zeros_like(instant.q), instant.turns),
        loads=np.zeros_like(simulation.state.loads),
        step=round(instant.t / simulation.h),
    )
    notes = [singular] if singular else []
    told = RestStability(UNDECIDED, np.zeros(0), np.zeros((0, model.n)), True, True)
    if model.n > DENSE:
        notes.append(f'stability is not told of more than {DENSE} coordinates; see `modes`')
    elif not singular:
        told = stability_of(instant, reduced_stiffness(instant, landing.lam))
        if not told.stiffness.size:
            notes.append('nothing is free: rows and drives hold every point')
    blur = _uncertainty(instant, told)
    if blur > _SHARP * model.size:
        most = float(np.abs(instant.Q).max(initial=0.0))
        notes.append(
            f'the position is uncertain by about {blur:.1g} m: {landing.left:.2g} m/s^2 are left, '
            f'which rounding of loads of {most:.2g} N hides'
        )
        if blur > _BLURRED * model.size:
            told = replace(told, verdict=UNDECIDED)
    if not told.conservative:
        notes.append('the loads have no potential here: stability is that of the linear motion')
    if not told.draining:
        notes.append('damping gives energy here: stability is that of the linear motion')
    if np.isnan(told.stiffness).any():
        notes.append('without damping a pair of motions grows as it oscillates (flutter)')
    notes += _held(instant)
    if told.stiffness.size and instant.is_kinked:
        told, sides = with_both_sides(instant, told)
        notes.append('a force has a kink here: the stiffness is of one side of it')
        if sides:
            notes.append(sides)
    notes += held_to_second_order(instant) if told.stiffness.size else []
    notes += standing_still(model, instant.t)
    notes += read_at(instant)
    if told.stiffness.size and model.system.rows.velocity:
        if instant.position_directions.shape[1] > told.stiffness.size:
            notes.append('rows bind velocities only: other positions of rest lie all around')
    sample = simulation._sample(instant.t, state, False)
    return Equilibrium(
        simulation=simulation,
        sample=sample,
        state=state,
        stability=told.verdict,
        stiffness=told.stiffness,
        directions=in_order(model, told.directions),
        residual=landing.left,
        conservative=told.conservative,
        notes=tuple(notes),
        steps=landing.steps,
    )


def _uncertainty(instant: Instant, told: RestStability) -> float:
    """How far the forces left would move the mechanism until its stiffness holds them, m."""
    squares = np.where(told.stiffness != 0.0, np.abs(told.stiffness), np.inf)
    along = told.directions @ instant.Q[: instant.model.n] / squares
    return float(np.abs(np.nan_to_num(along @ told.directions)).max(initial=0.0))


def in_order(model: Model, directions: Floats) -> Floats:
    """Directions (f, n) of the kernel in the order of `Sample.q`, vectors without unit."""
    D, points = model.layout.dimension, sum(not p.fixed for p in model.mechanism.points)
    own = directions.reshape(len(directions), model.layout.movable, D)
    blocks = own[:, model.coordinate_block]
    blocks[:, points:] /= model.layout.length
    return np.asarray(blocks.reshape(len(directions), model.n))


def _singular(simulation: Simulation, landing: Landing) -> str:
    """The kind of a singular position; empty for other positions."""
    model, q = simulation.model, landing.instant.q
    if model.n > DENSE or (landing.lefts > _NEAR_SINGULAR * landing.scales).any():
        return ''
    dependent = len(model.row_names) - round(model.system.rank)
    if not ordinary_positions.within(model, q, dependent):
        return ''
    with np.errstate(all='ignore'):
        found = position(model, assembly.close(model, {}, q, least=0.0), landing.instant.t)
    gained = found.kind != SMOOTH or len(found.lost) > dependent
    kind = found.kind if gained else 'too near to tell'
    return f'it lies in a singular position ({kind}): stability is not decided there'


def _held(instant: Instant) -> list[str]:
    """Notes about friction, and about stops and contacts that push."""
    notes, each = [], instant.loads.applied.each
    for effect in instant.loads.effects:
        at_rest = getattr(effects.load(effect.kind), 'at_rest', None)
        what = None if at_rest is None else at_rest(effect.parameters)
        if what == contract.FRICTION_HOLDS:
            notes.append(
                f'{effect.label}: friction holds positions around this one too; this is the one '
                'that rests without it'
            )
        elif what is not None:
            Q = np.zeros_like(instant.q)
            part = each[effect.label].effects
            kernel.applied_forces(part, instant.t, instant.q, instant.qd, instant.near, Q)
            if Q.any():
                notes.append(f'{effect.label}: {what} carries load here')
    return notes


def _unrest(simulation: Simulation, landing: Landing) -> str:
    """Why there is no position of rest."""
    model, instant = simulation.model, landing.instant
    # not what forces act on: they may balance there, beside a part that falls
    pull, _ = pushed(instant, ConstrainedSolve(model, instant.loads.tangents.cliques))
    names = ', '.join(moving(model, pull)[:3])
    text = (
        f'no position of rest is found: after {landing.steps} steps {landing.left:.3g} m/s^2 are '
        f'left, at {names}'
    )
    if model.n <= DENSE and not reduced_stiffness(instant, landing.lam).conservative:
        return text + '; the loads have no potential, and do not settle'
    return f'{text}; {_REASONS[landing.ending]}'
