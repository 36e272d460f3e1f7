"""A log continued from one of its instants, with changes, into a log of its own."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import AssemblyError, InputError
from alf_ros.logs.input_faults import check_motion, shows_states
from alf_ros.logs.log import Log
from alf_ros.logs.progress import Report, silent
from alf_ros.logs.rerun import Rerun
from alf_ros.logs.resume import resume
from alf_ros.logs.stamps import ENDS, LAST
from alf_ros.model import assembly
from alf_ros.model.compile import Model
from alf_ros.ros.recording.recorder import unused
from alf_ros.ros.recording.run_writer import LogRun, ticks
from alf_ros.scene import overrides
from alf_ros.scene.effect_values import effect_values
from alf_ros.scene.scene import PICKED, Scene, joined
from alf_ros.simulation import input_checks as check
from alf_ros.simulation import state_vector
from alf_ros.simulation.formulations import check_going_on
from alf_ros.simulation.integral_sums import couplings_off, with_couplings_of
from alf_ros.simulation.observables import READINGS
from alf_ros.simulation.setup import Setup, on_grid, steps_per_tick
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State

_OPEN = 1e-9  # of the size: constraints that a changed mechanism leaves open further are closed


def fork(
    log: Log,
    at: float,
    changes: Mapping[str, str],
    folder: Path,
    name: str = '',
    duration: float | None = None,
    trust: bool = False,
    report: Report = silent,
    warn: Callable[[str], None] = lambda _: None,
) -> Path:
    """Continue a log from its last instant up to `at` (s), for `duration` (s) or to its end.

    `changes` are changes for `scene.overrides`. The inputs that the log has from there on act at
    the same times. `warn` is called with a text if the log is not whole, if the steps are too
    long, if the scene of the new log has another start, and if the log has messages of
    sensors: the new one has none.
    Returns the folder of the new log, made in `folder`. Raises InputError for an impossible
    request, StepError if a step fails; the log is complete up to that step. A log whose inputs are
    not the ones of its motion is refused.
    """
    if duration is not None:
        check.number(duration, '--duration', 0.0)
    if name:
        unused(folder, name)  # told before the log is run
    resumed = resume(log, at, trust)
    rerun = resumed.rerun
    before, steps = rerun.simulation, rerun.steps_per_tick
    tick, start = steps * before.h, before.t
    changed = {k.partition('.')[2] for k in changes if k.startswith('solver.')}
    state, scene = before.state, rerun.scene
    if changes:
        state = _change(rerun, changes, changed, warn)
    simulation = rerun.simulation
    steps = _steps_in(tick, simulation.h)
    resumed.rest = _kept(resumed.rest, rerun, changed, _other_values(scene, rerun.scene))
    end = log.end if duration is None else start + duration
    if end * 1e9 + log.ahead > LAST:
        most = f'at most {math.floor((LAST - log.ahead) * 1e-9 - start)} s'
        raise InputError(ENDS, key='--duration', value=duration, expected=most)
    if 'step' in changed:
        _check_steps(resumed.rest, simulation.h, end)
    if log.absent and end > log.end + 0.5 * tick:  # inputs in them may act there
        raise InputError(
            f'nothing is known of the later inputs: {log.absent}',
            file=str(log.path),
            key='--duration',
            value=duration,
            expected=f'at most {log.end - start:.9g} s',
        )
    if log.cut:
        warn(log.cut)
    if shows_states(log):
        again = resume(log, at, trust)
        check_motion(log, again.rerun, again.rest, end)
    parent = {
        'log': log.path.name,
        'seal': log.inputs[0].get('seal', ''),
        'step': before.step_index,
        't': start,
        'changes': dict(changes),
    }
    if measured := measuring(log, scene):
        warn(f'the new log has no messages of sensors ({", ".join(measured)})')
    recorded = [r.name for r in READINGS.values() if log.topic(r.name) in log.survey.counts]
    setup = Setup(rerun.scene, simulation, steps)
    run = LogRun(
        folder,
        setup,
        state=state,
        ahead=log.ahead,
        topics=log.info.get('topics'),
        recorded=recorded,
        about={'parent': parent},
        name=name,
    )
    try:
        run.send()
        for t in ticks(run, resumed, end):
            report((t - start) / max(end - start, t - start))
    finally:
        run.close()
        if rerun.trouble:
            warn(rerun.trouble)
    return run.recorder.folder


def measuring(log: Log, scene: Scene) -> list[str]:
    """The sensors of a scene that a log has messages of."""
    labels = [each.label for each in scene.sensors]
    return [label for label in labels if log.topic(f'~/{label}') in log.survey.counts]


def _change(
    rerun: Rerun,
    changes: Mapping[str, str],
    changed: set[str],
    warn: Callable[[str], None],
) -> State:
    """Let `rerun` continue with changes; returns the state in which the changed mechanism
    begins."""
    before = rerun.simulation
    for name in changes:
        if name.partition('.')[0] == 'initial':
            said = 'has no effect: a fork begins in the state of the log'
            raise InputError(said, key='--set', value=name)
    for target, held in before.state.inputs.targets.items():
        # with a position from outside, the velocity is the one from outside, or the slope of it
        for what, by in (('position', held.position), ('velocity', held.velocity)):
            name, acts = f'targets.{target}.{what}', held.position is None and by is None
            if name in changes and not acts:
                said = 'has no effect: a target from outside is held there'
                raise InputError(said, key='--set', value=name)
    own = {
        key: getattr(overrides.with_changes(rerun.scene, changes).solver, key) for key in changed
    }
    solver = dataclasses.asdict(before.solver)
    if own:
        solver = joined(solver, own)
    scene, after = _startable(rerun, changes, solver, warn)
    start = before.state
    if start.loads.size != after.state.loads.size:  # other effects rub: nothing is known of them
        start = dataclasses.replace(start, loads=np.zeros_like(after.state.loads))
    numbers, rates = state_vector.values(before.model, start)
    names = [
        state_vector.names(before.model, start),
        state_vector.names(after.model, after.state),
    ]
    check_going_on(before.solver.formulation, after.solver.formulation)
    if names[0] != names[1]:
        raise InputError('the state of the log does not fit the changed scene', key='--set')
    if after.state.carried.size and scene.mechanism != rerun.scene.mechanism:
        text = f'{after.solver.formulation} cannot continue with another mechanism'
        raise InputError(text, key='--set')
    first = after.state
    state = state_vector.state(after.model, first, numbers, rates, start.inputs)
    if scene.mechanism != rerun.scene.mechanism:
        # what lies near half a turn may count another one as drawn now, and at this instant
        begun = before.initial_state
        first = first.moved(first.q, first.qd, _turns(before.model, begun, after.model, first.q))
        turns = _turns(before.model, start, after.model, state.q)
        if (turns != state.turns).any():
            state = state.moved(state.q, state.qd, turns)
        state = with_couplings_of(after.model, state, first)
    after.restore(_on_grid(state, before, after))
    found, q, qd = after.sample().diagnostics, state.q, state.qd
    is_open = max(found.position_violation, found.velocity_violation) > _OPEN * after.model.size
    if is_open:
        try:
            off = couplings_off(after.model, after.state)
            q, qd = assembly.brought_back(after.model, q, qd, after.t, off)
        except AssemblyError as error:
            raise InputError(f'from this instant, {error.message}', key='--set') from None
        # an angle near half a turn that is moved over it goes on, and does not begin a turn away
        turns = _turns(before.model, start, after.model, q)
        after.restore(with_couplings_of(after.model, after.state.moved(q, qd, turns), first))
        for name, missed in couplings_off(after.model, after.state).items():
            if abs(missed) > _OPEN * after.model.size:  # whole turns, which closing does not see
                text = f'from this instant, coupling {name} is more than half a turn away'
                raise InputError(text, key='--set')
    rerun.scene, rerun.simulation = scene, after
    return after.state


def _startable(
    rerun: Rerun, changes: Mapping[str, str], solver: dict[str, Any], warn: Callable[[str], None]
) -> tuple[Scene, Simulation]:
    """The changed scene, and its simulation at its start.

    A fork does not begin there, but in the state of the log. So a start that the changes make
    impossible, or not unique, is given up: first its velocities, then its positions too.
    """
    given_up: dict[str, str] = {}
    reason = ''
    while True:
        scene = overrides.with_changes(rerun.scene, {**changes, **given_up})
        try:
            after = Simulation(scene, **solver, ledger=rerun.simulation.ledger)
            break
        except AssemblyError as error:
            reason = reason or error.message
            if scene.velocities and error.key == 'initial.velocities':
                given_up['initial.velocities'] = '{}'
            elif scene.positions and error.key in ('initial.velocities', 'initial.positions'):
                given_up['initial.positions'] = '{}'
                if scene.velocities:
                    given_up['initial.velocities'] = '{}'
            else:
                raise
            if scene.branch is not None:  # which velocities begin on
                given_up['initial.branch'] = '~'
    if given_up:
        names = ' and '.join(name for name in sorted(given_up) if name != 'initial.branch')
        warn(
            f'without {names} in the scene of the new log: {reason} (the new log begins in the '
            'state of the old one)'
        )
    return scene, after


def _on_grid(state: State, before: Simulation, after: Simulation) -> State:
    """The state for the steps of `after`. Raises InputError if none of these ends there."""
    try:
        return on_grid(state, before.h, after.h)
    except InputError:
        begin = f'the fork begins at t = {before.t:.9g} s'
        text = f'{begin}, which is not a whole number of such steps'
        raise InputError(text, key='--set solver.step', value=after.h) from None


def _steps_in(tick: float, h: float) -> int:
    """The steps of h (s) in a tick (s) of the log. Raises InputError if it is not a whole number.

    A command that forks has no rate, which another message would name.
    """
    try:
        return steps_per_tick(1.0 / tick, h)
    except InputError:
        text = f'the log has ticks of {tick:.9g} s, which are not a whole number of such steps'
        raise InputError(text, key='--set solver.step', value=h) from None


def _turns(before: Model, start: State, after: Model, q: Floats) -> Integers:
    """The turns of each angle at q (blocks D, m) of the changed mechanism."""
    jumps = _angles(after, q, start) - _angles(before, start.q, start)
    return np.asarray(start.turns - np.round(jumps / (2.0 * np.pi)).astype(np.int64))


def _angles(model: Model, q: Floats, state: State) -> Floats:
    """The counted angles (rad) at q (blocks D, m), with the turns and velocities of a state."""
    angles, *others = np.zeros((3, state.turns.size))
    of = model.unit, model.system.angles, q, state.qd, state.turns
    kernel.counted_angles(*of, angles, *others)
    return angles


def _other_values(before: Scene, after: Scene) -> set[str]:
    """The names of the numbers of effects that differ in two scenes."""
    known = {name: each.value for name, each in effect_values(before).items()}
    return {name for name, each in effect_values(after).items() if known.get(name) != each.value}


def _check_steps(rest: list[dict[str, Any]], h: float, end: float) -> None:
    """Raise InputError for an entry before `end` (s) that acts between steps of h (s): it would
    act at another time."""
    for entry in rest:
        t = entry['t']
        if t < end - 0.5 * h and abs(t / h - round(t / h)) > 1e-6:
            text = f'the log has an input at t = {t:.9g} s, which lies between such steps'
            raise InputError(text, key='--set solver.step', value=h)


def _kept(
    rest: list[dict[str, Any]], rerun: Rerun, changed: set[str], effects: set[str]
) -> list[dict[str, Any]]:
    """Settings to come do not take back what the fork has changed: these fields of the solver and
    numbers of effects."""
    solver = dataclasses.asdict(rerun.simulation.solver)
    if not changed.isdisjoint(('accuracy', *PICKED)):
        changed = changed.union(('accuracy', *PICKED))
    own = {key: solver[key] for key in changed}
    kept = []
    for entry in rest:
        if entry['kind'] == 'settings':
            tick = entry['steps_per_tick'] * entry['solver']['step']
            entry = {**entry, 'solver': {**entry['solver'], **own}}
            entry['steps_per_tick'] = _steps_in(tick, entry['solver']['step'])
            left = {key: x for key, x in entry['effects'].items() if key not in effects}
            entry['effects'] = left
        kept.append(entry)
    return kept
