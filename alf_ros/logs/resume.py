"""A log's run at one of its instants, ready to continue: state, inputs held, and later inputs."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field
from typing import Any

from alf_ros.errors import InputError
from alf_ros.logs.input_faults import check_type, checked_journal
from alf_ros.logs.log import Log
from alf_ros.logs.rerun import Event, Rerun, in_order
from alf_ros.simulation import state_vector
from alf_ros.simulation.observables import READINGS

_CLOSE = 1e-9  # s: stamps are whole nanoseconds
_ROUNDED = 4  # of the last places of large times


@dataclass
class Resumed:
    """`rerun` stands at the last logged instant up to the time asked for; `rest` are the entries
    of the journal that act from there on, and `instants` the logged ones behind it (s)."""

    rerun: Rerun
    rest: list[dict[str, Any]]
    instants: array[float] = field(default_factory=lambda: array('d'))


def resume(log: Log, at: float, trust: bool = False) -> Resumed:
    """Go to the last logged instant up to `at` (s): from its state, or through all steps before if
    the log has no states. Raises InputError if `at` is not within the log or its journal is not as
    it was written, StepError."""
    rerun, inputs = Rerun(log, trust), checked_journal(log)
    source = _source(log)
    check_type(log, source)
    has_states = source == log.topic('~/state')
    latest: Event | None = None
    waiting: list[dict[str, Any]] = []
    instants = array('d')
    entries, beyond = iter(inputs), False
    close = _CLOSE + _ROUNDED * math.ulp(log.end)
    for piece in log.pieces([source, '~/inputs']):
        for event in in_order(piece):
            if event.series.topic != source:
                entry = next(entries)
                if entry['kind'] != 'start':
                    waiting.append(entry)
                continue
            stamp = int(event.series.stamp[event.row])
            t = float(log.time(stamp))
            beyond = beyond or t > at + close
            if stamp > log.survey.last:
                continue
            if beyond:
                instants.append(t)
                continue
            for entry in waiting:
                _restore(rerun, latest, has_states)
                rerun.act(entry)
            waiting, latest = [], event
    first, last = log.time(log.survey.first), log.end
    if latest is None or at > last + close:
        expected = f'from {first:.9g} to {last:.9g} s'
        raise InputError('not within the log', key='--at', value=at, expected=expected)
    _restore(rerun, latest, has_states)
    rerun.go_to(rerun.step_of(int(latest.series.stamp[latest.row])))
    return Resumed(rerun, waiting, instants)


def _source(log: Log) -> str:
    """The topic that gives the instants of the log: the states, or another one of every tick."""
    topics = [log.topic(reading.name) for reading in READINGS.values()]
    found = [topic for topic in topics if topic in log.survey.counts]
    if not found:
        raise InputError(
            'the log has no states, and no values derived from them', file=str(log.path)
        )
    return max(found, key=lambda topic: (topic == topics[0], log.survey.counts[topic]))


def _restore(rerun: Rerun, event: Event | None, has_states: bool) -> None:
    if event is None or not has_states:
        return
    simulation, series, row = rerun.simulation, event.series, event.row
    before = simulation.state
    try:
        numbers, rates = (series.columns[key][row] for key in ('position', 'velocity'))
        if int(numbers[-1]) <= before.step:
            return  # entries of one step act in turn
        if int(numbers[-1]) != rerun.step_of(int(series.stamp[row])):
            raise ValueError('its step does not belong to its stamp')
        state = state_vector.state(simulation.model, before, numbers, rates, before.inputs)
    except (KeyError, IndexError, ValueError, OverflowError) as error:
        raise InputError(f'a state of the log does not fit its scene: {error}') from None
    simulation.restore(state)
