"""The inputs in a recording: commands and wrenches, and the journal of a log of this package."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from alf_ros.errors import InputError
from alf_ros.logs import journal, log
from alf_ros.logs.series import Series
from alf_ros.simulation.input_checks import controlled
from alf_ros.simulation.saved_states import read_curve
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.identification.recorded_names import RecordedNames, is_called
from alf_ros.studies.identification.recording import KINDS, HeldInput

_NS = 1e-9  # s
_SAID = {  # in an entry of a journal, by its kind
    'wrench': ('force', 'torque', 'frame'),
    'effort': ('effort',),
    'target': ('position', 'velocity'),
}


class RecordedInputs:
    """Collected message by message."""

    def __init__(self, names: RecordedNames, simulation: Simulation, plan: bool) -> None:
        self._names, self._simulation, self._plan = names, simulation, plan
        self._held: list[HeldInput] = []  # of a journal, in simulated time
        self._commands: list[tuple[int, tuple[str, str, dict[str, Any]]]] = []  # stamps, ns
        self._measured: set[str] = set()  # joints whose efforts are, beside their positions

    def __len__(self) -> int:
        return len(self._commands) + len(self._held)

    @property
    def stamps(self) -> list[int]:
        """Of those in messages, ns."""
        return [stamp for stamp, _ in self._commands]

    @property
    def spans(self) -> dict[tuple[str, str], tuple[int, int]]:
        """The first and the last stamp (ns) of each input in messages, by kind and name."""
        found: dict[tuple[str, str], tuple[int, int]] = {}
        for stamp, (kind, name, _) in self._commands:
            first, last = found.get((kind, name), (stamp, stamp))
            found[kind, name] = min(first, stamp), max(last, stamp)
        return found

    def inputs(self, origin: int) -> tuple[HeldInput, ...]:
        """By time. `origin`: the stamp at which time is zero, ns. Raises InputError for stamps of
        a command that go back: messages of one sender are recorded in their order."""
        last: dict[tuple[str, str], int] = {}
        for stamp, (kind, name, _) in self._commands:
            back = stamp < last.setdefault((kind, name), stamp)
            if back and name not in self._measured:
                raise InputError(
                    f'stamps of its {kind} go back: more than one run, or more than one sender',
                    file=str(self._names.path),
                    key=name,
                    value=f'{(stamp - last[kind, name]) * _NS:.6g} s',
                    expected='a recording for each run, with one clock',
                )
            last[kind, name] = stamp
        given = [HeldInput((t - origin) * _NS, *what) for t, what in self._commands]
        return tuple(sorted([*given, *self._held], key=lambda each: each.t))

    def _stamped(self, topic: str, stamp: int) -> int:
        if stamp == 0 and not self._plan:  # a plan may begin at zero
            raise InputError(
                'an input without a stamp: nothing tells when it acted',
                file=str(self._names.path),
                key=topic,
                expected='times in the headers, of the clock of the measurements',
            )
        return stamp

    def commanded(self, series: Series) -> None:
        """Efforts and targets in joint states."""
        self._names.each_once(series)
        joints = self._simulation.model.coordinate_names
        known = controlled(self._simulation.model, self._simulation.scene.effects)
        for k, recorded in enumerate(series.names):
            name = self._names.name(recorded)
            if not name:
                continue
            if name not in known:
                self._names.refuse(
                    'an effort on a joint that the scene lacks', recorded, name, known
                )
            self._names.alone('input', name, series.topic, 'commands')
            controls = dict(zip(KINDS, known[name], strict=True), effort=name in joints)
            if is_called(series.topic, self._names.topics.joints):
                controls = dict.fromkeys(KINDS, False)  # measured there, not commanded
                self._measured.add(name)
            else:
                self._refuse_unfollowed(series, k, name, controls)
            given = {
                key: series.columns[key][:, k]
                for key in ('effort', *KINDS)
                if key in series.columns and controls.get(key, True)
            }
            for n, stamp in enumerate(series.told.tolist()):
                said = {key: float(x[n]) for key, x in given.items() if not math.isnan(x[n])}
                if said:
                    self._command(self._stamped(series.topic, stamp), series.topic, name, said)

    def _refuse_unfollowed(
        self, series: Series, k: int, name: str, controls: Mapping[str, bool]
    ) -> None:
        """Refuse targets that nothing follows, except beside an effort, as in a joint state."""
        efforts = series.columns.get('effort')
        free = np.isnan(efforts[:, k]) if efforts is not None else np.ones(len(series), bool)
        for kind in KINDS:
            if kind in series.columns and not controls[kind]:
                if np.isfinite(series.columns[kind][free, k]).any():
                    raise InputError(
                        f'a {kind} that no motor of the scene follows',
                        file=str(self._names.path),
                        key=series.topic,
                        value=name,
                        expected=f'a motor with {kind}_gain',
                    )

    def _command(self, stamp: int, topic: str, name: str, said: dict[str, float]) -> None:
        for key, value in said.items():
            self._finite(topic, f'{key} of {name}', [value])
        if 'effort' in said:
            effort = {'effort': said.pop('effort')}
            self._commands.append((stamp, ('effort', name, effort)))
        if said:
            self._commands.append((stamp, ('target', name, said)))

    def pushed(self, series: Series) -> None:
        """The wrenches of a topic."""
        last = series.topic.rpartition('/')[2]
        name = self._names.name(series.topic)
        name = last if name == series.topic else name
        if not name:
            return
        model = self._simulation.model
        names = [*model.body_names, *model.point_names]
        if name not in names:
            self._names.refuse('a wrench on what the scene lacks', series.topic, name, names)
        self._names.alone('wrench', name, series.topic, 'map')
        for message in series.messages:
            at = message['header']['stamp']
            stamp = self._stamped(series.topic, at['sec'] * 1_000_000_000 + at['nanosec'])
            self._commands.append((stamp, ('wrench', name, self._wrench(series, name, message))))

    def _wrench(self, series: Series, name: str, message: dict[str, Any]) -> dict[str, Any]:
        force, torque = (
            [message['wrench'][part][axis] for axis in 'xyz'] for part in ('force', 'torque')
        )
        frame = message['header']['frame_id']
        if frame not in ('', 'world', name):
            raise InputError(
                'a wrench in another frame',
                file=str(self._names.path),
                key=series.topic,
                value=frame,
                expected=f"'world' or {name!r}",
            )
        self._finite(series.topic, 'force and torque', [*force, *torque])
        planar = self._simulation.model.layout.dimension == 2
        return {
            'force': force[:2] if planar else force,
            'torque': torque[2] if planar else torque,
            'frame': 'body' if frame == name else 'world',
        }

    def _finite(self, topic: str, what: str, values: list[float]) -> None:
        if not all(map(math.isfinite, values)):
            raise InputError(
                f'{what}: not finite',
                file=str(self._names.path),
                key=topic,
                value=values if len(values) > 1 else values[0],
            )

    def from_journal(self, series: Series) -> None:
        """Its entries, which tell simulated time."""
        for entry in journal.entries(series):
            kind = entry['kind']
            if kind == journal.UNREADABLE or (kind == 'settings' and entry['effects']):
                what = 'cannot be read' if kind == journal.UNREADABLE else 'changes the effects'
                raise InputError(
                    f'an entry of its journal {what}',
                    file=str(self._names.path),
                    value=journal.told(entry),
                    expected='a whole log, with one set of numbers',
                )
            if kind in _SAID:
                said = {key: entry[key] for key in _SAID[kind]}
                self._hold(entry['t'], kind, entry['name'], said)

    def held_before(self, own: log.Log) -> None:
        """The inputs in the state with which a log begins."""
        held = own.info.get('state', {}).get('inputs', {})
        for name in held.get('added', {}):
            raise InputError(
                'its state holds two wrenches there',
                file=str(self._names.path),
                key=name,
                expected='one wrench on a body',
            )
        for kind, each in (('wrench', 'wrenches'), ('effort', 'efforts'), ('target', 'targets')):
            for name, what in held.get(each, {}).items():
                self._hold(0.0, kind, name, {'effort': what} if kind == 'effort' else what)

    def _hold(self, t: float, kind: str, name: str, said: Mapping[str, Any]) -> None:
        curves = ('effort', 'position')
        read = {key: read_curve(x) if key in curves else x for key, x in said.items()}
        self._held.append(HeldInput(t, kind, name, read))
