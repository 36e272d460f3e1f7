"""How rosbag2 describes a log: message definitions, type hashes, QoS and metadata.yaml.

Nothing here needs `ament_index` or an environment variable: a message package knows its own place.
"""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from alf_ros.errors import AlfError

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

# Version 8 is the last one with QoS policies as integers, and what rosbag2 assumes for a bare file
# whose `rosbag2` record was lost, as after a kill.
METADATA_VERSION = 8
_SEPARATOR = '=' * 80


def type_name(message_type: type) -> str:
    """ROS name of a message class, such as 'sensor_msgs/msg/JointState'."""
    return f'{message_type.__module__.partition(".")[0]}/msg/{message_type.__name__}'


@cache
def definition(name: str) -> str:
    """`ros2msg` schema of a type: its text, then each type it needs once, depth first."""
    seen = {name}
    text = _file(name, '.msg').read_text('utf-8')
    return text + ''.join(_dependencies(name, text, seen))


def _dependencies(name: str, text: str, seen: set[str]) -> list[str]:
    parts = []
    for used in _types_in(text, name.split('/')[0]):
        if used not in seen:
            seen.add(used)
            body = _file(used, '.msg').read_text('utf-8')
            package, _, short = used.split('/')
            parts.append(f'\n{_SEPARATOR}\nMSG: {package}/{short}\n{body}')
            parts += _dependencies(used, body, seen)
    return parts


def _types_in(text: str, package: str) -> list[str]:
    """Message types of the fields in a definition; primitive types start with a small letter."""
    found = []
    for line in text.splitlines():
        words = line.partition('#')[0].split()
        if len(words) < 2:
            continue
        field = words[0].partition('[')[0].partition('<')[0]
        owner, _, short = field.rpartition('/')
        if short[0].isupper():
            found.append(f'{owner.partition("/")[0] or package}/msg/{short}')
    return found


@cache
def type_hash(name: str) -> str:
    """RIHS01 hash of a type, or '' where the distribution ships none (before Iron)."""
    try:
        description = json.loads(_file(name, '.json').read_text('utf-8'))
    except AlfError:
        return ''
    hashes = {entry['type_name']: entry['hash_string'] for entry in description['type_hashes']}
    return str(hashes[name])


def _file(name: str, suffix: str) -> Path:
    """`<prefix>/share/<package>/msg/<Type><suffix>`, the prefix being above the Python package."""
    package, _, short = name.split('/')
    module = importlib.import_module(package)
    start = Path(module.__file__ or '')
    for prefix in start.parents:
        path = prefix / 'share' / package / 'msg' / (short + suffix)
        if path.is_file():
            return path
    raise AlfError(f'no share/{package}/msg/{short}{suffix} above {start}')


def qos_text(qos: QoSProfile) -> str:
    """`offered_qos_profiles` of a channel: YAML, one profile, policies as integers."""

    def duration(value: Any) -> dict[str, int]:
        seconds, nanoseconds = divmod(value.nanoseconds, 1_000_000_000)
        return {'sec': seconds, 'nsec': nanoseconds}

    profile = {
        'history': int(qos.history),
        'depth': qos.depth,
        'reliability': int(qos.reliability),
        'durability': int(qos.durability),
        'deadline': duration(qos.deadline),
        'lifespan': duration(qos.lifespan),
        'liveliness': int(qos.liveliness),
        'liveliness_lease_duration': duration(qos.liveliness_lease_duration),
        'avoid_ros_namespace_conventions': qos.avoid_ros_namespace_conventions,
    }
    return yaml.safe_dump([profile], sort_keys=False)


@dataclass
class RecordedTopic:
    """A topic in a log and how many messages it has so far."""

    id: int
    topic: str
    type: str
    qos: str
    type_hash: str
    count: int = 0


@dataclass(frozen=True)
class File:
    """A file of a log: first and last stamp (ns), number of messages."""

    name: str
    start: int
    end: int
    count: int


def metadata(
    files: Sequence[File], channels: Iterable[RecordedTopic], info: Mapping[str, str]
) -> dict[str, Any]:
    """The metadata that rosbag2 keeps about a log of these files; `channels` of all of them."""
    topics: dict[str, RecordedTopic] = {}
    for channel in channels:
        before = topics[channel.topic].count if channel.topic in topics else 0
        topics[channel.topic] = replace(channel, count=before + channel.count)
    filled = [file for file in files if file.count] or files[:1]
    start, end = min(file.start for file in filled), max(file.end for file in filled)
    return {
        'version': METADATA_VERSION,
        'storage_identifier': 'mcap',
        **_span(start, end, sum(file.count for file in files)),
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': channel.topic,
                    'type': channel.type,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': channel.qos,
                    'type_description_hash': channel.type_hash,
                },
                'message_count': channel.count,
            }
            for channel in topics.values()
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file.name for file in files],
        'files': [
            {'path': file.name, **_span(file.start, file.end, file.count)} for file in files
        ],
        'custom_data': dict(info),
        'ros_distro': os.environ.get('ROS_DISTRO', 'unknown'),
    }


def _span(start: int, end: int, count: int) -> dict[str, Any]:
    return {
        'starting_time': {'nanoseconds_since_epoch': start},
        'duration': {'nanoseconds': end - start},
        'message_count': count,
    }


def write_metadata(
    folder: Path, files: Sequence[File], channels: Iterable[RecordedTopic], info: Mapping[str, str]
) -> None:
    """Write metadata.yaml beside the files of a log; `channels` of all of them.

    Raises OSError if it cannot be written.
    """
    about = metadata(files, channels, info)
    document = {'rosbag2_bagfile_information': about}
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    (folder / 'metadata.yaml').write_text(text, 'utf-8')
