"""Solid bodies in the page of `analyze` and in the live view: pixels where the shapes are."""

from __future__ import annotations

import base64
import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from alf_ros import load_scene
from alf_ros.arrays import Floats
from alf_ros.commands.analyze import main
from alf_ros.logs.report import solid_bodies
from alf_ros.ros.view.server import POLICY
from support.browser import CHROMIUM, Browser
from support.log_files import make
from support.meshes import WEDGE, binary_stl
from support.ros_node import START_LIMIT, SimulatorProcess
from support.view_process import ViewProcess

pytestmark = pytest.mark.skipif(not CHROMIUM, reason='no chromium here: apt install chromium')
RED, GREEN, BLUE = [1, 0, 0], [0, 1, 0], [0, 0, 1]


def scene(mesh: Path) -> dict[str, Any]:
    """A swing beside a red box before a green one, a cylinder, and a mesh shaped as an L."""
    swing = {'points': ['O', 'A'], 'mass': 1.0, 'inertia': {'about_com': [0.1, 0.1, 0.1]}}
    hinge = {'type': 'revolute', 'between': ['ground', 'swing'], 'at': 'O', 'axis': [0, 1, 0]}
    laid = {'at': [1, 0, 0.5], 'rpy': ['pi/2', 0, 0]}
    shapes: list[dict[str, Any]] = [
        {'box': {'size': [0.6, 0.2, 0.6]}, 'at': [0, -0.5, 1], 'color': RED},
        {'box': {'size': [1.0, 0.2, 0.4]}, 'at': [0.2, 0.5, 1], 'color': GREEN},
        {'mesh': {'file': str(mesh), 'scale': [0.5, 0.5, 2]}, **laid, 'color': BLUE},
        {'mesh': {'file': '/nowhere/away.stl'}},
    ]
    return {
        'name': 'swing',
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {'O': {'at': [-1, 0, 1], 'fixed': True}, 'A': {'at': [-0.5, 0, 1]}},
            'bodies': {'swing': {**swing, 'com': [0.25, 0, 0], 'shapes': [_hub()]}},
            'joints': {'hinge': hinge},
            'shapes': shapes,
        },
        'effects': {'gravity': {'acceleration': [0, 0, -9.81]}},
    }


def _hub() -> dict[str, Any]:
    return {'cylinder': {'radius': 0.05, 'length': 0.3}, 'rpy': ['pi/2', 0, 0]}


@pytest.fixture(scope='module')
def given(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    mesh = tmp_path_factory.mktemp('meshes') / 'l.stl'
    mesh.write_bytes(binary_stl(WEDGE))
    return scene(mesh)


@pytest.fixture(scope='module')
def log(given: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp('swing'), given, ticks=20)[0].parent


@pytest.fixture(scope='module')
def page(log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp('page') / 'page.html'
    assert main([str(log), '-o', str(target)]) == 0
    return target


@pytest.fixture(scope='module')
def solid(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(page.as_uri(), tmp_path_factory.mktemp('profile')) as browser:
        browser.until('!!stage.solids')
        browser.run("$('reactions').checked = false; draw()")
        yield browser


def look(browser: Browser, yaw: float, pitch: float) -> Any:
    """(height, width, 3) the picture of the stage, seen from there."""
    browser.run(f'Object.assign(stage.camera, {{yaw: {yaw}, pitch: {pitch}}}); drawStage()')
    text = browser.run("$('stage').toDataURL()").partition(',')[2]
    image = Image.open(io.BytesIO(base64.b64decode(text)))
    white = Image.new('RGBA', image.size, 'white')
    return np.asarray(Image.alpha_composite(white, image.convert('RGBA')).convert('RGB'))


def colored(picture: Any, color: list[int]) -> Any:
    """Pixels of a colour, however bright."""
    own, others = np.array(color) > 0, np.array(color) == 0
    shades = picture.astype(float)
    return shades[..., own].min(axis=2) > 2.0 * shades[..., others].max(axis=2) + 20.0


def inside(picture: Any, polygon: Floats, room: float = 0.0) -> Any:
    """Pixels in a polygon (k, 2), grown about its middle by a few pixels."""
    middle = polygon.mean(axis=0)
    away = polygon - middle
    grown = middle + away * (1.0 + room / np.linalg.norm(away, axis=1, keepdims=True))
    mask = Image.new('1', picture.shape[1::-1])
    ImageDraw.Draw(mask).polygon([tuple(place) for place in grown.tolist()], fill=1)
    return np.asarray(mask)


def projected(browser: Browser, places: Floats) -> Floats:
    """(k, 2) pixels of places (k, 3) m."""
    return np.array(browser.run(f'{places.tolist()}.map((x) => stage.project(...x).slice(0, 2))'))


def outline(browser: Browser, places: Floats) -> Floats:
    """The convex outline on the screen of places (k, 3) m."""
    return np.array(browser.run(f'hull({projected(browser, places).tolist()})'))


def box(at: list[float], size: list[float]) -> Floats:
    """(8, 3) its corners."""
    corners = np.array(np.meshgrid(*3 * [[-0.5, 0.5]])).reshape(3, -1).T
    return np.array(at) + corners * size


RED_BOX, GREEN_BOX = box([0, -0.5, 1], [0.6, 0.2, 0.6]), box([0.2, 0.5, 1], [1.0, 0.2, 0.4])


@pytest.mark.parametrize(
    ('yaw', 'pitch', 'near', 'far'),
    [
        (0.0, 0.0, (RED_BOX, RED), (GREEN_BOX, GREEN)),
        (np.pi, 0.0, (GREEN_BOX, GREEN), (RED_BOX, RED)),
        (0.35, 0.3, (RED_BOX, RED), (GREEN_BOX, GREEN)),
    ],
)
def test_bodies_are_where_they_are_projected_and_hide_others(
    solid: Browser, yaw: float, pitch: float, near: Any, far: Any
) -> None:
    picture = look(solid, yaw, pitch)
    front, back = outline(solid, near[0]), outline(solid, far[0])
    shown, hidden = inside(picture, front), inside(picture, back)
    seen = colored(picture, near[1])
    assert seen[inside(picture, front, -2.0)].all()
    assert not seen[~inside(picture, front, 2.0)].any()
    assert (shown & hidden).sum() > 200  # one is before the other
    seen = colored(picture, far[1])
    assert seen[inside(picture, back, -2.0) & ~inside(picture, front, 2.0)].all()
    assert not seen[inside(picture, front, -2.0) | ~inside(picture, back, 2.0)].any()


def test_faces_are_lit(solid: Browser) -> None:
    """Three faces of the red box in three shades."""
    picture = look(solid, 0.6, 0.5)
    reds = picture[colored(picture, RED)][:, 0]
    _, counts = np.unique(reds, return_counts=True)
    assert sorted(counts)[-3] > 100


def test_a_mesh_is_shown_with_its_notch(solid: Browser) -> None:
    picture = look(solid, 0.0, 0.0)
    blue = colored(picture, BLUE)
    turned = WEDGE.reshape(-1, 3) * [0.5, 0.5, 2.0]
    places = np.array([1, 0, 0.5]) + turned[:, [0, 2, 1]] * [1, -1, 1]
    whole = inside(picture, outline(solid, places))
    notch = np.array([[0.45, 0, 0.45], [1, 0, 0.45], [0.45, 0, 1]]) * 0.5 + [1, 0, 0.5]
    bay = inside(picture, projected(solid, notch), -2.0)
    assert bay.sum() > 100 and not blue[bay].any()
    assert not blue[~inside(picture, outline(solid, places), 2.0)].any()
    # an L of width 0.4 in a hull that lacks half of the rest
    assert blue.sum() == pytest.approx(whole.sum() * 0.64 / 0.82, rel=0.05)


def test_the_page_says_what_is_not_drawn(solid: Browser) -> None:
    assert 'away.stl: no such file' in solid.run("$('about').textContent")
    assert solid.run('motions[0].missing') == 1 and solid.run('stage.flat') == ''
    assert solid.complaints == []


def test_bodies_in_the_plane_keep_their_depth(tmp_path: Path) -> None:
    """Without it they are black. The view encloses both ends of a shape."""
    shape = {'box': {'size': [1.4, 0.2, 0.3]}, 'at': [0.5, 0], 'color': RED}
    bar = {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod', 'shapes': [shape]}
    given = {
        'name': 'bar',
        'mechanism': {
            'alf': 1,
            'space': 'planar',
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
            'bodies': {'bar': bar},
            'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
        },
    }
    target = tmp_path / 'page.html'
    assert main([str(make(tmp_path / 'log', given, ticks=20)[0].parent), '-o', str(target)]) == 0
    with Browser(target.as_uri(), tmp_path / 'profile') as browser:
        browser.until('!!stage.solids')
        browser.run("$('reactions').checked = false; draw()")
        text = browser.run("$('stage').toDataURL()").partition(',')[2]
        shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(text))).convert('RGB'))
        face = outline(browser, box([0.5, 0, 0], [1.4, 0.2, 0]))
        assert colored(shown, RED)[inside(shown, face, -2.0)].mean() > 0.8  # a line is before it
        low, high = browser.run('stage.box')
        assert np.allclose([low, high], [[-0.2, -0.1, -0.15], [1.2, 0.1, 0.15]], atol=1e-3)
        assert browser.complaints == []


@pytest.mark.parametrize('width', [390, 1280])
def test_without_webgl_there_are_outlines(page: Path, tmp_path: Path, width: int) -> None:
    with Browser(page.as_uri(), tmp_path / 'profile', (width, 800), flat=True) as browser:
        browser.until("stage.flat === 'outlines only: this browser has no WebGL'")
        picture = look(browser, 0.0, 0.0).astype(int)
        pale = (picture[..., 2] - picture[..., 0] > 30) & (picture[..., 2] > 200)
        bay = np.array([[0.45, 0, 0.45], [0.6, 0, 0.45], [0.45, 0, 0.6]]) * 0.5 + [1, 0, 0.5]
        assert pale[inside(picture, projected(browser, bay))].mean() > 0.9  # a convex outline
        assert browser.complaints == []


@pytest.fixture
def no_trimesh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As where it is not installed."""
    known = (solid_bodies.three_js, solid_bodies.packed_script)
    monkeypatch.setitem(sys.modules, 'trimesh', None)
    for each in known:
        each.cache_clear()
    yield
    for each in known:
        each.cache_clear()


@pytest.mark.usefixtures('no_trimesh')
def test_without_trimesh_the_page_says_how_to_get_solids(
    log: Path, page: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / 'page.html'
    assert main([str(log), '-o', str(target)]) == 0
    assert solid_bodies.HINT in capsys.readouterr().out
    text = target.read_text('utf-8')
    assert f'outlines only: {solid_bodies.HINT}' in text
    assert page.stat().st_size - len(text) > 200_000  # nothing of three.js is in it


def test_the_live_view_shows_the_mesh(given: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / 'swing.yaml'
    path.write_text(load_scene(given).text, 'utf-8')
    options = ['--no-record', '--scene', str(path)]
    with SimulatorProcess(tmp_path / 'run', *options).wait_running() as node:
        with ViewProcess() as view, Browser(view.url, tmp_path / 'profile') as page:
            page.until('!!stage.solids && picture?.shapes?.length === 4', START_LIMIT)
            page.until('!!picture.shapes[2].mesh && !!meshOf(picture.shapes[2].mesh)')
            assert page.run('picture.missing') == 1
            places = 'picture?.shape_points?.slice(36).join()'
            first = page.until(places)
            page.until(f"({places} ?? '{first}') !== '{first}'")
            page.run("$('reactions').checked = false")
            blue = colored(look(page, 0.0, 0.0), BLUE)
            assert blue.sum() > 200
            policy = "fetch('three.js').then((x) => x.headers.get('Content-Security-Policy'))"
            assert page.run(policy) == POLICY
            assert page.complaints == []
        assert node.stop() == 0
