"""Answers of `check` about the start of a scene: its position, its angles, its velocities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from alf_ros.errors import AssemblyError
from alf_ros.inspection.answer import BAD, NOTE, OK, Answer, counted, some
from alf_ros.inspection.branches_report import reported
from alf_ros.inspection.far_angles import far_angles
from alf_ros.model import singular_branches
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import moving
from alf_ros.model.singular_branches import Position
from alf_ros.model.yielding import yielding, yields
from alf_ros.scene.scene import Scene
from alf_ros.simulation.simulation import Simulation


def dependent_rows(model: Model) -> int:
    """How many rows depend on others at ordinary positions."""
    return len(model.row_names) - round(model.system.rank)


def start_answers(scene: Scene, here: Position, is_known_bad: bool) -> Iterator[Answer]:
    """Whether the scene's start is one that a motion begins with, as the simulation judges it.

    `here`: of the model without drives, which knows its ordinary values.
    """
    solver = replace(scene.solver, accuracy=None, formulation='alf2')
    simulation, fault = None, None
    try:
        simulation = Simulation(replace(scene, solver=solver))
    except AssemblyError as error:
        fault = error
    dependent = dependent_rows(here.model)
    gained = len(here.lost) - dependent
    if simulation is not None and simulation.singular_start is not None:
        if not scene.mechanism.drives or simulation.singular_start.is_driven:
            here, gained = simulation.singular_start, max(gained, 1)
    if simulation is not None and simulation.adjustment is not None:
        yield Answer(NOTE, 'redundant lengths', str(simulation.adjustment))
    yield _place_of_start(here, gained, dependent)
    far = [] if simulation is None else far_angles(scene, simulation)
    yield from (Answer(NOTE, 'initial angles', text) for text in far)
    question = 'initial velocities'
    if simulation is None:
        of_velocities = fault is not None and fault.key == 'initial.velocities'
        if fault is not None and (of_velocities or not is_known_bad):
            yield Answer(BAD, question if of_velocities else 'start', fault.message)
    elif simulation.state.qd[: simulation.model.n].any():
        yield Answer(OK, question, 'fit the constraints')
    elif simulation.resolution.unexamined:
        yield Answer(NOTE, question, simulation.resolution.unexamined)
    elif simulation.singular_start is not None and not yields(here, dependent):
        yield _from_rest(here, simulation)


def _place_of_start(here: Position, gained: int, dependent: int) -> Answer:
    question = 'initial position'
    if here.kind == singular_branches.SHAKY and not any(b.dimension for b in here.branches):
        names = some(moving(here.model, here.free[0, : here.model.n]))
        text = f'infinitesimally mobile only (shaky): {names} may yield, but no motion begins'
        return Answer(BAD, question, text)
    if not here.is_driven and yields(here, dependent):
        count, names = yielding(here)
        text = (
            f'not singular, but shaky wherever it goes: rows hold {count} of the '
            f'{counted(len(here.free), "freedom")} of velocity to second order only; {names} may '
            'yield, and no finite reactions hold what pushes them there'
        )
        return Answer(NOTE, question, text)
    if gained <= 0:
        return Answer(OK, question, 'not singular')
    text = reported(here, dependent).text
    return Answer(
        NOTE, question, f'singular: {counted(gained, "freedom")} more than around it; {text}'
    )


def _from_rest(here: Position, simulation: Simulation) -> Answer:
    """Result of the rule for a start at rest in a singular position."""
    question, departure = 'initial velocities', simulation.departure
    if departure is not None:
        alone = here.described(None, [departure])
        number = f'branch {here.number(departure)}, ' if len(here.branches) > 1 else ''
        text = f'at rest: leaves along {number}{alone}, where forces do most'
        return Answer(NOTE, question, text)
    if here.kind in (singular_branches.CURVED, singular_branches.MANY):
        text = 'at rest: a force starts the branch that is nearest to its acceleration'
        return Answer(NOTE, question, text)
    return Answer(OK, question, 'at rest, and stays there: no force acts along a branch')
