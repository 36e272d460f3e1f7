"""`verify` finds changes of bytes that leave all numbers as they were."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from support.log_files import make
from support.paths import ROOT

sys.path.insert(0, str(ROOT / 'fuzz'))

from mcap_records import CHANNEL, MESSAGE, Record, behind, read_text, records, together

STATISTICS = 0x0B
STAMPS = 22  # bytes of a message before its data

# Changes the messages of one topic, which are in the order of the log.
Change = Callable[[list[Record]], None]


@pytest.fixture(scope='module')
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path, _ = make(tmp_path_factory.mktemp('whole'), 'slider_crank', ticks=8, push_at=4)
    return path.read_bytes()


def faults(path: Path, data: bytes) -> list[str]:
    path.write_bytes(data)
    return compare(load(path)).faults


def changed(whole: bytes, topic: str, change: Change) -> bytes:
    """The log with other messages of a topic, and with the index that it had."""
    parts = records(whole)
    every = [record for part in parts for record in (part.inner or [part])]
    ids = {
        read_text(record.content, 4)[0].decode(): record.content[:2]
        for record in every
        if record.code == CHANNEL
    }
    found = [
        record for record in every if record.code == MESSAGE and record.content[:2] == ids[topic]
    ]
    change(found)
    for part in parts:
        if part.inner is not None:
            part.inner = [record for record in part.inner if record not in found or record.content]
    return together(parts, behind(whole))


def put(record: Record, at: int, data: bytes, instead_of: int = 0) -> None:
    """Bytes put into a message, in place of so many."""
    at += STAMPS
    record.content = record.content[:at] + data + record.content[at + instead_of :]


def without_last(messages: list[Record]) -> None:
    messages[-1].content = b''


def another_option(messages: list[Record]) -> None:
    put(messages[3], 2, b'\x80', 1)


def bytes_behind(messages: list[Record]) -> None:
    put(messages[3], len(messages[3].content) - STAMPS, bytes(8))


def test_the_log_itself_has_no_fault(whole: bytes, tmp_path: Path) -> None:
    same = changed(whole, '/joint_states', lambda _: None)
    assert faults(tmp_path / 'same.mcap', same) == []


@pytest.mark.parametrize('topic', ['/joint_states', '/simulator/state', '/simulator/inputs'])
def test_the_last_message_of_a_topic_is_missed(whole: bytes, tmp_path: Path, topic: str) -> None:
    found = faults(tmp_path / 'short.mcap', changed(whole, topic, without_last))
    assert any(fault.startswith(f'{topic}: ') and 'its index states' in fault for fault in found)


@pytest.mark.parametrize('change', [another_option, bytes_behind])
@pytest.mark.parametrize('topic', ['/joint_states', '/simulator/energy'])
def test_another_form_of_a_message_is_found(
    whole: bytes, tmp_path: Path, topic: str, change: Change
) -> None:
    found = faults(tmp_path / 'form.mcap', changed(whole, topic, change))
    assert any('not written as the messages before' in fault for fault in found), found


def test_another_form_of_an_input_is_found(whole: bytes, tmp_path: Path) -> None:
    def change(messages: list[Record]) -> None:
        put(messages[-1], 2, b'\x80', 1)

    found = faults(tmp_path / 'form.mcap', changed(whole, '/simulator/inputs', change))
    assert found and all('is not written as a text is' in fault for fault in found)


def test_an_input_without_a_seal_is_found(whole: bytes, tmp_path: Path) -> None:
    def change(messages: list[Record]) -> None:
        content = messages[-1].content
        messages[-1].content = content.replace(b'"seal"', b'"leas"')

    (found,) = faults(tmp_path / 'seal.mcap', changed(whole, '/simulator/inputs', change))
    assert 'changed after it was written' in found


def test_a_closed_log_states_its_counts(whole: bytes, tmp_path: Path) -> None:
    end, at = behind(whole), 0
    while end[at] != STATISTICS:
        at += 9 + struct.unpack_from('<Q', end, at + 1)[0]
    size = 9 + struct.unpack_from('<Q', end, at + 1)[0]
    (found,) = faults(
        tmp_path / 'none.mcap', together(records(whole), end[:at] + end[at + size :])
    )
    assert found == 'its index does not state how many messages it has'
