"""Logs read without any care: messages as they stand in the bytes, to compare a changed log with
the whole one."""

from __future__ import annotations

import contextlib
import json
from typing import Any

from mcap_records import CHANNEL, MESSAGE, read_text, records

JOURNAL = '/simulator/inputs'
_OF_ORIGIN = ('versions', 'topics', 'seal')
_COMPARED = (
    'state',
    'joint_states',
    'reactions',
    'constraints',
    'energy',
    'work',
    'drives',
    'inputs',
)


def plain(topic: str, message: bytes) -> bytes:
    """A message of `outputs` without the bytes that only align its numbers, which say nothing: its
    head, its size and its values. As it is if it cannot be read."""
    from rclpy.serialization import deserialize_message

    from alf_ros.ros.messages.topics import TOPICS

    kinds = {each.name.rpartition('/')[2]: each.type for each in TOPICS}
    kind = kinds.get(topic.rpartition('/')[2])
    if kind is None:
        return message
    try:
        read = deserialize_message(message[12:], kind)
    except Exception:  # a class of its own in each ROS 2
        return message
    return message[:16] + f'{len(message)} {read!r}'.encode()


def without_origin(log: dict[str, list[bytes]], other: dict[str, list[bytes]]) -> Any:
    """The messages of a log. If another log has other versions or topics, the entries of the
    journal come without these, and without the seals that depend on them."""
    entries, others = (
        [entry_of(message) for message in each.get(JOURNAL, [])] for each in (log, other)
    )
    here, there = (
        [[each.get(key) for key in ('versions', 'topics')] for each in some[:1]]
        for some in (entries, others)
    )
    if here == there:
        return log
    kept = [
        json.dumps({k: v for k, v in entry.items() if k not in _OF_ORIGIN}).encode()
        for entry in entries
    ]
    return {**log, JOURNAL: kept}


def entry_of(message: bytes) -> dict[str, Any]:
    """An entry of the journal, of a message of `outputs`; empty if it is none."""
    text = message[20:].rstrip(b'\0').decode('utf-8', 'replace')
    try:
        entry = json.loads(text)
    except ValueError:
        return {}
    return entry if isinstance(entry, dict) else {}


def outputs(data: bytes) -> dict[str, list[bytes]]:
    """Messages by topic, of the topics that verify looks at: stamp, number and payload; as far as
    the file can be read without any care."""
    found: dict[str, list[bytes]] = {}
    topics: dict[int, str] = {}
    with contextlib.suppress(Exception):
        for part in records(data):
            inside = part.inner if part.inner is not None else [part]
            for record in inside:
                if record.code == CHANNEL:
                    name = read_text(record.content, 4)[0].decode()
                    topics[int.from_bytes(record.content[:2], 'little')] = name
            for record in inside:
                topic = topics.get(int.from_bytes(record.content[:2], 'little'), '')
                if record.code == MESSAGE and topic.rpartition('/')[2] in _COMPARED:
                    told = record.content[2:14] + record.content[22:]
                    found.setdefault(topic, []).append(told)
    return found
