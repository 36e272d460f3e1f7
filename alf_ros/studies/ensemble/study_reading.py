"""A study from Python values, or from a YAML file; whatever cannot be is refused here.

A file has the keys of `study_of`:

    scene: slider_crank
    vary:
      coupler.mass: {normal: [1.0, 0.05]}
      gravity.acceleration.1: {uniform: [-9.9, -9.7]}
    members: 1000
    outputs: [max(norm(crank_pin.force)), final(energy)]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene, SceneSource, load_scene, scene_within
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.expression import ExpressionError, evaluate
from alf_ros.scene.text.yaml_document import BOOLEAN, Entry
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble import varied_table
from alf_ros.studies.ensemble.chunk_size import cost_of, size_of
from alf_ros.studies.ensemble.distributions import Distribution, distribution, value
from alf_ros.studies.ensemble.kept_outputs import outputs as read_outputs
from alf_ros.studies.ensemble.listed_values import refused
from alf_ros.studies.ensemble.sampling import Sampling, Varied, sampling_named
from alf_ros.studies.ensemble.store import kept_size
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.varied_table import VariedTable

KEYS = ('scene', 'vary', 'members', 'seed', 'sampling', 'duration', 'period', 'outputs', 'chunk')
SAMPLES = 100  # in the duration, if no period is given
MOST_SEED = 2**63 - 1


def study_of(
    scene: SceneSource,
    vary: Mapping[str, Any] | str | Path,
    *,
    members: int | None = None,
    seed: int = 0,
    outputs: Any = ('energy',),
    sampling: str | None = None,
    duration: float = 10.0,
    period: float | None = None,
    chunk: int | None = None,
    store: str | Path | None = None,
) -> Study:
    """The study of these values; `alf_ros.ensemble` explains them. Without a `chunk` it has the
    one of an earlier `store`. Raises InputError."""
    loaded = load_scene(scene)
    table = None
    if isinstance(vary, (str, Path)):
        table = varied_table.read(paths.named(vary, 'vary'))
        vary = table.columns
        sampling = 'table' if sampling is None else sampling
    if not isinstance(vary, Mapping):
        expected = '{name: distribution}, or a CSV file'
        raise InputError('not a mapping', key='vary', value=vary, expected=expected)
    sampling = 'random' if sampling is None else sampling
    varied = {str(name): _varied(data, f'vary.{name}') for name, data in vary.items()}
    loaded = overrides.with_inputs(loaded, varied, 'vary.')
    _refuse_words(loaded, varied, table)
    if members is not None:
        members = check.whole(members, 'members', 1)
    seed = check.whole(seed, 'seed', 0, MOST_SEED)
    samples = Sampling(sampling, varied, members, seed)
    simulation = Simulation(loaded)
    duration = _positive(duration, 'duration')
    steps = check.steps_of(duration, simulation.h, 0)
    if not steps:
        raise InputError('shorter than a step', key='duration', value=duration)
    if period is None:
        period = check.steps_between(steps, SAMPLES) * simulation.h
    period = _positive(period, 'period')
    if period > duration:
        raise InputError('longer than the duration', key='period', value=period)
    check.samples_of(duration, period)
    found = read_outputs(outputs)
    for output in found:
        if output.times and output.times[-1] > duration:
            late = output.times[-1]
            key, expected = f'outputs.{output.label}', f'up to the duration, {duration:g} s'
            raise InputError('after the end', key=key, value=late, expected=expected)
    study = Study(
        **Study.parts(loaded),
        vary=tuple(varied.items()),
        members=samples.members,
        seed=seed,
        sampling=sampling,
        duration=duration,
        period=period,
        outputs=found,
        chunk=1,
        cost=math.inf,
    )
    _examined(study)
    if chunk is None:
        cost = cost_of(study)
        runs = not any(output.kind == 'function' for output in found)
        chunk = (store and kept_size(store)) or size_of(study, cost)
        study = replace(study, cost=cost.seconds if runs else math.inf)
    # a larger chunk has room on the disk for members that the study does not have
    return replace(study, chunk=min(check.whole(chunk, 'chunk', 1), study.members))


def _varied(data: Any, key: str) -> Varied:
    if hasattr(data, 'tolist'):
        data = data.tolist()
    if isinstance(data, Sequence) and not isinstance(data, str):
        if not data:
            raise InputError('an empty list', key=key, expected='values')
        return tuple(value(item, key) for item in data)
    return distribution(data, key)


def _refuse_words(scene: Scene, vary: Mapping[str, Varied], table: VariedTable | None) -> None:
    """Raises InputError for a listed value that no member can have, with the line of its table."""
    for name, varied in vary.items():
        found = None if isinstance(varied, Distribution) else refused(scene, name, varied)
        if found is None:
            continue
        k, error = found
        if table is None:
            raise error.about(f'vary.{name}[{k}]')
        raise InputError(
            error.message,
            file=table.file,
            line=table.lines[k],
            key=name,
            value=error.value,
            expected=error.expected,
        )


def _positive(given: Any, key: str) -> float:
    found = check.number(given, key, 0.0)
    if found == 0.0:
        raise InputError('not usable', key=key, value=given, expected='s, more than 0')
    return found


def _examined(study: Study) -> None:
    """Raises InputError for a quantity that is none, and for names or values that no scene of the
    first members takes: single ones may be refused."""
    try:
        study.variables  # noqa: B018  an output that cannot be shows here, before any member runs
    except InputError as error:
        if (error.key or '').partition('.')[0] in ('vary', 'outputs'):
            raise
        raise InputError(str(error), key='outputs') from None
    first: InputError | None = None
    for k in range(min(study.members, 8)):
        try:
            study.scene_of(k)
            return
        except InputError as error:
            first = first or error
    assert first is not None
    raise first


# -------------------------------------------------------------------------------------------- YAML


def load_study(source: str | Path, **changes: Any) -> Study:
    """The study in a YAML file; `changes` replace keys of it, and errors in them name no line.
    Raises InputError."""
    path = paths.named(source)
    fields = yaml_document.read(path).mapping(KEYS, ('scene', 'vary'))
    given: dict[str, Any] = {}
    for key, entry in fields.items():
        if key != 'scene':
            given[key] = within(entry, lambda entry=entry: plain(entry))  # type: ignore[misc]
    given['scene'] = scene_of(fields['scene'], path.parent)
    lines = lines_of(fields)
    if 'sampling' in given:  # nothing is no sampling here: whoever wants the default has no key
        within(fields['sampling'], lambda: sampling_named(given['sampling']))
    if isinstance(given['vary'], str):
        given['vary'] = within(fields['vary'], lambda: _table(path.parent, given['vary']))
    if 'outputs' in given:
        given['outputs'] = _functions(given['outputs'], path.parent)
        lines |= _output_lines(fields['outputs'], given['outputs'])
        given['outputs'] = within(fields['outputs'], lambda: read_outputs(given['outputs']))
    changed = {key: value for key, value in changes.items() if value is not None}
    given.update(changed)
    try:
        return study_of(**given)
    except InputError as error:
        key = error.key or ''
        if error.file is not None or key.partition('.')[0] in changed:
            raise
        raise InputError(str(error), file=str(path), line=line_of(key, lines)) from None


def lines_of(fields: Mapping[str, Entry]) -> dict[str, int | None]:
    """The lines of the keys of a study, of the entries in them, as in 'vary.coupler.mass', and of
    the items of these, as in 'vary.coupler.mass[2]'."""
    lines = {}
    for key, entry in fields.items():
        lines[key] = entry.line
        if isinstance(entry.value, dict):
            lines |= {f'{key}.{name}': inner.line for name, inner in entry.value.items()}
            lines |= {
                f'{key}.{name}[{k}]': item.line
                for name, inner in entry.value.items()
                if isinstance(inner.value, tuple)
                for k, item in enumerate(inner.value)
            }
    return lines


def line_of(key: str, lines: Mapping[str, int | None]) -> int | None:
    """The line of a key, or of the nearest key around it; None if it is missing."""
    while key and key not in lines:
        key = key.rpartition('.')[0]
    return lines.get(key)


def _output_lines(entry: Entry, data: Any) -> dict[str, int | None]:
    """The line of each output, by its label. Each is read by itself here, so that its errors say
    this line. Raises InputError."""
    parts: list[tuple[Any, Entry]] = []
    if isinstance(entry.value, dict):
        parts = [({label: data[label]}, inner) for label, inner in entry.value.items()]
    elif isinstance(entry.value, tuple):
        parts = [([one], inner) for one, inner in zip(data, entry.value, strict=True)]
    return {
        f'outputs.{output.label}': inner.line
        for part, inner in parts
        for output in within(inner, lambda part=part: read_outputs(part))  # type: ignore[misc]
    }


def within(entry: Entry, made: Callable[[], Any]) -> Any:
    """The result of `made`; its errors say where the entry is."""
    try:
        return made()
    except InputError as error:
        if error.file is not None:
            raise
        raise InputError(str(error), file=entry.file, line=entry.line) from None


def plain(entry: Entry) -> Any:
    """The value of an entry: numbers and expressions of constants as numbers."""
    if isinstance(entry.value, dict):
        return {key: plain(inner) for key, inner in entry.value.items()}
    if isinstance(entry.value, tuple):
        return [plain(inner) for inner in entry.value]
    if entry.is_null:
        return None
    if not entry.plain:
        return entry.value
    if entry.value in BOOLEAN:
        return BOOLEAN[entry.value]
    try:
        number = evaluate(entry.value, {})
    except ExpressionError:
        return entry.value
    return int(number) if number == int(number) and abs(number) < 2**53 else number


def scene_of(entry: Entry, folder: Path) -> Any:
    """The scene that a study contains, or the name or path of one, from the folder of the study.
    Raises InputError."""
    if isinstance(entry.value, dict):
        return scene_within(entry, folder)

    def named() -> Any:
        given = plain(entry)
        if not isinstance(given, str) or not (given.endswith(('.yaml', '.yml')) or '/' in given):
            return given
        found = folder / paths.named(given)
        if not found.exists():
            raise InputError('no such file', key='scene', value=str(found))
        return found

    return within(entry, named)


def _table(folder: Path, name: str) -> Path:
    found = folder / paths.named(name)
    if not found.exists():
        raise InputError('no such file', key='vary', value=str(found))
    return found


def _functions(data: Any, folder: Path) -> Any:
    """The outputs, listed or by label, with the files of functions in the folder of the study."""
    if isinstance(data, Mapping):
        return {label: _function(output, folder) for label, output in data.items()}
    return [_function(output, folder) for output in data] if isinstance(data, list) else data


def _function(output: Any, folder: Path) -> Any:
    named = output.get('function') if isinstance(output, Mapping) else None
    return {**output, 'function': str(folder / named)} if isinstance(named, str) else output
