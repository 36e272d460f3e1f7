"""A log of the simulator: the scene, its inputs and its results, as arrays.

Files that were cut off are read up to their last whole chunk. Everything is read when it is first
asked for; `pieces` goes through a log of any length in bounded memory.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros import html_table, paths
from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract import user_file
from alf_ros.effects.contract.user_file import is_file_name
from alf_ros.errors import InputError, shortened
from alf_ros.logs import journal, mcap_chunks, progress, record
from alf_ros.logs.journal_faults import JournalFaults
from alf_ros.logs.mcap_chunks import Contents
from alf_ros.logs.series import ChannelReader, Series, joined, type_with
from alf_ros.scene.references import WHOLE
from alf_ros.scene.scene import Scene, effect_names, scene_from_text
from alf_ros.scene.text import yaml_document

_PART = re.compile(r'(.*?)(?:_(\d+))?\.mcap')
RECORD = 'alf_ros'  # name of its metadata
COMPRESSED = '.zstd'  # what rosbag2 adds to the name of a file that it compresses
_BAG, _LISTED = 'rosbag2_bagfile_information', 'relative_file_paths'  # in a metadata.yaml
_INPUTS = '~/inputs'


@dataclass(frozen=True)
class States:
    """step (N,), t (N,) s, q and qd (N, n) in the order of `names`: m and m/s, vectors in the
    length of the drawing, as the solver has them."""

    names: tuple[str, ...]
    step: Integers
    t: Floats
    q: Floats
    qd: Floats


@dataclass
class Survey:
    """Contents of a log, from one passage through it.

    `types` by topic: where it comes with several, all of them. `lost`: messages that are missing,
    by topic, of which `dropped` were never written; `damage`:
    the unreadable places, `passed_over` if later parts were read; `leap`: a stamp that cannot be
    one of the run, '' if there is none. first and last stamp without such. `stated` are the counts
    that the files state at their ends; None if a file does not. `journal_fault`: the first one of
    the journal, in words.
    """

    counts: dict[str, int] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    inputs: list[dict[str, Any]] = field(default_factory=list)
    lost: dict[str, int] = field(default_factory=dict)
    first: int = 0  # ns
    last: int = 0
    damage: str = ''
    passed_over: str = ''
    leap: str = ''
    dropped: int = 0
    stated: dict[str, int] | None = field(default_factory=dict)
    journal_fault: str = ''


class Log:
    """The log in a folder, of one file or of several, or in one file.

    `info` is what it says of itself: 'scene', 'scene_sha256', 'solver', 'steps_per_tick',
    'stamps_ahead_ns', 'topics', 'files', 'effects', 'versions'; 'state' where it did not begin at
    the beginning, 'parent' of a fork; `scene_text` is the scene in full.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = paths.named(path)
        self.files = parts(self.path)
        self._size = sum(file.stat().st_size for file in self.files)
        contents = mcap_chunks.described(self.files[0], RECORD)
        if RECORD not in contents.metadata:
            raise InputError(
                'not a log of this simulator', file=str(self.path), expected='a record alf_ros'
            )
        self.record = contents.metadata[RECORD]
        self.info: dict[str, Any] = record.read(self.record, str(self.path))
        self.scene_text = self.record['scene_text']

    # ------------------------------------------------------------------------- what it says itself

    @property
    def versions(self) -> dict[str, str]:
        """Versions of the package, Python, numpy, numba, LLVM ..., and the processor."""
        return dict(self.info['versions'])

    @property
    def ahead(self) -> int:
        """How much stamps are ahead of the simulated time, ns."""
        return int(self.info['stamps_ahead_ns'])

    def scene(self, trust: bool = False) -> Scene:
        """The scene as it was run.

        Only the log is read. An effect that is a file is known by its digest, whatever file has
        its path now. Its text comes from the log, and runs with `trust`, or if it has run in this
        process before. Raises InputError otherwise.
        """
        file = str(self.path)
        names = [name for name in effect_names(self.scene_text, file) if is_file_name(name)]
        for name in names:
            if not user_file.digest(name):
                raise InputError(
                    'its scene names the file of an effect without a digest: the text that ran is '
                    'unknown',
                    file=file,
                    value=name,
                )
        new = [name for name in names if not user_file.is_known(name)]
        if new and not trust:
            raise InputError(
                'to run it means to run the code that it contains: '
                f'{", ".join(map(_file_said, new))}',
                file=file,
                expected='trust in it (--trust)',
            )
        for name in new:
            text = self._files.get(name)
            if text is None:
                said = 'it does not contain the code of an effect in its scene'
                raise InputError(said, file=file, value=name.partition('#')[0])
            user_file.provide(name, text)
        return scene_from_text(self.scene_text, file, references=WHOLE)

    @property
    def _files(self) -> dict[str, str]:
        """The texts of effects that are files, by full name, as far as they are texts."""
        told = self.info.get('files')
        pairs = told.items() if isinstance(told, dict) else ()
        return {name: text for name, text in pairs if isinstance(text, str)}

    @cached_property
    def survey(self) -> Survey:
        """Contents of the log, from one passage: counts, the journal, damage."""
        return self.surveyed(progress.silent)

    def surveyed(self, report: progress.Report) -> Survey:
        """The survey, made now; `report` hears how far it is."""
        found, stamps, faults = Survey(), _Stamps(self.info), JournalFaults(self.info)
        numbers: dict[str, int] = {}
        where = self.topic(_INPUTS)
        for block, contents in self._blocks(found, report):
            stamps.add(block.stamp)
            for id_ in np.unique(block.channel).tolist():
                rows, channel = np.flatnonzero(block.channel == id_), contents.channels[id_]
                topic = channel.topic
                note_type(found.types, topic, channel.type)
                found.counts[topic] = found.counts.get(topic, 0) + rows.size
                number = int(block.sequence[rows[-1]])
                numbers[topic] = max(numbers.get(topic, 0), number)
                if topic == where:
                    for series in ChannelReader(channel).series(block, rows):
                        entries = journal.entries(series)
                        found.inputs += entries
                        stamps.heed(entries)
                        for row, entry in enumerate(entries):
                            for fault in faults.of(series, row, entry):
                                found.journal_fault = found.journal_fault or fault
        for topic, number in numbers.items():
            if number > found.counts[topic]:
                found.lost[topic] = number - found.counts[topic]
        found.first, found.last, found.leap = stamps.first, stamps.last, stamps.leap
        self.__dict__['survey'] = found
        return found

    @property
    def inputs(self) -> list[dict[str, Any]]:
        """The journal: start, commands, settings, each with the `step` from which it acts."""
        return self.survey.inputs

    @property
    def damage(self) -> str:
        """Where the log cannot be read, such as its end after a kill; '' if it is whole."""
        return self.survey.damage

    @cached_property
    def absent(self) -> str:
        """Whether files of a log of several are not there, by its metadata.yaml; '' if none is
        known to be. Such a log seems to be whole, if they are the last ones."""
        return absent(self.path, self.files)

    @property
    def cut(self) -> str:
        """A sentence about a log that is not whole: its end and the reason; '' of a whole one."""
        reason = self.damage or self.absent
        until = f'it is the run until t = {self.end:.9g} s'
        return f'the log is not whole: {until} ({reason})' if reason else ''

    # ------------------------------------------------------------------------------------- content

    def topic(self, name: str) -> str:
        """Where a topic of the simulator is in this log: by the name a user writes, without '~/',
        or in full. Raises InputError if it is ambiguous or absent."""
        if name.startswith('/'):
            return name
        known: dict[str, str] = self.info.get('topics', {})
        for key, full in known.items():
            if name in (key, key.rpartition('/')[2]):
                return full
        private = f'{self.node}/{name.rpartition("/")[2]}'
        return private if name.startswith('~/') else f'/{name}'

    @property
    def node(self) -> str:
        """The full name of the simulator."""
        return node_of(self.info.get('topics', {}))

    def pieces(
        self,
        topics: Collection[str] = (),
        report: progress.Report = progress.silent,
        found: Survey | None = None,
    ) -> Iterator[list[Series]]:
        """The log chunk by chunk: a list of series each time, in the order of the log.

        `topics`: only these. A topic may come in several series of one piece. `found` is called
        with the damage, as an alternative to a survey.
        """
        wanted = {self.topic(name) for name in topics}
        readers: dict[tuple[int, str], ChannelReader] = {}
        for block, contents in self._blocks(found or Survey(), report):
            piece: list[Series] = []
            for id_ in np.unique(block.channel).tolist():
                channel = contents.channels[id_]
                if wanted and channel.topic not in wanted:
                    continue
                if (id_, channel.topic) not in readers:
                    readers[id_, channel.topic] = ChannelReader(channel)
                rows = np.flatnonzero(block.channel == id_)
                piece += readers[id_, channel.topic].series(block, rows)
            if piece:
                yield piece

    def _blocks(
        self, found: Survey, report: progress.Report
    ) -> Iterator[tuple[mcap_chunks.Block, Contents]]:
        before = 0
        for file in self.files:
            contents = Contents()
            for block in mcap_chunks.blocks(file, contents):
                yield block, contents
                report((before + block.read) / self._size)
            before += file.stat().st_size
            if contents.damage:
                found.damage = f'{file}: {contents.damage}'
            if contents.passed_over:
                found.passed_over = f'{file}: {contents.passed_over}'
            found.stated = _sum(found.stated, contents.counts)
            said = contents.metadata.get('alf_ros_dropped', {}).get('messages', '')
            found.dropped = max(found.dropped, int(said) if said.isdecimal() else 0)

    def read(self, topic: str) -> Series:
        """A whole topic. Raises InputError if the log has no such topic."""
        full = self.topic(topic)
        found = [series for piece in self.pieces([topic]) for series in piece]
        if not found:
            choices = sorted(self.survey.counts)
            raise InputError('not in this log', key='topic', value=full, choices=choices)
        return joined(found)

    def time(self, stamp: Integers | int) -> Floats:
        """Simulated time (s) of stamps (ns), to the nanosecond."""
        ns = np.asarray(stamp) - self.ahead
        return np.where(ns == 1, 0, ns) / 1e9  # 1e-9 itself is rounded

    @property
    def end(self) -> float:
        """Simulated time of the last message, s."""
        return float(self.time(self.survey.last))

    @property
    def states(self) -> States:
        """All states recorded. Raises InputError if there are none."""
        series = self.read('~/state')
        if series.type != type_with(('position', 'velocity')):
            raise InputError('no states of a run', key=series.topic, value=series.type)
        n = next(k for k, name in enumerate(series.names) if name in ('turns[0]', 'pace'))
        numbers, rates = series.columns['position'], series.columns['velocity']
        step = numbers[:, -1].astype(np.int64)
        return States(
            series.names[:n], step, self.time(series.stamp), numbers[:, :n], rates[:, :n]
        )

    def _repr_html_(self) -> str:
        """HTML for a notebook; a log above 100 MB is not read for it, unless already done."""
        solver = ', '.join(f'{key} {value}' for key, value in self.info['solver'].items())
        about = [
            ('log', str(self.path)),
            ('size', f'{self._size / 1e6:.3g} MB in {len(self.files)} files'),
            ('solver', solver),
            ('made by', f'alf_ros {self.versions.get("alf_ros", "of an unknown version")}'),
        ]
        parts = [html_table.heading(f'Log of the scene {self.info["scene"]}')]
        if 'survey' not in vars(self) and self._size > _READ_TO_SHOW:
            unread = html_table.paragraph('not read yet: `survey` reads it')
            return ''.join([*parts, html_table.pairs(about), unread])
        survey = self.survey
        if survey.counts:
            first, last = (float(self.time(at)) for at in (survey.first, survey.last))
            about.append(('time', f'{first:.9g} to {last:.9g} s'))
        about.append(('inputs', str(len(survey.inputs))))
        about += [('damage', survey.damage)] if survey.damage else []
        rows = ((name, survey.types[name], str(n)) for name, n in survey.counts.items())
        head = ('topic', 'type', 'messages')
        topics = html_table.table(head, rows, len(survey.counts))
        return ''.join([*parts, html_table.pairs(about), topics])


def note_type(types: dict[str, str], topic: str, name: str) -> None:
    """Note a type of a topic. Each channel has its own, so it may come with another one."""
    known = types.setdefault(topic, name)
    if name not in known.split(', '):
        types[topic] = f'{known}, {name}'


def node_of(topics: Mapping[str, str]) -> str:
    """The full name of the simulator whose `topics` these are, by the name a user writes.

    Any of them may be remapped: most of its own are below its name.
    """
    own = ((name[1:], full) for name, full in topics.items() if name.startswith('~/'))
    nodes = Counter(full.removesuffix(key) for key, full in own if full.endswith(key))
    return nodes.most_common(1)[0][0] if nodes else '/simulator'


_READ_TO_SHOW = 100_000_000  # bytes

# Solver steps between two messages, beyond which a stamp is damaged rather than far away: made
# again they would take minutes at the least. A log has a message at every tick, or one a second.
_MOST_STEPS = 10_000_000


def _sum(one: dict[str, int] | None, other: dict[str, int] | None) -> dict[str, int] | None:
    """Counts of two files together."""
    if one is None or other is None:
        return None
    return {topic: one.get(topic, 0) + other.get(topic, 0) for topic in {*one, *other}}


class _Stamps:
    """The stamps (ns) of a log that are possible in its run: `first`, `last`, and a description of
    the first impossible one."""

    def __init__(self, info: dict[str, Any]) -> None:
        self._h = 0.0
        self._take(info['solver'])
        self.first = self.last = 0
        self.leap = ''
        self._begun = False

    def heed(self, entries: list[dict[str, Any]]) -> None:
        """Settings may make the steps longer."""
        for entry in entries:
            if entry['kind'] == 'settings':
                self._take(entry['solver'])

    def _take(self, solver: dict[str, Any]) -> None:
        step = solver.get('step')
        if isinstance(step, (int, float)) and not isinstance(step, bool) and 0.0 < step <= 1e6:
            self._h = max(self._h, float(step))

    def add(self, stamps: Integers) -> None:
        """Continue with the stamps of a chunk."""
        farthest = min(_MOST_STEPS * self._h * 1e9, 2.0**62)
        ordered = np.unique(stamps)
        if not self._begun and ordered.size:
            self.first = self.last = int(ordered[0])
            self._begun = True
        beyond = np.flatnonzero(np.diff(ordered, prepend=self.last).astype(float) > farthest)
        good = ordered[: beyond[0]] if beyond.size else ordered
        if good.size:
            self.first = min(self.first, int(good[0]))
            self.last = max(self.last, int(good[-1]))
        if beyond.size and not self.leap:
            self.leap = f'the stamp {int(ordered[beyond[0]])} ns does not belong to its run'


def _file_said(name: str) -> str:
    """The name of a file and the begin of its digest."""
    path, _, digest = name.partition('#sha256=')
    return f'{shortened(path)} (sha256 {digest[:12]})'


def load(path: str | Path) -> Log:
    """The log in a folder or a file. Raises InputError if it is none."""
    return Log(path)


def parts(path: Path) -> list[Path]:
    """The MCAP files of a log or another recording, in order. Raises InputError without any."""
    if os.path.isfile(path):
        _check_format(path, [path.name])
        return [path]
    if not os.path.isdir(path):
        raise InputError('no such log', file=str(path), expected='a folder or an .mcap file')
    found = sorted(path.glob('*.mcap'), key=_number)
    if not found:
        _check_format(path, [each.name for each in path.glob('*')])
        raise InputError('no .mcap file in this folder', file=str(path))
    return found


def _check_format(path: Path, names: Sequence[str]) -> None:
    """Raises InputError for files that rosbag2 writes in other formats."""
    if any(name.endswith(('.db3', f'.db3{COMPRESSED}')) for name in names):
        expected = 'MCAP: `ros2 bag convert` makes it'
        raise InputError('a recording in SQLite', file=str(path), expected=expected)
    if any(name.endswith(f'.mcap{COMPRESSED}') for name in names):
        expected = 'files that `zstd -d` made .mcap again'
        raise InputError('a recording in compressed files', file=str(path), expected=expected)


def absent(folder: Path, files: Sequence[Path]) -> str:
    """Whether the metadata.yaml in a folder lists more files than are there, or cannot be read;
    '' if not, and without one."""
    try:
        count = len(listed(folder))
    except InputError as error:
        return f'its metadata.yaml does not tell its files: {error.message}'
    missing = count - len(files)
    return f'{missing} of its {count} files are not there' if missing > 0 else ''


def listed(folder: Path) -> list[str]:
    """The names of the files that the metadata.yaml in a folder lists; none without one, as of one
    file, or of a recording that was cut off. Raises InputError if it cannot be read."""
    path = folder / 'metadata.yaml'
    if not os.path.isfile(path):
        return []
    bag = yaml_document.read(path).mapping((_BAG,), (_BAG,))[_BAG]
    entries = bag.mapping(required=(_LISTED,))[_LISTED].sequence()
    return [entry.text().rpartition('/')[2] for entry in entries]


def _number(path: Path) -> tuple[str, int]:
    match = _PART.fullmatch(path.name)
    return (match[1], int(match[2] or 0)) if match else (path.name, 0)
