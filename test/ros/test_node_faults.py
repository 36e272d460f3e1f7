"""The node reports faults of its surroundings: a closed terminal, a parameter of another type."""

import fcntl
import os
import pty
import signal
import subprocess
import sys
import termios
import time

import pytest
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from alf_ros.kernel.numba_ext import cache
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.ros.simulator.slow_work import Compiling
from support.paths import ROOT
from support.ros_node import LIMIT, START_LIMIT, Peer, SimulatorProcess

SECRET = 'root:x:0:0:root:/root:/bin/sh\nhunter2\n'


def on_a_terminal(command, folder):
    """Start a command with a terminal of its own; returns the process and the terminal."""
    terminal, end = pty.openpty()

    def own():
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    process = subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': f'{ROOT}:{os.environ.get("PYTHONPATH", "")}'},
        stdin=end,
        stdout=end,
        stderr=end,
        start_new_session=True,
        preexec_fn=own,
    )
    os.close(end)
    return process, terminal


def read_until(terminal, text):
    seen, end = '', time.monotonic() + START_LIMIT
    while text not in seen:
        assert time.monotonic() < end, seen
        seen += os.read(terminal, 1000).decode(errors='replace')


def test_a_terminal_that_closes_ends_it_with_a_whole_log(tmp_path):
    command = [sys.executable, '-m', 'alf_ros', 'simulator', '--log-folder', 'logs']
    process, terminal = on_a_terminal(command, tmp_path)
    try:
        read_until(terminal, 'running:')
        time.sleep(0.7)  # the live line is being written
        os.close(terminal)
        assert process.wait(LIMIT) == 0
    finally:
        process.kill()
        process.wait()
    (path,) = tmp_path.glob('logs/*/*.mcap')
    log = load(path)
    assert log.damage == '' and compare(log).equal


@pytest.mark.thorough
def test_nohup_keeps_it_running(tmp_path):
    command = ['nohup', sys.executable, '-m', 'alf_ros', 'simulator', '--log-folder', 'logs']
    with open(tmp_path / 'out', 'w') as out:
        process = subprocess.Popen(
            command, cwd=tmp_path, env={**os.environ, 'PYTHONPATH': str(ROOT)}, stdout=out
        )
    end = time.monotonic() + START_LIMIT
    while 'running:' not in (tmp_path / 'out').read_text():
        assert process.poll() is None and time.monotonic() < end
        time.sleep(0.02)
    process.send_signal(signal.SIGHUP)
    time.sleep(0.7)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    assert process.wait(LIMIT) == 0
    (path,) = tmp_path.glob('logs/*/*.mcap')
    assert load(path).damage == ''


@pytest.fixture(scope='module')
def ask(tmp_path_factory):
    """Sets a parameter of a paused node; returns the reason of a refusal, '' for success."""
    folder = tmp_path_factory.mktemp('paused')
    with Peer() as peer, SimulatorProcess(folder, start_paused='true').wait_running() as node:

        def set_to(name, value):
            asked = Parameter(name, value=value).to_parameter_msg()
            if value is None:
                asked.value = ParameterValue()
            service = '/simulator/set_parameters'
            (result,) = peer.call(SetParameters, service, parameters=[asked]).results
            assert result.successful == (result.reason == '')
            return result.reason

        yield set_to
        assert node.stop() == 0, node.output


@pytest.mark.parametrize(
    ('name', 'value', 'says'),
    [
        ('scene', 5, 'scene: a whole number given; expected a text'),
        ('scene', ['a'], 'scene: a list of texts given; expected a text'),
        ('scene', None, 'scene: nothing given; expected a text'),
        ('scene', 'four_baar', "did you mean 'four_bar'?"),
        ('rate', 'fast', 'rate: a text given; expected a number'),
        ('rate', True, 'rate: true or false given; expected a number'),
        ('step_count', 2.5, 'step_count: a number given; expected a whole number'),
        (
            'effects.gravity.acceleration',
            ['a', 'b'],
            'effects.gravity.acceleration: a list of texts given; expected a list of numbers',
        ),
        ('raet', 250.0, "unknown parameter of the node, got 'raet'; did you mean 'rate'?"),
        ('rate', 333, 'expected 333.333333 or 250 Hz'),
    ],
)
def test_a_parameter_of_another_type_is_told_what_came_and_what_was_expected(
    ask, name, value, says
):
    reason = ask(name, value)
    assert says in reason and '\n' not in reason


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('rate', 250),
        ('command_timeout', 1),
        ('real_time_factor', 0),
        ('accuracy', 0),
        ('effects.gravity.acceleration', [0, -2]),
    ],
)
def test_whole_numbers_are_numbers(ask, name, value):
    assert ask(name, value) == ''


@pytest.mark.parametrize('text', [SECRET, f'mechanism: {{}}\n---\n{SECRET}', '- hunter2\n'])
def test_a_file_that_is_no_scene_is_not_shown(ask, tmp_path, text):
    secret = tmp_path / 'secret.yaml'
    secret.write_text(text)
    named = tmp_path / 'named.yaml'
    named.write_text(f'mechanism: {secret}\n')
    for path in (secret, named):
        reason = ask('scene', str(path))
        assert f'{secret}:' in reason and 'expected' in reason
        assert 'hunter2' not in reason and 'x:0:0' not in reason


@pytest.mark.parametrize(
    ('option', 'says'),
    [
        ('rate:=fast', 'rate: bad value of a parameter: a text given, got'),
        ('scene:=5', 'scene: bad value of a parameter: a whole number given, got 5; expected a'),
        ('record.topics:=all', 'a text given'),
        ('record.topics:=[]', 'record.topics: bad value of a parameter: an empty list given; exp'),
        ('rate:=[]', 'rate: bad value of a parameter: an empty list given; expected a number'),
        ('use_sim_time:=3', "use_sim_time: bad value of a parameter of rclpy, got '3'; expected"),
    ],
)
def test_so_is_one_at_the_start(tmp_path, option, says):
    name, _, value = option.partition(':=')
    with SimulatorProcess(tmp_path, **{name: value}) as node:
        assert node.wait() == 2
    assert says in node.output and 'Traceback' not in node.output


def test_it_says_that_it_compiles_only_if_it_does():
    said = Compiling()
    assert said() == ''
    before = cache.misses()

    part = float(time.time_ns())  # another one each time: no run before has compiled it

    @compiled
    def share(x):
        return part * x

    assert share(1.0) == part
    assert cache.misses() == before + 1
    assert said().startswith('compiling')
