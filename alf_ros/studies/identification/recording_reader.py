"""Recordings from rosbag2: a folder, or a file of one.

Positions and velocities come from JointState messages; `recorded_inputs` reads what acted. Times
are the stamps of the headers.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from alf_ros import paths
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.logs import log, mcap_chunks
from alf_ros.logs.input_faults import checked_journal
from alf_ros.logs.mcap_chunks import Contents
from alf_ros.logs.series import ChannelReader, Series
from alf_ros.scene.scene import Scene
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.identification import rosbag_files
from alf_ros.studies.identification.counted_once import check_one_source, first_at_stamps
from alf_ros.studies.identification.recorded_inputs import RecordedInputs
from alf_ros.studies.identification.recorded_names import RecordedNames, Topics, is_called
from alf_ros.studies.identification.recording import FARTHEST, KINDS, MeasuredChannel, Recording

_JOINTS, _WRENCH = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/WrenchStamped'
_STRING = 'std_msgs/msg/String'
_NS = 1e-9  # s
_DAY = 86_400_000_000_000  # ns: inputs that far from all measurements have another clock
_LATE = 10  # messages that may overtake one; stamps that go back further are of another run


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
        self._names = RecordedNames(path, topics)
        self._inputs = RecordedInputs(self._names, simulation, plan)
        self._is_other = rosbag_files.is_for_rosbags(path)
        self._files = [path] if self._is_other else _parts(path)
        self._joints: dict[tuple[str, str], list[tuple[Integers, Floats]]] = {}
        self._sources: dict[str, str] = {}  # of each joint, its name in the recording
        self._untimed = ''  # a topic of measurements without stamps
        self._unused: dict[str, None] = {}
        self._all: dict[str, str] = {}  # topic -> type
        self._damage = '' if self._is_other else log.absent(path, self._files)

    def recording(self) -> Recording:
        own = self._own_log()
        if own is not None:
            checked_journal(own)
            self._inputs.held_before(own)
        for series in self._series(None if own is None else own.topic('~/inputs')):
            if series.type == _JOINTS and is_called(series.topic, self._topics.joints):
                self._measured(series)
            elif own is not None and series.type == _STRING:
                self._inputs.from_journal(series)
            elif own is None and series.type == _JOINTS:
                self._inputs.commanded(series)
            elif own is None and series.type == _WRENCH:
                self._inputs.pushed(series)
        self._joints = {
            key: pieces
            for key, pieces in self._joints.items()
            if any(np.isfinite(values).any() for _, values in pieces)
        }
        self._check()
        begins = [int(told.min()) for pieces in self._joints.values() for told, _ in pieces]
        begins = begins or self._inputs.stamps
        origin = min(begins) if own is None else own.ahead
        channels = tuple(
            self._channel(joint, kind, pieces, origin)
            for (joint, kind), pieces in self._joints.items()
        )
        inputs = self._inputs.inputs(origin)
        unused = tuple(self._unused)
        return Recording(str(self._path), channels, inputs, unused, self._damage, origin)

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
        far = np.abs(values) >= FARTHEST
        if far.any():
            raise InputError(
                f'not a {kind}',
                file=str(self._path),
                key=joint,
                value=float(values[far.argmax()]),
                expected=f'less than {FARTHEST:g}',
            )
        new = first_at_stamps(t, values, str(self._path), joint)
        if kind == 'position':
            check_one_source(values[new], str(self._path), joint)
        return MeasuredChannel(joint, kind, t[new], values[new])

    # ---------------------------------------------------------------------------------- reading

    def _own_log(self) -> log.Log | None:
        if self._is_other:
            return None
        contents = mcap_chunks.described(self._files[0], log.RECORD)
        return log.load(self._path) if log.RECORD in contents.metadata else None

    def _series(self, journal_topic: str | None) -> Iterator[Series]:
        blocks = rosbag_files.blocks if self._is_other else mcap_chunks.blocks
        for file in self._files:
            contents = Contents()
            readers: dict[int, ChannelReader] = {}
            for block in blocks(file, contents):
                for id_ in np.unique(block.channel).tolist():
                    channel = contents.channels[id_]
                    known = self._all.setdefault(channel.topic, channel.type)
                    if channel.type != known and self._wanted(channel.topic, known, journal_topic):
                        raise InputError(
                            f'written as {known}, {channel.type}',
                            file=str(file),
                            key=channel.topic,
                            expected='one type of each topic',
                        )
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
                    try:
                        if not channel.definition.strip():
                            raise InputError('no definition of its type', value=channel.type)
                        reader = readers.get(id_) or ChannelReader(channel)
                        readers[id_] = reader
                        yield from reader.series(block, np.flatnonzero(block.channel == id_))
                    except InputError as error:  # of a message, which does not know its topic
                        raise InputError(
                            error.message,
                            file=str(file),
                            key=channel.topic,
                            value=error.value,
                            expected=error.expected,
                        ) from None
            if contents.damage:
                self._damage = f'{file.name}: {contents.damage}'

    def _wanted(self, topic: str, kind: str, journal_topic: str | None) -> bool:
        if journal_topic is not None:
            return topic == journal_topic or (
                kind == _JOINTS and is_called(topic, self._topics.joints)
            )
        named = any(
            is_called(topic, name) for name in (self._topics.joints, self._topics.commands)
        )
        return kind == _WRENCH or (kind == _JOINTS and named)

    def _measured(self, series: Series) -> None:
        if is_called(series.topic, self._topics.commands):
            self._inputs.commanded(series)
        self._names.each_once(series)
        known = self._simulation.model.coordinate_names
        timed = series.told != 0
        if not timed.all():
            self._untimed = series.topic
        for k, recorded in enumerate(series.names):
            name = self._names.name(recorded)
            if name not in known:
                if name != recorded and name:
                    self._names.refuse('no such joint coordinate', recorded, name, known)
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
            self._names.alone('joint', name, series.topic, 'joints')
            for kind in KINDS:
                if kind in series.columns and timed.any():
                    piece = series.told[timed], series.columns[kind][timed, k]
                    self._joints.setdefault((name, kind), []).append(piece)

    # ----------------------------------------------------------------------------------- checks

    def _check(self) -> None:
        plan = self._plan
        for name in self._topics.renamed:
            if name not in self._names.seen and not plan:
                names = list(dict.fromkeys((*self._unused, *(joint for joint, _ in self._joints))))
                raise InputError(
                    'nothing of this name in the recording',
                    file=str(self._path),
                    key='map',
                    value=name,
                    choices=names or sorted(self._all),
                )
        enough = plan and len(self._inputs) > 0
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
            if self._joints:
                raise InputError(
                    'velocities without positions',
                    file=str(self._path),
                    key='joints',
                    value=next(joint for joint, _ in self._joints),
                    expected='positions, which tell where windows begin',
                )
            damaged = f', which is damaged: {self._damage}' if self._damage else ''
            if not self._all and not damaged:
                raise InputError('no messages in this recording', file=str(self._path))
            for topic, kind in self._all.items():
                if is_called(topic, self._topics.joints) and not damaged:
                    why = 'no positions of joints in this recording'
                    raise InputError(
                        why if kind == _JOINTS else 'not of the type of joint states',
                        file=str(self._path),
                        key=topic,
                        value=kind,
                        expected=None if kind == _JOINTS else _JOINTS,
                    )
            raise InputError(
                f'no positions of joints in this recording{damaged}',
                file=str(self._path),
                key='joints',
                value=self._topics.joints,
                choices=topics or sorted(self._all),
            )

        if not plan:
            self._check_clocks()

    def _check_clocks(self) -> None:
        """Refuse inputs of which none can have acted while anything was measured, and each input
        with another clock."""
        measured = [told for pieces in self._joints.values() for told, _ in pieces]
        given = self._inputs.stamps
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
        for (kind, name), (first, last) in self._inputs.spans.items():
            apart = max(first - end, begin - last)
            if apart > _DAY:
                raise InputError(
                    f'its {kind} is at other times than the measurements',
                    file=str(self._path),
                    key=name,
                    value=f'{apart * _NS:g} s {"behind" if first > end else "before"} them',
                    expected='stamps of one clock',
                )


def _parts(path: Path) -> list[Path]:
    """The MCAP files. Raises InputError, also if one of them is of another recording."""
    files = log.parts(path)
    try:
        listed = {name.removesuffix(log.COMPRESSED) for name in log.listed(path)}
    except InputError:  # which `log.absent` says
        return files
    for file in files:
        if listed and file.name not in listed:
            raise InputError(
                'a file that the metadata.yaml beside it does not list',
                file=str(path),
                value=file.name,
                expected='each recording in a folder of its own',
            )
    return files
