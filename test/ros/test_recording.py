"""The node while its disk fills up or goes away; logs in several files, and thinned out."""

import json
import resource
import shutil
import subprocess
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from mcap_ros2.reader import read_ros2_messages
from rcl_interfaces.msg import Log
from rosbags.highlevel import AnyReader
from std_srvs.srv import SetBool, Trigger

from alf_ros import load_scene
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.ros.recording.recorder import Split
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation import setup as settings
from support.foxglove_readers import JAVASCRIPT, NODE, PACKAGES
from support.log_files import make, push
from support.ros_node import Diagnostics, SimulatorProcess

SPACE = 400_000  # bytes


@pytest.fixture
def small_disk(tmp_path):
    """A small tmpfs where one may be mounted, or None."""
    folder = tmp_path / 'disk'
    folder.mkdir()
    mount = ['mount', '-t', 'tmpfs', '-o', f'size={SPACE}', 'alf_ros_test', str(folder)]
    if shutil.which('mount') is None or subprocess.run(mount, capture_output=True).returncode:
        yield None
        return
    yield folder
    subprocess.run(['umount', str(folder)], check=True)


def goes_on_without_a_log(peer, node, spoil, expected):
    """Spoil the log of a paused node and play: the node continues and reports the error once.

    The report is in the diagnostics and on /rosout.
    """
    said, found = peer.listen('/rosout', Log), Diagnostics(peer)
    peer.until(lambda: found.value('record', 'error') == '', 'health')
    spoil()
    assert peer.call(SetBool, '/simulator/pause', data=False).success
    peer.until(lambda: found.value('record', 'error'), 'the error')
    level, message, values = found.status('record')
    assert level == DiagnosticStatus.ERROR and expected in message == values['error']
    before = float(found.value('solver', 'simulated_time_s'))
    peer.until(
        lambda: float(found.value('solver', 'simulated_time_s')) > before + 2.0, 'time to go on'
    )
    assert found.status('record')[0] == DiagnosticStatus.ERROR
    told = [message.msg for message in said if 'recording has stopped' in message.msg]
    assert len(told) == 1 and expected in told[0]
    return int(values['written_messages'])


def test_a_full_disk_stops_the_log_and_not_the_simulation(peer, tmp_path, small_disk):
    folder = small_disk or tmp_path
    options = ['--log-folder', str(folder)]
    with SimulatorProcess(tmp_path, *options, start_paused='true').wait_running() as node:

        def fill():
            if small_disk is None:
                resource.prlimit(node.process.pid, resource.RLIMIT_FSIZE, (SPACE, SPACE))

        text = 'No space' if small_disk else 'File too large'
        written = goes_on_without_a_log(peer, node, fill, text)
        # room again: a reset begins another log
        (path,) = folder.glob('*/*.mcap')
        log = load(path)
        assert 'cut off at byte' in log.damage  # no index, and not half a chunk
        assert log.survey.lost == {} and log.end > 0.5 and compare(log).equal
        assert written == sum(log.survey.counts.values()) > 500
        if small_disk:
            shutil.rmtree(path.parent)
            assert peer.call(Trigger, '/simulator/reset').success
        assert node.stop() == 1, node.output
    assert f'log incomplete: {path}: {text}' in node.output
    if small_disk:
        (path,) = folder.glob('*/*.mcap')
        assert compare(load(path)).equal


def test_a_folder_that_is_gone_stops_the_log_and_not_the_simulation(peer, tmp_path):
    with SimulatorProcess(tmp_path, start_paused='true').wait_running() as node:
        (folder,) = (path.parent for path in node.logs)
        written = goes_on_without_a_log(peer, node, lambda: shutil.rmtree(folder), 'No such file')
        assert written == 0
        assert peer.call(Trigger, '/simulator/reset').success
        assert node.stop() == 1, node.output
    (path,) = node.logs
    log = load(path)
    assert path.parent != folder and log.damage == '' and compare(log).equal


def test_a_log_in_several_files_is_one_log(tmp_path):
    setup = settings.made(load_scene('slider_crank'), {})
    run = LogRun(tmp_path, setup, split=Split(duration=0.5))
    run.send()
    for tick in range(1, 1001):
        if tick % 300 == 0:
            push(run, 'coupler')
        setup.simulation.step(setup.steps)
        run.send()
    run.close()
    folder = run.recorder.folder
    log = load(folder)
    assert [file.name for file in log.files] == [f'{folder.name}_{k}.mcap' for k in range(4)]
    assert log.survey.lost == {} and len(log.states.t) == 1001 and len(log.inputs) == 4
    result = compare(log)
    assert result.equal and result.compared == 5 * 1001
    for k, file in enumerate(log.files):
        part = load(file)
        assert part.record == log.record and part.damage == ''
        stamps = part.read('~/state').stamp
        assert len(stamps) == 250 + (k == 0)
        assert stamps[0] >= k * 500_000_000 and stamps[-1] - stamps[0] <= 500_000_000
    with AnyReader([folder]) as reader:
        counts: dict[str, int] = {}
        for connection, _, _ in reader.messages():
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
    assert counts == log.survey.counts


def test_the_node_splits_and_thins_out(tmp_path):
    options = {
        'duration': 4.0,
        'real_time_factor': 2.0,
        'record.max_size': 30_000,
        'record.rate.joint_states': 50.0,
        'record.rate.reactions': 3.0,
    }
    with SimulatorProcess(tmp_path, **options) as node:
        assert node.wait() == 0, node.output
    folder = node.logs[0].parent
    log = load(folder)
    assert len(log.files) > 2 and log.damage == ''
    assert all(file.stat().st_size > 30_000 for file in log.files[:-1])
    assert len(log.read('~/state')) == len(log.read('~/energy')) == 2001
    assert log.read('joint_states').stamp.tolist() == [max(1, k * 20_000_000) for k in range(201)]
    assert len(log.read('reactions')) == 13
    assert log.survey.lost == {} and compare(log).equal


@pytest.mark.thorough
@pytest.mark.skipif(not NODE, reason='no node and npm')
def test_the_readers_of_foxglove_read_split_recovered_and_bare_logs(tmp_path):
    from alf_ros.ros.recording.recover import recover

    install = ['npm', 'install', '--silent', '--no-audit', '--no-fund', *PACKAGES]
    subprocess.run(install, cwd=tmp_path, check=True, timeout=120)
    (tmp_path / 'read.js').write_text(JAVASCRIPT)
    path, _ = make(tmp_path / 'whole', 'slider_crank', 300, split=Split(duration=0.3))
    files = load(path.parent).files
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(files[0].read_bytes()[:-3000])
    recover(load(cut), tmp_path / 'recovered')
    for file in (*files, tmp_path / 'recovered/recovered_0.mcap'):
        done = subprocess.run(
            ['node', 'read.js', str(file)],
            cwd=tmp_path,
            check=True,
            capture_output=True,
            text=True,
            timeout=60,
        )
        found = [json.loads(line) for line in done.stdout.splitlines()]
        others = [
            (message.channel.topic, message.log_time_ns, message.ros_msg)
            for message in read_ros2_messages(str(file))
        ]
        assert len(found) == len(others) > 0
        for topic, value in (('/simulator/energy', 'data'), ('/joint_states', 'position')):
            theirs = [(stamp, read) for name, stamp, read in found if name == topic]
            ours = [(stamp, getattr(m, value)) for name, stamp, m in others if name == topic]
            assert theirs == [(s, list(v) if value == 'position' else v) for s, v in ours]


def test_a_file_of_a_split_log_alone_is_not_verified_as_if_it_were_all(tmp_path):
    path, _ = make(tmp_path, 'slider_crank', 300, split=Split(duration=0.2))
    assert isinstance(path, Path) and path.name.endswith('_2.mcap')
    result = compare(load(path))
    assert not result.equal and 'no journal' in result.faults[-1]
