"""A log of the simulator: what was run, its inputs, and what came out, as arrays.

Files that were cut off are read up to their last whole chunk. Everything is read when it is first
asked for; `pieces` goes through a log of any length in bounded memory.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract import user_file
from alf_ros.errors import InputError
from alf_ros.logs import journal, mcap_chunks, progress
from alf_ros.logs.mcap_chunks import Contents
from alf_ros.logs.series import ChannelReader, Series, joined
from alf_ros.scene.scene import Scene, scene_from_text

_PART = re.compile(r'(.*?)(?:_(\d+))?\.mcap')
_INPUTS = '~/inputs'
_TEXTS = ('scene', 'scene_sha256')
_NEEDED = (*_TEXTS, 'solver', 'steps_per_tick', 'stamps_ahead_ns', 'versions')


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
    """What one passage through a log shows."""

    counts: dict[str, int] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    inputs: list[dict[str, Any]] = field(default_factory=list)
    lost: dict[str, int] = field(default_factory=dict)
    first: int = 0  # stamps, ns
    last: int = 0
    damage: str = ''


class Log:
    """The log in a folder, of one file or of several, or in one file.

    `info` is what it says of itself: 'scene', 'scene_sha256', 'solver', 'steps_per_tick',
    'stamps_ahead_ns', 'topics', 'files', 'effects', 'versions'; 'state' where it did not begin at
    the beginning, 'parent' of a fork; `scene_text` is the scene in full.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path).expanduser()
        self.files = _files(self.path)
        self._size = sum(file.stat().st_size for file in self.files)
        contents = Contents()
        for _ in mcap_chunks.blocks(self.files[0], contents):
            break
        if 'alf_ros' not in contents.metadata:
            raise InputError(
                'not a log of this simulator', file=str(self.path), expected='a record alf_ros'
            )
        self.record = contents.metadata['alf_ros']
        told = dict(self.record)
        try:
            self.scene_text = told.pop('scene_text')
            self.info: dict[str, Any] = {
                key: text if key in _TEXTS else json.loads(text) for key, text in told.items()
            }
            missing = [key for key in _NEEDED if key not in self.info]
        except (KeyError, ValueError):
            missing = ['it cannot be read']
        if missing:
            text = f'its record alf_ros is damaged: {", ".join(missing)}'
            raise InputError(text, file=str(self.path))

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

        An effect that is a file, and is no longer there as it was, is taken from the log if
        `trust` says that its code may run. Raises InputError otherwise.
        """
        for name, text in self.info.get('files', {}).items():
            if not user_file.is_there(name):
                if not trust:
                    raise InputError(
                        'the log brings the code of an effect whose file is not here any more',
                        value=name.partition('#')[0],
                        expected='trust in it (--trust)',
                    )
                user_file.provide(name, text)
        return scene_from_text(self.scene_text, str(self.path))

    @cached_property
    def survey(self) -> Survey:
        """What one passage through the log shows: counts, the journal, what is damaged."""
        return self.surveyed(progress.silent)

    def surveyed(self, report: progress.Report) -> Survey:
        """The survey, made now; `report` hears how far it is."""
        found, first = Survey(), 2**63
        numbers: dict[str, int] = {}
        where = self.topic(_INPUTS)
        for block, contents in self._blocks(found, report):
            for id_ in np.unique(block.channel).tolist():
                rows, channel = np.flatnonzero(block.channel == id_), contents.channels[id_]
                topic = channel.topic
                found.types[topic] = channel.type
                found.counts[topic] = found.counts.get(topic, 0) + rows.size
                first = min(first, int(block.stamp[rows].min()))
                found.last = max(found.last, int(block.stamp[rows].max()))
                number = int(block.sequence[rows[-1]])
                numbers[topic] = max(numbers.get(topic, 0), number)
                if topic == where:
                    for series in ChannelReader(channel).series(block, rows):
                        found.inputs += [
                            journal.read(message['data']) for message in series.messages
                        ]
        for topic, number in numbers.items():
            if number > found.counts[topic]:
                found.lost[topic] = number - found.counts[topic]
        found.first = min(first, found.last)
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

    # ------------------------------------------------------------------------------------- content

    def topic(self, name: str) -> str:
        """Where a topic of the simulator is in this log: by the name a user writes, without '~/',
        or in full. Raises InputError where it cannot be told."""
        if name.startswith('/'):
            return name
        known: dict[str, str] = self.info.get('topics', {})
        for key, full in known.items():
            if name in (key, key.rpartition('/')[2]):
                return full
        node = next((f for k, f in known.items() if k == '~/energy'), '/simulator/energy')
        private = f'{node.rpartition("/")[0]}/{name.rpartition("/")[2]}'
        return private if name.startswith('~/') else f'/{name}'

    def pieces(
        self,
        topics: Collection[str] = (),
        report: progress.Report = progress.silent,
        found: Survey | None = None,
    ) -> Iterator[list[Series]]:
        """The log chunk by chunk: a list of series each time, in the order of the log.

        `topics`: only these. A topic may come in several series of one piece. `found` is told the
        damage, for who has no other need of a survey.
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
        return np.where(ns == 1, 0, ns) * 1e-9

    @property
    def end(self) -> float:
        """Simulated time of the last message, s."""
        return float(self.time(self.survey.last))

    @property
    def states(self) -> States:
        """All states recorded. Raises InputError if there are none."""
        series = self.read('~/state')
        n = next(k for k, name in enumerate(series.names) if name in ('turns[0]', 'pace'))
        numbers, rates = series.columns['position'], series.columns['velocity']
        step = numbers[:, -1].astype(np.int64)
        return States(
            series.names[:n], step, self.time(series.stamp), numbers[:, :n], rates[:, :n]
        )


def load(path: str | Path) -> Log:
    """The log in a folder or a file. Raises InputError if it is none."""
    return Log(path)


def _files(path: Path) -> list[Path]:
    """The parts of a log, in order."""
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise InputError('no such log', file=str(path), expected='a folder or an .mcap file')
    found = sorted(path.glob('*.mcap'), key=_number)
    if not found:
        raise InputError('no .mcap file in this folder', file=str(path))
    return found


def _number(path: Path) -> tuple[str, int]:
    match = _PART.fullmatch(path.name)
    return (match[1], int(match[2] or 0)) if match else (path.name, 0)
