"""The solver section of an imported scene: settings that fit the effects and a position error.

Files of other formats have no integrator that would serve here. Their damping and gains act on
links with little inertia, so that explicit steps of the usual length are unstable. Which effect
asks for the implicit method is computed from the drawn position, and the error is estimated by two
runs. The choice reads no clock: the same file always gets the same settings.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.effects.contract import Effect
from alf_ros.effects.contract.scalars import place
from alf_ros.effects.tendon import STOP
from alf_ros.effects.tendon import Parameters as Tendon
from alf_ros.effects.torsion_spring import Parameters as Spring
from alf_ros.errors import AlfError, StepError
from alf_ros.scene.scene import Scene
from alf_ros.simulation.accuracy import DEAR, OVERHEAD, WORK
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.stiff_failures import IMPLICIT, told
from alf_ros.simulation.stiffness import stiffest

ACCURACY = 1e-6  # m
STEP = 1e-3  # s
EXPLICIT = 'dop853_adaptive'
_TOLERANCES = {EXPLICIT: (1e-8, 1e-9, 1e-10), IMPLICIT: (1e-6, 1e-7, 1e-8, 1e-9)}
_FINER = 1e-2  # part of the tolerance of the run that a run is compared with
_ROUNDED = 1e-12  # m: error below which rounding decides
_MARGIN = 2.0  # between the stability limit and the step, and of the error
_STAGES = 12  # of an explicit step
_DURATION, _SPACING = 50, 10  # instants that are compared, and steps between two
_DEPTH = 0.01  # rad or m, by which the motion presses a stop
_PART = 0.1  # of the work of a trial for an `accuracy`
_EXAMINED = 1500  # coordinates of mechanisms whose stiffness is computed, with dense matrices


@dataclass(frozen=True, eq=False)
class TrialRun:
    """A run: places (instants, blocks, 3) in m, evaluations in a step, and why it ended early."""

    places: Floats = field(default_factory=lambda: np.zeros((0, 0, 3)))
    evaluations: float = math.inf
    failed: str = ''

    def is_better_than(self, other: TrialRun) -> bool:
        """Whether this run, an implicit one, came further or took less time than an explicit."""
        mine, its = len(self.places), len(other.places)
        return mine > its or (mine == its and DEAR * self.evaluations < other.evaluations)


@dataclass(frozen=True, eq=False)
class Choice:
    """Settings, the run with them, and what it says about their error."""

    integrator: str
    tolerance: float
    trial: TrialRun
    error: str = ''

    def section(self, reason: str = '') -> str:
        """The text of the section with its comments."""
        failed = f'The run fails: {self.trial.failed}.' if self.trial.failed else ''
        lines = [line for each in (reason, self.error, failed) for line in textwrap.wrap(each, 97)]
        settings = f'step: {STEP:g}, integrator: {self.integrator}, tolerance: {self.tolerance:g}'
        return ''.join(f'# {line}\n' for line in lines) + f'solver: {{{settings}}}\n'


def section(scene: Scene, accuracy: float = ACCURACY) -> str:
    """The text of the solver section for a scene without one, with the reasons as comments.

    accuracy: largest error of a point, m, over half a second from the start.
    """
    try:
        simulation = Simulation(scene, step=STEP)
        stiff = _stiff(simulation)
    except AlfError as error:
        failed = str(error).removeprefix(f'{scene.file}: ')
        return Choice(EXPLICIT, _TOLERANCES[EXPLICIT][0], TrialRun(failed=failed)).section()
    if stiff:
        return _tried(simulation, IMPLICIT, accuracy).section(stiff)
    explicit = _tried(simulation, EXPLICIT, accuracy)
    if not explicit.trial.failed and explicit.trial.evaluations <= _MARGIN * _STAGES:
        return explicit.section()
    implicit = _tried(simulation, IMPLICIT, accuracy)
    if not implicit.trial.is_better_than(explicit.trial):
        return explicit.section()
    how = 'stops earlier' if explicit.trial.failed else 'takes short steps'
    return implicit.section(f'The integrator is implicit: in a trial {EXPLICIT} {how}.')


def _stiff(simulation: Simulation) -> str:
    """Why the scene needs the implicit integrator as drawn; empty if it does not."""
    if simulation.model.n > _EXAMINED:
        return ''
    scene = pressed(simulation)
    if scene is not simulation.scene:
        simulation = Simulation(scene, step=STEP)
    try:
        alone, whole = stiffest([simulation.sample()])
    except (StepError, np.linalg.LinAlgError):
        return ''
    if whole.step(EXPLICIT) >= _MARGIN * STEP:
        return ''
    return f'The integrator is implicit because of {told(alone, whole, EXPLICIT)}.'


def pressed(simulation: Simulation) -> Scene:
    """The scene as stiff as when something presses its stops and its ground: with a spring in
    place of each stop, and each ground below what it carries raised or lowered to press that."""
    scene = simulation.scene
    instead: dict[str, Callable[[Effect], list[Effect]]] = {
        'joint_stop': _spring,
        'tendon': _taut,
        'ground_contact': partial(_raised, simulation),
    }
    if not any(each.kind in instead for each in scene.effects):
        return scene
    effects = (
        instead[each.kind](each) if each.kind in instead else [each] for each in scene.effects
    )
    return replace(scene, effects=tuple(found for each in effects for found in each))


def _spring(stop: Effect) -> list[Effect]:
    p = stop.parameters
    slope = p.stiffness * p.exponent * _DEPTH ** (p.exponent - 1.0)
    return [Effect('torsion_spring', f'torsion_spring as {stop.label}', Spring(p.joint, slope))]


def _taut(tendon: Effect) -> list[Effect]:
    """The tendon without stops, and a spring along it."""
    p = tendon.parameters
    if p.lower is None and p.upper is None:
        return [tendon]
    slope = p.stop_stiffness * STOP * _DEPTH ** (STOP - 1.0)
    spring = Tendon(joints=p.joints, path=p.path, weights=p.weights, stiffness=slope)
    free = replace(p, lower=None, upper=None)
    name = f'tendon as the stop of {tendon.label}'
    return [replace(tendon, parameters=free), Effect('tendon', name, spring)]


def _raised(simulation: Simulation, contact: Effect) -> list[Effect]:
    """With a plane that the contact presses as drawn."""
    p, layout = contact.parameters, simulation.model.layout
    q = simulation.state.q.reshape(-1, layout.dimension)
    normal = np.array(p.normal or (*np.zeros(layout.dimension - 1), 1.0))
    normal /= np.linalg.norm(normal)
    radius = p.radius
    if p.axle:
        axle = layout.direction(p.on, p.axle).value(q) / np.linalg.norm(p.axle)
        radius *= math.sqrt(max(0.0, 1.0 - float(normal @ axle) ** 2))
    through = place(layout, p.on, p.at).value(q) - (radius - _DEPTH) * normal
    return [replace(contact, parameters=replace(p, through=tuple(map(float, through))))]


def _tried(simulation: Simulation, integrator: str, accuracy: float) -> Choice:
    """The largest tolerance that keeps to the accuracy, or else the smallest one."""
    for tolerance in _TOLERANCES[integrator]:
        trial = _run(simulation, integrator, tolerance)
        if len(trial.places) == 0:
            return Choice(integrator, _TOLERANCES[integrator][0], trial)
        finer = _run(simulation, integrator, _FINER * tolerance)
        n = min(len(trial.places), len(finer.places))
        error = math.inf
        if n > 0:
            error = float(np.linalg.norm(trial.places[:n] - finer.places[:n], axis=2).max())
        kept = _MARGIN * error <= accuracy
        if kept or trial.failed:  # beside what ends a run no tolerance helps
            break
    verb, span = 'keeps to' if kept else 'does not keep to', n * _SPACING * STEP
    size = f'about {error:.1g} m' if error > _ROUNDED else f'less than {_ROUNDED:g} m'
    line = (
        f'The tolerance {verb} {accuracy:g} m: for {span:g} s from the start the error is {size}.'
    )
    return Choice(integrator, tolerance, trial, line)


def _run(simulation: Simulation, integrator: str, tolerance: float) -> TrialRun:
    places: list[Floats] = []
    failed, evaluations = '', math.inf
    try:
        run = simulation.with_solver(integrator, tolerance)
        most = _PART * WORK / (OVERHEAD + run.model.n)
        while len(places) < _DURATION and run.evaluations <= most:
            run.step()  # one alone can be thousands of short ones
            evaluations = run.evaluations / run.step_index
            if run.step_index % _SPACING == 0:
                places.append(run.state.q.reshape(-1, run.model.layout.dimension))
    except StepError as error:
        failed = str(error)
    return TrialRun(np.array(places), evaluations, failed)
