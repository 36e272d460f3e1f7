"""Recordings in SQLite, and compressed by rosbag2, written by the package rosbags: the same as
the MCAP file with their messages."""

from __future__ import annotations

import sqlite3
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from alf_ros.errors import InputError
from alf_ros.studies.identification.recording import Recording
from alf_ros.studies.identification.recording_reader import read_recording
from support.foreign_bags import Message, joints, wrench, written
from support.recordings import scene
from support.thorough import thinned

NOW = 1_760_000_000_123_456_789  # ns, as clocks of machines are
STORE = get_typestore(Stores.LATEST)
COUNT = 5000  # more than a block has


def messages() -> list[Message]:
    found = []
    for k in range(COUNT):
        stamp = NOW + k * 10**6
        found.append(joints('/joint_states', stamp, ['crank_pin'], position=[0.7 + 1e-5 * k]))
        if k % 100 == 0:
            found.append(joints('/joint_commands', stamp, ['crank_pin'], effort=[1e-3 * k]))
            found.append(wrench('/w/coupler', stamp, [0.5, -1e-3 * k, 0.0]))
    return found


def value(kind: str, content: Any) -> Any:
    """A message of rosbags."""
    if not isinstance(content, dict):
        return np.array(content) if isinstance(content, list) and kind != 'string' else content
    made = STORE.types[kind]
    inner = {
        'header': 'std_msgs/msg/Header',
        'stamp': 'builtin_interfaces/msg/Time',
        'wrench': 'geometry_msgs/msg/Wrench',
        'force': 'geometry_msgs/msg/Vector3',
        'torque': 'geometry_msgs/msg/Vector3',
        'name': 'string',
    }
    return made(**{key: value(inner.get(key, ''), each) for key, each in content.items()})


def bag(
    folder: Path,
    version: Literal[8, 9] = 9,
    storage: StoragePlugin = StoragePlugin.SQLITE3,
    compression: CompressionMode | None = None,
) -> Path:
    writer = Writer(folder, version=version, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        open_ = {}
        for topic, kind, stamp, content in messages():
            if topic not in open_:
                open_[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(open_[topic], stamp, STORE.serialize_cdr(value(kind, content), kind))
    return folder


def check(found: Recording, expected: Recording) -> None:
    assert list(map(repr, found.inputs)) == list(map(repr, expected.inputs))
    for one, other in zip(found.channels, expected.channels, strict=True):
        assert one.name == other.name
        assert one.t.tobytes() == other.t.tobytes()
        assert one.values.tobytes() == other.values.tobytes()


SQLITE, MCAP = StoragePlugin.SQLITE3, StoragePlugin.MCAP
KINDS: dict[str, dict[str, Any]] = {
    'SQLite': {},
    'SQLite before Iron': {'version': 8},
    'SQLite, compressed files': {'compression': CompressionMode.FILE},
    'SQLite, compressed messages': {'compression': CompressionMode.MESSAGE},
    'MCAP, compressed files': {'storage': MCAP, 'compression': CompressionMode.FILE},
    'MCAP, compressed messages': {'storage': MCAP, 'compression': CompressionMode.MESSAGE},
}


@pytest.mark.parametrize(
    'kind',
    thinned(
        KINDS, lambda kind: kind not in ('SQLite, compressed messages', 'MCAP, compressed files')
    ),
)
def test_they_are_read_as_mcap_is(tmp_path: Path, kind: str) -> None:
    expected = read_recording(written(tmp_path / 'mcap', messages(), late=0), scene())
    assert len(expected.inputs) > 0 and len(expected.channels[0].t) == COUNT
    found = read_recording(bag(tmp_path / 'bag', **KINDS[kind]), scene())
    check(found, expected)
    assert found.damage == ''


def test_one_file_without_its_definitions(tmp_path: Path) -> None:
    """As `ros2 bag record` wrote it before ROS 2 Iron."""
    (file,) = bag(tmp_path / 'bag', version=8).glob('*.db3')
    with sqlite3.connect(file) as base:
        base.execute('DROP TABLE message_definitions')
        base.execute('UPDATE schema SET schema_version = 3')
    base.close()
    expected = read_recording(written(tmp_path / 'mcap', messages(), late=0), scene())
    check(read_recording(file, scene()), expected)
    (file.parent / 'metadata.yaml').unlink()
    check(read_recording(file.parent, scene()), expected)


def test_what_cannot_be_read_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good = bag(tmp_path / 'good')
    (file,) = good.glob('*.db3')
    (tmp_path / 'text.db3').write_text('no bag')
    (tmp_path / 'empty.db3').write_bytes(b'')
    alone = tmp_path / 'alone'  # two files, and nothing tells their order
    alone.mkdir()
    for n in range(2):
        (alone / f'bag_{n}.db3').write_bytes(file.read_bytes())
    gone = bag(tmp_path / 'gone')
    next(gone.glob('*.db3')).unlink()
    (gone / 'other.db3').write_bytes(file.read_bytes())
    packed = bag(tmp_path / 'packed', compression=CompressionMode.FILE)
    (zstd,) = packed.glob('*.zstd')
    zstd.write_bytes(zstd.read_bytes()[:200] + bytes(200))
    for path in (tmp_path / 'text.db3', tmp_path / 'empty.db3', alone, gone, packed):
        with pytest.raises(InputError, match='cannot be read: ') as caught:
            read_recording(path, scene())
        assert '\n' not in str(caught.value), path
    monkeypatch.setitem(sys.modules, 'rosbags.rosbag2', None)
    with pytest.raises(InputError, match='pip install rosbags'):
        read_recording(good, scene())


def test_a_damaged_file_is_read_up_to_the_damage(tmp_path: Path) -> None:
    """And the recording names the damage."""
    (file,) = bag(tmp_path / 'bag').glob('*.db3')
    whole = file.read_bytes()
    half = len(whole) // 2
    file.write_bytes(whole[:half] + bytes([0xA5]) * (len(whole) - half))
    try:
        recording = read_recording(file.parent, scene())
    except InputError as error:
        assert 'cannot be read: ' in str(error) and '\n' not in str(error)
    else:
        assert recording.damage and len(recording.channels[0].t) < COUNT
