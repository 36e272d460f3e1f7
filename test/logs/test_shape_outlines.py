"""Shapes in the page of `analyze` and in the live view: outlines where the shapes are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rclpy.serialization import deserialize_message
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.commands.analyze import main
from alf_ros.inspection.shape_places import DrawnShapes, shape_places
from alf_ros.logs import load
from alf_ros.logs.report import animation
from alf_ros.logs.report.shape_outlines import outlines
from alf_ros.logs.report.summary import account
from alf_ros.ros.messages.markers import markers
from alf_ros.ros.messages.shape_markers import shape_outline
from alf_ros.simulation.display_geometry import Display, poses
from support.browser import CHROMIUM, Browser
from support.log_files import make
from support.thorough import thinned

needs_chromium = pytest.mark.skipif(not CHROMIUM, reason='no chromium here: apt install chromium')
ARM: dict[str, Any] = {
    'name': 'arm',
    'mechanism': {
        'alf': 1,
        'space': 'spatial',
        'points': {
            'O': {'at': [0, 0, 0.3], 'fixed': True},
            'A': {'at': [0.5, 0, 0.3]},
        },
        'bodies': {
            'upper': {
                'points': ['O', 'A'],
                'mass': 1.0,
                'inertia': {'about_com': [0.001, 0.02, 0.02]},
                'com': [0.25, 0, 0],
                'shapes': [
                    {'box': {'size': [0.5, 0.08, 0.06]}, 'at': [0.25, 0, 0], 'rpy': [0.3, 0, 0]},
                    {'cylinder': {'radius': 0.07, 'length': 0.2}, 'rpy': ['pi/3', 0, 0]},
                    {'mesh': {'file': '/nowhere/hand.stl'}},
                    {'sphere': {'radius': 0.05}, 'at': [0.5, 0, 0], 'color': [1, 0, 0]},
                ],
            }
        },
        'joints': {
            'shoulder': {
                'type': 'revolute',
                'between': ['ground', 'upper'],
                'at': 'O',
                'axis': [0, 1, 0],
            }
        },
        'shapes': [{'cylinder': {'radius': 0.04, 'length': 0.5}, 'at': [0, 0.15, 0]}],
    },
    'effects': {'gravity': {'acceleration': [0, 0, -9.81]}},
}


@pytest.fixture(scope='module')
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp('arm'), ARM, ticks=200)[0].parent


def surface(kind: str, ends: Floats) -> Floats:
    """Places (k, 3) on a shape, from its middle and the ends of its half axes (4, 3)."""
    middle, axes = ends[0], ends[1:] - ends[0]
    if kind == 'box':
        corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return middle + corners @ axes
    angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    if kind == 'cylinder':
        rim = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
        return middle + np.vstack([rim, rim * [1, 1, -1]]) @ axes
    turns = Rotation.random(3000, random_state=1).as_matrix()[:, 0]
    return middle + np.linalg.norm(axes[0]) * turns


def area(outline: Floats) -> float:
    """Of a polygon (k, 2) whose corners are in order."""
    (x, y), (u, v) = outline.T, np.roll(outline, -1, axis=0).T
    return float(0.5 * abs(np.sum(x * v - y * u)))


def test_half_axes_are_those_of_the_shapes_in_the_world() -> None:
    simulation = Simulation(load_scene(ARM))
    simulation.step(150)
    shown = shape_places(simulation.scene.mechanism)
    assert shown is not None
    drawn = DrawnShapes(shown, {})
    kinds = [shape.kind for shape in drawn.shapes]
    assert kinds == ['cylinder', 'box', 'cylinder', 'sphere']
    (frame,) = poses(simulation.sample())
    place, turn = frame[:3], Rotation.from_quat(frame[3:]).as_matrix()
    post, box, hub, ball = drawn.places(frame[None]).reshape(4, 4, 3)
    assert post == pytest.approx(
        np.array([[0, 0.15, 0], [0.04, 0.15, 0], [0, 0.19, 0], [0, 0.15, 0.25]])
    )
    x, y, z = Rotation.from_euler('x', 0.3).as_matrix().T * [[0.25], [0.04], [0.03]]
    middle = np.array([0.25, 0, 0])
    local = np.array([middle, middle + x, middle + y, middle + z])
    assert box == pytest.approx(place + local @ turn.T, abs=1e-12)
    assert np.linalg.norm(hub[1:] - hub[0], axis=1) == pytest.approx([0.07, 0.07, 0.1])
    assert np.linalg.norm(ball[1:] - ball[0], axis=1) == pytest.approx(3 * [0.05])
    # the view makes the same of the markers
    data = markers(simulation.model, Display())(simulation.sample(), 1)
    heard = [m for m in deserialize_message(data, MarkerArray).markers if m.ns == 'shapes']
    outlines = [each for each in map(shape_outline, heard) if each is not None]
    assert [about['kind'] for about, _ in outlines] == kinds
    assert outlines[3][0]['color'] == [1, 0, 0, 1]
    for (_, ends), expected in zip(outlines, (post, box, hub, ball), strict=True):
        assert ends == pytest.approx(expected, abs=1e-12)


def test_markers_of_strangers_are_left_out() -> None:
    """Anybody may publish on the topic."""
    marker = Marker(type=Marker.CUBE, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    assert shape_outline(marker) is not None
    marker.pose.orientation.w = 0.0
    assert shape_outline(marker) is None
    marker.pose.orientation.w, marker.pose.position.x = 1.0, float('nan')
    assert shape_outline(marker) is None
    marker.pose.position.x = 0.0
    for kind in (Marker.MESH_RESOURCE, Marker.TEXT_VIEW_FACING, 99):
        marker.type = kind
        assert shape_outline(marker) is None


def test_a_log_is_drawn_with_the_shapes_of_its_scene(log: Path) -> None:
    motion = account(load(log)).motion
    assert motion is not None and motion.missing == ['hand.stl: no such file']
    assert [shape.kind for shape in motion.shapes] == ['cylinder', 'box', 'cylinder', 'sphere']
    drawn = motion.places[:, motion.shape_points].reshape(len(motion.t), 4, 4, 3)
    assert np.ptp(drawn[:, 0], axis=0).max() == 0.0  # of the ground
    centre = drawn[:, 3, 0]  # the ball is at the point A
    ends = motion.places[:, motion.links].reshape(len(motion.t), -1, 3)
    assert np.abs(ends - centre[:, None]).max(axis=2).min(axis=1).max() < 1e-9
    assert np.ptp(centre, axis=0).max() > 0.1


def test_outlines_of_the_moving_picture(log: Path, tmp_path: Path) -> None:
    """They enclose the shapes as seen, and the picture has their colours."""
    found = account(load(log))
    film, motion = animation.film(found, ''), found.motion
    assert motion is not None
    places = film.places[-1][motion.shape_points]
    whole = motion.places[-1][motion.shape_points].reshape(-1, 4, 3)
    for shape, ends, polygon in zip(
        motion.shapes, whole, outlines(motion.shapes, {}, places), strict=True
    ):
        seen = animation.projected(surface(shape.kind, ends), spatial=True)
        assert area(polygon) == pytest.approx(ConvexHull(seen).volume, rel=0.02)
        assert polygon.min(axis=0) == pytest.approx(seen.min(axis=0), abs=1e-3)
        assert polygon.max(axis=0) == pytest.approx(seen.max(axis=0), abs=1e-3)
    path = tmp_path / 'film.gif'
    assert main([str(log), '-o', str(tmp_path / 'page.html'), '--animation', str(path)]) == 0
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert('RGB')).astype(int)
    pale_red = (pixels[..., 0] > 240) & (np.ptp(pixels, axis=2) > 40)
    assert pale_red.sum() > 100


@needs_chromium
@pytest.mark.parametrize('width', thinned([1280, 390], keep=[390]))
def test_outlines_of_the_page_enclose_what_is_seen(log: Path, tmp_path: Path, width: int) -> None:
    """The convex hull of many places of each shape, projected by the page."""
    page = tmp_path / 'page.html'
    assert main([str(log), '-o', str(page)]) == 0
    with Browser(page.as_uri(), tmp_path / 'profile', (width, 800)) as browser:
        browser.until('stage.project !== undefined')
        places = browser.run(
            'motions[0].pick(motions[0].places(view.t), motions[0].shapePoints).map(Number)'
        )
        for n, kind in enumerate(('cylinder', 'box', 'cylinder', 'sphere')):
            ends = np.array(places).reshape(-1, 4, 3)[n]
            drawn = f'hull(stage.silhouette({{kind: {kind!r}}}, {ends.tolist()}))'
            outline = np.array(browser.run(f'{drawn}.map((place) => place.slice(0, 2))'))
            whole = surface(kind, ends).tolist()
            seen = np.array(browser.run(f'{whole}.map((x) => stage.project(...x).slice(0, 2))'))
            assert area(outline) == pytest.approx(ConvexHull(seen).volume, rel=0.01)
            assert outline.min(axis=0) == pytest.approx(seen.min(axis=0), abs=0.5)
            assert outline.max(axis=0) == pytest.approx(seen.max(axis=0), abs=0.5)
        assert browser.run('document.documentElement.scrollWidth') <= width
        assert browser.complaints == []
