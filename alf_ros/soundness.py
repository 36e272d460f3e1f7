"""Whether a mechanism is sound: its loops close, it can move, what moves has mass, and the motion
from where it starts is one.

Redundant rows, reactions that rigid bodies leave open and singular positions on the way are no
faults: they are told, because other programs stumble over them and because forces depend on them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alf_ros import assembly, kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.linearised import Linearised, moving
from alf_ros.model import Model, allocate, compile_model
from alf_ros.reactions import Reactions
from alf_ros.rows import joint_rows, rigidity
from alf_ros.scene import Scene
from alf_ros.sweep import Sweep, sweep

OK, NOTE, BAD = 'ok', 'note', 'BAD'
LARGEST = 4000  # coordinates: matrices are dense here


@dataclass(frozen=True)
class Answer:
    """One line of the table: ok, note (worth knowing) or BAD (not sound)."""

    verdict: str
    question: str
    answer: str


@dataclass(frozen=True, eq=False)
class Soundness:
    """What was found. `q` is the closed position (blocks D, m), the drawn one if none is."""

    model: Model
    q: Floats
    answers: tuple[Answer, ...]
    walk: Sweep

    @property
    def sound(self) -> bool:
        """Whether no answer is BAD."""
        return all(answer.verdict != BAD for answer in self.answers)


def examine(scene: Scene) -> Soundness:
    """Look at the mechanism of a scene where the scene starts it.

    Raises AssemblyError if nothing moves or has mass, or if it is too large for dense matrices.
    """
    # what it could do is asked of it free, so that a walk can take the place of its drives
    mechanism = replace(scene.mechanism, drives=())
    model = compile_model(mechanism, scene.solver.penalty)
    if model.n > LARGEST:
        raise AssemblyError(f'{model.n} coordinates, too many to look at: {LARGEST} at most')
    drawn = Linearised(model, model.q)
    if drawn.massless.shape[1]:
        return Soundness(model, model.q, (*_size(drawn), _mass(drawn)), Sweep())
    try:
        at = Linearised(model, assembly.close(model, scene.positions))
    except AssemblyError as error:
        closed = Answer(BAD, 'loops', str(error.message))
        return Soundness(model, model.q, (closed, *_size(drawn)), Sweep())
    usual = _ordinary(at)
    walk = sweep(usual)
    answers = [_closing(at), *_size(at), _mobility(at, usual), _redundant(usual)]
    answers += _drives(scene, usual.model.n - usual.rank)
    answers += [_reactions(usual), _mass(at), _start(at, usual), _on_the_way(usual, walk)]
    return Soundness(model, at.q, tuple(answers), walk)


def _ordinary(at: Linearised) -> Linearised:
    """The position itself, or one near it where more rows are independent."""
    random = np.random.default_rng(0)
    model, best = at.model, at
    for distance in (0.01, 0.05, 0.05):
        q = np.array(at.q)
        q[: model.n] += distance * model.size * random.standard_normal(model.n)
        try:
            near = Linearised(model, assembly.close(model, {}, q))
        except AssemblyError:
            continue
        if near.rank > best.rank:
            best = near
    return best


# ------------------------------------------------------------------------------------ the answers


def _closing(at: Linearised) -> Answer:
    model = at.model
    moved = np.linalg.norm((at.q - model.q).reshape(-1, model.layout.dimension), axis=1)
    by_point = {name: float(moved[block]) for name, block in model.layout.of_point.items()}
    far = [name for name in by_point if by_point[name] > 1e-9 * model.size]
    far.sort(key=lambda name: -by_point[name])
    if not far:
        return Answer(OK, 'loops', 'closed as drawn')
    listed = _list([f'{name} {by_point[name]:.3g} m' for name in far])
    verdict = NOTE if by_point[far[0]] > 0.01 * model.size else OK
    return Answer(verdict, 'loops', f'closed; from where it is drawn moved {listed}')


def _size(at: Linearised) -> Iterator[Answer]:
    model = at.model
    velocity = model.system.rows.velocity
    rows = f'{_count(len(model.row_names), "constraint row")}, rank {at.rank}'
    if velocity:
        rows += f'; {velocity} of velocities'
    points = sum(not point.fixed for point in model.mechanism.points)
    vectors = sum(not vector.fixed for vector in model.mechanism.vectors)
    of = _count(points, 'point') + (f' and {_count(vectors, "vector")}' if vectors else '')
    yield Answer(OK, 'size', f'{model.n} coordinates of {of}; {rows}')


def _mobility(at: Linearised, usual: Linearised) -> Answer:
    freedoms = usual.model.n - usual.rank
    if not freedoms:
        return Answer(BAD, 'mobility', 'none: it is a structure and cannot move')
    text = _count(freedoms, 'freedom')
    places = usual.model.n - usual.rank_of_positions
    if places != freedoms:
        text += f' of velocity, {places} of position'
    return Answer(OK, 'mobility', text)


def _drives(scene: Scene, freedoms: int) -> Iterator[Answer]:
    """Whether each motion that is prescribed takes a freedom, of which there are so many."""
    drives = scene.mechanism.drives
    if not drives:
        return
    motions = sum(motion is not None for drive in drives for motion in drive.motion)
    model = compile_model(scene.mechanism, scene.solver.penalty)
    try:
        at = _ordinary(Linearised(model, assembly.close(model, scene.positions)))
    except AssemblyError as error:
        yield Answer(BAD, 'drives', str(error.message))
        return
    left = model.n - at.rank
    text = f'{_count(motions, "motion")} for {_count(freedoms, "freedom")}'
    if freedoms - left < motions:
        yield Answer(BAD, 'drives', f'{text}: they take {freedoms - left} only, and jam elsewhere')
    else:
        yield Answer(OK, 'drives', f'{text}; {left or "none"} left free')


def _redundant(usual: Linearised) -> Answer:
    count = len(usual.model.row_names) - usual.rank
    if not count:
        return Answer(OK, 'redundant rows', 'none')
    owner = _owners(usual.model)
    names = list(dict.fromkeys(owner[usual.model.row_names[row]] for row in usual.dependent))
    return Answer(NOTE, 'redundant rows', f'{count}, among those of {_list(names)}')


def _reactions(usual: Linearised) -> Answer:
    model = usual.model
    if len(model.row_names) == usual.rank:
        return Answer(OK, 'reactions', 'all determinate')
    work = allocate(model, model.system, 0)
    kernel.linearise(model.unit, model.system, work, usual.q)
    reactions = Reactions(model)
    flags = reactions.indeterminate(reactions.on_cut_blocks(usual.q), work)
    names = [name for name, flag in zip(model.joint_names, flags, strict=True) if flag]
    if not names:
        return Answer(OK, 'reactions', 'all determinate')
    return Answer(NOTE, 'reactions', f'rigid bodies leave open those of {_list(names)}')


def _mass(at: Linearised) -> Answer:
    count = at.massless.shape[1]
    if not count:
        return Answer(OK, 'mass', 'in every direction that is free')
    names = moving(at.model, at.massless[:, 0])
    points = [name for name in names if name in at.model.layout.of_point]
    cure = f'give mass to what carries {_list(points)}'
    if not points:
        bodies = [body.name for body in at.model.mechanism.bodies if {*names} & {*body.vectors}]
        cure = f'{_list(bodies)} may turn without inertia'
    return Answer(BAD, 'mass', f'none in {_count(count, "free direction")}: {cure}')


def _start(at: Linearised, usual: Linearised) -> Answer:
    if at.rank == usual.rank:
        return Answer(OK, 'initial position', 'not singular')
    more = _count(usual.rank - at.rank, 'freedom')
    text = f'singular: {more} more than around it, so that more than one motion may start here'
    return Answer(BAD, 'initial position', text)


def _on_the_way(usual: Linearised, walk: Sweep) -> Answer:
    question = 'singular positions'
    if len(walk.positions) < 2:
        return Answer(OK, question, 'not looked for')
    looked = f'{len(walk.positions)} positions, ' + (
        'all the way round' if walk.whole else 'a part of the way'
    )
    if not walk.singular:
        return Answer(OK, question, f'none found ({looked})')
    first = _place(usual.model, walk.singular[0])
    return Answer(NOTE, question, f'{len(walk.singular)} found ({looked}); at {first}')


def _place(model: Model, q: Floats) -> str:
    """Some points that move, and where they are."""
    places = q.reshape(-1, model.layout.dimension)
    points = [point.name for point in model.mechanism.points if not point.fixed]
    parts = []
    for name in points[:3]:
        numbers = ', '.join(
            f'{x + 0.0:.4g}' for x in np.round(places[model.layout.of_point[name]], 6)
        )
        parts.append(f'{name} [{numbers}]')
    return ', '.join(parts) + (' ...' if len(points) > 3 else '')


def _owners(model: Model) -> dict[str, str]:
    """The joint, body or vector that each row is of."""
    owner = {f'{vector.name}_unit': vector.name for vector in model.mechanism.vectors}
    for body in model.mechanism.bodies:
        owner.update((row.name, body.name) for row in rigidity(body, model.layout))
    for joint in model.mechanism.joints:
        owner.update((row.name, joint.name) for row in joint_rows(joint, model.layout))
    return owner


def _list(names: Sequence[str], most: int = 6) -> str:
    return ', '.join(names[:most]) + (f' and {len(names) - most} more' if names[most:] else '')


def _count(n: int, what: str) -> str:
    return f'{n} {what}{"" if n == 1 else "s"}'
