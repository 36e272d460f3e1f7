"""The journal of a log as signals: commands, and held forces."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.logs import journal
from alf_ros.logs.report.decimation import Trace

MOST_TEXTS, MOST_HELD = 1000, 20_000
_ROWS = 2048
_HIDDEN = ('step', 't', 'kind', 'name', journal.SEAL)
_LONGEST = 160  # letters


@dataclass(frozen=True)
class Held:
    """A wrench on `name` from time `t` (s) on, as the journal has it; `at`: its place in the body,
    None for the centre of mass."""

    t: float
    name: str
    force: Any
    frame: str
    at: Any = None


@dataclass
class Orders:
    """`traces`: by (kind, name), of the value commanded: N of a force, the effort, the target; NaN
    where it is no number. `texts`: (t, text) of every `stride`-th entry. `held`: wrenches; of
    those that follow each other closely the last, where there are many."""

    count: int = 0
    traces: dict[tuple[str, str], Trace] = field(default_factory=dict)
    texts: list[tuple[float, str]] = field(default_factory=list)
    stride: int = 1
    held: list[Held] = field(default_factory=list)

    def add(self, t: Floats, entries: Sequence[dict[str, Any]]) -> None:
        """Continue with entries of the journal, stamped t (n,) s."""
        for at, entry in zip(t.tolist(), entries, strict=True):
            # A fork, and a restored state, begin with what was held before.
            for each in held_before(entry) if entry['kind'] == 'start' else [entry]:
                self._add(at, each)

    def _add(self, at: float, entry: dict[str, Any]) -> None:
        kind, name = str(entry['kind']), str(entry.get('name', ''))
        if (kind, name) not in self.traces:
            self.traces[kind, name] = Trace(1, _ROWS)
        self.traces[kind, name].add(np.array([at]), np.array([[value(entry)]]))
        if self.count % self.stride == 0:
            self.texts.append((at, told(entry)))
        self.count += 1
        if len(self.texts) > MOST_TEXTS:
            self.texts, self.stride = self.texts[::2], 2 * self.stride
        if kind == 'wrench' and 'force' in entry:
            frame, place = entry.get('frame', 'world'), entry.get('at')
            self._hold(Held(at, name, entry['force'], frame, place))

    def _hold(self, new: Held) -> None:
        """Of many in a short time the last is kept: the animation cannot show more."""
        self.held.append(new)
        if len(self.held) <= MOST_HELD:
            return
        # Half of them, so that this is done once in a while.
        names = len({each.name for each in self.held})
        spacing = 2.0 * names * (self.held[-1].t - self.held[0].t) / MOST_HELD
        last = {(each.name, math.floor(each.t / (spacing or 1.0))): each for each in self.held}
        self.held = sorted(last.values(), key=lambda each: each.t)


def held_before(start: dict[str, Any]) -> list[dict[str, Any]]:
    """The commands in the state that an entry 'start' begins with, as entries of their own."""
    state = start.get('state')
    inputs = state.get('inputs') if isinstance(state, dict) else None
    found = []
    for kind, group in (('wrench', 'wrenches'), ('effort', 'efforts'), ('target', 'targets')):
        of = inputs.get(group) if isinstance(inputs, dict) else None
        for name, held in of.items() if isinstance(of, dict) else ():
            fields = held if isinstance(held, dict) else {'effort': held}
            about = {'step': start['step'], 't': start['t'], 'kind': kind, 'cause': 'held before'}
            entry = {**about, 'name': name, **fields}
            if journal.is_entry(entry):
                found.append(entry)
    return found


def value(entry: dict[str, Any]) -> float:
    """The number of a command: the size of a force, an effort, a position; NaN if it has none."""
    found = entry.get({'wrench': 'force', 'target': 'position'}.get(entry['kind'], 'effort'))
    if entry['kind'] == 'wrench':
        return float(np.linalg.norm(found)) if found is not None else 0.0
    return float(found) if isinstance(found, (int, float)) else math.nan


def told(entry: dict[str, Any]) -> str:
    """An entry in a line."""
    shown = (key for key in entry if key not in _HIDDEN and entry[key] is not None)
    rest = {key: _short(entry[key]) for key in shown}
    text = json.dumps(rest).replace('"', '')[1:-1]
    return f'{journal.told(entry)}: {text[:_LONGEST]}'


def _short(value: Any) -> Any:
    """Six digits, for a reader; the journal has all."""
    if isinstance(value, list):
        return [_short(each) for each in value]
    return float(f'{value:.6g}') if isinstance(value, float) else value
