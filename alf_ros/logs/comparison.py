"""A log against a re-run of it, bit for bit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError, StepError, printable
from alf_ros.logs import input_faults, journal, progress, provenance
from alf_ros.logs.journal_faults import JournalFaults
from alf_ros.logs.log import Log
from alf_ros.logs.rerun import Rerun, in_order
from alf_ros.logs.series import COMPONENTS, TEXT, Series, type_with
from alf_ros.simulation.observables import READINGS, Reading
from alf_ros.simulation.sample import Sample

_MOST = 12  # variables told one by one
_MOST_FAULTS = 100
_BESIDE = ('/diagnostics', '/robot_description', '/tf', '/clock', '/markers')


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
    """Result. `faults` are faults of the log itself; `versions` are the differing ones: (there,
    here) by name; `lost` names messages that were never written; `measured` counts messages of
    sensors, which are not compared."""

    steps: int = 0
    compared: int = 0
    inputs: int = 0
    first: Difference | None = None
    variables: dict[str, Variable] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    versions: dict[str, tuple[str, str]] = field(default_factory=dict)
    damage: str = ''
    lost: str = ''
    trouble: str = ''
    measured: int = 0

    @property
    def equal(self) -> bool:
        """Whether every number is the same, and the log is as written."""
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
    if result.lost:
        lines.append(f'  {result.lost}')
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
        beside = f'; {result.measured} of sensors are not compared' if result.measured else ''
        lines.append(f'EQUAL: {result.compared} messages, bit for bit{beside}')
    else:
        lines.append('DIFFERS' if result.first is not None else 'NOT AS WRITTEN')
    return '\n'.join(map(printable, lines))


class _Comparison:
    def __init__(self, log: Log, trust: bool) -> None:
        self._log = log
        self._readings = {log.topic(reading.name): reading for reading in READINGS.values()}
        self._journal = log.topic('~/inputs')
        self._types = {topic: type_with(each.fields) for topic, each in self._readings.items()}
        self._types[self._journal] = TEXT
        self._inputs, self._cause = JournalFaults(log.info), ''
        self._numbers: dict[str, int] = {}
        self._missing: dict[str, int] = {}
        self._forms: dict[tuple[str, tuple[str, ...]], bytes] = {}
        self._ends: dict[str, tuple[int, int]] = {}  # last stamp and largest gap of a topic, ns
        self._sample: Sample | None = None
        self._result = Result(versions=_other(log.versions, provenance.versions()))
        self._wrong(input_faults.of_scene(log))
        self._rerun = Rerun(log, trust)
        there = log.info.get('effects') or {}
        self._result.versions.update(_other(there, provenance.foreign_code(self._rerun.scene)))

    def run(self, report: progress.Report) -> Result:
        result = self._result
        topics = [*self._readings, self._journal]
        survey = self._log.survey
        self._wrong(input_faults.unread(self._log))
        self._wrong([self._log.absent] if self._log.absent else [])
        self._wrong(input_faults.of_types(self._log, survey.types))
        for topic in sorted(survey.counts):
            if not self._is_known(topic):
                self._fault(f'{topic}: a topic that its run does not have')
        try:
            for piece in self._log.pieces(topics, report):
                for series, row in in_order(piece):
                    if int(series.stamp[row]) <= survey.last:
                        self._follow(series, row)
        except StepError as error:
            self._fault(f'the re-run fails: {error}')
        self._count_missing()
        if not result.inputs:
            self._fault('the log has no journal: the inputs are unknown')
        result.inputs = max(0, result.inputs - 1)  # without the start
        sensors = {self._log.topic(f'~/{each.label}') for each in self._rerun.scene.sensors}
        result.measured = sum(survey.counts[topic] for topic in sensors & survey.counts.keys())
        result.damage = self._log.damage
        result.trouble = self._rerun.trouble
        return result

    def _follow(self, series: Series, row: int) -> None:
        topic = series.topic
        if series.type != self._types[topic]:
            return  # one fault says so of all of them
        if topic == self._journal:
            entry = journal.entries(series)[row]
            self._wrong(self._inputs.of(series, row, entry))
            self._result.inputs += 1
            self._cause = journal.told(entry) if entry['kind'] != 'start' else ''
            self._act(entry, journal.told(entry))
            return
        number, expected = int(series.sequence[row]), self._numbers.get(topic, 0) + 1
        self._numbers[topic] = max(number, expected - 1)
        if number < expected:
            self._fault(f'{topic}: message {number} comes after message {expected - 1}')
        self._missing[topic] = self._missing.get(topic, 0) + max(0, number - expected)
        stamp = int(series.stamp[row])
        before, gap = self._ends.get(topic, (stamp, 0))
        self._ends[topic] = stamp, max(gap, stamp - before)
        self._compare(series, row, self._readings[topic])

    def _act(self, entry: dict[str, Any], told: str) -> None:
        """Damaged entries may request impossible actions."""
        self._sample = None
        try:
            if self._rerun.step_before(entry) > self._rerun.step_of(self._log.survey.last):
                raise InputError('is after the end of the log')
            self._rerun.act(entry)
        except (InputError, TypeError, ValueError) as error:  # also of numbers that do not fit
            self._fault(f'input at {told}: {error}')

    def _is_known(self, topic: str) -> bool:
        """Whether a topic is one that a simulator writes: another may be one with its name
        changed."""
        told = self._log.info.get('topics', {}).values()
        own = (self._journal, self._log.topic('~/scene'))
        return topic in (*told, *self._readings, *own) or topic.endswith(_BESIDE)

    def _count_missing(self) -> None:
        """Messages dropped while recording are reported; other missing messages are a fault, and
        so is a closed log that states other counts than it has."""
        missing, dropped = sum(self._missing.values()), self._log.survey.dropped
        if missing > dropped:
            for topic, count in self._missing.items():
                if count:
                    self._fault(f'{topic}: {count} messages are missing')
        elif missing:
            self._result.lost = f'{missing} messages were dropped when it was recorded'
        if self._log.survey.damage:
            return
        self._wrong(input_faults.of_counts(self._log))
        if missing:
            return
        last = max((stamp for stamp, _ in self._ends.values()), default=0)
        for topic, (stamp, gap) in self._ends.items():
            if gap and stamp + 1.5 * gap < last:
                self._fault(f'{topic}: ends at {stamp} ns, and other topics continue')

    def _wrong(self, faults: Iterable[str]) -> None:
        for fault in faults:
            self._fault(fault)

    def _fault(self, text: str) -> None:
        """The first of many."""
        if len(self._result.faults) < _MOST_FAULTS:
            self._result.faults.append(text)

    def _compare(self, series: Series, row: int, reading: Reading) -> None:
        rerun, result, stamp = self._rerun, self._result, int(series.stamp[row])
        step = rerun.step_of(stamp)
        if self._sample is None or self._sample.step != step:
            try:
                rerun.go_to(step)
            except InputError as error:
                self._fault(f'{series.topic}: {error.message}')
                return
            self._sample = rerun.simulation.sample()
            result.steps += 1
        sample = self._sample
        if rerun.stamp != stamp:
            self._fault(f'{series.topic}: stamp {stamp} ns is not the stamp of a step')
        elif int(series.told[row]) != stamp:
            told = int(series.told[row])
            self._fault(f'{series.topic}: stamp {stamp} ns in the log, {told} ns in the message')
        result.compared += 1
        names = reading.names(sample)
        values = dict(zip(reading.fields, reading.values(sample), strict=True))
        # arrays that a reading does not have are written as zeros (`templates`)
        values |= {k: np.zeros_like(v[row]) for k, v in series.columns.items() if k not in values}
        values = {key: now for key, now in values.items() if now.size}
        expected = () if reading.fields == ('data',) else names
        if series.names != expected or series.columns.keys() != values.keys():
            self._fault(f'{series.topic}: has other contents than the scene at step {step}')
            return
        if series.form != self._forms.setdefault((series.topic, names), series.form):
            self._fault(f'{series.topic}: at step {step} not written as the messages before')
        for key, now in values.items():
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
