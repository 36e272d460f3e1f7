"""Packages around a xacro and around the file that names a mesh, in a source tree."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import yaml

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.nearby_packages import nearby_package

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
LINK = """<link name="{}"><visual><geometry><mesh filename="{}"/></geometry></visual>
  <inertial><mass value="2.5"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="pin" type="continuous"><parent link="base"/><child link="bar"/></joint>"""


def saved(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, 'utf-8')
    return path


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A robot in the package `robot`, with a part of the package `parts` beside it."""
    pytest.importorskip('xacro')
    pytest.importorskip('ament_index_python')
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    source = tmp_path / 'source'
    saved(source / 'robot' / 'package.xml', '<package><name>robot</name></package>')
    saved(source / 'parts' / 'package.xml', '<package><name>parts</name></package>')
    bar = LINK.format('bar', 'file://$(find parts)/meshes/bar.stl')
    saved(source / 'parts' / 'urdf' / 'bar.xacro', f'<robot {XACRO}>{bar}</robot>')
    saved(source / 'parts' / 'meshes' / 'bar.stl', '')
    include = '<xacro:include filename="$(find parts)/urdf/bar.xacro"/>'
    saved(source / 'robot' / 'urdf' / 'all.xacro', f'<robot {XACRO}>{include}</robot>')
    include = '<xacro:include filename="$(find robot)/urdf/all.xacro"/>'
    text = f'<robot name="r" {XACRO}>{include}<link name="base"/>{JOINT}</robot>'
    saved(source / 'robot' / 'urdf' / 'it.urdf.xacro', text)
    return source


def test_a_xacro_finds_packages_of_its_source_tree(tree: Path) -> None:
    """Its own, and one beside it that an included file names; paths are where the files are."""
    text = imported(str(tree / 'robot/urdf/it.urdf.xacro'))
    (bar,) = yaml.safe_load(text)['bodies'].values()
    assert bar['mass'] == 2.5
    (mesh,) = bar['shapes']
    assert mesh['mesh']['file'] == str(tree / 'parts/meshes/bar.stl')
    assert 'AMENT_PREFIX_PATH' not in os.environ


def test_what_is_missing_there_is_told_where_it_is_missing(tree: Path) -> None:
    (tree / 'parts/urdf/bar.xacro').unlink()
    with pytest.raises(InputError) as caught:
        imported(str(tree / 'robot/urdf/it.urdf.xacro'))
    said = f'No such file or directory: {tree / "parts/urdf/bar.xacro"}'
    assert caught.value.message == f'xacro cannot expand it: {said}'
    (tree / 'parts/package.xml').unlink()  # a folder like any other
    with pytest.raises(InputError, match="finds no package, got 'parts'; expected"):
        imported(str(tree / 'robot/urdf/it.urdf.xacro'))


def test_a_mesh_of_a_package_around_the_file_has_its_path(tree: Path) -> None:
    named = [f'package://{name}/meshes/bar.stl' for name in ('robot', 'parts', 'other')]
    text = ''.join(LINK.format(f'bar{n}', name) for n, name in enumerate(named))
    for n in range(3):
        text += f"""<joint name="pin{n}" type="continuous"><parent link="base"/>
          <child link="bar{n}"/></joint>"""
    path = saved(tree / 'robot/it.urdf', f'<robot name="r"><link name="base"/>{text}</robot>')
    bodies = yaml.safe_load(imported(str(path)))['bodies']
    files = [bodies[f'bar{n}']['shapes'][0]['mesh']['file'] for n in range(3)]
    assert files == [f'{tree}/robot/meshes/bar.stl', f'{tree}/parts/meshes/bar.stl', named[2]]


def test_a_package_that_ros_finds_is_not_searched(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tree / 'robot/urdf/it.urdf.xacro'
    assert nearby_package('parts', file) == tree / 'parts'
    (tmp_path / 'install/share/parts').mkdir(parents=True)
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'install'))
    assert nearby_package('parts', file) is None
    for name in ('', '..', '../robot', '/robot'):
        assert nearby_package(name, file) is None


def test_what_is_no_package_file_is_not_waited_for(tree: Path) -> None:
    (tree / 'parts/package.xml').unlink()
    os.mkfifo(tree / 'parts/package.xml')  # nobody writes into it
    file = tree / 'robot/urdf/it.urdf.xacro'
    assert nearby_package('parts', file) is None
    for text in ('', '<package>', '<package/>', '<package><name>\xff</name></package>'):
        (tree / 'robot/package.xml').write_text(text, 'latin-1')
        assert nearby_package('robots', file) is None
        assert nearby_package('robot', file) == tree / 'robot'
