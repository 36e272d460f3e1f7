"""doc/install.md: a workspace of rosdep and colcon has no mcap, no zstandard, and numpy 1."""

import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package import parse_package
from mcap.reader import make_reader

from alf_ros import Simulation, load_scene
from alf_ros.commands import COMMANDS
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from support.paths import ROOT
from support.ros_node import START_LIMIT, read_log
from support.thorough import LONG

PACKAGE = ROOT / 'package.xml'


def interpreter(folder, *without):
    """A Python of its own with the libraries of this one, but for those whose names begin so."""
    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', folder], check=True)
    site = folder / 'lib' / f'python{sysconfig.get_python_version()}' / 'site-packages'
    for path in [path for path in sys.path if path.endswith('-packages')]:
        for entry in Path(path).iterdir():
            there = site / entry.name
            if not re.match('|'.join(without) or '$^', entry.name) and not there.exists():
                there.symlink_to(entry)
    if (Path(sys.prefix) / 'share').is_dir():  # definitions of messages
        (folder / 'share').symlink_to(Path(sys.prefix) / 'share')
    return folder / 'bin/python'


def run(python, folder, *arguments, **variables):
    """Run a command of the package, with variables of the environment; returns what it printed."""
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH', '')]))
    done = subprocess.run(
        [python, '-m', 'alf_ros', *arguments],
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': paths, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=5 * START_LIMIT,  # it may have to compile
    )
    assert done.returncode == 0 and 'Traceback' not in done.stdout, done.stdout
    return done.stdout


def test_without_mcap_the_node_runs_and_says_how_to_get_logs(tmp_path):
    python = interpreter(tmp_path / 'venv', 'mcap')
    said = run(python, tmp_path, 'simulator', '--duration', '0.2')
    assert 'the library mcap is missing; pip install "mcap>=1.5" zstandard\n' in said
    assert 'real-time factor 1; no log\n' in said and 'stopped at t = 0.2 s' in said
    assert not list(tmp_path.glob('logs/*'))
    if LONG:  # nothing is said to who wants no log
        said = run(python, tmp_path, 'simulator', '--duration', '0.1', '--no-record')
        assert 'mcap' not in said


def test_without_zstandard_a_log_is_written_uncompressed(tmp_path):
    python = interpreter(tmp_path / 'venv', 'zstandard', 'backports')
    said = run(python, tmp_path, 'simulator', '--duration', '0.5')
    assert 'logs are not compressed: the library zstandard is missing' in said
    (path,) = tmp_path.glob('logs/*/*.mcap')
    with open(path, 'rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert {chunk.compression for chunk in chunks} == {''}
    assert len(read_log(path)['/joint_states']) == 251 and compare(load(path)).equal
    # and read again without it
    assert 'EQUAL' in run(python, tmp_path, 'verify', str(path))


@pytest.mark.thorough
@pytest.mark.skipif(sys.version_info >= (3, 13), reason='numpy 1 has no wheels from 3.13 on')
def test_with_numpy_1(tmp_path):
    python = interpreter(tmp_path / 'venv', 'numpy')
    pip = [sys.executable, '-m', 'pip', '--python', python, 'install', '--quiet', '--no-deps']
    # most files of numpy are never imported here, so none is compiled beforehand
    subprocess.run([*pip, '--no-compile', '-r', ROOT / 'requirements/numpy1.txt'], check=True)
    show = [python, '-c', 'import numpy; print(numpy.__version__)']
    assert subprocess.run(show, capture_output=True, text=True).stdout.startswith('1.26')
    # compiled anew for this numpy, once; LLVM, which knows no numpy, optimises less, for the time
    less = {'NUMBA_OPT': '1'}
    run(python, tmp_path, 'simulator', '--duration', '0.1', **less)
    (path,) = tmp_path.glob('logs/*/*.mcap')
    log = load(path)
    assert log.damage == '' and len(log.states.t) == 51
    assert 'EQUAL' in run(python, tmp_path, 'verify', str(path), **less)
    # numpy 2 adds up some products in another order: the same but for rounding
    simulation = Simulation(load_scene('slider_crank'))
    simulation.step(100)
    assert log.states.q[-1] == pytest.approx(simulation.sample().q, abs=1e-12)


def test_bloom_and_rosdep_find_what_they_ask_for():
    warnings: list[str] = []
    package = parse_package(str(PACKAGE), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    assert {url.type for url in package.urls} == {'website', 'repository', 'bugtracker'}
    assert (
        package.get_build_type() == 'ament_python' and (ROOT / package.licenses[0].file).is_file()
    )
    changes = get_changelog_from_path(str(ROOT), package.name)
    assert changes.rst and changes.foreach_version()


def test_package_xml_names_every_package_that_is_imported():
    declared = {depend.name for depend in parse_package(str(PACKAGE)).exec_depends}
    lines = '\n'.join(
        path.read_text('utf-8')
        for folder in ('alf_ros/ros', 'alf_ros/commands', 'launch')
        for path in (ROOT / folder).rglob('*.py')
    )
    used = set(
        re.findall(
            r'^ *(?:from|import) (\w+_(?:msgs|srvs|interfaces)|rclpy|launch\w*)', lines, re.M
        )
    )
    used |= set(re.findall(r"package='(\w+)'", lines)) - {'alf_ros'}
    used -= {'rviz2', 'controller_manager'}  # where they are: rviz:=true, ros2_control
    assert used and used <= declared


def test_the_page_names_what_there_is():
    page = (ROOT / 'doc/install.md').read_text('utf-8')
    for name in re.findall(r'^(?:make|.*(?:-m|run) alf_ros) (\w+)', page, re.M):
        assert name in COMMANDS or re.search(
            rf'^{name}:', (ROOT / 'Makefile').read_text(), re.M
        ), name
    for name in re.findall(r'(requirements/\w+\.txt)', page):
        assert (ROOT / name).is_file()
