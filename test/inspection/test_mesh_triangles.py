"""Meshes as few triangles: formats, units, colours, and files that are none."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from alf_ros.errors import InputError
from alf_ros.inspection.mesh_triangles import MOST_TRIANGLES, read_mesh, read_meshes
from support.meshes import WEDGE, ascii_stl, binary_stl

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit meter="0.01" name="cm"/><up_axis>Y_UP</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="pa" count="9">0 0 0 100 0 0 0 200 0</float_array>
      <technique_common><accessor source="#pa" count="3" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n"><translate>300 0 0</translate>
    <instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
end_header
0 0 0 255 0 0
1 0 0 255 0 0
0 2 0 255 0 0
3 0 1 2
"""


def corners(mesh):
    """Places (m) of the corners of each triangle, in the axes of the file."""
    return (mesh.middle + mesh.halves * mesh.vertices)[mesh.faces]


@pytest.mark.parametrize('write', [ascii_stl, binary_stl])
def test_stl(tmp_path: Path, write) -> None:
    file = tmp_path / 'wedge.STL'
    file.write_bytes(write(WEDGE))
    mesh = read_mesh(str(file))
    assert corners(mesh) == pytest.approx(WEDGE, abs=1e-6)
    assert mesh.middle == pytest.approx([0.5, 0.5, 0.25]) and mesh.colors is None
    assert len(mesh.vertices) == 12 and not mesh.is_reduced  # each place once
    outer = np.abs(mesh.vertices[:, :2]).max(axis=1) == 1.0
    assert len(mesh.extremes) == outer.sum()


def test_formats_with_units_transforms_and_colours(tmp_path: Path) -> None:
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 2, 0]]], dtype=float)
    part = trimesh.Trimesh(triangle[0], [[0, 1, 2]])
    part.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(baseColorFactor=[0, 0, 255, 255])
    )
    moved = trimesh.Scene()
    moved.add_geometry(part, transform=trimesh.transformations.translation_matrix([3, 0, 0]))
    (tmp_path / 'a.obj').write_text('v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n')
    (tmp_path / 'b.ply').write_text(PLY)
    (tmp_path / 'c.glb').write_bytes(moved.export(file_type='glb'))
    (tmp_path / 'd.dae').write_text(DAE)
    a, b, c, d = (read_mesh(str(tmp_path / name)) for name in ('a.obj', 'b.ply', 'c.glb', 'd.dae'))
    assert corners(a) == pytest.approx(triangle) and corners(b) == pytest.approx(triangle)
    assert corners(c) == pytest.approx(triangle + [3, 0, 0])
    assert corners(d) == pytest.approx(triangle + [3, 0, 0])
    assert b.colors == pytest.approx(np.tile([1.0, 0.0, 0.0], (3, 1)))
    assert c.colors == pytest.approx(np.tile([0.0, 0.0, 1.0], (3, 1)))


def test_large_meshes_get_fewer_triangles(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=6, radius=2.0)
    assert len(ball.faces) > 4 * MOST_TRIANGLES
    file = tmp_path / 'ball.stl'
    file.write_bytes(ball.export(file_type='stl'))
    mesh = read_mesh(str(file))
    assert 0.4 * MOST_TRIANGLES < len(mesh.faces) <= MOST_TRIANGLES and mesh.is_reduced
    assert np.linalg.norm(corners(mesh), axis=2) == pytest.approx(2.0, abs=1e-5)
    reach = np.linalg.norm(mesh.extremes, axis=1)
    assert reach == pytest.approx(1.0) and len(mesh.extremes) > 100


def test_what_cannot_be_drawn_is_told(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe.stl')
    (tmp_path / 'text.stl').write_text('solid')
    (tmp_path / 'text.glb').write_text('no such thing')
    (tmp_path / 'none.obj').write_text('v 0 0 0\n')
    (tmp_path / 'old.3ds').touch()
    (tmp_path / 'nan.obj').write_text('v 0 0 nan\nv 1 0 0\nv 0 2 0\nf 1 2 3\n')
    with (tmp_path / 'huge.stl').open('wb') as huge:
        huge.truncate(1 << 30)
    names = [
        *('away.stl', 'pipe.stl', 'text.stl', 'text.glb', 'none.obj', 'nan.obj'),
        *('old.3ds', 'huge.stl'),
    ]
    found, faults = read_meshes([str(tmp_path / name) for name in names])
    assert not found and [fault.partition(':')[0] for fault in faults] == names
    assert faults[0] == 'away.stl: no such file' and faults[1] == 'pipe.stl: no such file'
    assert 'only .dae' in faults[6] and 'more than 64 MB' in faults[7]
    assert all('\n' not in fault for fault in faults)


def test_no_file_beside_a_mesh_is_read(tmp_path: Path) -> None:
    """Textures and materials are named by the file, which may be a stranger's."""
    secret = tmp_path / 'secret.mtl'
    secret.write_text('newmtl m\nKd 1 0 0\n')
    file = tmp_path / 'a.obj'
    file.write_text('mtllib secret.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n')
    assert read_mesh(str(file)).colors is None


def test_without_trimesh_it_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / 'wedge.stl'
    file.write_bytes(binary_stl(WEDGE))
    monkeypatch.setitem(sys.modules, 'trimesh', None)
    with pytest.raises(InputError, match=r'pip install .alf_ros\[view\].'):
        read_mesh(str(file))
