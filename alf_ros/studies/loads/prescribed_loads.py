"""`alf_ros.loads`: efforts of chosen actuators and reactions of joints along a given motion."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene.scene import SceneSource, load_scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.input_checks import by_name, number, texts
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.loads.driven_motion import Carrier, moving, undriven
from alf_ros.studies.loads.inverse_dynamics import InverseDynamics, Motion, NeededEfforts
from alf_ros.studies.loads.load_history import POSSIBLE, LoadHistory
from alf_ros.studies.loads.singular_instants import limits

_AGREED = 1e-11  # of the largest load of friction: it no longer changes
_ROUNDS = 100  # of efforts and loads of friction


def loads(
    motion: SceneSource | Simulation,
    actuators: Sequence[str] | None = None,
    *,
    times: Sequence[float] | Floats,
    weights: Mapping[str, float] | None = None,
    without: Sequence[str] = (),
) -> LoadHistory:
    """The efforts with which actuators make a motion, and the reactions of all joints.

    motion: a scene whose drives prescribe it, or a simulation that moves; the drives are left out,
    and the actuators take their place. actuators: names of joint coordinates, or of wrenches such
    as 'wrenches.C.force.z'; the driven joints if absent. times (s, ascending): instants of the
    motion. Effects of the scene act as they do in a run, except those named in `without`, such as
    motors that made the motion.

    If the actuators are more than the freedoms, the efforts have the least Σ w u², w from
    `weights` (1 if absent; u in N or N m). If they cannot make the motion, the efforts leave the
    least accelerations in the metric of the mass: `LoadHistory.missing`.

    Raises InputError for names and numbers that cannot be used, and if friction and efforts find
    no balance.
    """
    motion = motion if isinstance(motion, Simulation) else load_scene(motion)
    simulation = moving(motion)
    begin = copy.copy(simulation)
    names = _actuators(simulation, actuators)
    bare = undriven(motion, texts(without, 'without'))
    solver = InverseDynamics(bare, names)
    solver.weigh(_weights(solver.names, weights))
    carrier = Carrier(simulation, bare)
    instants = check.times(times, simulation.t, simulation.h, 'times')
    if not instants:
        raise InputError('no instants', key='times', expected='s, one or more')
    last = max(0.0, instants[-1] - simulation.t)
    path = carrier.motion(list(simulation.run(last, at=instants)))
    found = solver.needed(path)
    if path.loads.size:
        path, found = _with_friction(carrier, bare, solver, path, found)
    else:
        found = _with_limits(carrier, begin, solver, path, found)
    return history_of(carrier, bare, solver, path, found)


def history_of(
    carrier: Carrier, bare: Simulation, solver: InverseDynamics, path: Motion, found: NeededEfforts
) -> LoadHistory:
    """The efforts found for a path, with samples of the mechanism that they move."""
    return LoadHistory(
        t=path.t,
        names=solver.names,
        units=solver.units,
        efforts=found.efforts,
        short=found.short,
        missing=found.missing,
        notes=_notes(carrier, bare, solver, path, found),
        sampled=lambda: _sampled(carrier, bare, solver, path, found),
    )


def _actuators(simulation: Simulation, given: Sequence[str] | None) -> tuple[str, ...]:
    if given is not None:
        names = texts(given, 'actuators')
        if not names:
            raise InputError('no actuators', key='actuators', expected='one or more')
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError('given twice', key='actuators', value=twice)
        return names
    drives = simulation.scene.mechanism.drives
    if not drives or any(drive.kind not in ('angle', 'length') for drive in drives):
        raise InputError(
            'which actuators move it?',
            key='actuators',
            expected='names of joints',
            choices=simulation.model.coordinate_names,
        )
    return tuple(drive.of[0] for drive in drives)


def _weights(names: tuple[str, ...], given: Mapping[str, float] | None) -> Floats:
    weights = dict.fromkeys(names, 1.0)
    for name, value in by_name(given, 'weights', 'a number for each actuator').items():
        if name not in weights:
            raise InputError('no such actuator', key='weights', value=name, choices=names)
        weights[name] = number(value, f'weights.{name}', 0.0)
        if weights[name] == 0.0:
            raise InputError('not usable', key=f'weights.{name}', value=value, expected='> 0')
    return np.array(list(weights.values()))


def _with_friction(
    carrier: Carrier, bare: Simulation, solver: InverseDynamics, path: Motion, found: NeededEfforts
) -> tuple[Motion, NeededEfforts]:
    """Efforts and loads of friction that agree. Raises InputError if they do not settle."""
    if not found.is_regular.any():
        return path, found
    for _ in range(_ROUNDS):
        samples = _sampled(carrier, bare, solver, path, found)
        rubbing = path.loads.copy()
        rubbing[found.is_regular] = [sample.friction_loads for sample in samples]
        change = float(np.abs(rubbing - path.loads).max(initial=0.0))
        path = replace(path, loads=rubbing)
        found = solver.needed(path)
        if change <= _AGREED * float(np.abs(rubbing).max(initial=0.0)):
            return path, found
    raise InputError(
        'friction and efforts find no balance: friction holds the motion', key='actuators'
    )


def _with_limits(
    carrier: Carrier,
    begin: Simulation,
    solver: InverseDynamics,
    path: Motion,
    found: NeededEfforts,
) -> NeededEfforts:
    """The efforts with limits along the motion in singular positions."""
    lost = ~found.is_known
    if not lost.any() or lost.all():
        return found

    def read(times: Floats) -> Floats:
        again, at = copy.copy(begin), times.tolist()
        samples = list(again.run(at[-1] - begin.t, at=at))
        return solver.needed(carrier.motion(samples)).efforts

    span = float(path.t[0]), float(path.t[-1])
    efforts = found.efforts.copy()
    efforts[lost] = limits(path.t[lost], span, np.nanmax(np.abs(efforts), axis=0), read)
    return replace(found, efforts=efforts)


def _sampled(
    carrier: Carrier,
    bare: Simulation,
    solver: InverseDynamics,
    path: Motion,
    found: NeededEfforts,
    most: int | None = None,
) -> list[Sample]:
    """The motion as samples of the mechanism that the actuators move, at regular instants, or the
    first ones: in a singular position, reactions feel the rounding of an effort over the distance
    to it."""
    samples, before = [], bare.state.inputs
    for k in np.flatnonzero(found.is_regular)[:most]:
        bare._run.hold(solver.held(found.efforts[k]))
        samples.append(bare._sample(float(path.t[k]), carrier.state(path, int(k)), False))
    bare._run.hold(before)
    return samples


def _notes(
    carrier: Carrier, bare: Simulation, solver: InverseDynamics, path: Motion, found: NeededEfforts
) -> tuple[str, ...]:
    """Conditions of the result, a sentence each."""
    notes, count = [], len(solver.names)
    lost = ~found.is_known
    if lost.any():
        notes.append(
            f'at {lost.sum()} of {lost.size} instants, first at t = {path.t[lost][0]:.6g} s, the '
            'efforts are not determined (a singular position): they are NaN'
        )
    if lost.all():
        return tuple(notes)
    if np.median(found.moved[~lost]) < count:
        notes.append(
            f'{count} actuators move {round(float(np.median(found.moved[~lost])))} freedoms: the '
            'efforts have the least sum w u^2'
        )
    short = np.where(lost, 0.0, np.nan_to_num(found.short))
    if short.max() > POSSIBLE:
        k = int(short.argmax())
        names, rates = bare.model.coordinate_names, found.missing[k]
        joint = int(np.abs(rates).argmax()) if rates.size else -1
        unit = '' if joint < 0 else 'rad' if bare.model.coordinates[joint].is_angle else 'm'
        worst = f': {names[joint]} misses {abs(rates[joint]):.3g} {unit}/s^2' if joint >= 0 else ''
        notes.append(
            f'the actuators cannot make this motion{worst} at t = {path.t[k]:.6g} s, '
            f'{math.ceil(100.0 * short[k])}% of the largest forces'
        )
    for sample in _sampled(carrier, bare, solver, path, found, 1):
        open_ = [name for name, each in sample.reactions.items() if each.indeterminate]
        if open_:
            notes.append(
                f'joints are redundant: the shares of the load in {", ".join(open_)} are one '
                'solution of many'
            )
    return tuple(notes)
