"""`optimise`: numbers of a scene that minimise a number of its motion."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError, StoppedError
from alf_ros.scene.scene import Scene, SceneSource, load_scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble.crews import Processes
from alf_ros.studies.ensemble.distributions import uniform
from alf_ros.studies.ensemble.sampling import Sampling
from alf_ros.studies.optimisation.design_numbers import DesignNumbers, design_numbers
from alf_ros.studies.optimisation.design_study import DesignStudy, SearchEnd, started_search
from alf_ros.studies.optimisation.designs import Design, DesignCurve, Designs, Told
from alf_ros.studies.optimisation.driven_design import is_driven
from alf_ros.studies.optimisation.local_search import OUTSIDE
from alf_ros.studies.optimisation.optimum import Optimum, StartedSearch

SAMPLINGS = ('lhs', 'sobol', 'random')
SAMPLES = 100  # in the duration, if no period is given
MOST_SEED = 2**63 - 1
_AT_BOUND = 1e-6  # of the range of a number
_NOTHING = 1e-10  # part of a number of a design by which another one does not change it
Report = Callable[[str], None]


def optimise(
    scene: SceneSource,
    vary: Mapping[str, Any],
    minimise: Any,
    *,
    subject_to: Mapping[str, Any] | None = None,
    starts: int = 1,
    seed: int = 0,
    sampling: str = 'lhs',
    duration: float = 10.0,
    period: float | None = None,
    designs: int = 200,
    workers: int | None = None,
    report: Report | None = None,
) -> Optimum:
    """Find numbers of a scene, between bounds, that minimise a number of its motion.

    vary: [least, greatest] by the names of `fork --set`. minimise: 'max(norm(knee.force))',
    {'path': 'P', 'through': places} and so on, see doc/optimisation.md. subject_to: [least, most]
    by such numbers, None for no limit; or {label: {'of': …, 'between': [least, most]}}. starts:
    how many searches begin, the first one at the scene, the others from `sampling` within the
    bounds, with `seed`. duration and period (s): of the motion, and between its samples. designs:
    evaluations of one search at most. workers: processes of this machine that share the starts (as
    many as it has processors; 0: none, this one). report: called with a line of text.

    Gradients are exact: of tangents of the run, or, where drives decide on the motion, of the
    constraints. Raises InputError for what cannot be used, and AlfError if every start fails.
    """
    loaded = load_scene(scene)
    numbers = design_numbers(loaded, vary)
    _check_within(numbers)
    simulation = Simulation(loaded)
    length = _positive(duration, 'duration')
    driven = is_driven(simulation)
    count = check.whole(starts, 'starts', 1, 10_000)
    study = DesignStudy(
        **DesignStudy.parts(loaded),
        vary=dict(vary),
        minimise=minimise,
        subject_to=check.by_name(subject_to, 'subject_to', '{max(norm(knee.force)): [~, 50]}'),
        duration=length,
        period=_period(simulation, length, period, driven),
        driven=driven,
        begins=_begins(numbers, count, check.whole(seed, 'seed', 0, MOST_SEED), sampling),
        most=check.whole(designs, 'designs', 2, 1_000_000),
    ).sized()  # refuses goals that cannot be
    evaluation = study.designs()
    ends = _ends(study, _workers(workers, count), report or _silent)
    best = _best([end.row for end in ends])
    if best is None:
        first = ends[0].error
        assert first is not None
        if isinstance(first, InputError):
            raise first
        raise AlfError(f'no start is usable; the first one: {first}')
    return _optimum(loaded, evaluation, ends, best)


def _ends(study: DesignStudy, workers: int, report: Report) -> list[SearchEnd]:
    """Of all starts, in their order."""
    count = len(study.begins)
    if not workers:
        return [started_search(study, k, _teller(report, k, count)) for k in range(count)]
    found: dict[int, SearchEnd] = {}
    for k, end in Processes(workers, run=_numbered).chunks(study, range(count)):
        found[k] = end
        told = f'{end.row.objective:.6g}' if end.design is not None else 'failed'
        report(f'{len(found)}/{count} starts, start {k}: {told}')
    return [found[k] for k in range(count)]


def _numbered(study: DesignStudy, k: int) -> tuple[int, SearchEnd]:
    """For a worker: the start, and how it ended."""
    return k, started_search(study, k)


def _optimum(scene: Scene, study: Designs, ends: list[SearchEnd], best: int) -> Optimum:
    after, numbers, rows = ends[best].design, study.numbers, [end.row for end in ends]
    assert after is not None
    objective_before, limits_before, curves_before = _before(study, numbers)
    return Optimum(
        scene=scene,
        optimised_scene=numbers.at(after.values),
        numbers=numbers,
        objective=study.objective,
        limits=study.limits,
        values=after.values,
        objective_before=objective_before,
        objective_after=after.objective.value,
        limits_before=limits_before,
        limits_after=tuple(each.value for each in after.limited),
        active=_active(study, after),
        is_feasible=rows[best].outside <= OUTSIDE,
        notes=tuple(_notes(study, rows[best], after)),
        starts=tuple(rows),
        best=best,
        curves_before=tuple(curves_before),
        curves_after=tuple(study.curves(after.values)),
    )


def _before(
    study: Designs, numbers: DesignNumbers
) -> tuple[float, tuple[float, ...], list[DesignCurve]]:
    """Of the scene itself; without numbers where it has none."""
    try:
        objective, *limited = study.numbers_of(numbers.before)
        return objective, tuple(limited), study.curves(numbers.before)
    except StoppedError:
        raise
    except AlfError:
        return math.nan, (math.nan,) * len(study.limits), []


def _best(rows: list[StartedSearch]) -> int | None:
    """The start that ended best: inside all limits, else the least outside."""
    ended = [k for k, row in enumerate(rows) if row.end is not None]
    if not ended:
        return None
    inside = [k for k in ended if rows[k].outside <= OUTSIDE]
    if inside:
        return min(inside, key=lambda k: rows[k].objective)
    return min(ended, key=lambda k: rows[k].outside)


def _active(study: Designs, design: Design) -> tuple[str, ...]:
    numbers = study.numbers
    edge = np.minimum(design.values - numbers.lower, numbers.upper - design.values)
    found = [
        name
        for name, at in zip(numbers.names, edge / numbers.width <= _AT_BOUND, strict=True)
        if at
    ]
    for limit, asked in zip(study.limits, design.limited, strict=True):
        if abs(limit.room(asked.value)) <= OUTSIDE:
            found.append(limit.goal.text)
    return tuple(found)


def _notes(study: Designs, row: StartedSearch, design: Design) -> list[str]:
    found = []
    if row.outside > OUTSIDE:
        found.append(f'no design within the limits was found: {row.outside:.2%} outside')
    if not row.settled:
        found.append(f'the search has not settled: {row.reason}')
    idle = _idle(study, design)
    found += [f'{name} changes neither the objective nor a limited number there' for name in idle]
    return found + study.notes(design.values)


def _idle(study: Designs, design: Design) -> list[str]:
    """The numbers on which a design does not depend."""
    numbers, each = study.numbers, (design.objective, *design.limited)
    felt = np.zeros(len(numbers.names), dtype=bool)
    for asked in each:
        changes = np.abs(asked.gradient) * numbers.width
        felt |= changes > _NOTHING * max(abs(asked.value), changes.max(initial=0.0))
    return [name for name, known in zip(numbers.names, felt.tolist(), strict=True) if not known]


# ---------------------------------------------------------------------------------- arguments


def _check_within(numbers: DesignNumbers) -> None:
    for name, value, low, high in zip(numbers.names, numbers.before, *numbers.asked, strict=True):
        if not low <= value <= high:
            raise InputError(
                'the scene begins outside the bounds',
                key=f'vary.{name}',
                value=float(value),
                expected=f'{low:g} to {high:g}',
            )


def _positive(given: Any, key: str) -> float:
    found = check.number(given, key, 0.0)
    if found == 0.0:
        raise InputError('not usable', key=key, value=given, expected='s, more than 0')
    return found


def _period(simulation: Simulation, duration: float, given: Any, driven: bool) -> float:
    """s between samples, a whole part of the duration, and whole steps where forces decide."""
    h = simulation.h
    asked = duration / SAMPLES if given is None else _positive(given, 'period')
    if asked > duration:
        raise InputError('longer than the duration', key='period', value=asked)
    check.samples_of(duration, asked)
    if driven:
        parts = max(1, round(duration / asked))
        if abs(parts * asked - duration) > check.CLOSE * asked:
            raise _no_whole_part(asked, duration)
        return duration / parts
    steps = round(duration / h)
    if not steps or abs(steps * h - duration) > check.CLOSE * h:
        raise InputError('not whole steps', key='duration', value=duration, expected=f'k * {h:g}')
    if given is None:
        every = check.steps_between(steps, SAMPLES)
        return every * h if steps % every == 0 else h  # the motion ends with a sample
    every = round(asked / h)
    if not every or abs(every * h - asked) > check.CLOSE * h:
        raise InputError('not whole steps', key='period', value=asked, expected=f'k * {h:g}')
    if steps % every:
        raise _no_whole_part(asked, duration)
    return every * h


def _no_whole_part(period: float, duration: float) -> InputError:
    text = 'not a whole part of the duration'
    return InputError(text, key='period', value=period, expected=f'{duration:g} / n')


def _workers(given: Any, starts: int) -> int:
    """Worker processes; 0 for none."""
    if given is not None:
        return check.whole(given, 'workers', 0)
    return min(starts, len(os.sched_getaffinity(0))) if starts > 1 else 0


def _begins(numbers: DesignNumbers, count: int, seed: int, sampling: Any) -> tuple[Floats, ...]:
    """(P,) of each start: the scene, then samples within the bounds."""
    check.choice(sampling, 'sampling', SAMPLINGS, 'no such sampling')
    found = [np.clip(numbers.before, numbers.lower, numbers.upper)]
    if count > 1:
        vary = {name: uniform(0.0, 1.0) for name in numbers.names}
        samples = Sampling(sampling, vary, count - 1, seed)
        found += [numbers.lower + samples.unit(k) * numbers.width for k in range(count - 1)]
    return tuple(found)


def _silent(text: str) -> None:
    """Tell nobody."""


def _teller(report: Report, k: int, count: int) -> Told:
    return lambda tried, value: report(f'start {k + 1}/{count}, design {tried}: {value:.6g}')
