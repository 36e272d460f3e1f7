"""The package as others install it: colcon (both ways), source distribution and wheel."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from xml.etree import ElementTree

import pytest

from alf_ros import resources
from alf_ros.commands import COMMANDS
from support.paths import ROOT
from support.thorough import thinned

VERSION = ElementTree.parse(ROOT / 'package.xml').findtext('version')
SCENES = {path.name for path in (ROOT / 'config' / 'scenes').glob('*.yaml')}
# Run with the package installed: says what is found where, and which commands can be called.
REPORT = """
import alf_ros, json
from importlib.metadata import entry_points
from alf_ros import load_scene, resources
scripts = [each for each in entry_points(group='console_scripts') if each.module[:7] == 'alf_ros']
commands = sorted({each.name for each in scripts if callable(each.load())})
scenes = [*map(str, resources.folder('scenes'))]
print(json.dumps([commands, alf_ros.__file__, *scenes, resources.version()]))
load_scene('slider_crank')
"""
STARTED = ('simulator', 'check')  # of the scripts, which differ by the name of a function


@pytest.fixture
def sources(tmp_path):
    """A copy of the source tree without generated files."""
    everywhere = shutil.ignore_patterns('.*', '__pycache__', '*.egg-info')
    above = shutil.ignore_patterns('build', 'install', 'log', 'logs')

    def made(folder, names):
        found = everywhere(folder, names)
        return found | above(folder, names) if Path(folder) == ROOT else found

    return Path(shutil.copytree(ROOT, tmp_path / 'src' / 'alf_ros', ignore=made))


def run(*command, cwd, **changes):
    # A sourced ROS 2 is on PYTHONPATH and must stay, a sourced alf_ros must not be what is tested.
    paths = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    others = os.pathsep.join(path for path in paths if path and not Path(path, 'alf_ros').exists())
    environment = os.environ | {'PYTHONPATH': others} | changes
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, f'{command}\n{done.stdout}\n{done.stderr}'
    return done.stdout


def check_prefix(prefix):
    """A prefix has the files that ROS 2 tools look for."""
    assert (prefix / 'share/ament_index/resource_index/packages/alf_ros').is_file()
    assert (prefix / 'share/alf_ros/package.xml').is_file()
    assert (prefix / 'share/alf_ros/launch/simulate.launch.py').is_file()
    assert {path.name for path in (prefix / 'share/alf_ros/config/scenes').iterdir()} == SCENES
    assert (prefix / 'share/alf_ros/config/schema/scene.json').is_file()
    for name in COMMANDS:
        assert os.access(prefix / 'lib/alf_ros' / name, os.X_OK)


def check_pages(package):
    """The package has the files that `view` and `analyze` show in a browser."""
    for page in (
        'ros/view/page/index.html',
        'logs/report/page/stage.js',
        'logs/report/page/solids.js',
        'logs/report/page/analysis.html',
        'studies/atlas/page/atlas.html',
        'studies/atlas/page/atlas.js',
        'studies/statics/page/modes.html',
    ):
        assert (package / page).is_file()


@pytest.mark.parametrize(
    'flags',
    thinned(
        [pytest.param([], id='copied'), pytest.param(['--symlink-install'], id='symlinked')],
        keep=bool,
    ),
)
def test_colcon(sources, tmp_path, flags):
    run(sys.executable, '-m', 'colcon', 'build', *flags, cwd=tmp_path)
    prefix = tmp_path / 'install' / 'alf_ros'
    check_prefix(prefix)
    sourced = f'. {tmp_path}/install/local_setup.bash && exec "$@"'
    for name in STARTED:
        command = prefix / 'lib/alf_ros' / name
        assert 'usage:' in run('bash', '-c', sourced, '-', command, '--help', cwd=tmp_path)
    commands, module, *scenes, version = json.loads(
        run('bash', '-c', sourced, '-', sys.executable, '-c', REPORT, cwd=tmp_path)
    )
    assert Path(module).is_relative_to(tmp_path)
    check_pages(Path(module).parent)
    assert Path(scenes[0]).is_relative_to(sources if flags else prefix)
    assert version == VERSION and commands == sorted(COMMANDS)


def test_pip(sources, tmp_path):
    """A wheel made of the source distribution, installed beside the libraries."""
    build = "from setuptools import build_meta as build; build.build_sdist('../../dist')"
    run(sys.executable, '-c', build, cwd=sources)
    (archive,) = (tmp_path / 'dist').iterdir()
    assert archive.name == f'alf_ros-{VERSION}.tar.gz'
    wheel = [sys.executable, '-m', 'pip', 'wheel', '--no-deps', '--no-build-isolation']
    run(*wheel, '--wheel-dir', tmp_path / 'wheels', archive, cwd=tmp_path)
    (made,) = (tmp_path / 'wheels').iterdir()
    prefix = tmp_path / 'venv'
    python = prefix / 'bin' / 'python'
    run(sys.executable, '-m', 'venv', '--without-pip', prefix, cwd=tmp_path)
    # The new venv sees the libraries of this one; alf_ros must come from what is installed.
    site = prefix / 'lib' / f'python{sysconfig.get_python_version()}' / 'site-packages'
    libraries = [path for path in sys.path if path.endswith('-packages')]
    (site / 'libraries.pth').write_text('\n'.join(libraries) + '\n')
    pip = [sys.executable, '-m', 'pip', '--python', python, 'install', '--no-deps']
    run(*pip, '--ignore-installed', made, cwd=tmp_path)
    check_prefix(prefix)
    # Neither venv is activated: the executable has to find the python it was installed for.
    path = f'{sys.base_prefix}/bin{os.pathsep}{os.defpath}'
    for name in STARTED:
        command = prefix / 'lib/alf_ros' / name
        assert 'usage:' in run(command, '--help', cwd=tmp_path, PATH=path)
    commands, module, *scenes, version = json.loads(run(python, '-c', REPORT, cwd=tmp_path))
    assert Path(module).is_relative_to(site)
    check_pages(Path(module).parent)
    assert scenes[0] == str(prefix / 'share/alf_ros/config/scenes')
    assert version == VERSION and commands == sorted(COMMANDS)


def test_resources_come_from_the_source_tree_first(tmp_path, monkeypatch):
    share = tmp_path / 'share' / 'alf_ros'
    (share / 'config' / 'scenes').mkdir(parents=True)
    shutil.copy(ROOT / 'package.xml', share)
    monkeypatch.setenv('AMENT_PREFIX_PATH', os.pathsep.join(['/nowhere', str(tmp_path)]))
    found = resources.folder('scenes')
    assert found[0] == ROOT / 'config' / 'scenes'
    assert share / 'config' / 'scenes' in found
    assert share / 'config' / 'mechanisms' not in resources.folder('mechanisms')
    assert resources.version() == VERSION
