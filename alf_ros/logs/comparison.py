"""A log against a re-run of it, bit for bit."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError, StepError
from alf_ros.logs import journal, progress, provenance
from alf_ros.logs.log import Log
from alf_ros.logs.rerun import Rerun, in_order
from alf_ros.logs.series import COMPONENTS, Series
from alf_ros.simulation.observables import READINGS, Reading
from alf_ros.simulation.sample import Sample

_MOST = 12  # variables told one by one


@dataclass(frozen=True)
class Difference:
    """One number that is another in the re-run, and the last input before it ('' if none)."""

    step: int
    t: float
    variable: str
    logged: float
    repeated: float
    cause: str

    def __str__(self) -> str:
        return (
            f'step {self.step}, t = {self.t:.9g} s: {self.variable} is {self.logged!r} in the '
            f'log, {self.repeated!r} now, a difference of {self.size:.3g}'
        )

    @property
    def size(self) -> float:
        """How much it is."""
        return abs(self.repeated - self.logged)


@dataclass
class Variable:
    """How often a variable differs, and the largest difference."""

    count: int
    worst: Difference


@dataclass
class Result:
    """What came out. `faults` are what is wrong with the log itself; `versions` those that are
    others here: (there, here) by name."""

    steps: int = 0
    compared: int = 0
    inputs: int = 0
    first: Difference | None = None
    variables: dict[str, Variable] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    versions: dict[str, tuple[str, str]] = field(default_factory=dict)
    damage: str = ''
    trouble: str = ''

    @property
    def equal(self) -> bool:
        """Whether every number is the same, and the log is what was written."""
        return self.first is None and not self.faults


def compare(log: Log, trust: bool = False, report: progress.Report = progress.silent) -> Result:
    """Run a log again and compare. Raises InputError for one that cannot be run."""
    return _Comparison(log, trust).run(report)


def told(log: Log, result: Result) -> str:
    """The result as lines of text."""
    lines = [f'{log.info["scene"]}: {result.steps} instants, {result.inputs} inputs']
    for key, (there, here) in result.versions.items():
        lines.append(f'  other {key}: {there} in the log, {here} here')
    if result.damage:
        lines.append(f'  not closed: {result.damage}')
    lines += [f'  wrong: {fault}' for fault in result.faults]
    if result.first is not None:
        lines.append(f'  first: {result.first}')
        if result.first.cause:
            lines.append(f'  last input before it: {result.first.cause}')
        lines.append('  largest difference of each variable:')
        worst = sorted(result.variables.items(), key=lambda item: -item[1].worst.size)
        for name, variable in worst[:_MOST]:
            size, step = variable.worst.size, variable.worst.step
            lines.append(
                f'    {name:40} {size:.3g} at step {step}, differs {variable.count} times'
            )
        if len(worst) > _MOST:
            lines.append(f'    and {len(worst) - _MOST} more')
    if result.equal:
        lines.append(f'EQUAL: {result.compared} messages, bit for bit')
    else:
        lines.append('DIFFERS' if result.first is not None else 'NOT AS IT WAS WRITTEN')
    return '\n'.join(lines)


class _Comparison:
    def __init__(self, log: Log, trust: bool) -> None:
        self._log = log
        self._readings = {log.topic(reading.name): reading for reading in READINGS.values()}
        self._journal = log.topic('~/inputs')
        self._seal, self._cause = '', ''
        self._numbers: dict[str, int] = {}
        self._sample: Sample | None = None
        self._result = Result(versions=_other(log.versions, provenance.versions()))
        self._check_scene()
        self._rerun = Rerun(log, trust)

    def _check_scene(self) -> None:
        digest = hashlib.sha256(self._log.scene_text.encode()).hexdigest()
        if digest != self._log.info['scene_sha256']:
            self._fault('the text of the scene is not the one that was run')

    def run(self, report: progress.Report) -> Result:
        result = self._result
        topics = [*self._readings, self._journal]
        try:
            for piece in self._log.pieces(topics, report):
                for series, row in in_order(piece):
                    self._follow(series, row)
        except StepError as error:
            self._fault(f'the re-run fails: {error}')
        if not result.inputs:
            self._fault('there is no journal: the inputs are not known')
        result.inputs = max(0, result.inputs - 1)  # without the start
        result.damage = self._log.damage
        result.trouble = self._rerun.trouble
        return result

    def _follow(self, series: Series, row: int) -> None:
        number, expected = int(series.sequence[row]), self._numbers.get(series.topic, 0) + 1
        self._numbers[series.topic] = number
        if series.topic != self._journal:
            self._compare(series, row, self._readings[series.topic])
            return
        entry = journal.read(series.messages[row]['data'])
        told = journal.told(entry)
        if number > expected:
            self._fault(f'{number - expected} inputs are missing before {told}')
        self._check(entry, told)
        self._act(entry, told)

    def _check(self, entry: dict[str, Any], told: str) -> None:
        self._result.inputs += 1
        fault = journal.fault(entry, self._seal)
        if fault:
            self._fault(f'input at {told}: {fault}')
        if entry['kind'] == 'start' and not _same_start(entry, self._log.info):
            self._fault('its beginning is told in two ways')
        self._seal = entry.get(journal.SEAL, '')
        self._cause = told if entry['kind'] != 'start' else ''

    def _act(self, entry: dict[str, Any], told: str) -> None:
        """What was damaged may ask for what cannot be done."""
        self._sample = None
        try:
            if self._rerun.step_before(entry) > self._rerun.step_of(self._log.survey.last):
                raise InputError('lies behind the end of the log')
            self._rerun.act(entry)
        except (InputError, KeyError, TypeError, ValueError, OverflowError) as error:
            self._fault(f'input at {told}: {error}')

    def _fault(self, text: str) -> None:
        self._result.faults.append(text)

    def _compare(self, series: Series, row: int, reading: Reading) -> None:
        rerun, result, stamp = self._rerun, self._result, int(series.stamp[row])
        step = rerun.step_of(stamp)
        if self._sample is None or self._sample.step != step:
            rerun.go_to(step)
            self._sample = rerun.simulation.sample()
            result.steps += 1
        sample = self._sample
        if rerun.stamp != stamp:
            self._fault(f'{series.topic}: stamp {stamp} ns is not that of a step')
        result.compared += 1
        names = reading.names(sample)
        if series.names not in (names, ()):
            self._fault(f'{series.topic}: names others than the scene at step {step}')
            return
        for key, now in zip(reading.fields, reading.values(sample), strict=True):
            logged = series.columns[key][row]
            if logged.tobytes() != now.tobytes():
                self._note(reading, key, names, logged, now, sample)

    def _note(
        self,
        reading: Reading,
        key: str,
        names: tuple[str, ...],
        logged: Floats,
        now: Floats,
        sample: Sample,
    ) -> None:
        for place in _places(logged, now):
            variable = _variable(reading, key, names, place)
            found = Difference(
                sample.step,
                sample.t,
                variable,
                float(logged[place]),
                float(now[place]),
                self._cause,
            )
            if self._result.first is None:
                self._result.first = found
            known = self._result.variables.setdefault(variable, Variable(0, found))
            known.count += 1
            if not found.size <= known.worst.size:
                known.worst = found


def _places(logged: Floats, now: Floats) -> Iterator[tuple[int, ...]]:
    """Where the bits differ."""
    bits = logged.astype('<f8').view(np.int64), now.astype('<f8').view(np.int64)
    yield from map(tuple, np.argwhere(bits[0] != bits[1]).tolist())


def _variable(reading: Reading, key: str, names: tuple[str, ...], place: tuple[int, ...]) -> str:
    if reading.fields == ('data',):
        return reading.key
    component = f'.{COMPONENTS[place[1]]}' if len(place) > 1 else ''
    return f'{reading.key}.{key}.{names[place[0]]}{component}'


def _other(there: Mapping[str, str], here: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    keys = dict.fromkeys((*there, *here))
    pairs = {key: (there.get(key, 'unknown'), here.get(key, 'unknown')) for key in keys}
    return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}


def _same_start(entry: dict[str, Any], info: dict[str, Any]) -> bool:
    return all(entry.get(key) == value for key, value in info.items())
