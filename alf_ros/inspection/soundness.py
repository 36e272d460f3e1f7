"""Whether a mechanism is sound: its loops close, it can move, moving parts have mass, and the
motion from its start is unique.

Redundant rows, indeterminate reactions and singular positions on the way are no faults. They are
reported because other programs fail on them and because forces depend on them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.inspection.answer import BAD, NOTE, OK, Answer, counted, some
from alf_ros.inspection.branches_report import Branches, reported
from alf_ros.inspection.missing_meshes import missing_meshes
from alf_ros.inspection.position_sweep import Sweep, sweep
from alf_ros.inspection.potentials import unlike_forces
from alf_ros.inspection.start_answers import dependent_rows, start_answers
from alf_ros.model import assembly, ordinary_positions, singular_branches
from alf_ros.model.compile import Model, allocate, compile_model
from alf_ros.model.constraints.drives import offset
from alf_ros.model.constraints.rows import joint_rows, rigidity
from alf_ros.model.dense_linearisation import Linearised, moving
from alf_ros.model.handedness import check_hands
from alf_ros.model.singular_branches import Position
from alf_ros.model.singular_location import located
from alf_ros.model.yielding import yielding, yields
from alf_ros.scene.scene import Scene
from alf_ros.simulation.bearing_shares import BearingShares, has_bearings
from alf_ros.simulation.packed_effects import loaded
from alf_ros.simulation.reactions import Reactions

LARGEST = 4000  # coordinates: matrices are dense here
_WIDTH = 100  # characters of a line of the table
_KINDS = 6  # of singular positions in it


@dataclass(frozen=True, eq=False)
class Soundness:
    """The findings. `q` is the closed position (blocks D, m), the drawn one if none is.

    freedoms: of velocity, at ordinary positions; zero if the loops do not close. singular: what
    the singular positions of the walk are, in its order.
    """

    model: Model
    q: Floats
    answers: tuple[Answer, ...]
    walk: Sweep
    freedoms: int = 0
    singular: tuple[Branches, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether no answer is BAD."""
        return all(answer.verdict != BAD for answer in self.answers)


class TooLarge(AssemblyError):
    """A mechanism with more coordinates than dense matrices allow."""


def examine(scene: Scene) -> Soundness:
    """Look at the mechanism of a scene where the scene starts it.

    Raises AssemblyError if nothing moves or has mass, TooLarge if it has too many coordinates.
    """
    found, missing = _mechanics(scene), missing_meshes(scene.mechanism)
    told = Answer(NOTE, 'meshes', f'not drawn: {some(missing)}')
    return replace(found, answers=(*found.answers, told)) if missing else found


def _mechanics(scene: Scene) -> Soundness:
    # what it could do is asked of it free, so that a walk can take the place of its drives
    model = compile_model(replace(scene.mechanism, drives=()), scene.solver.penalty)
    if model.n > LARGEST:
        raise TooLarge(f'{model.n} coordinates, too many to examine: {LARGEST} at most')
    model = _without_rotors(model)
    drawn = Linearised(model, model.q)
    if drawn.massless.shape[1]:
        return Soundness(model, model.q, (*_size(drawn), _mass(drawn)), Sweep())
    try:
        q = assembly.close(model, scene.positions)
        check_hands(model, q)
        at = Linearised(model, q)
    except AssemblyError as error:
        closed = Answer(BAD, 'loops', str(error.message))
        return Soundness(model, model.q, (closed, *_size(drawn)), Sweep())
    usual, accustomed = _ordinary(at)
    walk = sweep(usual, None if usual is at else at)
    here = singular_branches.position(accustomed, at.q)
    answers = [_closing(at), *_size(at), _mobility(usual, here), _redundant(usual)]
    answers += _drives(scene, at, usual.model.n - usual.rank)
    answers += [*_reactions(scene, usual), _mass(at)]
    known_bad = any(answer.verdict == BAD for answer in answers)
    answers += start_answers(scene, here, known_bad)
    singular = _examined(accustomed, walk)
    answers += [*_on_the_way(usual, walk, singular), *_energy(scene, usual.model, walk)]
    return Soundness(model, at.q, tuple(answers), walk, usual.model.n - usual.rank, singular)


def table(found: Soundness, name: str) -> str:
    """The answers as lines of text."""
    lines = [f'{name}: is this mechanism sound?', '']
    for answer in found.answers:
        start = f'  {answer.verdict:5}{answer.question:20}'
        lines += textwrap.wrap(
            answer.answer, _WIDTH, initial_indent=start, subsequent_indent=' ' * len(start)
        )
    return '\n'.join([*lines, '', 'sound' if found.sound else 'NOT SOUND'])


def as_data(found: Soundness, name: str) -> dict[str, Any]:
    """All findings as numbers, text and lists, for a JSON file."""
    return {
        'name': name,
        'sound': found.sound,
        'freedoms': found.freedoms,
        'answers': [asdict(answer) for answer in found.answers],
        'positions_looked_at': len(found.walk.positions),
        'all_the_way_round': found.walk.whole,
        'singular_positions': [each.as_data() for each in found.singular],
    }


def _without_rotors(model: Model) -> Model:
    """The model without the inertia of rotors (`armature`), which adds coordinates and rows but no
    freedom; with it, where it is all the mass that something has."""
    if not model.mechanism.rotors:
        return model
    try:
        bare = compile_model(replace(model.mechanism, rotors=()), model.penalty)
    except AssemblyError:
        return model
    return model if Linearised(bare, bare.q).massless.shape[1] else bare


def _ordinary(at: Linearised) -> tuple[Linearised, Model]:
    """The position itself, or an ordinary one near it where more rows are independent; and the
    model that knows its ordinary values."""
    dependent, place, sigma = ordinary_positions.ordinary(at.model, at.q)
    near = Linearised(at.model, place)
    return near if near.rank > at.rank else at, at.model.accustomed(sigma, dependent)


# ------------------------------------------------------------------------------------ the answers


def _closing(at: Linearised) -> Answer:
    model = at.model
    moved = np.linalg.norm((at.q - model.q).reshape(-1, model.layout.dimension), axis=1)
    by_point = {name: float(moved[block]) for name, block in model.layout.of_point.items()}
    far = [name for name in by_point if by_point[name] > 1e-9 * model.size]
    far.sort(key=lambda name: -by_point[name])
    if not far:
        return Answer(OK, 'loops', 'closed as drawn')
    listed = some([f'{name} {by_point[name]:.3g} m' for name in far])
    verdict = NOTE if by_point[far[0]] > 0.01 * model.size else OK
    return Answer(verdict, 'loops', f'closed; moved from the drawing by {listed}')


def _size(at: Linearised) -> Iterator[Answer]:
    model = at.model
    velocity = model.system.rows.velocity
    rows = f'{counted(len(model.row_names), "constraint row")}, rank {at.rank}'
    if velocity:
        rows += f'; {velocity} of velocities'
    points = sum(not point.fixed for point in model.mechanism.points)
    vectors = sum(not vector.fixed for vector in model.mechanism.vectors)
    of = counted(points, 'point') + (f' and {counted(vectors, "vector")}' if vectors else '')
    yield Answer(OK, 'size', f'{model.n} coordinates of {of}; {rows}')


def _mobility(usual: Linearised, here: Position) -> Answer:
    freedoms = usual.model.n - usual.rank
    if not freedoms:
        return Answer(BAD, 'mobility', 'none: it is a structure and cannot move')
    text = counted(freedoms, 'freedom')
    places = usual.model.n - usual.rank_of_positions
    if yields(here, dependent_rows(here.model)):
        places -= yielding(here)[0]
    if places != freedoms:
        text += f' of velocity, {places} of position'
    return Answer(OK, 'mobility', text)


def _drives(scene: Scene, at: Linearised, freedoms: int) -> Iterator[Answer]:
    """Whether each motion that is prescribed takes a freedom, of which there are so many, and
    begins where the mechanism is drawn."""
    drives = scene.mechanism.drives
    if not drives:
        return
    motions = sum(motion is not None for drive in drives for motion in drive.motion)
    model = compile_model(scene.mechanism, scene.solver.penalty)
    off = ', '.join(_off(scene, model, at))
    if off and at.rank < at.model.n - freedoms:
        off += '; the drawing is singular and does not tell which branch is meant: draw it beside'
    try:
        there, _ = _ordinary(Linearised(model, assembly.close(model, scene.positions)))
    except AssemblyError as error:
        begins = f'; {off}' if off else ''
        yield Answer(BAD, 'drives', f'{error.message}{begins}')
        return
    left = model.n - there.rank
    text = f'{counted(motions, "motion")} for {counted(freedoms, "freedom")}'
    if freedoms - left < motions:
        yield Answer(BAD, 'drives', f'{text}: they take {freedoms - left} only, and jam elsewhere')
        return
    text = f'{text}; {left or "none"} left free'
    yield Answer(NOTE, 'drives', f'{text}; {off}') if off else Answer(OK, 'drives', text)


def _off(scene: Scene, model: Model, at: Linearised) -> Iterator[str]:
    """How far each drive begins from where the mechanism is drawn, or would begin without it."""
    layout, D = model.layout, model.layout.dimension
    drawn, closed = np.array(model.q), np.array(model.q)
    for name, components in scene.positions.items():
        is_point = name in layout.of_point
        block = layout.of_point[name] if is_point else layout.of_vector[name]
        for axis, value in enumerate(components):
            if value is not None:
                unit = 1.0 if is_point else layout.length
                drawn.reshape(-1, D)[block, axis] = unit * value
    for kind in ('of_point', 'of_vector'):
        blocks = getattr(at.model.layout, kind)
        for name, block in getattr(layout, kind).items():
            closed.reshape(-1, D)[block] = at.q.reshape(-1, D)[blocks[name]]
    for drive in scene.mechanism.drives:
        is_angle = drive.kind == 'angle'
        off = min(offset(drive, layout, q) for q in (drawn, closed))
        if off > (1e-6 if is_angle else 1e-6 * model.size):
            yield f'{drive.name} begins {off:.3g} {"rad" if is_angle else "m"} from the drawing'


def _redundant(usual: Linearised) -> Answer:
    count = len(usual.model.row_names) - usual.rank
    if not count:
        return Answer(OK, 'redundant rows', 'none')
    owner = _owners(usual.model)
    names = list(dict.fromkeys(owner[usual.model.row_names[row]] for row in usual.dependent))
    return Answer(NOTE, 'redundant rows', f'{count}, among the rows of {some(names)}')


def _reactions(scene: Scene, usual: Linearised) -> Iterator[Answer]:
    model = usual.model
    if len(model.row_names) == usual.rank:
        yield Answer(OK, 'reactions', 'all determinate')
        return
    work = allocate(model, model.system, 0)
    work.q[:] = usual.q
    kernel.linearise(model.unit, model.system, work, work.q)
    reactions = Reactions(model)
    there = reactions.workspace()
    if has_bearings(model):
        shares = BearingShares(model, reactions)
        kernel.place_on_cut(model.unit, reactions.arrays, there, work.q, work.qd)
        flags, cause = shares.open_components(work, there), 'rigid bodies and bearings'
    else:
        flags = reactions.indeterminate(there, work)
        cause = 'rigid bodies'
    names = [
        f'{name} ({_components(flag)})'
        for name, flag in zip(model.joint_names, flags, strict=True)
        if flag.any()
    ]
    if not names:
        shared = ', shared by bearings' if has_bearings(model) else ''
        yield Answer(OK, 'reactions', f'all determinate{shared}')
        return
    yield Answer(NOTE, 'reactions', f'not determined by {cause}: {some(names)}')
    open_forces = np.asarray(flags[:, : model.layout.dimension].any(axis=1))
    loads = {each.name: model.joint_names.index(each.joint.name) for each in model.coordinates}
    pairs = ((effect.label, loaded(effect)) for effect in scene.effects)
    rubbing = [label for label, name in pairs if name is not None and open_forces[loads[name]]]
    if rubbing:
        text = f'{some(rubbing)}: loads that are not determined, so the motion is one of many'
        yield Answer(
            NOTE, 'friction', f'{text}; give a `load`, or leave one of the redundant joints out'
        )


def _components(flags: NDArray[np.bool_]) -> str:
    """Components of force and torque that are not determined, such as 'force xy, torque z'."""
    forces, torques = ('xy', 'z') if flags.size == 3 else ('xyz', 'xyz')
    marked = zip((*forces, *torques), flags, strict=True)
    axes = [axis if flag else '' for axis, flag in marked]
    parts = {'force': ''.join(axes[: len(forces)]), 'torque': ''.join(axes[len(forces) :])}
    return ', '.join(f'{what} {which}' for what, which in parts.items() if which)


def _mass(at: Linearised) -> Answer:
    count = at.massless.shape[1]
    if not count:
        return Answer(OK, 'mass', 'in every free direction')
    names = moving(at.model, at.massless[:, 0])
    points = [name for name in names if name in at.model.layout.of_point]
    cure = f'give mass to the bodies that carry {some(points)}'
    if not points:
        bodies = [body.name for body in at.model.mechanism.bodies if {*names} & {*body.vectors}]
        cure = f'{some(bodies)} may turn without inertia'
    return Answer(BAD, 'mass', f'none in {counted(count, "free direction")}: {cure}')


def _examined(model: Model, walk: Sweep) -> tuple[Branches, ...]:
    """The kinds of the singular positions of a walk, which become exact in `walk.singular`;
    `model` knows its ordinary values."""
    walk.singular[:] = [located(model, q) for q in walk.singular]
    count = dependent_rows(model)
    return tuple(reported(singular_branches.position(model, q), count) for q in walk.singular)


def _on_the_way(usual: Linearised, walk: Sweep, singular: Sequence[Branches]) -> Iterator[Answer]:
    question = 'singular positions'
    if len(walk.positions) < 2:
        yield Answer(OK, question, 'not looked for')
        return
    looked = f'{len(walk.positions)} positions, ' + (
        'all the way round' if walk.whole else 'a part of the way'
    )
    if not singular:
        yield Answer(OK, question, f'none found ({looked})')
        return
    yield Answer(NOTE, question, f'{len(singular)} found ({looked})')
    alike: dict[str, list[int]] = {}
    for n, each in enumerate(singular):
        alike.setdefault(each.text, []).append(n)
    for text, which in list(alike.items())[:_KINDS]:
        first = _place(usual.model, walk.singular[which[0]])
        places = f'first at {first}' if which[1:] else f'at {first}'
        yield Answer(NOTE, f'  {len(which)} of them', f'{text}; {places}')
    if len(alike) > _KINDS:
        yield Answer(NOTE, '  others', f'of {len(alike) - _KINDS} more kinds')


def _energy(scene: Scene, model: Model, walk: Sweep) -> Iterator[Answer]:
    """Whether potentials of effects of users belong to their forces."""
    unlike = list(unlike_forces(scene, model, walk.positions))
    if unlike:
        text = f'at rest a force is not the slope of its potential: {some(unlike)}'
        yield Answer(NOTE, 'energy', text)


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
    owner.update((coupling.name, coupling.name) for coupling in model.mechanism.couplings)
    return owner
