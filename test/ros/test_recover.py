"""Killed at any instant, cut anywhere: at most a second is missing, and nothing is wrong.

Four kills; two hundred, and a longer log, with make thorough
ARGS=test/ros/test_recover.py.
"""

import os
import random
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest
import yaml
from geometry_msgs.msg import WrenchStamped
from mcap.reader import make_reader
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock

from alf_ros.__main__ import main
from alf_ros.logs import load, mcap_chunks
from alf_ros.logs.comparison import compare
from alf_ros.logs.report.summary import account
from alf_ros.ros.recording.recorder import Split
from alf_ros.ros.recording.recover import recover
from support.full_disk import small_files
from support.log_files import make, read_by_others, rewritten
from support.ros_node import Peer, SimulatorProcess, wrench
from support.thorough import LONG

KILLS = 200 if LONG else 2
TICKS = 2000 if LONG else 800  # of a log that is cut
LONGEST = 3.0  # s of a run that is killed
MOST_LOST = 1.0  # s


@pytest.fixture(scope='module')
def peer():
    peer = Peer()
    yield peer
    peer.close()


def check_with_public_readers(folder):
    """Everything that we find in a folder, rosbags and mcap-ros2-support find too."""
    log = load(folder)
    with AnyReader([folder]) as reader:
        found: list[tuple[str, int, Any]] = [
            (connection.topic, stamp, reader.deserialize(data, connection.msgtype))
            for connection, stamp, data in reader.messages()
        ]
    counts: dict[str, int] = {}
    positions = []
    for topic, stamp, message in found:
        counts[topic] = counts.get(topic, 0) + 1
        if topic == '/joint_states':
            positions.append((stamp, message.position.tolist()))
    assert counts == log.survey.counts
    series = log.read('joint_states')
    ours = zip(series.stamp.tolist(), series.columns['position'].tolist(), strict=True)
    assert positions == list(ours)
    for path in log.files:
        with open(path, 'rb') as stream:
            summary = make_reader(stream).get_summary()
        others = read_by_others(path)
        assert summary.statistics.message_count == sum(map(len, others.values()))
    told = yaml.safe_load((folder / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert told['message_count'] == sum(counts.values())
    assert told['relative_file_paths'] == [path.name for path in log.files]
    return log


@pytest.mark.parametrize('k', range(KILLS))
def test_a_kill_loses_less_than_a_second(peer, tmp_path, k):
    clock = peer.listen('/clock', Clock, QoSProfile(depth=1, reliability=BEST_EFFORT))
    seconds = random.Random(k).uniform(0.0, LONGEST)
    with SimulatorProcess(tmp_path).wait_running() as node:
        if k % 2:
            push = peer.talk('/simulator/wrench/coupler', WrenchStamped)
            push.publish(wrench(1.0 / (k + 3.0), 1.0))
        peer.until(lambda: clock, 'the clock')
        first = nanoseconds(clock[0])
        peer.until(lambda: nanoseconds(clock[-1]) - first >= seconds * 1e9, 'time to pass')
        os.killpg(node.process.pid, signal.SIGKILL)
        node.process.wait()
        heard = nanoseconds(clock[-1])
    folder = node.logs[0].parent
    assert not (folder / 'metadata.yaml').exists()
    assert main(['recover', str(folder), '-o', str(tmp_path / 'whole')]) == 0
    if not load(folder).survey.counts:  # killed before there was a chunk
        assert heard < MOST_LOST * 1e9
        return
    log = check_with_public_readers(tmp_path / 'whole')
    assert log.damage == '' and load(folder).survey.counts == log.survey.counts
    assert heard - log.survey.last < MOST_LOST * 1e9
    assert compare(log).equal
    shutil.rmtree(folder)


BEST_EFFORT = ReliabilityPolicy.BEST_EFFORT


def nanoseconds(clock):
    return clock.clock.sec * 10**9 + clock.clock.nanosec


def test_a_log_cut_anywhere_is_recovered(tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank', TICKS)
    whole = rewritten(path, tmp_path).read_bytes()
    cut = tmp_path / 'cut'
    cut.mkdir()
    for number, part in enumerate((0.4, 0.7, 0.95, 0.9999) if LONG else (0.7, 0.9999)):
        (cut / 'cut_0.mcap').write_bytes(whole[: int(part * len(whole))])
        folder = tmp_path / f'recovered_{number}'
        assert main(['recover', str(cut), '-o', str(folder)]) == 0
        said = capsys.readouterr().out
        log = check_with_public_readers(folder)
        count = sum(log.survey.counts.values())
        assert f'{count} messages, to t = {log.end:.9g} s' in said
        assert 'lost: ' in said and 'cut off at byte' in said
        assert compare(log).equal


def test_a_broken_chunk_loses_its_messages_only(tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank', 1000)
    spoilt = rewritten(path, tmp_path)
    data = bytearray(spoilt.read_bytes())
    middle = list(mcap_chunks.blocks(spoilt, mcap_chunks.Contents()))[5]
    for place in range(middle.read - 120, middle.read - 100):
        data[place] ^= 255  # one bit may stand for a copy of other bytes that are the same
    spoilt.write_bytes(data)
    assert main(['recover', str(spoilt)]) == 0
    assert 'broken chunk' in (said := capsys.readouterr().out) or 'wrong checksum' in said
    log = check_with_public_readers(tmp_path / 'rewritten_0_recovered')
    assert log.survey.last == load(path).survey.last
    assert 0 < log.survey.lost['/joint_states'] < 500


def test_a_whole_log_stays_what_it_is(tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank')
    assert main(['recover', str(path.parent)]) == 0
    assert 'nothing was lost' in capsys.readouterr().out
    folder = Path(f'{path.parent}_recovered')
    log = check_with_public_readers(folder)
    assert log.survey.counts == load(path).survey.counts and log.record == load(path).record
    assert main(['recover', str(path.parent)]) == 2
    assert 'exists already' in capsys.readouterr().err


@pytest.mark.parametrize('place', [1, -1])
def test_a_file_that_is_not_there_is_said(tmp_path, capsys, place):
    """Of a log of several files, also the last one: without it the log ends as a whole one."""
    path, _ = make(tmp_path, 'slider_crank', 400, split=Split(duration=0.2))
    files = sorted(path.parent.glob('*.mcap'))
    assert len(files) == 4
    files[place].unlink()
    log = load(path.parent)
    assert '1 of its 4 files are not there' in compare(log).faults
    assert '1 of its 4 files are not there' in account(log).faults
    assert main(['recover', str(path.parent)]) == 0
    said = capsys.readouterr().out
    assert 'lost: 1 of its 4 files are not there' in said and 'nothing was lost' not in said
    told = path.parent / 'metadata.yaml'
    document = yaml.safe_load(told.read_text())
    told.write_text(yaml.safe_dump(document, default_flow_style=True))  # as another tool may do
    assert load(path.parent).absent == '1 of its 4 files are not there'
    told.write_text(told.read_text()[:-40])
    assert 'its metadata.yaml does not tell its files: not YAML' in load(path.parent).absent
    missing = sum(log.survey.lost.values())
    assert (f'lost: {missing} messages before its end' in said) == (place == 1)


def test_where_nothing_can_be_written_is_one_line(tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank', 5)
    assert main(['recover', str(path), '-o', '/proc/nowhere']) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    (tmp_path / 'empty.mcap').write_bytes(b'')
    assert main(['recover', str(tmp_path / 'empty.mcap')]) == 2
    assert 'not a log of this simulator' in capsys.readouterr().err


def test_what_does_not_come_to_its_end_leaves_nothing(tmp_path, capsys):
    path, _ = make(tmp_path, 'slider_crank', 400)
    folder = tmp_path / 'whole'

    def stop(part):
        assert folder.is_dir()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        recover(load(path), folder, stop)
    assert not folder.exists()
    with small_files(path.stat().st_size // 2):
        assert main(['recover', str(path), '-o', str(folder)]) == 2
    assert 'cannot be written: File too large' in capsys.readouterr().err
    assert not folder.exists()
    assert main(['recover', str(path), '-o', str(folder)]) == 0
    assert compare(load(folder)).equal
