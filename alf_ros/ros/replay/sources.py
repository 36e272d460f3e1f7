"""Where a replay's messages come from: a log as it was written, or its simulation made again."""

from __future__ import annotations

import importlib
import importlib.util
import re
from bisect import bisect_left
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import yaml
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from alf_ros.errors import InputError
from alf_ros.logs.log import Log
from alf_ros.logs.mcap_chunks import Block, Contents, blocks
from alf_ros.logs.progress import Report, silent
from alf_ros.logs.resume import resume
from alf_ros.logs.stamps import stamp_ns
from alf_ros.ros.recording.run_writer import RunWriter, full_names, ticks
from alf_ros.ros.reliable_readers import depth_within
from alf_ros.simulation.observables import READINGS
from alf_ros.simulation.setup import Setup

_DEPTH = 1000  # messages at most in a queue that is deeper than in the log, for bursts

Topics = dict[str, tuple[type, QoSProfile]]


class StampedMessage(NamedTuple):
    """A message to publish at its stamp (ns)."""

    stamp: int
    topic: str
    data: bytes


class Source(Protocol):
    """Messages in the order of their stamps; `first` and `last` are stamps (ns)."""

    topics: Topics
    first: int
    last: int

    def items(self, stamp: int) -> Iterator[StampedMessage]:
        """From a stamp on; before them the latest of each topic that is latched."""
        ...


class Recorded:
    """The messages of a log. Raises InputError for types that are not installed."""

    def __init__(self, log: Log, report: Report = silent) -> None:
        self.topics: Topics = {}
        self._types: dict[str, str] = {}
        self._largest: dict[str, int] = {}  # bytes of a message of each topic
        self._latched: list[StampedMessage] = []
        self._places: list[tuple[int, int]] = []  # of each chunk: file, byte
        self._ends: list[int] = []
        self._contents = [Contents() for _ in log.files]
        self._files = log.files
        size, before = sum(file.stat().st_size for file in log.files), 0
        first = 2**63
        for number, (file, contents) in enumerate(zip(log.files, self._contents, strict=True)):
            begin = 0
            for block in blocks(file, contents):
                if block.stamp.size:
                    self._places.append((number, begin))
                    self._ends.append(int(block.stamp.max()))
                    first = min(first, int(block.stamp.min()))
                    self._note_topics(contents, block)
                begin = block.read
                report((before + begin) / size)
            before += file.stat().st_size
        if not self._ends:
            raise InputError('an empty log', file=str(log.path))
        self.first, self.last = first, max(self._ends)
        for topic, (_, qos) in self.topics.items():
            if not _is_latched(qos):
                qos.depth = max(qos.depth, depth_within(_DEPTH, self._largest.get(topic, 0)))

    def _note_topics(self, contents: Contents, block: Block) -> None:
        """Type, QoS and size of the topics of a chunk, and what of it is latched."""
        sizes = block.end - block.start
        for channel in contents.channels.values():
            known = self._types.setdefault(channel.topic, channel.type)
            if channel.type != known:
                text, expected = f'written as {known}, {channel.type}', 'one type of each topic'
                raise InputError(text, key=channel.topic, expected=expected)
            if channel.topic not in self.topics:
                self.topics[channel.topic] = message_class(channel.type), _qos(channel.metadata)
            own = block.channel == channel.id
            largest = self._largest.get(channel.topic, 0)
            self._largest[channel.topic] = int(sizes[own].max(initial=largest))
            if _is_latched(self.topics[channel.topic][1]):
                for k in own.nonzero()[0].tolist():
                    item = StampedMessage(int(block.stamp[k]), channel.topic, block.message(k))
                    self._latched.append(item)

    def items(self, stamp: int) -> Iterator[StampedMessage]:
        """From a stamp (ns) on; before them the latest of each topic that is latched."""
        latest = {item.topic: item for item in self._latched if item.stamp < stamp}
        yield from (item._replace(stamp=stamp) for item in latest.values())
        at = bisect_left(self._ends, stamp)
        if at == len(self._places):
            return
        first, begin = self._places[at]
        for number in range(first, len(self._files)):
            contents = self._contents[number]
            for block in blocks(self._files[number], contents, begin):
                for k in (block.stamp >= stamp).nonzero()[0].tolist():
                    topic = contents.channels[int(block.channel[k])].topic
                    yield StampedMessage(int(block.stamp[k]), topic, block.message(k))
            begin = 0


class Redriven:
    """The simulation of a log made again with its inputs; nothing else of the log is used but the
    state at the instant where it begins. `items` raises InputError, StepError."""

    def __init__(self, log: Log, trust: bool = False) -> None:
        self._log, self._trust = log, trust
        self.first, self.last = log.survey.first, log.survey.last
        self._made: list[StampedMessage] = []
        names = [reading.name for reading in READINGS.values()]
        self._recorded = [name for name in names if log.topic(name) in log.survey.counts]
        self._begin(float(log.time(self.first)))
        self.topics: Topics = self._run.topics

    def _begin(self, at: float) -> None:
        self._resumed = resumed = resume(self._log, at, self._trust)
        setup = Setup(resumed.rerun.scene, resumed.rerun.simulation, resumed.rerun.steps_per_tick)
        names = full_names() | (self._log.info.get('topics') or {})
        self._made.clear()
        self._run = RunWriter(self._keep, setup, self._log.ahead, names, self._recorded)
        self._run.note(self._start())

    def _start(self) -> dict[str, Any]:
        entry = self._log.inputs[0]
        return {key: value for key, value in entry.items() if key not in ('step', 't', 'seal')}

    def _keep(
        self,
        topic: str,
        kind: type,
        qos: QoSProfile,
        stamp: int,
        data: bytes,
        essential: bool = False,
    ) -> None:
        self._made.append(StampedMessage(stamp, topic, data))

    def items(self, stamp: int) -> Iterator[StampedMessage]:
        """From the last logged instant up to a stamp (ns) on."""
        self._begin(float(self._log.time(max(stamp, self.first))))
        self._run.send()
        yield from self._taken()
        for _ in ticks(self._run, self._resumed, self._log.end):
            yield from self._taken()

    @property
    def trouble(self) -> str:
        """Whether steps were too long on the way, and which would do; empty if not."""
        return self._resumed.rerun.trouble

    def _taken(self) -> list[StampedMessage]:
        taken, self._made[:] = list(self._made), []
        return taken


_TYPE = re.compile(r'([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)')


def message_class(name: str) -> Any:
    """The class of 'package/msg/Type'. Raises InputError if it is not installed.

    The name comes from a log: only packages that have messages are imported.
    """
    match = _TYPE.fullmatch(name)
    spec = importlib.util.find_spec(match[1]) if match else None  # imports nothing
    for folder in (spec and spec.submodule_search_locations) or ():
        if match and (Path(folder) / 'msg' / '__init__.py').is_file():
            with suppress(ImportError, AttributeError):
                return getattr(importlib.import_module(f'{match[1]}.msg'), match[2])
    raise InputError('this type of message is not installed', value=name)


def stamp_of(log: Log, t: float) -> int:
    """The stamp (ns) of a simulated time (s)."""
    return stamp_ns(t, log.ahead)


def _qos(metadata: dict[str, str]) -> QoSProfile:
    """QoS as offered. Raises InputError for an invalid QoS."""
    text = metadata.get('offered_qos_profiles', '')
    try:
        profiles = yaml.safe_load(text) or [{}]
        told = profiles[0]
        qos = QoSProfile(
            depth=min(max(1, int(told.get('depth', 10))), _DEPTH),
            reliability=ReliabilityPolicy(
                int(told.get('reliability', ReliabilityPolicy.RELIABLE))
            ),
            durability=DurabilityPolicy(int(told.get('durability', DurabilityPolicy.VOLATILE))),
        )
    except (yaml.YAMLError, AttributeError, LookupError, TypeError, ValueError, RecursionError):
        raise InputError('not a QoS of a topic', value=text) from None
    return qos


def _is_latched(qos: QoSProfile) -> bool:
    return bool(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)
