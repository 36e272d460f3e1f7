"""The contents of a log, in memory of constant size: signals for plots, frames, commands."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.logs import journal, progress
from alf_ros.logs.log import Log, Survey, note_type
from alf_ros.logs.report.commands import Orders
from alf_ros.logs.report.decimation import Instants, Trace
from alf_ros.logs.report.diagnostic_levels import Reports
from alf_ros.logs.series import NUMERIC, Series

# A plot has at most so many rows, fewer where there are many signals: the page stays small.
MOST_ROWS, LEAST_ROWS, NUMBERS = 4096, 512, 400_000
# So many numbers of states and of reactions are kept, of so many instants.
FRAME_NUMBERS, MOST_STATES, MOST_REACTIONS, LEAST = 4_000_000, 200_000, 40_000, 500
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
PARTS = ('size', 'x', 'y', 'z')


class Label(NamedTuple):
    """Of a signal: the panel it is drawn in, its name, and which part of a vector it is."""

    panel: str
    name: str
    part: str = ''


@dataclass(frozen=True)
class Signals:
    """A trace and what its signals are."""

    labels: tuple[Label, ...]
    trace: Trace


@dataclass
class Gathered:
    """`states` by the names of their numbers, `reactions` (frames of (joints, 3) N) by the names
    of the joints: a change of settings may change the names."""

    first: float = np.inf  # s
    last: float = -np.inf
    counts: dict[str, int] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)  # last sequence number, by topic
    signals: dict[tuple[Label, ...], Signals] = field(default_factory=dict)
    states: dict[tuple[str, ...], Instants] = field(default_factory=dict)
    reactions: dict[tuple[str, ...], Instants] = field(default_factory=dict)
    orders: Orders = field(default_factory=Orders)
    reports: Reports = field(default_factory=Reports)
    damage: str = ''
    worst: tuple[float, str] = (0.0, '')  # |Φ|, and the row

    @property
    def lost(self) -> dict[str, int]:
        """Messages that are missing, by topic."""
        pairs = ((topic, self.numbers[topic] - count) for topic, count in self.counts.items())
        return {topic: missing for topic, missing in pairs if missing > 0}


def gather(log: Log, report: progress.Report = progress.silent) -> Gathered:
    """Go through a log once."""
    found, survey = Gathered(), Survey()
    node = log.node
    found.reports.task = f'{node}: '.lstrip('/')
    known = {
        log.topic('joint_states'): (_joints, ()),
        log.topic('~/reactions'): (_reactions, ('wrench',)),
        log.topic('~/constraints'): (_constraints, ('position', 'velocity')),
        log.topic('~/state'): (_states, ('position',)),
        log.topic('~/energy'): (_energy, ('data',)),
        log.topic('~/work'): (_work, ('position',)),
    }
    inputs = log.topic('~/inputs')
    for piece in log.pieces(report=report, found=survey):
        for series in piece:
            t = log.time(series.stamp)
            found.first, found.last = min(found.first, t.min()), max(found.last, t.max())
            found.counts[series.topic] = found.counts.get(series.topic, 0) + len(series)
            note_type(found.types, series.topic, series.type)
            number = int(series.sequence.max())
            found.numbers[series.topic] = max(found.numbers.get(series.topic, 0), number)
            drawn, columns = known.get(series.topic, (None, ()))
            if drawn is not None:
                if all(len(series.columns.get(key, ())) for key in columns):
                    drawn(found, series, t)
            elif series.topic == inputs:
                found.orders.add(t, journal.entries(series))
            elif series.type == DIAGNOSTICS:
                found.reports.add(t, series.messages)
            elif series.type in NUMERIC:
                _other(found, series, t, node)
    found.damage = survey.damage
    return found


def rows(signals: int) -> int:
    """Rows of a trace of so many signals; even."""
    return max(LEAST_ROWS, min(MOST_ROWS, NUMBERS // signals)) // 2 * 2


def _plot(found: Gathered, labels: Iterable[Label], t: Floats, values: Floats) -> None:
    key = tuple(labels)
    if not key:
        return
    if key not in found.signals:
        found.signals[key] = Signals(key, Trace(len(key), rows(len(key))))
    found.signals[key].trace.add(t, values)


def _keep(
    frames: dict[tuple[str, ...], Instants],
    series: Series,
    t: Floats,
    values: Floats,
    most: int,
) -> None:
    if series.names not in frames:
        some = FRAME_NUMBERS // max(1, values[0].size)
        frames[series.names] = Instants(max(LEAST, min(most, some)))
    frames[series.names].add(t, values)


def _joints(found: Gathered, series: Series, t: Floats) -> None:
    for key, values in series.columns.items():
        _plot(found, (Label(key, name) for name in series.names), t, values)


def _reactions(found: Gathered, series: Series, t: Floats) -> None:
    wrenches = series.columns['wrench']
    for panel, vectors in (('force', wrenches[..., :3]), ('torque', wrenches[..., 3:])):
        sizes = np.linalg.norm(vectors, axis=2, keepdims=True)
        values = np.concatenate([sizes, vectors], axis=2).reshape(len(t), -1)
        labels = (Label(panel, name, part) for name in series.names for part in PARTS)
        _plot(found, labels, t, values)
    _keep(found.reactions, series, t, wrenches[..., :3], MOST_REACTIONS)


def _constraints(found: Gathered, series: Series, t: Floats) -> None:
    errors = [np.abs(series.columns[key]) for key in ('position', 'velocity')]
    row, column = np.unravel_index(int(errors[0].argmax()), errors[0].shape)
    found.worst = max(found.worst, (float(errors[0][row, column]), series.names[column]))
    labels = Label('violation', 'largest |Φ|'), Label('violation', 'largest |dΦ/dt|')
    _plot(found, labels, t, np.column_stack([each.max(axis=1) for each in errors]))


def _states(found: Gathered, series: Series, t: Floats) -> None:
    _keep(found.states, series, t, series.columns['position'], MOST_STATES)


def _energy(found: Gathered, series: Series, t: Floats) -> None:
    _plot(found, [Label('energy', 'energy')], t, series.columns['data'])


def _work(found: Gathered, series: Series, t: Floats) -> None:
    """The work of each effect; logs without a ledger do not have it."""
    _plot(found, (Label('work', name) for name in series.names), t, series.columns['position'])


def _other(found: Gathered, series: Series, t: Floats, node: str) -> None:
    """Other topics of numbers: a panel for each, named by the topic."""
    short = series.topic.removeprefix(node).lstrip('/')
    labelled = series.labelled()
    labels = [Label(f'~{short}', name) for name in labelled]
    _plot(found, labels, t, np.column_stack(list(labelled.values())))
