"""Wheels in moving pictures and on the page: their rims turn with their bodies."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from alf_ros.arrays import Floats
from alf_ros.commands.analyze import main
from alf_ros.logs import load
from alf_ros.logs.report.drawn_motion import DrawnMotion
from alf_ros.logs.report.summary import account
from support.log_files import make

BAR = (31, 111, 178)


def drawn(folder: Path, scene: str, ticks: int = 400) -> tuple[DrawnMotion, Floats]:
    """The motion of a log, and (frames, wheels, 3, 3) m: centre and two places of each rim."""
    motion = account(load(make(folder, scene, ticks=ticks)[0].parent)).motion
    assert motion is not None
    return motion, motion.places[:, motion.wheels].reshape(len(motion.t), -1, 3, 3)


@pytest.mark.parametrize(
    ('scene', 'radius', 'wheels'), [('coin', 0.0129, 1), ('rolling_disk', 0.5, 1)]
)
def test_a_rolling_wheel_touches_the_ground(
    tmp_path: Path, scene: str, radius: float, wheels: int
) -> None:
    _, places = drawn(tmp_path, scene)
    assert places.shape[1] == wheels
    a, b = (places[..., n, :] - places[..., 0, :] for n in (1, 2))
    for arm in (a, b):
        assert np.linalg.norm(arm, axis=-1) == pytest.approx(radius, rel=1e-9)
    assert np.sum(a * b, axis=-1) == pytest.approx(0.0, abs=1e-9 * radius**2)
    lowest = places[..., 0, 2] - np.hypot(a[..., 2], b[..., 2])
    assert lowest == pytest.approx(0.0, abs=1e-9)
    turned = np.unwrap(np.arctan2(b[:, 0, 2], a[:, 0, 2]))
    assert abs(turned[-1] - turned[0]) > 0.5


def test_gears_turn_as_willis_says(tmp_path: Path) -> None:
    """Each wheel of several joints counts once; the carrier turns rs/(rs + rr) of the sun."""
    _, places = drawn(tmp_path, 'planetary_gear', ticks=1000)
    centre, arm = places[..., 0, :2], places[..., 1, :2] - places[..., 0, :2]
    radii = np.linalg.norm(arm[0], axis=-1)
    assert sorted(radii) == pytest.approx([0.03, 0.03, 0.03, 0.03, 0.09])
    ring = int(np.argmax(radii))
    assert np.ptp(places[:, ring], axis=0).max() == 0.0
    away = np.linalg.norm(centre[0], axis=-1)
    (sun,) = [n for n in range(5) if away[n] == 0.0 and n != ring]
    planet = int(np.argmax(away))

    def turned(vectors: Floats) -> Floats:
        angle = np.unwrap(np.arctan2(vectors[:, 1], vectors[:, 0]))
        return angle - angle[0]

    assert turned(centre[:, planet]) == pytest.approx(0.25 * turned(arm[:, sun]), abs=1e-6)
    assert turned(arm[:, sun])[-1] > 0.1
    # outwards the planet rolls in the ring: (rr - rp)/rp turns backwards
    assert turned(arm[:, planet]) == pytest.approx(-2.0 * turned(centre[:, planet]), abs=1e-6)


def test_a_picture_and_the_page_show_the_wheel(tmp_path: Path) -> None:
    """The coin has one point and no bars: its rim is all that is drawn."""
    log = make(tmp_path, 'coin', ticks=200)[0].parent
    page, film = tmp_path / 'page.html', tmp_path / 'coin.webp'
    assert main([str(log), '-o', str(page), '--animation', str(film)]) == 0
    with Image.open(film) as picture:
        pixels = np.asarray(picture.convert('RGB')).astype(int)
    rim = np.argwhere(np.abs(pixels - BAR).max(axis=2) < 60)
    assert len(rim) > 100 and np.ptp(rim, axis=0).min() > 20
    wheels = re.search(r'"wheels": ?(\[[\d, ]*\])', page.read_text('utf-8'))
    assert wheels and json.loads(wheels[1]) == [1, 2, 3]
