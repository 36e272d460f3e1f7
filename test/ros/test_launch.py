"""The launch files, run as `ros2 launch` runs them. Needs launch_ros: a ROS 2 installation."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from alf_ros import load_scene
from alf_ros.exchange.urdf_export import urdf
from support.paths import ROOT
from support.ros_node import START_LIMIT, read_log

pytest.importorskip('launch_ros', reason='launch_ros comes with a ROS 2 installation')

LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

file, *arguments = sys.argv[1:]
given = [argument.split(':=') for argument in arguments]
service = LaunchService()
source = PythonLaunchDescriptionSource(file)
service.include_launch_description(
    LaunchDescription([IncludeLaunchDescription(source, launch_arguments=given)])
)
sys.exit(service.run())
"""
SIMULATOR = f'#!/bin/sh\nexec {sys.executable} -m alf_ros simulator "$@"\n'
# Keeps what it was started with, in place of the program of that name.
KEEP = f"""#!{sys.executable}
import json, pathlib, sys
files = [argument for argument in sys.argv if argument.endswith('.yaml') or '/launch_' in argument]
texts = [pathlib.Path(file).read_text() for file in files]
pathlib.Path('kept_' + pathlib.Path(sys.argv[0]).name).write_text(json.dumps([sys.argv, texts]))
"""


@pytest.fixture
def launch(tmp_path):
    """Runs a launch file with this source tree as the installed package."""
    prefix = tmp_path / 'prefix'
    packages = {'alf_ros': 'simulator'}
    packages |= {name: name for name in ('robot_state_publisher', 'rviz2')}
    for package, program in packages.items():
        for folder in ('lib', 'share'):
            (prefix / folder / package).mkdir(parents=True)
        marker = prefix / 'share/ament_index/resource_index/packages' / package
        marker.parent.mkdir(parents=True, exist_ok=True)
        marker.touch()
        executable = prefix / 'lib' / package / program
        executable.write_text(SIMULATOR if package == 'alf_ros' else KEEP)
        executable.chmod(0o755)
    view = prefix / 'lib/alf_ros/view'
    view.write_text(KEEP)
    view.chmod(0o755)
    for name in ('launch', 'config', 'rviz', 'package.xml'):
        (prefix / 'share/alf_ros' / name).symlink_to(ROOT / name)

    def run(file, *arguments):
        paths = [str(prefix), os.environ.get('AMENT_PREFIX_PATH', '')]
        inherited = os.environ.get('PYTHONPATH', '')
        environment = {
            **os.environ,
            'AMENT_PREFIX_PATH': os.pathsep.join(filter(None, paths)),
            'PYTHONPATH': os.pathsep.join(filter(None, [str(ROOT), inherited])),
        }
        command = [sys.executable, '-c', LAUNCH, str(ROOT / 'launch' / file), *arguments]
        return subprocess.run(
            command,
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=START_LIMIT,
        )

    return run


def kept(tmp_path, program):
    """Arguments a program was started with, and the parameters in its files."""
    arguments, texts = json.loads((tmp_path / f'kept_{program}').read_text())
    parameters: dict[str, Any] = {}
    for text in texts:
        for node in yaml.safe_load(text).values():
            parameters |= node['ros__parameters']
    return arguments, parameters


def yaml_topics(config: Path) -> list[str]:
    """The topics that a configuration of RViz shows."""
    displays = yaml.safe_load(config.read_text())['Visualization Manager']['Displays']
    topics = [each.get(key, {}) for each in displays for key in ('Topic', 'Description Topic')]
    return [topic['Value'] for topic in topics if topic]


def test_simulate(launch, tmp_path):
    done = launch('simulate.launch.py', 'scene:=four_bar', 'rate:=100', 'duration:=0.5')
    assert done.returncode == 0, done.stderr
    (log,) = tmp_path.glob('logs/*/*.mcap')
    stamps = [stamp for stamp, _ in read_log(log)['/joint_states']]
    assert stamps == [1] + [10_000_000 * k for k in range(1, 51)]


def test_simulate_without_a_log_and_shown(launch, tmp_path):
    shown = 'view:=true', 'rviz:=true', 'namespace:=left'
    done = launch('simulate.launch.py', 'record:=false', 'duration:=0.1', *shown)
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.glob('logs/*'))
    arguments, _ = kept(tmp_path, 'rviz2')
    config = Path(arguments[arguments.index('-d') + 1])
    assert config.samefile(ROOT / 'rviz/simulator.rviz')
    # in a namespace it showed nothing
    topics = ('/simulator/markers', '/robot_description', '/tf', '/tf_static')
    assert {f'{topic}:={topic[1:]}' for topic in topics} <= set(arguments)
    assert '__ns:=/left' in arguments
    for topic in yaml_topics(config):
        assert topic in topics
    kept(tmp_path, 'view')


@pytest.mark.parametrize('wrong', ['rate:=often', 'record:=perhaps', 'scene:=four_baar'])
def test_what_cannot_be_used_is_told(launch, wrong):
    done = launch('simulate.launch.py', wrong)
    assert done.returncode != 0 or 'exit code 2' in done.stdout + done.stderr
    expected = {'r': 'expected', 's': "did you mean 'four_bar'"}[wrong[0]]
    assert expected in done.stdout + done.stderr


def test_with_robot_state_publisher(launch, tmp_path):
    done = launch(
        'with_robot_state_publisher.launch.py', 'scene:=four_bar', 'duration:=0.2', 'record:=false'
    )
    assert done.returncode == 0, done.stderr
    arguments, parameters = kept(tmp_path, 'robot_state_publisher')
    assert parameters['use_sim_time'] is True
    assert parameters['robot_description'] == urdf(load_scene('four_bar').mechanism)
    assert 'robot_description:=~/robot_description' in arguments
    names = {
        joint.get('name') for joint in ElementTree.fromstring(parameters['robot_description'])
    }
    assert {'crank_pin', 'knee', 'rocker_pin'} <= names
