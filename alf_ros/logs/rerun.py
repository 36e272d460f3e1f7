"""A run made again from its log: the same scene, the same inputs at the same steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from alf_ros.errors import InputError
from alf_ros.logs import journal
from alf_ros.logs.log import Log
from alf_ros.logs.series import Series
from alf_ros.logs.stamps import stamp_ns
from alf_ros.scene.effect_values import effect_values, with_effect_values
from alf_ros.scene.scene import Solver
from alf_ros.simulation.saved_states import from_data, read_curve
from alf_ros.simulation.setup import on_grid
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State


class Event(NamedTuple):
    """Message `row` of a series."""

    series: Series
    row: int


def in_order(piece: list[Series]) -> Iterator[Event]:
    """The messages of all series of a piece in the order in which they were written."""
    places = np.concatenate([series.place for series in piece])
    which = np.repeat(np.arange(len(piece)), [len(series) for series in piece])
    rows = np.concatenate([np.arange(len(series)) for series in piece])
    for k in np.argsort(places, kind='stable').tolist():
        yield Event(piece[which[k]], int(rows[k]))


class Rerun:
    """`simulation` begins where the log begins. Raises InputError for a log that cannot be run."""

    def __init__(self, log: Log, trust: bool = False) -> None:
        try:
            self._ahead = log.ahead
            self.steps_per_tick = int(log.info['steps_per_tick'])
            solver = Solver(**log.info['solver'])
        except (TypeError, ValueError) as error:
            text = f'its settings do not belong to this version: {error}'
            raise InputError(text, file=str(log.path)) from None
        self._trouble = ''
        self.scene = log.scene(trust)
        ledger = bool(log.info.get('ledger', False))  # earlier versions had none
        self.simulation = Simulation(self.scene, **asdict(solver), ledger=ledger)
        if 'state' in log.info:
            self.simulation.restore(read_state(log, self.simulation))

    @property
    def trouble(self) -> str:
        """Whether steps were too long on the way, and which would do; empty if not."""
        return self._trouble or self.simulation.sample().diagnostics.trouble

    def step_of(self, stamp: int) -> int:
        """The step of a stamp (ns)."""
        ns = stamp - self._ahead
        return 0 if ns == 1 else round(ns / 1e9 / self.simulation.h)

    def step_before(self, entry: dict[str, Any]) -> int:
        """The step at which an entry of the journal acts; settings count in their own steps.

        Raises InputError for one that cannot be read.
        """
        if entry['kind'] == journal.UNREADABLE:
            raise InputError('an entry of the journal that cannot be read', value=entry['text'])
        if entry['kind'] == 'settings':
            return round(entry['t'] / self.simulation.h)
        return int(entry['step'])

    @property
    def stamp(self) -> int:
        """The stamp (ns) of the present state."""
        return stamp_ns(self.simulation.t, self._ahead)

    def go_to(self, step: int) -> None:
        """Make the steps up to this one. Raises StepError, and InputError if it lies behind."""
        missing = step - self.simulation.step_index
        if missing < 0:
            raise InputError(
                f'step {step} comes after step {self.simulation.step_index}', key='journal'
            )
        if missing:
            self.simulation.step(missing)

    def act(self, entry: dict[str, Any]) -> None:
        """Let an entry of the journal act, at its step. Raises InputError, StepError."""
        self.go_to(self.step_before(entry))
        kind = entry['kind']
        if kind == 'wrench':
            names = ('name', 'force', 'torque', 'frame')
            self.simulation.apply_wrench(**{name: entry[name] for name in names})
        elif kind == 'effort':
            self.simulation.apply_effort(entry['name'], read_curve(entry['effort']))
        elif kind == 'target':
            position = read_curve(entry['position'])
            self.simulation.apply_target(entry['name'], position, entry['velocity'])
        elif kind == 'settings':
            self._change(entry)
        elif kind != 'start':
            raise InputError('unknown kind of entry in the journal', value=kind)

    def changes(self, entry: dict[str, Any]) -> list[str]:
        """The names of the settings that an entry changes; none for another rate of the ticks."""
        solver, known = asdict(self.simulation.solver), effect_values(self.scene)
        return [
            *(f'solver.{key}' for key, new in entry['solver'].items() if solver.get(key) != new),
            *(
                name
                for name, new in entry['effects'].items()
                if name not in known or known[name].value != new
            ),
        ]

    def _change(self, entry: dict[str, Any]) -> None:
        before = self.simulation
        self.steps_per_tick = max(1, entry['steps_per_tick'])
        now = asdict(before.solver)
        if not entry['solver'].keys() <= now.keys():
            raise InputError('settings that do not belong to this version', key='solver')
        if entry['solver'].items() <= now.items() and not entry['effects']:
            return
        self._trouble = self.trouble
        self.scene = with_effect_values(self.scene, entry['effects'])
        self.simulation = Simulation(self.scene, **entry['solver'], ledger=before.ledger)
        self.simulation.restore(on_grid(before.state, before.h, self.simulation.h))


def read_state(log: Log, simulation: Simulation) -> State:
    """The state that a log begins with."""
    try:
        return from_data(log.info['state'], simulation.state)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f'its first state does not fit its scene: {error}', file=str(log.path)
        ) from None
