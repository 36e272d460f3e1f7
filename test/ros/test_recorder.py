"""The log is what others read: three independent readers, and a disk that does not play."""

import json
import os
import random
import subprocess
import sys
import textwrap
import time
import tracemalloc
from pathlib import Path
from typing import Any

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Wrench
from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64, String

from alf_ros.errors import InputError
from alf_ros.logs.mcap_chunks import Contents, blocks
from alf_ros.ros.messages.topics import BEST_EFFORT, LATCHED, RELIABLE
from alf_ros.ros.recording import rosbag2_metadata
from alf_ros.ros.recording.mcap_file import LogFile
from alf_ros.ros.recording.recorder import Recorder
from support.foxglove_readers import JAVASCRIPT, NODE, PACKAGES
from support.paths import ROOT

TEXT = 'mechanism: slider_crank\n# "quotes", ünïcode: {a: [1, 2]}\n'
COUNT = 500


def joint_state(k):
    message = JointState(name=['crank_pin', 'guide'])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(k * 1_000_000, 10**9)
    message.position, message.velocity, message.effort = [0.1 * k, -k], [1.0 / k, 2.0], [0.0, 3.0]
    return message


def reaction(k):
    message = MultiDOFJointState(joint_names=['a', 'bc'], wrench=[Wrench(), Wrench()])
    message.header.frame_id = 'world'
    message.wrench[1].force.y = -0.5 * k
    return message


def diagnostic(k):
    values = [KeyValue(key='step', value=str(k)), KeyValue(key='x' * (k % 7), value='')]
    return DiagnosticArray(status=[DiagnosticStatus(level=b'\1', name='s: t', values=values)])


MADE = {
    '/joint_states': (JointState, RELIABLE, joint_state),
    '/simulator/reactions': (MultiDOFJointState, RELIABLE, reaction),
    '/simulator/energy': (Float64, RELIABLE, lambda k: Float64(data=k / 3.0)),
    '/simulator/scene': (String, LATCHED, lambda k: String(data=TEXT + 'x' * (k % 5))),
    '/clock': (Clock, BEST_EFFORT, lambda k: Clock()),
    '/diagnostics': (DiagnosticArray, RELIABLE, diagnostic),
}


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    recorder = Recorder(tmp_path_factory.mktemp('logs'), 'scene', {'scene_text': TEXT})
    for k in range(1, COUNT + 1):
        for topic, (kind, qos, make) in MADE.items():
            recorder.write(topic, kind, qos, k * 1_000_000, serialize_message(make(k)))
    recorder.close()
    assert (recorder.written, recorder.dropped, recorder.error) == (COUNT * len(MADE), 0, '')
    return recorder.path


def equal(message, read):
    """Whether a message and what a reader made of it say the same, field by field."""
    if hasattr(message, 'get_fields_and_field_types'):
        fields = message.get_fields_and_field_types()
        return all(equal(getattr(message, name), getattr(read, name)) for name in fields)
    if isinstance(message, (str, bool, float, int)):
        return message == read
    if isinstance(message, bytes):
        return message == bytes([read]) if isinstance(read, int) else message == bytes(read)
    return len(message) == len(read) and all(map(equal, message, read))


def check_all(found):
    """`found`: (topic, log time, message) of everything a reader found."""
    seen = dict.fromkeys(MADE, 0)
    for topic, log_time, read in found:
        seen[topic] += 1
        assert log_time == seen[topic] * 1_000_000
        assert equal(MADE[topic][2](seen[topic]), read), (topic, read)
    assert seen == dict.fromkeys(MADE, COUNT)


def test_mcap_ros2_support_reads_every_message(log):
    check_all((m.channel.topic, m.log_time_ns, m.ros_msg) for m in read_ros2_messages(str(log)))


@pytest.mark.parametrize('what', ['folder', 'file'])
def test_rosbags_reads_every_message(log, what):
    with AnyReader([log.parent if what == 'folder' else log]) as reader:
        check_all(
            (connection.topic, t, reader.deserialize(data, connection.msgtype))
            for connection, t, data in reader.messages()
        )


@pytest.mark.skipif(not NODE, reason='no node and npm')
def test_the_readers_of_foxglove_read_every_message(log, tmp_path):
    install = ['npm', 'install', '--silent', '--no-audit', '--no-fund', *PACKAGES]
    subprocess.run(install, cwd=tmp_path, check=True, timeout=120)
    (tmp_path / 'read.js').write_text(JAVASCRIPT)
    node = ['node', 'read.js', str(log)]
    done = subprocess.run(
        node, cwd=tmp_path, check=True, capture_output=True, text=True, timeout=60
    )
    found: dict[str, list[Any]] = {topic: [] for topic in MADE}
    for line in done.stdout.splitlines():
        topic, log_time, value = json.loads(line)
        found[topic].append((log_time, value))
    expected = {
        '/joint_states': lambda m: list(m.position),
        '/simulator/energy': lambda m: m.data,
        '/simulator/reactions': lambda m: m.wrench[1].force.y,
        '/simulator/scene': lambda m: m.data,
        '/diagnostics': lambda m: m.status[0].values[0].value,
        '/clock': lambda m: m.clock.sec,
    }
    for topic, value in expected.items():
        make = MADE[topic][2]
        stamps = range(1, COUNT + 1)
        assert found[topic] == [(k * 1_000_000, value(make(k))) for k in stamps], topic


def test_the_file_is_indexed_and_says_what_rosbag2_looks_for(log):
    with open(log, 'rb') as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert reader.get_header().profile == 'ros2'
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    assert summary.statistics.message_count == COUNT * len(MADE)
    assert all(index.message_index_offsets for index in summary.chunk_indexes)
    assert {index.compression for index in summary.chunk_indexes} == {'zstd'}
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding) == ('cdr', 'ros2msg')
        assert channel.metadata['topic_type_hash'].startswith('RIHS01_')
        (profile,) = yaml.safe_load(channel.metadata['offered_qos_profiles'])
        latched, lossy = channel.topic == '/simulator/scene', channel.topic == '/clock'
        assert profile['durability'] == (1 if latched else 2)
        assert profile['reliability'] == (2 if lossy else 1)
    assert metadata['alf_ros'] == {'scene_text': TEXT}
    document = yaml.safe_load((log.parent / 'metadata.yaml').read_text('utf-8'))
    bagfile = document['rosbag2_bagfile_information']
    assert yaml.safe_load(metadata['rosbag2']['serialized_metadata']) == bagfile
    assert bagfile['storage_identifier'] == 'mcap' and 5 <= bagfile['version'] <= 9
    assert bagfile['relative_file_paths'] == [log.name]
    assert bagfile['message_count'] == COUNT * len(MADE)
    assert bagfile['starting_time']['nanoseconds_since_epoch'] == 1_000_000
    assert bagfile['duration']['nanoseconds'] == (COUNT - 1) * 1_000_000
    assert bagfile['custom_data'] == {'scene_text': TEXT}
    counts = {
        entry['topic_metadata']['name']: entry['message_count']
        for entry in bagfile['topics_with_message_count']
    }
    assert counts == dict.fromkeys(MADE, COUNT)


def test_a_definition_holds_every_type_once():
    text = rosbag2_metadata.definition('sensor_msgs/msg/MultiDOFJointState')
    held = [line for line in text.splitlines() if line.startswith('MSG: ')]
    assert len(held) == len(set(held))
    assert {'MSG: geometry_msgs/Quaternion', 'MSG: builtin_interfaces/Time'} <= set(held)
    assert text.startswith(
        (rosbag2_metadata._file('sensor_msgs/msg/MultiDOFJointState', '.msg')).read_text()[:40]
    )


def test_what_does_not_fit_the_queue_is_dropped_and_counted(tmp_path):
    data = serialize_message(String(data='x' * 1000))
    recorder = Recorder(tmp_path, 'scene', {}, queue_size=50_000)
    for k in range(1, 20_001):
        recorder.write('/text', String, RELIABLE, k, data)
    while recorder.waiting:
        time.sleep(0.01)
    recorder.write('/text', String, RELIABLE, 20_001, data)
    recorder.close()
    assert recorder.dropped > 0 and recorder.written > 0
    assert recorder.written + recorder.dropped == 20_001
    assert len(list(read_ros2_messages(str(recorder.path)))) == recorder.written
    # said in the log as well: by a record, and by gaps in the numbers
    with open(recorder.path, 'rb') as stream:
        told = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
        stream.seek(0)
        numbers = [message.sequence for *_, message in make_reader(stream).iter_messages()]
    assert told['alf_ros_dropped'] == {'messages': str(recorder.dropped)}
    assert numbers == sorted(set(numbers))
    assert (numbers[-1], numbers[-1] - len(numbers)) == (20_001, recorder.dropped)


def test_what_a_run_needs_has_room_when_the_rest_has_none(tmp_path):
    data = serialize_message(String(data='x' * 1000))
    recorder = Recorder(tmp_path, 'scene', {}, queue_size=50_000)
    for k in range(1, 2001):
        recorder.write('/text', String, RELIABLE, k, data)
        if k % 50 == 0:
            recorder.write('/journal', String, RELIABLE, k, data, essential=True)
    recorder.close()
    topics = [message.channel.topic for message in read_ros2_messages(str(recorder.path))]
    assert recorder.dropped > 0 and topics.count('/journal') == 40


def test_writing_never_waits_for_the_disk(tmp_path):
    """A pipe that nobody reads stands for a disk that hangs."""
    recorder = Recorder(tmp_path, 'scene', {}, queue_size=50_000)
    reading, writing = os.pipe()
    stream = recorder._file._stream
    os.dup2(writing, stream._file)
    os.close(writing)
    stream.path = Path(f'/proc/self/fd/{stream._file}')
    data = serialize_message(String(data=random.Random(1).randbytes(500).hex()))
    for k in range(1, 20_001):
        recorder.write('/text', String, RELIABLE, k, data)
        if k % 200 == 0:
            time.sleep(0.005)
    assert recorder.dropped > 10_000 and not recorder.error
    os.close(reading)  # the disk breaks: that is an error, and the end
    recorder.close()
    assert 'Broken pipe' in recorder.error


def test_a_log_that_cannot_be_made_is_one_clear_error(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError, match=r'record\.folder.*cannot write') as error:
        Recorder(tmp_path / 'file', 'scene', {})
    assert error.value.exit_code == 2 and '\n' not in str(error.value)


def test_logs_of_one_second_do_not_meet(tmp_path):
    recorders = [Recorder(tmp_path, 'scene', {}) for _ in range(3)]
    for recorder in recorders:
        recorder.close()
    assert len({recorder.path for recorder in recorders}) == 3
    assert all((recorder.folder / 'metadata.yaml').is_file() for recorder in recorders)


def test_a_disk_that_fills_up_stops_the_log_and_nothing_else(tmp_path):
    program = f"""
        import resource, sys, time
        from pathlib import Path
        from rclpy.serialization import serialize_message
        from std_msgs.msg import String
        from alf_ros.ros.messages.topics import RELIABLE
        from alf_ros.ros.recording.recorder import Recorder
        import random
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
        recorder = Recorder(Path({str(tmp_path)!r}), 'scene', {{}})
        end, sent = time.monotonic() + 10.0, 0
        while not recorder.error and time.monotonic() < end:
            data = serialize_message(String(data=random.randbytes(5000).hex()))
            sent += 1
            recorder.write('/text', String, RELIABLE, sent, data)
            time.sleep(0.001)
        recorder.write('/text', String, RELIABLE, sent + 1, data)
        recorder.close()
        print(recorder.error)
        print(recorder.path)
        print(recorder.written, recorder.dropped, sent + 1)
    """
    done = subprocess.run(
        [sys.executable, '-c', textwrap.dedent(program)],
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    error, path, counts = done.stdout.splitlines()
    written, dropped, given = map(int, counts.split())
    assert 'File too large' in error and dropped > 0 and written + dropped == given
    assert sum(block.stamp.size for block in blocks(Path(path), Contents())) == written


def test_the_index_of_a_long_log_needs_little_memory(tmp_path):
    file = LogFile(tmp_path / 'log.mcap', {})
    data = serialize_message(String(data='x'))

    def chunks(count):
        for _ in range(count):
            for topic in range(6):
                file.add(f'/{topic}', String, RELIABLE, file.count + 1, data, 1)
            file.flush()

    chunks(50)
    tracemalloc.start()
    try:
        chunks(50)  # what is kept of a call, such as its arguments
        before, _ = tracemalloc.get_traced_memory()
        chunks(500)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (after - before) / 500 < 300  # bytes of a chunk; the record has 140
    file.finish()
    with open(file.path, 'rb') as stream:
        reader = make_reader(stream)
        assert len(reader.get_summary().chunk_indexes) == 600
        assert len(list(reader.iter_messages(topics=['/3'], starting_at=1800))) == 300


LOGS = """
import random, shutil, sys
from pathlib import Path
from std_msgs.msg import String
from alf_ros.ros.messages.topics import RELIABLE
from alf_ros.ros.recording.recorder import Recorder

def anonymous():
    lines = Path('/proc/self/status').read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith('RssAnon'))

chance, folder = random.Random(1), Path(sys.argv[1])
data = chance.randbytes(1 << 20)
for log in range(31):
    recorder, size = Recorder(folder, 'scene', {}, name=f'{log}'), chance.choice((100, 30_000))
    for stamp in range(chance.randrange(1, 60)):
        at = chance.randrange(1 << 19)
        for topic in 'abc':
            recorder.write(topic, String, RELIABLE, stamp, data[at : at + size])
    recorder.close()
    shutil.rmtree(recorder.folder)
    if log in (0, 30):
        print(anonymous())
"""


@pytest.mark.skipif(not Path('/proc/self/status').is_file(), reason='memory is read from /proc')
def test_log_after_log_takes_no_more_memory(tmp_path):
    """Memory of one chunk in use, a compressor and its buffers, whatever the sizes of chunks: with
    fresh memory for each log it was 16 MB."""
    command = [sys.executable, '-c', LOGS, str(tmp_path)]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    first, last = map(int, said.split())
    assert last - first < 10 << 10, said  # kB
