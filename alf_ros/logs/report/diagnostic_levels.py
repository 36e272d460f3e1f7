"""The diagnostics of a log: levels of each task over time, and the numbers worth a plot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.logs.report.decimation import Trace

_ROWS = 2048
_MOST_TEXTS = 500
CLOSEST = 'distance', 'diagnostics: least since the last'
# (task, key) -> (panel, name)
PLOTTED = {
    ('solver', 'iterations'): ('iterations', 'iterations'),
    ('solver', 'step_cost_s'): ('cost', 'step'),
    ('solver', 'step_error'): ('step_error', 'sum over 1000 steps'),
    ('timing', 'lateness_p50_s'): ('cost', 'lateness of a tick, median'),
    ('timing', 'lateness_p99_s'): ('cost', 'lateness of a tick, 99 %'),
    ('constraints', 'distance_to_singular'): CLOSEST,
}
_OPEN = 'constraints', 'indeterminate_reactions'
_OPEN_EFFORTS = 'constraints', 'indeterminate_efforts'
_NO_NAMES = 'no', 'unknown'
_ENERGY = ('energy_j', 'initial_energy_j', 'change_j')
_JOULE = '_j'


@dataclass
class Reports:
    """`levels` by task: 0 OK, 1 WARN, 2 ERROR; `numbers` by (panel, name); `texts`: (t, level,
    text) of warnings and errors, once while they last; `open_joints`: whose reactions are one of
    many; `open_drives`: whose efforts are. `task` precedes the names of tasks."""

    task: str = ''
    open_joints: dict[str, None] = field(default_factory=dict)
    open_drives: dict[str, None] = field(default_factory=dict)
    levels: dict[str, Trace] = field(default_factory=dict)
    numbers: dict[tuple[str, str], Trace] = field(default_factory=dict)
    texts: list[tuple[float, int, str]] = field(default_factory=list)
    _last: dict[str, str] = field(default_factory=dict)

    def add(self, t: Floats, messages: Sequence[dict[str, Any]]) -> None:
        """Continue with messages of the topic /diagnostics, stamped t (n,) s."""
        for stamp, message in zip(t.tolist(), messages, strict=True):
            for status in message['status']:
                if status['name'].startswith(self.task):
                    self._add(stamp, status)

    def _add(self, t: float, status: dict[str, Any]) -> None:
        task, level = status['name'][len(self.task) :], int(status['level'])
        _note(self.levels, task, t, float(level))
        text = f'{task}: {status["message"]}' if level else ''
        if text and text != self._last.get(task) and len(self.texts) < _MOST_TEXTS:
            self.texts.append((t, level, text))
        self._last[task] = text
        for entry in status['values']:
            for key, found in ((_OPEN, self.open_joints), (_OPEN_EFFORTS, self.open_drives)):
                if (task, entry['key']) == key and entry['value'] not in _NO_NAMES:
                    found.update(dict.fromkeys(entry['value'].split(', ')))
            place = PLOTTED.get((task, entry['key'])) or _work(task, entry['key'])
            if place is not None:
                _note(self.numbers, place, t, _number(entry['value']))


def _work(task: str, key: str) -> tuple[str, str] | None:
    """Values of the energy report in addition to the energy, in J: the work of each effect."""
    if task == 'energy' and key.endswith(_JOULE) and key not in _ENERGY:
        return 'work', key.removesuffix(_JOULE).removeprefix('work_')
    return None


def _note(traces: dict[Any, Trace], key: Any, t: float, value: float) -> None:
    if key not in traces:
        traces[key] = Trace(1, _ROWS)
    traces[key].add(np.array([t]), np.array([[value]]))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
