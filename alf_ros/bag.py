"""How rosbag2 describes a log: message definitions, type hashes, QoS and metadata.yaml.

Nothing here needs `ament_index` or an environment variable: a message package knows its own place.
"""

from __future__ import annotations

import importlib
import json
import os
from dataclasses import dataclass
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
class Channel:
    """A topic in a log and how many messages it has so far."""

    id: int
    topic: str
    type: str
    qos: str
    count: int = 0


def metadata(
    file: str, channels: list[Channel], start: int, end: int, info: dict[str, str]
) -> dict[str, Any]:
    """What rosbag2 keeps about a log of one file; `start` and `end` are stamps (ns)."""

    def span() -> dict[str, Any]:
        return {
            'starting_time': {'nanoseconds_since_epoch': start},
            'duration': {'nanoseconds': end - start},
            'message_count': sum(channel.count for channel in channels),
        }

    return {
        'version': METADATA_VERSION,
        'storage_identifier': 'mcap',
        **span(),
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': channel.topic,
                    'type': channel.type,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': channel.qos,
                    'type_description_hash': type_hash(channel.type),
                },
                'message_count': channel.count,
            }
            for channel in channels
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file],
        'files': [{'path': file, **span()}],
        'custom_data': info,
        'ros_distro': os.environ.get('ROS_DISTRO', 'unknown'),
    }
