"""Logs for tests: made without a node, copied by another writer, read by another reader."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_ros2.reader import read_ros2_messages
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from alf_ros import Simulation, load_scene
from alf_ros.logs import journal
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation import setup as settings

JOURNAL = '/simulator/inputs'
Change = Callable[[str, bytes], bytes | None]  # of a topic and a message


def make(
    folder: Path,
    scene: Any,
    ticks: int = 400,
    push_at: int = 100,
    ledger: bool = False,
    **keywords: Any,
) -> tuple[Path, Simulation]:
    """A log of a scene with one push, and its simulation at the end."""
    setup = settings.made(load_scene(scene), {}, ledger=ledger)
    run = LogRun(folder, setup, **keywords)
    simulation = setup.simulation
    run.send()
    for tick in range(1, ticks + 1):
        if tick == push_at:
            push(run, simulation.model.body_names[-1])
        simulation.step(setup.steps)
        run.send()
    run.close()
    return run.recorder.path, simulation


def push(run: LogRun, body: str, x: float = 1.0 / 3.0) -> None:
    """Hold a force along x on a body."""
    simulation = run.setup.simulation
    force = [x] + [0.0] * (simulation.model.layout.dimension - 1)
    wrench: dict[str, Any] = {'name': body, 'force': force, 'torque': 0.0, 'frame': 'world'}
    simulation.apply_wrench(**wrench)
    run.note({'kind': 'wrench', 'cause': 'command', **wrench})


def rewritten(
    path: Path,
    folder: Path,
    compression: CompressionType = CompressionType.ZSTD,
    chunking: bool = True,
    change: Change | None = None,
    record: Callable[[str, dict[str, str]], dict[str, str]] | None = None,
    name: str = 'rewritten_0.mcap',
    rename: Callable[[str], str | None] = str,
    behind: bool = False,
) -> Path:
    """The log written by another writer, its metadata `behind` the messages if wanted.

    `change(topic, data)` may change or drop (None) data, `record(name, texts)` the texts of a
    Metadata record; `rename(topic)` another name, if any.
    """
    target = folder / name
    with open(path, 'rb') as source, open(target, 'wb') as stream:
        reader = make_reader(source)
        writer = Writer(stream, compression=compression, use_chunking=chunking, chunk_size=50_000)
        writer.start('ros2', 'test')

        def describe() -> None:
            for each in reader.iter_metadata():
                texts = record(each.name, dict(each.metadata)) if record else each.metadata
                writer.add_metadata(each.name, texts)

        if not behind:
            describe()
        channels = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in channels:
                assert schema is not None
                id_ = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    rename(channel.topic) or channel.topic,
                    channel.message_encoding,
                    id_,
                    channel.metadata,
                )
            data = change(channel.topic, message.data) if change else message.data
            if data is not None:
                stamps = message.log_time, data, message.publish_time, message.sequence
                writer.add_message(channels[channel.id], *stamps)
        if behind:
            describe()
        writer.finish()
    return target


class Retold:
    """A `change` for the journal: `edit(k, entry)` returns another k-th entry, or None.

    With `seal` all entries are sealed again: the chain of seals agrees with the new entries.
    """

    def __init__(self, edit: Callable[[int, Any], Any], seal: bool = False) -> None:
        self.edit, self.seal, self.k, self.last = edit, seal, -1, ''

    def __call__(self, topic: str, data: bytes) -> bytes | None:
        if topic != JOURNAL:
            return data
        self.k += 1
        entry = self.edit(self.k, json.loads(deserialize_message(data, String).data))
        if entry is None:
            return None
        text = json.dumps(entry)
        if self.seal:
            entry.pop(journal.SEAL)
            text, self.last = journal.chained(entry, self.last)
        return serialize_message(String(data=text))


def read_by_others(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Messages by topic, as mcap-ros2-support reads them: lists of (log time in ns, message)."""
    found: dict[str, list[tuple[int, Any]]] = {}
    for message in read_ros2_messages(str(path)):
        found.setdefault(message.channel.topic, []).append((message.log_time_ns, message.ros_msg))
    return found
