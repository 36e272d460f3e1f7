"""Edges of shapes in the drawing of `check`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros.arrays import Floats
from alf_ros.inspection.mechanism_plot import Picture
from alf_ros.inspection.mesh_lines import MeshLines
from alf_ros.inspection.mesh_triangles import read_mesh
from alf_ros.inspection.shape_edges import edges
from alf_ros.inspection.soundness import examine
from alf_ros.mechanism import VisualShape
from alf_ros.scene.scene import Scene, load_scene
from support.meshes import WEDGE, binary_stl

AT, TURNED = (0.3, -0.2, 0.5), (0.0, math.pi / 2.0, 0.0)  # z of the shape is x of the body


def wheel(shapes: Any) -> Scene:
    """A body that turns about its one point, which is fixed at a height of 0.5 m."""
    return load_scene(
        {
            'mechanism': {
                'alf': 1,
                'space': 'spatial',
                'points': {'C': {'at': [0, 0, 0.5], 'fixed': True}},
                'bodies': {
                    'wheel': {
                        'points': ['C'],
                        'mass': 1.0,
                        'inertia': {'about_com': [0.1, 0.2, 0.1]},
                        'shapes': shapes,
                    }
                },
                'joints': {
                    'hub': {
                        'type': 'revolute',
                        'between': ['ground', 'wheel'],
                        'at': 'C',
                        'axis': [0, 0, 1],
                    }
                },
            }
        }
    )


def corners(shape: VisualShape) -> Floats:
    return np.vstack(edges(shape)) - AT


def test_of_a_box() -> None:
    found = corners(VisualShape('box', (0.2, 0.4, 0.6), AT, TURNED))
    assert np.abs(found) == pytest.approx(np.tile([0.3, 0.2, 0.1], (len(found), 1)))
    assert len(np.unique(found.round(9), axis=0)) == 8


def test_of_a_cylinder() -> None:
    found = corners(VisualShape('cylinder', (0.1, 0.6), AT, TURNED))
    assert np.hypot(found[:, 1], found[:, 2]) == pytest.approx(np.full(len(found), 0.1))
    assert np.abs(found[:, 0]) == pytest.approx(np.full(len(found), 0.3))


def test_of_a_capsule_and_a_mesh() -> None:
    found = corners(VisualShape('capsule', (0.1, 0.6), AT, TURNED))
    axis = np.clip(found[:, 0], -0.3, 0.3)
    from_axis = np.linalg.norm(found - np.column_stack([axis, 0.0 * axis, 0.0 * axis]), axis=1)
    assert from_axis.max() == pytest.approx(0.1)
    assert np.abs(found[:, 0]).max() == pytest.approx(0.4)
    assert edges(VisualShape('mesh', (1.0, 1.0, 1.0), file='/x.stl')) == []


def seen(triangles: Floats, folder: Path, towards: Floats) -> Floats:
    """(k, 2, 3) lines of a mesh that is drawn twice as tall."""
    file = folder / 'mesh.stl'
    file.write_bytes(binary_stl(triangles))
    lines = MeshLines(read_mesh(str(file)), np.array([1.0, 1.0, 2.0])).seen_along(towards)
    assert np.isnan(lines[2::3]).all()
    return lines.reshape(-1, 3, 3)[:, :2]


@pytest.mark.parametrize('towards', [(0.0, 0.0, 1.0), (0.3, -0.8, 0.5)])
def test_a_mesh_has_its_sharp_edges(towards: tuple[float, ...], tmp_path: Path) -> None:
    """The prism over an L has 18, and sides that are cut into triangles."""
    found = seen(WEDGE, tmp_path, np.array(towards))
    assert len(found) == 18
    assert np.abs(found).reshape(-1, 3).max(axis=0) == pytest.approx([1.0, 1.0, 1.0])
    long = sorted(np.linalg.norm(found[:, 1] - found[:, 0], axis=1))
    assert long == pytest.approx(sorted([1.0, 0.4, 0.6, 0.6, 0.4, 1.0] * 2 + [1.0] * 6))


def test_a_round_mesh_has_its_contour(tmp_path: Path) -> None:
    """A cone of 40 sides: from the side its rim and two lines to the tip, from below its rim."""
    turn = np.linspace(0.0, 2.0 * np.pi, 41)
    rim = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    tip, middle = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    pairs = list(zip(rim[:-1], rim[1:], strict=True))
    cone = np.array([[a, b, tip] for a, b in pairs] + [[b, a, middle] for a, b in pairs])
    assert len(seen(cone, tmp_path, np.array([0.1, 1.0, 0.05]))) == 42
    assert len(seen(cone, tmp_path, np.array([0.0, 0.0, -1.0]))) == 40


def test_triangles_without_an_area_have_no_lines(tmp_path: Path) -> None:
    flat = np.array([[[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    assert len(seen(flat, tmp_path, np.array([0.0, 0.0, 1.0]))) == 0
    both = np.concatenate([flat, WEDGE])
    assert len(seen(both, tmp_path, np.array([0.0, 0.0, 1.0]))) == 18


def test_the_picture_shows_meshes(tmp_path: Path) -> None:
    """Its limits hold them. A file that cannot be drawn is named."""
    good, bad = tmp_path / 'mesh.stl', tmp_path / 'bad.stl'
    good.write_bytes(binary_stl(WEDGE))
    bad.write_bytes(b'solid')
    shapes = [
        {'mesh': {'file': str(good)}, 'at': [0, 0, 0.5], 'rpy': [0, math.pi / 2, 0]},
        {'mesh': {'file': str(bad)}},
    ]
    picture = Picture(examine(wheel(shapes)))
    assert picture.high[2] > 0.9  # the fixed point is at 0.5
    assert len(picture.meshes) == 1
    along = picture.meshes[0].seen(np.array([0.0, 0.0, 1.0]))
    assert along[~np.isnan(along[:, 0])].min(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert picture.missing == ['bad.stl: has no triangles']


def test_the_picture_has_room_for_them() -> None:
    """A wheel on an axle: its point is the only place that the drawing had."""
    picture = Picture(examine(wheel([{'cylinder': {'radius': 0.4, 'length': 0.1}}])))
    assert (picture.low[:2] < -0.4).all() and (picture.high[:2] > 0.4).all()
    assert {colour for colour, _ in picture.shapes} == {'#0072b2'}
