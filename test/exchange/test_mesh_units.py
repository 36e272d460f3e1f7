"""Meshes in millimetres are hinted at, and no others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros.exchange.import_file import imported
from support.meshes import WEDGE, ascii_stl, binary_stl

HINT = 'meshes far larger than the robot: their files may be in millimetres'


def _arm(visual: str, length: float = 0.3, base: str = '', inertia: float = 0.0075) -> str:
    """A link with a mass of 1 kg at this distance (m) from its only joint."""
    return f"""<robot name="arm"><link name="base">{base}</link><link name="arm">
      <inertial><origin xyz="{length} 0 0"/><mass value="1"/><inertia ixx="{inertia}"
        iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>{visual}</link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/>
      <axis xyz="0 0 1"/></joint></robot>"""


def _visual(name: str, scale: str = '1 1 1') -> str:
    return f'<visual><geometry><mesh filename="{name}" scale="{scale}"/></geometry></visual>'


def _obj(triangles: np.ndarray) -> bytes:  # type: ignore[type-arg]
    places = [f'v {x:g} {y:g} {z:g}' for x, y, z in triangles.reshape(-1, 3)]
    faces = [f'f {3 * n + 1} {3 * n + 2} {3 * n + 3}' for n in range(len(triangles))]
    return '\n'.join(['# a mesh', *places, *faces, '']).encode()


def _head(folder: Path, text: str) -> str:
    (folder / 'arm.urdf').write_text(text)
    return imported(str(folder / 'arm.urdf')).partition('\nalf:')[0]


@pytest.mark.parametrize(
    ('name', 'written'), [('a.stl', binary_stl), ('b.STL', ascii_stl), ('c.obj', _obj)]
)
def test_millimetres_are_hinted_at(name: str, written: object, tmp_path: Path) -> None:
    """A wedge of 0.4 m on an arm of 0.3 m. It was shown 400 m wide, without a word."""
    (tmp_path / name).write_bytes(written(400.0 * WEDGE))  # type: ignore[operator]
    head = _head(tmp_path, _arm(_visual(name)))
    assert f'{HINT}, and then need a scale of 0.001: {name} (400 m)' in head
    assert HINT not in _head(tmp_path, _arm(_visual(name, '0.001 0.001 0.001')))
    assert HINT in _head(tmp_path, _arm(_visual(name, '-1 1 1')))


def test_what_may_be_as_large_is_no_hint(tmp_path: Path) -> None:
    """A crane, the building around a robot, a turntable whose inertia is a point, lost files."""
    (tmp_path / 'a.stl').write_bytes(binary_stl(120.0 * WEDGE))
    crane, building = _arm(_visual('a.stl'), 20.0), _arm('', base=_visual('a.stl'))
    rotor = _arm(_visual('a.stl'), 0.0, inertia=600.0)
    (tmp_path / 'b.stl').write_bytes(binary_stl(5.0 * WEDGE))
    table = _arm(_visual('b.stl'), 0.0, inertia=1e-6)
    lost = _arm(_visual('c.stl') + _visual('package://none/a.stl') + _visual('d.obj'))
    (tmp_path / 'd.obj').write_bytes(b'v 1e400 nan -\nv 1 2\n\0\xff')
    for text in (crane, building, rotor, table, lost):
        assert HINT not in _head(tmp_path, text)
