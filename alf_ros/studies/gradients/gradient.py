"""The gradient of a number of a run: one run and one pass back, for any number of parameters."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError, argument_of
from alf_ros.logs.input_faults import check_motion, checked_journal, shows_states
from alf_ros.logs.log import Log, load
from alf_ros.logs.rerun import Rerun
from alf_ros.scene.scene import Scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.displaced_scenes import DisplacedScenes
from alf_ros.simulation.explicit_choice import explicit_solver
from alf_ros.simulation.named_number import CALL
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.tangent_following import checked_names
from alf_ros.studies.gradients.legs import RunInstant
from alf_ros.studies.gradients.observed_number import ObservedNumber, observed_number
from alf_ros.studies.gradients.taped_run import TapedRun
from alf_ros.studies.optimisation.folds import FOLDS, Folded, unit_of

_SAME = 1e-9  # of the largest value: what differs by less does not jump
_COARSE = 1e-3  # of the largest value: how far the number of half the samples may be off
_ROUNDING = 1e-9  # of the values beside it: a number that is off by less does not count
_SHORTEST = 3  # samples of a part between two changes of inputs that has its own polynomials
_FEW = 6  # samples of a polynomial: fewer tell nothing of those between them


@dataclass(frozen=True)
class Gradient:
    """`of`: the number, with its `value` and unit; `t`: the instant (s) that it belongs to, if it
    is one. `by`: its derivatives by numbers of the scene, per unit of each. `trouble`: steps of
    the run that are too long, or samples too far apart, in words; or empty."""

    of: str
    value: float
    unit: str
    t: float | None
    by: Mapping[str, float]
    trouble: str = ''


class _Stretch(NamedTuple):
    """Steps with the same inputs: the preparation before them, and their number."""

    begin: Callable[[], None]
    steps: int


def gradient(
    source: str | os.PathLike[str] | Log | Simulation | Scene,
    of: str,
    by: Sequence[str],
    duration: float | None = None,
    every: int | None = None,
    trust: bool = False,
) -> Gradient:
    """The derivatives of a number of a run by numbers of its scene, exact to rounding.

    source: a log; or a scene or a simulation, which stays as it is: a copy of it runs for
    `duration` (s) with the inputs held. of: `final(points.B.x)`, `mean(knee.position)`,
    `max(norm(reactions.knee.force))`, …: one of max, min, final, mean, integral and rms of a
    quantity, by its name as of `record`. by: names as of `fork --set`, and of inputs
    (`joints.knee.effort`, `joints.knee.effort[100:200]` in steps 100 to 199). every:
    steps from one sample to the next (default: a tick of the log, or one step). trust: run the
    effect code that a log contains.

    Raises InputError for a number without a derivative, by its name, and StepError.
    """
    if isinstance(source, Scene):
        made = Simulation(source)
        solver = explicit_solver(made)
        source = made if solver == made.solver else made._with(solver)
    if isinstance(source, Simulation):
        simulation, tick = copy.copy(source), 1
        steps = _steps_of(simulation, duration)
        stretches: Iterator[_Stretch] = iter([_Stretch(lambda: None, steps)])
    else:
        if not isinstance(source, (str, os.PathLike, Log)):
            expected = 'a log, a Simulation or a Scene'
            raise InputError('no run', key='source', value=source, expected=expected)
        if duration is not None:
            raise InputError('a log has its own duration', key='duration', value=duration)
        log = source if isinstance(source, Log) else load(Path(source))
        inputs = checked_journal(log)
        if shows_states(log):
            check_motion(log, Rerun(log, trust), inputs)
        rerun = Rerun(log, trust)
        simulation = rerun.simulation
        steps = rerun.step_of(log.survey.last) - simulation.step_index
        if steps < 1:
            raise InputError('no gradient: it has not one step', file=str(log.path))
        tick = min(rerun.steps_per_tick, steps)  # a fork may be shorter than a tick
        stretches = _stretches(log, rerun)
    every = check.whole(tick if every is None else every, 'every', 1)
    return _gradient(simulation, stretches, of, by, every)


def _steps_of(simulation: Simulation, duration: float | None) -> int:
    if duration is None:
        raise InputError('how long is the run?', key='duration', expected='seconds')
    steps = check.steps_of(duration, simulation.h, simulation.step_index)
    if steps < 1:
        raise InputError('not one step', key='duration', value=duration)
    return steps


def _stretches(log: Log, rerun: Rerun) -> Iterator[_Stretch]:
    """The stretches of a log. Raises InputError if its settings change on the way."""
    last, at = rerun.step_of(log.survey.last), rerun.simulation.step_index
    waiting: list[Callable[[], None]] = []

    def act() -> None:
        for each in waiting:
            each()
        waiting.clear()

    for entry in log.inputs:
        if entry['kind'] == 'start':
            continue
        if entry['kind'] == 'settings':
            changed = rerun.changes(entry)
            if changed:
                told, value = 'no gradient: it changes on the way', f't = {entry["t"]:.9g} s'
                raise InputError(told, file=str(log.path), key=changed[0], value=value)
            continue
        step = rerun.step_before(entry)
        if step >= last:
            break
        if step > at:
            yield _Stretch(act, step - at)
            at = step
        waiting.append(lambda entry=entry: rerun.act(entry))  # type: ignore[misc]
    yield _Stretch(act, last - at)


def _gradient(
    simulation: Simulation,
    stretches: Iterator[_Stretch],
    of: str,
    by: Sequence[str],
    every: int,
) -> Gradient:
    with argument_of('by', 'tangents'):
        names = checked_names(by)
        if not names:
            raise InputError('by no number', key='by', expected='names of numbers of the scene')
        run = TapedRun(simulation, names)
    fold, number, unit = _objective(of, simulation.sample(), run.displaced)
    first = simulation.step_index
    samples = _sampled(run, number, simulation, stretches, every)
    run.following.places.check_steps(first, simulation.step_index, 'by')
    values, sizes = map(np.array, zip(*samples.values(), strict=True))
    if not np.isfinite(values).all():
        raise InputError('it has no value on the way', key='of', value=of)
    trouble = simulation.sample().diagnostics.trouble
    t = np.array([instant.step for instant in samples]) * simulation.h
    found = fold(t, values, run.kinks)
    trouble = trouble or _coarse(t, values, sizes, found, lambda *half: fold(*half, run.kinks))
    weights = {
        instant: weight
        for instant, weight in zip(samples, found.weights.tolist(), strict=True)
        if weight != 0.0
    }
    slopes = run.derivatives(number, weights) if weights else np.zeros(len(names))
    derivatives = dict(zip(names, slopes.tolist(), strict=True))
    return Gradient(of, found.value, unit, found.t, derivatives, trouble)


def _sampled(
    run: TapedRun,
    number: ObservedNumber,
    simulation: Simulation,
    stretches: Iterator[_Stretch],
    every: int,
) -> dict[RunInstant, tuple[float, float]]:
    """Make the run. Returns the number where it begins and ends, and each `every` steps between;
    before and behind a change of inputs, by which it jumps or its rates do. With each one the size
    of the values beside it."""
    first, found = simulation.step_index, dict[RunInstant, tuple[float, float]]()
    for stretch in stretches:
        stretch.begin()
        begin, end = simulation.step_index, simulation.step_index + stretch.steps
        for leg in run.go_on(stretch.steps):
            steps = range(leg.state.step + 1, leg.end + 1)
            wanted = [RunInstant(n) for n in steps if (n - first) % every == 0 or n == end]
            if leg.state.step == begin:
                wanted.insert(0, leg.begin)
            samples = run.samples([instant.step for instant in wanted])
            for instant, sample in zip(wanted, samples, strict=True):
                found[instant] = number.value(sample)
    last = simulation.step_index
    if last - first < every:
        raise InputError('longer than the run', key='every', value=every, expected='steps')
    least = _SAME * max(abs(value) for value, _ in found.values())
    changes = [n for n, instant in enumerate(found) if instant.begins and instant.step > first]
    sizes = np.diff([0, *changes, len(found)]).tolist()
    instants = list(found)
    for n, beside in zip(changes, pairwise(sizes), strict=True):
        behind = instants[n]
        before = RunInstant(behind.step)
        # a polynomial across a kink would swing; parts of two samples have no better one
        if min(beside) < _SHORTEST and abs(found[behind][0] - found[before][0]) <= least:
            del found[behind]
            if (before.step - first) % every:
                del found[before]
    return found


def _coarse(
    t: Floats,
    y: Floats,
    sizes: Floats,
    found: Folded,
    fold: Callable[[Floats, Floats], Folded],
) -> str:
    """Whether a number of samples y (N,) at t (N,) s belongs to its polynomials more than to the
    quantity, in words: half the samples give another one. Final values need no polynomial.

    sizes (N,): of the values beside y. An energy that stays zero is rounding of its parts: each
    choice of samples has another one.
    """
    kept = np.arange(t.size) % 2 == 0
    kept[[0, -1]] = True
    twice = np.flatnonzero(np.diff(t) == 0.0)  # both sides of an input
    kept[twice] = kept[twice + 1] = True
    is_sample = found.t == t[-1] and np.count_nonzero(found.weights) == 1
    if is_sample or np.count_nonzero(kept) < _FEW:
        return ''
    half = fold(t[kept], y[kept])
    off = max(_COARSE * float(np.abs(y).max()), _ROUNDING * float(sizes.max()))
    if abs(half.value - found.value) <= off * float(abs(found.weights).sum()):
        return ''
    return (
        f'samples are too far apart for it: every second one gives {half.value:.6g}; take a '
        'smaller `every`, or smaller steps'
    )


def _objective(
    of: str, sample: Sample, beside: DisplacedScenes
) -> tuple[Callable[..., Folded], ObservedNumber, str]:
    """How the number is made of the values of a quantity, the quantity, and the number's unit."""
    called = CALL.fullmatch(check.closed(of.strip(), 'of')) if isinstance(of, str) else None
    if called is not None and called[1] not in FOLDS:
        raise InputError('no such number of a run', key='of', value=called[1], choices=FOLDS)
    if called is None:
        choices = ', '.join(f'{name}(…)' for name in FOLDS)
        raise InputError('not a number of a run', key='of', value=of, expected=choices)
    number = observed_number(called[2], 'of', sample, beside)
    return FOLDS[called[1]], number, unit_of(called[1], number.named.unit)
