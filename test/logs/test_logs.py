"""alf_ros.logs against readers that are not ours, on whole, cut, changed and repacked logs."""

import hashlib
import json
import struct
import subprocess
import sys
from itertools import product
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, Vector3, Wrench
from mcap.writer import CompressionType, Writer
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState, MultiDOFJointState
from std_msgs.msg import Empty, Float64, Header, String

from alf_ros import Simulation, load_scene
from alf_ros.errors import InputError
from alf_ros.logs import journal, load, mcap_chunks, tables
from alf_ros.logs.cdr import Decoder
from alf_ros.ros.recording import rosbag2_metadata
from support.log_files import make, read_by_others, rewritten
from support.paths import ROOT
from support.thorough import combined, thinned

TICKS = 400
EFFECT = """
from dataclasses import dataclass, field
import numpy as np
from numba import carray
from alf_ros.effects.contract import Packed, force

MULTIPLE = False

@dataclass(frozen=True)
class Parameters:
    strength: float = field(metadata={'kind': 'number', 'unit': 'N', 'doc': 'upwards, on block 0'})

def pack(effects, layout):
    return Packed(np.zeros(0, np.int64), np.array([effects[0].parameters.strength]))

@force
def force(t, q, qd, near, slots, params, Q):
    Q[1] += params[0]
"""


@pytest.fixture(scope='module')
def made(tmp_path_factory):
    return make(tmp_path_factory.mktemp('logs'), 'slider_crank')


@pytest.fixture(scope='module')
def path(made):
    return made[0]


def check_series(log, others):
    """Every topic of numbers holds what another reader finds, as far as `log` goes."""
    for topic, count in log.survey.counts.items():
        series = log.read(topic)
        same = [others[topic][number - 1] for number in series.sequence.tolist()]
        assert len(series) == count and series.stamp.tolist() == [stamp for stamp, _ in same]
        messages = [message for _, message in same]
        for key, column in series.columns.items():
            if key == 'wrench':
                wanted: list[Any] = [
                    [[getattr(getattr(w, v), a) for v in ('force', 'torque') for a in 'xyz']
                     for w in message.wrench]
                    for message in messages
                ]  # fmt: skip
            else:
                wanted = [np.atleast_1d(getattr(message, key)) for message in messages]
            assert np.array_equal(column, np.array(wanted)), (topic, key)
        if series.names:
            names = getattr(messages[0], 'name', None) or messages[0].joint_names
            assert list(series.names) == list(names)
        if not series.columns:
            assert [m['data'] for m in series.messages] == [m.data for m in messages]


def test_columns_are_what_another_reader_finds(path):
    log = load(path)
    others = read_by_others(path)
    assert log.survey.counts == {topic: len(found) for topic, found in others.items()}
    assert log.damage == '' and log.survey.lost == {}
    assert len(log.read('joint_states')) == TICKS + 1
    check_series(log, others)


def test_all_names_of_a_topic_mean_the_same(path):
    log = load(path.parent)
    full = log.read('/simulator/reactions').columns['wrench']
    for name in ('reactions', '~/reactions'):
        assert np.array_equal(log.read(name).columns['wrench'], full)
    with pytest.raises(InputError, match='not in this log.*did you mean'):
        log.read('/simulator/reaction')


def test_states_are_those_of_the_simulation_bit_for_bit(made):
    log, simulation = load(made[0]), Simulation(load_scene('slider_crank'))
    states = log.states
    assert states.names == ('A.x', 'A.y', 'B.x', 'B.y')
    assert list(states.step) == list(range(0, 2 * TICKS + 1, 2))
    assert states.t == pytest.approx(states.step * 1e-3, abs=1e-12)
    for k in range(100):
        simulation.step(int(states.step[k]) - simulation.step_index)
        sample = simulation.sample()
        assert (states.q[k].tolist(), states.qd[k].tolist()) == (
            sample.q.tolist(),
            sample.qd.tolist(),
        )
    assert states.q[-1].tolist() == made[1].sample().q.tolist()


def test_a_log_says_what_was_run(path):
    log, scene = load(path), load_scene('slider_crank')
    assert (log.scene_text, log.info['scene_sha256']) == (scene.text, scene.hash)
    assert log.scene() == scene
    wanted = {'alf_ros', 'python', 'numpy', 'numba', 'llvmlite', 'llvm', 'llvm_cpu', 'cpu'}
    assert wanted <= log.versions.keys() and 'unknown' not in log.versions.values()
    start, push = log.inputs
    assert (start['kind'], start['versions']) == ('start', log.versions)
    assert (push['kind'], push['step'], push['force']) == ('wrench', 198, [1.0 / 3.0, 0.0])


def test_pieces_are_the_whole_in_the_order_written(tmp_path):
    path, _ = make(tmp_path, 'slider_crank', 3000)
    log = load(path)
    reports: list[Any] = []
    pieces = list(log.pieces(['joint_states', '~/energy'], reports.append))
    assert len(pieces) > 1 and reports == sorted(reports) and 0.0 < reports[0] < reports[-1] <= 1.0
    for piece in pieces:
        assert {series.topic for series in piece} <= {'/joint_states', '/simulator/energy'}
    for topic in ('/joint_states', '/simulator/energy'):
        stamps = [t for piece in pieces for s in piece if s.topic == topic for t in s.stamp]
        assert stamps == log.read(topic).stamp.tolist()


@pytest.mark.parametrize(
    ('compression', 'chunking', 'behind'),
    combined(
        thinned(  # only chunks are compressed
            product(['NONE', 'LZ4', 'ZSTD'], [True, False]),
            keep=lambda compression, chunking: chunking or compression == 'NONE',
        ),
        [False, True],
    ),
)
def test_every_packing_reads_the_same(path, tmp_path, compression, chunking, behind):
    other = rewritten(path, tmp_path, CompressionType[compression], chunking, behind=behind)
    check_series(load(other), read_by_others(path))
    assert load(other).info == load(path).info


def test_a_log_cut_anywhere_gives_its_whole_chunks(path, tmp_path):
    whole = rewritten(path, tmp_path).read_bytes()
    others, cut = read_by_others(path), tmp_path / 'cut_0.mcap'
    first = load(path).survey.counts
    last: dict[str, Any] = {}
    for size in np.linspace(12_000, len(whole) - 1, 25).astype(int).tolist():
        cut.write_bytes(whole[:size])
        log = load(cut)
        counts = log.survey.counts
        assert all(counts[topic] >= count for topic, count in last.items())
        last = counts
        check_series(log, others)
        assert 'cut off at byte' in log.damage
    assert last == first


def test_one_changed_bit_anywhere_is_no_wrong_number(path, tmp_path):
    whole = bytearray(rewritten(path, tmp_path).read_bytes())
    others, changed = read_by_others(path), tmp_path / 'changed_0.mcap'
    random = np.random.default_rng(5)
    for at in random.integers(12_000, len(whole), 40).tolist():
        whole[at] ^= 1 << int(random.integers(8))
        changed.write_bytes(whole)
        log = load(changed)
        check_series(log, others)
        whole[at] = bytearray((tmp_path / 'rewritten_0.mcap').read_bytes())[at]


def test_missing_messages_are_counted(path, tmp_path):
    seen = []

    def change(topic, data):
        seen.append(topic)
        return None if topic == '/joint_states' and 10 < seen.count(topic) < 15 else data

    assert load(rewritten(path, tmp_path, change=change)).survey.lost == {'/joint_states': 4}


def test_seals_find_a_changed_entry_and_a_missing_one():
    entries, seal = [], ''
    for k in range(4):
        text, seal = journal.chained({'step': k, 'force': [1.0 / (k + 3.0), -0.0, 1e-300]}, seal)
        entries.append(json.loads(text))

    def faults(entries):
        seals = ['', *(entry['seal'] for entry in entries)]
        return [bool(journal.fault(e, s)) for e, s in zip(entries, seals, strict=False)]

    assert faults(entries) == [False] * 4
    changed = [dict(entry) for entry in entries]
    changed[2]['force'] = [float(np.nextafter(changed[2]['force'][0], 1.0)), -0.0, 1e-300]
    assert faults(changed) == [False, False, True, False]
    assert faults([entries[0], *entries[2:]]) == [False, True, False]
    for k in range(4):  # also the last one, which no later entry seals
        del changed[k]['seal']
        seal = entries[k - 1]['seal'] if k else ''
        assert journal.fault(changed[k], seal)


HEADER = Header(stamp=Time(sec=3, nanosec=5), frame_id='wörld')
MESSAGES = [
    Float64(data=1.0 / 3.0),
    String(data='ünïcode\n'),
    Empty(),
    Twist(linear=Vector3(x=1.5, z=-2.0)),
    JointState(header=HEADER, name=['a', 'bcd'], position=[1.0, 2.0], effort=[0.1]),
    MultiDOFJointState(header=HEADER, joint_names=['abc'], wrench=[Wrench(), Wrench()]),
    Imu(header=HEADER, orientation_covariance=np.arange(9.0)),
    DiagnosticArray(
        header=HEADER,
        status=[
            DiagnosticStatus(level=b'\2', name='n', values=[KeyValue(key='k', value='v')] * n)
            for n in range(3)
        ],
    ),
]


@pytest.mark.parametrize('message', MESSAGES, ids=lambda m: type(m).__name__)
def test_cdr_is_read_as_ros_wrote_it(message):
    name = rosbag2_metadata.type_name(type(message))
    data = serialize_message(message)
    read = Decoder(name, rosbag2_metadata.definition(name)).read(data)
    assert same(message, read), read
    for size in (0, 3, len(data) // 2):
        if size < len(data) - 4:
            with pytest.raises(InputError):
                Decoder(name, rosbag2_metadata.definition(name)).read(data[:size])


def same(message, read):
    if isinstance(read, dict):
        fields = set(message.get_fields_and_field_types())
        return set(read) == fields - {'structure_needs_at_least_one_member'} and all(
            same(getattr(message, key), value) for key, value in read.items()
        )
    if isinstance(read, list):
        return len(message) == len(read) and all(map(same, message, read))
    return message == (bytes([read]) if isinstance(message, bytes) else read)


def test_an_effect_from_a_file_is_in_the_log_and_runs_only_if_trusted(tmp_path):
    file = tmp_path / 'lift.py'
    file.write_text(EFFECT)
    effects = {str(file): {'strength': 2.5}}
    scene = {'mechanism': 'slider_crank', 'effects': effects, 'solver': {'step': 1e-3}}
    path, _ = make(tmp_path, scene, 20)
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    file.unlink()
    program = f"""
        import sys
        from alf_ros import Simulation
        from alf_ros.logs import load
        log = load({str(path)!r})
        try:
            log.scene()
        except Exception as error:
            print(type(error).__name__, error)
        simulation = Simulation(log.scene(trust=True))
        simulation.step(20)
        print(simulation.sample().q.tolist())
    """
    done = subprocess.run(
        [sys.executable, '-c', '\n'.join(line[8:] for line in program.splitlines())],
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr
    refused, positions = done.stdout.splitlines()
    assert refused.startswith('InputError') and 'trust' in refused and 'lift.py' in refused
    alone = Simulation(load_scene('slider_crank'))
    alone.step(20)
    assert json.loads(positions) == load(path).states.q[10].tolist() != alone.sample().q.tolist()
    assert load(path).inputs[0]['files'] == {f'{file}#sha256={digest}': EFFECT}


@pytest.mark.parametrize(
    'content', [b'', b'text', b'\x89MCAP0\r\n'], ids=['empty', 'text', 'bare']
)
def test_what_is_no_log_is_refused_in_one_line(tmp_path, content):
    (tmp_path / 'a.mcap').write_bytes(content)
    with pytest.raises(InputError, match=r'a\.mcap.*not a') as error:
        load(tmp_path / 'a.mcap')
    assert '\n' not in str(error.value)


def test_what_is_not_there_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / 'nowhere'):
        with pytest.raises(InputError, match=r'no such log|no \.mcap file'):
            load(path)


@pytest.mark.parametrize(
    ('name', 'words'),
    [
        ('a.mcap.zstd', r'in compressed files; expected files that `zstd -d` made \.mcap again'),
        ('a.db3', 'in SQLite; expected MCAP: `ros2 bag convert` makes it'),
        ('a.db3.zstd', 'in SQLite'),
    ],
)
def test_other_formats_of_rosbag2_are_refused_with_the_way_out(tmp_path, name, words):
    (tmp_path / name).write_bytes(b'packed')
    for path in (tmp_path, tmp_path / name):
        with pytest.raises(InputError, match=words):
            load(path)


def test_another_bag_is_refused(tmp_path):
    with open(tmp_path / 'other.mcap', 'wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        writer.finish()
    with pytest.raises(InputError, match='not a log of this simulator'):
        load(tmp_path / 'other.mcap')


def test_csv_reads_back_bit_for_bit(path, tmp_path):
    log = load(path)
    written = tables.to_csv(log, tmp_path / 'csv')
    assert {file.name for file in written} == {
        'inputs.jsonl',
        'joint_states.csv',
        'simulator_reactions.csv',
        'simulator_constraints.csv',
        'simulator_state.csv',
        'simulator_energy.csv',
    }
    lines = (tmp_path / 'csv/simulator_reactions.csv').read_text().splitlines()
    assert lines[0].split(',')[:4] == [
        'stamp',
        't',
        'wrench.crank_pin.force.x',
        'wrench.crank_pin.force.y',
    ]
    numbers = np.array([[float(cell) for cell in line.split(',')[2:]] for line in lines[1:]])
    wrench = log.read('reactions').columns['wrench']
    assert numbers.tobytes() == wrench.reshape(len(wrench), -1).tobytes()
    entries = (tmp_path / 'csv/inputs.jsonl').read_text().splitlines()
    assert [json.loads(line) for line in entries] == log.inputs
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError, match='cannot be written'):
        tables.to_csv(log, tmp_path / 'file')


def test_topics_that_differ_in_a_slash_have_two_tables(path, tmp_path):
    """Also beside a topic of the same letters."""
    topics = {'/simulator/energy': '/simulator/b_c', '/joint_states': '/simulator_b/c'}
    log = load(rewritten(path, tmp_path, rename=topics.get))
    written = tables.to_csv(log, tmp_path / 'csv')
    heads = {file.name: file.read_text().partition('\n')[0] for file in written}
    assert len(heads) == len(written)
    assert heads['simulator__b_c.csv'].strip() == 'stamp,t,data'
    assert heads['simulator_b__c.csv'].startswith('stamp,t,position.crank_pin,')


def test_frames_and_parquet_hold_the_same_numbers(path, tmp_path):
    pandas = pytest.importorskip('pandas')
    pytest.importorskip('pyarrow')
    log = load(path)
    frame = tables.frame(log, 'joint_states')
    assert frame.index.name == 't' and list(frame.columns[:2]) == ['stamp', 'position.crank_pin']
    knee = log.read('joint_states').columns['position'][:, 1]
    assert np.array_equal(frame['position.knee'], knee)
    written = tables.to_parquet(log, tmp_path / 'parquet')
    (file,) = (file for file in written if file.name == 'joint_states.parquet')
    assert np.array_equal(pandas.read_parquet(file)['position.knee'], knee)


WITHOUT = """
import sys

class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in ('rclpy', 'mcap', 'std_msgs', 'pandas', 'pyarrow'):
            raise ImportError('blocked: ' + name, name=name)

sys.meta_path.insert(0, Block())
from alf_ros.logs import load, tables
log = load(sys.argv[1])
assert len(log.states.t) == 401 and len(log.inputs) == 2
from alf_ros.logs.comparison import compare
assert compare(log).equal
for wanted in (lambda: tables.frame(log, 'energy'), lambda: tables.to_parquet(log, None)):
    try:
        wanted()
    except Exception as error:
        print(error)
"""


def test_a_log_needs_neither_ros_nor_mcap_to_be_read(path):
    done = subprocess.run(
        [sys.executable, '-c', WITHOUT, str(path)], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    assert 'pip install pandas' in done.stdout and 'pip install pyarrow' in done.stdout


def test_a_length_that_cannot_be_ends_the_reading(path, tmp_path):
    whole = rewritten(path, tmp_path)
    first = next(mcap_chunks.blocks(whole, mcap_chunks.Contents()))
    (tmp_path / 'a_0.mcap').write_bytes(
        whole.read_bytes()[: first.read] + struct.pack('<BQ', 6, 1 << 60) + bytes(100)
    )
    log = load(tmp_path / 'a_0.mcap')
    assert f'broken at byte {first.read}' in log.damage
    assert sum(log.survey.counts.values()) == first.channel.size
