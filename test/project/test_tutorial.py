"""The tutorial and the README done as a reader does it: blocks are saved, run and looked at."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import WrenchStamped
from mcap.reader import make_reader
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from alf_ros import Simulation, load_scene
from alf_ros.commands import COMMANDS
from support.forked import ended
from support.paths import ROOT
from support.reader import START_LIMIT, environment

README = (ROOT / 'README.md').read_text('utf-8')
TUTORIAL = (ROOT / 'doc/tutorial.md').read_text('utf-8')
FENCED = re.compile(r'^```(\w+)\n(.*?)^```$', re.DOTALL | re.MULTILINE)
BLOCKS = FENCED.findall(TUTORIAL)
# Discovery has 10 s of it.
LIMIT = 20.0
TYPES = {
    '/joint_states': JointState,
    '/simulator/energy': Float64,
    '/simulator/inputs': String,
}


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """A reader's folder, with the files of the tutorial saved in it."""
    folder = tmp_path_factory.mktemp('tutorial')
    for _, text in BLOCKS:
        if name := re.match(r'# (\w+\.\w+)\n', text):
            (folder / name[1]).write_text(text, 'utf-8')
    return folder


def made(command):
    """The command behind `make ...` of the tutorial once .venv exists, with this interpreter."""
    assert command in [text.strip() for kind, text in BLOCKS if kind == 'sh']
    make, *arguments = shlex.split(command)
    lines = subprocess.run(
        [make, '--dry-run', '--no-print-directory', '-C', str(ROOT), *arguments],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    (line,) = (line for line in lines if line.startswith('.venv/bin/python '))
    return [sys.executable, *shlex.split(line)[1:]]


def program(folder, name, limit=START_LIMIT):
    """The output of `.venv/bin/python <name>`, and what the tutorial shows (None: nothing)."""
    assert '`.venv/bin/python <name>`' in TUTORIAL
    done = ended([name], folder, environment(), limit)
    assert done.returncode == 0, done.stderr
    at = [text.startswith(f'# {name}\n') for _, text in BLOCKS].index(True)
    kind, text = BLOCKS[at + 1] if at + 1 < len(BLOCKS) else ('', '')
    return done.stdout, text if kind == 'text' else None


def shape(text):
    """The text with every number replaced."""
    return re.sub(r'-?\d+(\.\d+)?(e-?\d+)?', '#', text)


def logged(folder):
    """Messages of the newest log by topic: lists of (log time in ns, message)."""
    log = max(folder.glob('logs/*/*.mcap'), key=lambda path: path.stat().st_mtime)
    found: dict[str, Any] = {topic: [] for topic in TYPES}
    with open(log, 'rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages(list(TYPES)):
            content = deserialize_message(message.data, TYPES[channel.topic])
            found[channel.topic].append((message.log_time, content))
    return found


@pytest.fixture(scope='module')
def pushed(folder):
    """The first terminal runs, the second pushes, the first is ended with Ctrl-C."""
    screen = folder / 'first_terminal.txt'
    with open(screen, 'w') as output:
        first = subprocess.Popen(
            made('make run'),
            cwd=folder,
            env=environment(),
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        end = time.monotonic() + START_LIMIT
        while 'running:' not in screen.read_text():
            assert first.poll() is None and time.monotonic() < end, screen.read_text()
            time.sleep(0.05)
        program(folder, 'push.py', LIMIT)
        os.killpg(first.pid, signal.SIGINT)
        code = first.wait(LIMIT)
    finally:
        if first.poll() is None:
            os.killpg(first.pid, signal.SIGKILL)
            first.wait()
    assert code == 0, screen.read_text()
    return logged(folder)


def test_push_moves_the_mechanism(pushed):
    """The log has the push and its release; a run with this push repeats it bit for bit."""
    entries = [json.loads(message.data) for _, message in pushed['/simulator/inputs']]
    push, release = [entry for entry in entries if entry['kind'] == 'wrench']
    assert (push['name'], push['force'], push['frame']) == ('coupler', [0.0, 5.0], 'world')
    assert (release['name'], release['force']) == ('coupler', [0.0, 0.0])
    assert 0.5 < release['t'] - push['t'] < 3.0

    logged = np.array([message.position for _, message in pushed['/joint_states']])
    with_push, without = (Simulation(load_scene('slider_crank')) for _ in range(2))
    for entry in (push, release):
        with_push.step(entry['step'] - with_push.step_index)
        with_push.apply_wrench(entry['name'], entry['force'])
    steps = round(pushed['/joint_states'][-1][0] * 1e-9 / without.h)
    with_push.step(steps - with_push.step_index)
    assert logged[-1].tolist() == with_push.sample().joint_positions.tolist()

    free = [sample.joint_positions for sample in without.run(steps * without.h, every=2)]
    before = push['step'] // 2 + 1
    assert np.array_equal(logged[:before], free[:before])
    assert np.abs(logged - free).max() > 0.02


def test_log_is_looked_at(folder, pushed):
    """look.py prints what the log holds, in the form the tutorial shows."""
    output, promised = program(folder, 'look.py')
    assert shape(output) == shape(promised)
    entries = [json.loads(message.data) for _, message in pushed['/simulator/inputs']]
    energies = [message.data for _, message in pushed['/simulator/energy']]
    *commands, last = output.splitlines()
    steps = [entry['step'] for entry in entries if entry['kind'] == 'wrench']
    assert [int(line.split()[1]) for line in commands] == steps
    numbers = [len(energies), energies[0], energies[-1]]
    assert [float(word) for word in re.findall(r'\d+\.?\d*', last)] == numbers
    assert energies[0] == pytest.approx(float(re.search(r'first (\S+)', promised)[1]), rel=1e-12)
    assert max(abs(energy - energies[0]) for energy in energies) > 1e-3


def test_command_for_an_installed_ros_2_pushes_alike():
    """`ros2` is not on PyPI; its line and push.py have the same topic, type and fields."""
    (line,) = re.findall(r'^`(ros2 topic pub .*)`', TUTORIAL, re.MULTILINE)
    *start, topic, kind, fields = shlex.split(line)
    assert start == ['ros2', 'topic', 'pub', '--once']
    (program,) = (text for _, text in BLOCKS if text.startswith('# push.py'))
    assert f"'{topic}'" in program
    assert kind == 'geometry_msgs/msg/WrenchStamped'
    message = WrenchStamped()
    fill(message, yaml.safe_load(fields))
    assert message.wrench.force.y == 5.0 and 'in (5.0, 0.0)' in program


def fill(message, fields):
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)


def test_the_view():
    assert made('make view')[1:] == ['-m', 'alf_ros', 'view']


def test_library_without_ros(folder):
    """api.py prints what the tutorial says, digit for digit."""
    output, promised = program(folder, 'api.py')
    assert output == promised


@pytest.mark.thorough
def test_own_mechanism(folder):
    """The scene of the tutorial runs as a node, and its point C is on the ellipse it promises."""
    command = made('make run SCENE=ellipse.yaml DURATION=2')
    done = subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, timeout=START_LIMIT
    )
    assert done.returncode == 0, done.stderr
    times = [time for time, _ in logged(folder)['/joint_states']]
    assert (len(times), times[-1]) == (1001, 2_000_000_000)
    places = [
        sample.points['C'] for sample in Simulation(load_scene(folder / 'ellipse.yaml')).run(2.0)
    ]
    x, y = np.array(places).T
    assert (x / 0.5) ** 2 + y**2 == pytest.approx(1.0, abs=1e-12)
    assert np.ptp(x) > 0.99 and np.ptp(y) > 1.5


def test_a_minute_of_python(tmp_path):
    """The program of the README draws its picture, and its forces obey Newton's law."""
    (text,) = (text for kind, text in FENCED.findall(README) if kind == 'python')
    name = re.match(r'# (\w+\.py)\n', text)[1]
    assert f'`.venv/bin/python {name}`' in README
    check = """
import numpy as np

for sample in samples[::37]:
    pin, knee = (sample.reactions[joint].force for joint in ('crank_pin', 'knee'))
    rate = 0.5 * sample.qdd[:2] * 1.0  # of the crank's momentum: 1 kg, centre half way to A
    assert np.allclose(pin - knee + [0.0, -9.81], rate, rtol=0.0, atol=1e-9), sample.t
"""
    (tmp_path / name).write_text(text + check, 'utf-8')
    done = ended([name], tmp_path, {**environment(), 'MPLBACKEND': 'Agg'}, START_LIMIT)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / 'pin_force.png').stat().st_size > 10_000


def test_everything_named_exists():
    """Every link of README.md leads somewhere, and every command is one the tests above run."""
    links = re.findall(r'\]\(([^)#]+)\)', README)
    assert len(links) > 5
    assert [link for link in links if not (ROOT / link).exists()] == []
    links = re.findall(r'\]\(([^)#]+)\)', TUTORIAL)
    assert [link for link in links if not (ROOT / 'doc' / link).exists()] == []
    commands = [text.strip() for kind, text in BLOCKS if kind == 'sh']
    assert commands == ['make run', 'make view', 'make run SCENE=ellipse.yaml DURATION=2']
    assert len(README.splitlines()) <= 150
    assert (ROOT / 'doc/pictures/passing.gif').stat().st_size < 3e6  # README.md loads it


def test_every_command_is_in_the_tutorial():
    table = TUTORIAL.partition('## All commands')[2]
    listed = re.findall(r'^\| `(\w+)` \|', table, re.MULTILINE)
    assert sorted(listed) == sorted(COMMANDS)
