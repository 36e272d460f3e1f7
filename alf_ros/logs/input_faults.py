"""Whether the inputs in a log are the ones of its run: what makes a run again depends on it.

An entry that is changed, or missing before another one, shows in the journal itself. The last
entries may be missing, or all may be sealed again: this shows only in the motion.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from alf_ros.errors import InputError, StepError
from alf_ros.logs import provenance
from alf_ros.logs.log import Log
from alf_ros.logs.rerun import Rerun
from alf_ros.logs.series import TEXT, Series, type_with
from alf_ros.simulation import state_vector
from alf_ros.simulation.observables import READINGS

_SAYS_MORE = 'a log as it was written (`verify` says more)'
_CLOSE = 2e-9  # s: stamps are whole nanoseconds
_ROUNDED = 4  # of the last places of large times


def of_scene(log: Log) -> Iterator[str]:
    """Whether the text of the scene has been changed."""
    digest = hashlib.sha256(log.scene_text.encode()).hexdigest()
    if digest != log.info['scene_sha256']:
        yield 'the text of the scene is not the text that was run'


def unread(log: Log) -> Iterator[str]:
    """Why parts of a log are not known."""
    if log.survey.leap:
        yield log.survey.leap
    if log.survey.passed_over:
        yield f'a part cannot be read: {log.survey.passed_over}'


def of_counts(log: Log, topics: Collection[str] = ()) -> Iterator[str]:
    """Where a closed log states other numbers of messages than it has; of all topics, or these."""
    counts, stated = log.survey.counts, log.survey.stated
    if log.survey.damage:
        return
    if stated is None:
        yield 'its index does not state how many messages it has'
        return
    for topic in sorted(topics or {*counts, *stated}):
        found, told = counts.get(topic, 0), stated.get(topic, 0)
        if found != told:
            yield f'{topic}: {found} messages, and its index states {told}'


def of_types(log: Log, types: Mapping[str, str]) -> Iterator[str]:
    """Which topics have another type than the one that a simulator writes. `types` by topic, as in
    a survey."""
    wanted_types = {log.topic(each.name): type_with(each.fields) for each in READINGS.values()}
    for topic, wanted in {log.topic('~/inputs'): TEXT, **wanted_types}.items():
        if types.get(topic, wanted) != wanted:
            yield f'{topic}: written as {types[topic]}, and its run writes {wanted}'


def check_type(log: Log, topic: str) -> None:
    """Raises InputError for a topic with another type than the one that a simulator writes."""
    for fault in of_types(log, {topic: log.survey.types[topic]}):
        raise InputError(fault, file=str(log.path), expected=_SAYS_MORE)


def checked_journal(log: Log) -> list[dict[str, Any]]:
    """The journal of a log. Raises InputError, with what `verify` says, if it has none, or not as
    it was written."""
    file = str(log.path)
    if not log.inputs:
        raise InputError('the log has no journal: its inputs are not known', file=file)
    fault = next(_faults(log), None)
    if fault is not None:
        raise InputError(f'not the inputs of its run: {fault}', file=file, expected=_SAYS_MORE)
    return log.inputs


def _faults(log: Log) -> Iterator[str]:
    yield from of_scene(log)
    yield from unread(log)
    own = log.topic('~/inputs')
    yield from of_types(log, {own: log.survey.types.get(own, TEXT)})
    if log.survey.journal_fault:
        yield log.survey.journal_fault
    if log.survey.stated is not None:
        yield from of_counts(log, [log.topic('~/inputs')])


def shows_states(log: Log) -> bool:
    """Whether a log has states, of these versions and of this machine: others have other bits."""
    return log.versions == provenance.versions() and log.topic('~/state') in log.survey.counts


def check_motion(
    log: Log, rerun: Rerun, entries: Sequence[dict[str, Any]], end: float = math.inf
) -> None:
    """Continue a re-run with these entries of the journal, and compare the states up to `end` (s)
    with the ones in the log. Raises InputError at the first state that is another one.

    Only for a log that `shows_states`.
    """
    check_type(log, log.topic('~/state'))
    waiting, file = list(entries), str(log.path)
    for piece in log.pieces(['~/state']):
        for series in piece:
            for row, stamp in enumerate(series.stamp.tolist()):
                t, half = float(log.time(stamp)), 0.5 * rerun.simulation.h
                # not half a step: a tick may be that short behind an entry with shorter steps
                close = min(half, _CLOSE + _ROUNDED * math.ulp(t))
                if t < rerun.simulation.t + close or stamp > log.survey.last:
                    continue
                if t > end + half:
                    return
                try:
                    while waiting and waiting[0]['t'] < t - close:
                        rerun.act(waiting.pop(0))
                    rerun.go_to(rerun.step_of(stamp))
                except StepError as error:
                    raise InputError(f'the re-run fails: {error}', file=file) from None
                if not _is_state(rerun, series, row):
                    text = f'its inputs give another motion than it has at t = {t:.9g} s'
                    raise InputError(text, file=file, expected=_SAYS_MORE)


def _is_state(rerun: Rerun, series: Series, row: int) -> bool:
    """Whether a re-run is in a state of the log, bit for bit."""
    simulation = rerun.simulation
    now = state_vector.values(simulation.model, simulation.state)
    logged = (series.columns.get(key) for key in ('position', 'velocity'))
    return all(
        one is not None and one[row].tobytes() == other.tobytes()
        for one, other in zip(logged, now, strict=True)
    )
