"""Dockerfile, devcontainer and pixi.toml name what exists, in the versions of the project.

No container engine and no pixi runs here: these files are parsed and compared, not executed.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import re
import sys
from typing import Any

import pytest
from catkin_pkg.package import parse_package

from alf_ros.commands import COMMANDS
from support.paths import ROOT

tomllib = importlib.import_module('tomllib' if sys.version_info >= (3, 11) else 'tomli')

DISTRIBUTION = 'kilted'  # of the wheels in requirements/ros.txt
# Only services use it, and only where it is installed.
OPTIONAL = {'simulation_interfaces'}
# rosdep keys of Python libraries, by their names in conda-forge
LIBRARIES = {
    'python3-numpy': 'numpy',
    'python3-scipy': 'scipy',
    'python3-numba': 'numba',
    'python3-yaml': 'pyyaml',
}


def pins(name: str) -> dict[str, str]:
    """Versions in a file of requirements/, by lower-case name."""
    text = (ROOT / 'requirements' / name).read_text('utf-8')
    return {k.lower(): v for k, v in re.findall(r'^([\w.-]+)==(\S+)$', text, re.MULTILINE)}


def supported() -> tuple[tuple[int, int], tuple[int, int]]:
    """The oldest and newest Python of scripts/environment.py."""
    spec = importlib.util.spec_from_file_location('setup', ROOT / 'scripts' / 'environment.py')
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: tuple[tuple[int, int], tuple[int, int]] = module.SUPPORTED
    return found


@pytest.fixture
def pixi() -> dict[str, Any]:
    found: dict[str, Any] = tomllib.loads((ROOT / 'pixi.toml').read_text('utf-8'))
    return found


def instructions() -> list[tuple[str, str]]:
    """Instructions of the Dockerfile, continued lines joined."""
    lines = (ROOT / 'Dockerfile').read_text('utf-8').splitlines()
    text = '\n'.join(line for line in lines if not line.startswith('#'))
    joined = re.sub(r'\\\n\s*', ' ', text)
    return [(line.split()[0], line.split(None, 1)[1]) for line in joined.splitlines() if line]


def test_the_image_has_the_pinned_libraries_and_starts_the_node() -> None:
    assert f'ROS 2 {DISTRIBUTION.title()}' in (ROOT / 'requirements/ros.txt').read_text('utf-8')
    found = instructions()
    assert found[0] == ('FROM', f'ros:{DISTRIBUTION}-ros-base')
    assert {kind for kind, _ in found} == {'FROM', 'RUN', 'COPY', 'WORKDIR', 'ENV', 'CMD'}
    shell = ' '.join(text for kind, text in found if kind == 'RUN')
    files = re.findall(r'requirements/\w+\.txt', shell)
    names = ('constraints', 'core', 'numpy1', 'record')
    assert files == [f'requirements/{name}.txt' for name in names]
    assert [file for file in files if not (ROOT / file).is_file()] == []
    command = json.loads(dict(found)['CMD'])
    assert command == ['python', '-m', 'alf_ros', 'simulator'] and command[-1] in COMMANDS
    first_run = re.findall(r'python -m alf_ros (\w+) (.*)', shell)
    assert first_run == [('simulator', '--duration 1 --no-record')]


def test_the_image_leaves_products_of_this_machine_out() -> None:
    ignored = set((ROOT / '.dockerignore').read_text('utf-8').splitlines())
    assert {'.git', '.venv', 'build', 'logs'} <= ignored
    needed = ('requirements', 'alf_ros', 'config', 'setup.py', 'package.xml', 'resource', 'launch')
    assert not ignored & set(needed)
    assert [name for name in needed if not (ROOT / name).exists()] == []


def test_the_devcontainer_makes_the_environment_of_make_setup() -> None:
    found = json.loads((ROOT / '.devcontainer/devcontainer.json').read_text('utf-8'))
    version = re.fullmatch(r'mcr\.\S+/python:3\.(\d+)-\w+', found['image'])
    oldest, newest = supported()
    assert version is not None and oldest <= (3, int(version[1])) <= newest
    assert found['postCreateCommand'] == 'make setup'
    assert re.search(r'^setup:$', (ROOT / 'Makefile').read_text('utf-8'), re.MULTILINE)
    settings = found['customizations']['vscode']['settings']
    assert settings['python.defaultInterpreterPath'].endswith('/.venv/bin/python')
    help_text = (ROOT / 'alf_ros/commands/view.py').read_text('utf-8')
    assert f'default: {found["forwardPorts"][0]};' in help_text


def test_pixi_has_the_pinned_libraries(pixi: dict[str, Any]) -> None:
    wanted = pixi['dependencies']
    assert {name: wanted[name] for name in pins('core.txt')} == {
        name: f'=={version}' for name, version in pins('core.txt').items()
    }
    assert pixi['pypi-dependencies'] == {
        name: f'=={version}' for name, version in pins('record.txt').items()
    }
    (_, oldest), (_, newest) = supported()
    assert wanted['python'] == f'>=3.{oldest},<3.{newest + 1}'
    numpy = re.fullmatch(r'>=(\d+\.\d+),<3', wanted['numpy'])
    assert numpy is not None and pins('numpy1.txt')['numpy'].startswith(numpy[1])


def test_pixi_has_every_dependency_of_the_package(pixi: dict[str, Any]) -> None:
    declared = {depend.name for depend in parse_package(str(ROOT / 'package.xml')).exec_depends}
    ros = declared - set(LIBRARIES) - OPTIONAL
    names = {f'ros-{DISTRIBUTION}-{name.replace("_", "-")}' for name in ros}
    assert set(LIBRARIES) | OPTIONAL <= declared
    assert set(pixi['dependencies']) == {*names, *LIBRARIES.values(), 'python'}
    assert f'https://prefix.dev/robostack-{DISTRIBUTION}' in pixi['workspace']['channels']
    for task in pixi['tasks'].values():
        command = re.fullmatch(r'python -m alf_ros (\w+)', task)
        assert command is not None and command[1] in COMMANDS
