"""Recordings from rosbag2: a folder with MCAP files, or one such file.

Positions and velocities come from JointState messages, efforts and targets from `joint_commands`,
wrenches from WrenchStamped messages. A log of this package has its inputs in its journal. Times
are the stamps of the headers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros import paths
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.logs import journal, log, mcap_chunks
from alf_ros.logs.input_faults import checked_journal
from alf_ros.logs.mcap_chunks import Contents
from alf_ros.logs.series import ChannelReader, Series
from alf_ros.scene.scene import Scene
from alf_ros.simulation.input_checks import controlled
from alf_ros.simulation.saved_states import read_curve
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.identification.recording import KINDS, HeldInput, MeasuredChannel, Recording

_JOINTS, _WRENCH = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/WrenchStamped'
_STRING = 'std_msgs/msg/String'
_NS = 1e-9  # s
_DAY = 86_400_000_000_000  # ns: inputs that far before all measurements have another clock
_LATE = 10  # messages that may overtake one; stamps that go back further are of another run
_SAID = {  # in an entry of a journal, by its kind
    'wrench': ('force', 'torque', 'frame'),
    'effort': ('effort',),
    'target': ('position', 'velocity'),
}


@dataclass(frozen=True)
class Topics:
    """Where a recording has what: topics in full or their last part.

    joints: measured joint states; commands: efforts and targets of joints; wrenches: the topics
    whose last part, or its entry in `renamed`, is a body or a point. renamed: recorded names of
    joints and topics of wrenches -> names of the scene; '' leaves one out.
    """

    joints: str = 'joint_states'
    commands: str = 'joint_commands'
    renamed: Mapping[str, str] = field(default_factory=dict)

    def name(self, recorded: str) -> str:
        """The name in the scene."""
        return self.renamed.get(recorded, recorded)


def read_recording(
    path: str | Path, scene: Scene, topics: Topics | None = None, plan: bool = False
) -> Recording:
    """The recording in a folder or file, in the names of a scene. `plan`: inputs are enough;
    without measured positions times begin with the first input.

    Raises InputError: for no recording, one without positions of joints of the scene, commands of
    joints that the scene lacks, and names in `renamed` that nothing has.
    """
    return _Reader(paths.named(path), Simulation(scene), topics or Topics(), plan).recording()


class _Reader:
    def __init__(self, path: Path, simulation: Simulation, topics: Topics, plan: bool) -> None:
        self._path, self._topics, self._simulation = path, topics, simulation
        self._plan = plan
        self._files = _parts(path)
        self._joints: dict[tuple[str, str], list[tuple[Integers, Floats]]] = {}
        self._inputs: list[HeldInput] = []  # of a journal, in simulated time
        self._commands: list[tuple[int, tuple[str, str, dict[str, Any]]]] = []  # stamps, ns
        self._seen: set[str] = set()
        self._sources: dict[str, str] = {}  # of each joint, its name in the recording
        self._topic_of: dict[tuple[str, str], str] = {}  # of a joint or input, by kind and name
        self._untimed = ''  # a topic of measurements without stamps
        self._unused: dict[str, None] = {}
        self._all: dict[str, str] = {}  # topic -> type
        self._damage = ''

    def recording(self) -> Recording:
        own = self._own_log()
        if own is not None:
            checked_journal(own)
            self._held_before(own)
        for series in self._series(None if own is None else own.topic('~/inputs')):
            if series.type == _JOINTS and _is(series.topic, self._topics.joints):
                self._measured(series)
            elif own is not None and series.type == _STRING:
                self._from_journal(series)
            elif own is None and series.type == _JOINTS:
                self._commanded(series)
            elif own is None and series.type == _WRENCH:
                self._pushed(series)
        self._joints = {
            key: pieces
            for key, pieces in self._joints.items()
            if any(np.isfinite(values).any() for _, values in pieces)
        }
        self._check()
        begins = [int(told.min()) for pieces in self._joints.values() for told, _ in pieces]
        begins = begins or [stamp for stamp, _ in self._commands]
        origin = min(begins) if own is None else own.ahead
        channels = tuple(
            self._channel(joint, kind, pieces, origin)
            for (joint, kind), pieces in self._joints.items()
        )
        given = [HeldInput((t - origin) * _NS, *what) for t, what in self._commands]
        inputs = sorted([*given, *self._inputs], key=lambda each: each.t)
        unused = tuple(self._unused)
        return Recording(str(self._path), channels, tuple(inputs), unused, self._damage)

    def _channel(
        self, joint: str, kind: str, pieces: list[tuple[Integers, Floats]], origin: int
    ) -> MeasuredChannel:
        stamps = np.concatenate([each for each, _ in pieces])
        t = np.where(stamps == 1, 0, stamps - origin) * _NS  # 1 ns stands for no time
        values = np.concatenate([each for _, each in pieces])
        known = np.isfinite(values)
        t, values = t[known], values[known]
        order = np.argsort(t, kind='stable')
        back = np.abs(order - np.arange(order.size)) > _LATE
        if back.any():  # else the motions of two runs would be mixed
            raise InputError(
                'stamps go back: more than one run, as behind a reset',
                file=str(self._path),
                key=joint,
                value=f'{t[back.argmax()]:.6g} s',
                expected='a recording for each run',
            )
        t, values = t[order], values[order]
        new = np.diff(t, prepend=-np.inf) > 0.0  # a stamp that is there twice counts once
        return MeasuredChannel(joint, kind, t[new], values[new])

    # ---------------------------------------------------------------------------------- reading

    def _own_log(self) -> log.Log | None:
        contents = Contents()
        for _ in mcap_chunks.blocks(self._files[0], contents):
            break
        return log.load(self._path) if 'alf_ros' in contents.metadata else None

    def _series(self, journal_topic: str | None) -> Iterator[Series]:
        for file in self._files:
            contents = Contents()
            readers: dict[int, ChannelReader] = {}
            for block in mcap_chunks.blocks(file, contents):
                for id_ in np.unique(block.channel).tolist():
                    channel = contents.channels[id_]
                    self._all[channel.topic] = channel.type
                    if not self._wanted(channel.topic, channel.type, journal_topic):
                        continue
                    if channel.encoding != 'cdr':
                        raise InputError(
                            'not a ROS 2 recording',
                            file=str(file),
                            key=channel.topic,
                            value=channel.encoding,
                            expected='cdr',
                        )
                    reader = readers.setdefault(id_, ChannelReader(channel))
                    try:
                        yield from reader.series(block, np.flatnonzero(block.channel == id_))
                    except InputError as error:  # of a message, which does not know its topic
                        raise InputError(
                            error.message, file=str(file), key=channel.topic, value=error.value
                        ) from None
            if contents.damage:
                self._damage = f'{file.name}: {contents.damage}'

    def _wanted(self, topic: str, kind: str, journal_topic: str | None) -> bool:
        if journal_topic is not None:
            return topic == journal_topic or (kind == _JOINTS and _is(topic, self._topics.joints))
        named = any(_is(topic, name) for name in (self._topics.joints, self._topics.commands))
        return kind == _WRENCH or (kind == _JOINTS and named)

    def _measured(self, series: Series) -> None:
        if _is(series.topic, self._topics.commands):
            self._commanded(series)
        self._each_once(series)
        known = self._simulation.model.coordinate_names
        timed = series.told != 0
        if not timed.all():
            self._untimed = series.topic
        for k, recorded in enumerate(series.names):
            name = self._renamed(recorded)
            if name not in known:
                if name != recorded and name:
                    self._refuse('no such joint coordinate', recorded, name, known)
                self._unused[recorded] = None
                continue
            other = self._sources.setdefault(name, recorded)
            if other != recorded:
                raise InputError(
                    f'two recorded joints stand for it, {other!r} and {recorded!r}',
                    file=str(self._path),
                    key='map',
                    value=name,
                )
            self._alone('joint', name, series.topic, 'joints')
            for kind in KINDS:
                if kind in series.columns and timed.any():
                    piece = series.told[timed], series.columns[kind][timed, k]
                    self._joints.setdefault((name, kind), []).append(piece)

    def _renamed(self, recorded: str) -> str:
        if recorded in self._topics.renamed:
            self._seen.add(recorded)
        return self._topics.name(recorded)

    def _each_once(self, series: Series) -> None:
        for k, name in enumerate(series.names):
            if name in series.names[:k]:
                raise InputError(
                    'a joint that is in one message twice',
                    file=str(self._path),
                    key=series.topic,
                    value=name,
                )

    def _alone(self, kind: str, name: str, topic: str, key: str) -> None:
        """Refuse a second topic of a joint or input: as of another robot, or of a planner."""
        other = self._topic_of.setdefault((kind, name), topic)
        if other != topic:
            raise InputError(
                f'{name!r} is on two topics',
                file=str(self._path),
                key=key,
                value=f'{other} and {topic}',
                expected='one of them' + ('' if key == 'map' else ', in full'),
            )

    def _stamped(self, topic: str, stamp: int) -> int:
        if stamp == 0 and not self._plan:  # a plan may begin at zero
            raise InputError(
                'an input without a stamp: nothing tells when it acted',
                file=str(self._path),
                key=topic,
                expected='times in the headers, of the clock of the measurements',
            )
        return stamp

    def _commanded(self, series: Series) -> None:
        self._each_once(series)
        joints = self._simulation.model.coordinate_names
        known = controlled(self._simulation.model, self._simulation.scene.effects)
        for k, recorded in enumerate(series.names):
            name = self._renamed(recorded)
            if not name:
                continue
            if name not in known:
                self._refuse('an effort on a joint that the scene lacks', recorded, name, known)
            self._alone('input', name, series.topic, 'commands')
            controls = dict(zip(KINDS, known[name], strict=True), effort=name in joints)
            if _is(series.topic, self._topics.joints):
                controls = dict.fromkeys(KINDS, False)  # measured there, not commanded
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
                        file=str(self._path),
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

    def _pushed(self, series: Series) -> None:
        last = series.topic.rpartition('/')[2]
        name = self._renamed(series.topic)
        name = last if name == series.topic else name
        if not name:
            return
        model = self._simulation.model
        names = [*model.body_names, *model.point_names]
        if name not in names:
            self._refuse('a wrench on what the scene lacks', series.topic, name, names)
        self._alone('wrench', name, series.topic, 'map')
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
                file=str(self._path),
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
                file=str(self._path),
                key=topic,
                value=values if len(values) > 1 else values[0],
            )

    def _from_journal(self, series: Series) -> None:
        for entry in journal.entries(series):
            kind = entry['kind']
            if kind == journal.UNREADABLE or (kind == 'settings' and entry['effects']):
                what = 'cannot be read' if kind == journal.UNREADABLE else 'changes the effects'
                raise InputError(
                    f'an entry of its journal {what}',
                    file=str(self._path),
                    value=journal.told(entry),
                    expected='a whole log, with one set of numbers',
                )
            if kind in _SAID:
                said = {key: entry[key] for key in _SAID[kind]}
                self._hold(entry['t'], kind, entry['name'], said)

    def _held_before(self, own: log.Log) -> None:
        """The inputs in the state with which a log begins."""
        held = own.info.get('state', {}).get('inputs', {})
        for kind, each in (('wrench', 'wrenches'), ('effort', 'efforts'), ('target', 'targets')):
            for name, what in held.get(each, {}).items():
                self._hold(0.0, kind, name, {'effort': what} if kind == 'effort' else what)

    def _hold(self, t: float, kind: str, name: str, said: Mapping[str, Any]) -> None:
        curves = ('effort', 'position')
        read = {key: read_curve(x) if key in curves else x for key, x in said.items()}
        self._inputs.append(HeldInput(t, kind, name, read))

    # ----------------------------------------------------------------------------------- checks

    def _check(self) -> None:
        plan = self._plan
        for name in self._topics.renamed:
            if name not in self._seen and not plan:
                names = [*self._unused, *(joint for joint, _ in self._joints)]
                raise InputError(
                    'nothing of this name in the recording',
                    file=str(self._path),
                    key='map',
                    value=name,
                    choices=names or sorted(self._all),
                )
        enough = plan and (self._commands or self._inputs)
        if not enough and not any(kind == 'position' for _, kind in self._joints):
            topics = [topic for topic, kind in self._all.items() if kind == _JOINTS]
            if self._untimed:
                raise InputError(
                    'measurements without stamps',
                    file=str(self._path),
                    key=self._untimed,
                    expected='times in the headers',
                )
            if self._unused:
                raise InputError(
                    'no recorded joint is one of the scene',
                    file=str(self._path),
                    value=next(iter(self._unused)),
                    choices=self._simulation.model.coordinate_names,
                )
            raise InputError(
                'no positions of joints in this recording',
                file=str(self._path),
                key='joints',
                value=self._topics.joints,
                choices=topics or sorted(self._all),
            )

        if not plan:
            self._check_clocks()

    def _check_clocks(self) -> None:
        """Refuse inputs of which none can have acted while anything was measured."""
        measured = [told for pieces in self._joints.values() for told, _ in pieces]
        given = [stamp for stamp, _ in self._commands]
        if not measured or not given:
            return
        begin, end = min(int(x.min()) for x in measured), max(int(x.max()) for x in measured)
        late, early = min(given) - end, begin - max(given)
        if late > 0 or early > _DAY:
            beside = f'{late * _NS:g} s behind' if late > 0 else f'{early * _NS:g} s before'
            raise InputError(
                'all inputs are at other times than the measurements',
                file=str(self._path),
                value=f'{beside} them',
                expected='stamps of one clock',
            )

    def _refuse(self, why: str, recorded: str, name: str, known: Any) -> None:
        raise InputError(
            f'{why} ({recorded!r} in the recording)' if name != recorded else why,
            file=str(self._path),
            key='map',
            value=name,
            choices=known,
        )


def _is(topic: str, name: str) -> bool:
    return topic == name if name.startswith('/') else topic.rpartition('/')[2] == name


def _parts(path: Path) -> list[Path]:
    """The MCAP files. Raises InputError."""
    if path.is_dir() and not any(path.glob('*.mcap')) and any(path.glob('*.db3')):
        raise InputError(
            'a recording in SQLite', file=str(path), expected='MCAP: `ros2 bag convert` makes it'
        )
    if path.suffix == '.db3':
        raise InputError(
            'a recording in SQLite', file=str(path), expected='MCAP: `ros2 bag convert` makes it'
        )
    return log.parts(path)
