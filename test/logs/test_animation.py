"""`analyze --animation`: the pictures show where the mechanism is, and say where they cannot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from alf_ros.commands.analyze import main
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.logs.report import animation
from alf_ros.logs.report.summary import account
from support.log_files import make
from support.thorough import thinned

BAR, RED = (31, 111, 178), (192, 39, 45)
CIRCLE = 6.0  # pixels: the circle of a joint hides the end of a bar


@pytest.fixture(scope='module')
def planar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2 s of the slider-crank: through its first singular position."""
    return make(tmp_path_factory.mktemp('planar'), 'slider_crank', ticks=1000)[0].parent


def coloured(picture: Image.Image, colour: tuple[int, int, int]) -> Any:
    """(k, 2) columns and rows of the pixels near a colour."""
    pixels = np.asarray(picture.convert('RGB')).astype(int)
    return np.argwhere(np.abs(pixels - colour).max(axis=2) < 60)[:, ::-1]


@pytest.mark.parametrize('ending', thinned(['gif', 'webp'], keep=['webp']))
def test_the_bars_are_where_the_mechanism_is(planar: Path, tmp_path: Path, ending: str) -> None:
    path = tmp_path / f'film.{ending}'
    assert main([str(planar), '-o', str(tmp_path / 'page.html'), '--animation', str(path)]) == 0
    (film,) = [animation.film(account(load(planar)), '')]
    with Image.open(path) as picture:
        frames = getattr(picture, 'n_frames', 1)
        assert frames == round(film.t[-1] * animation.FPS) + 1
        found, wanted, red = [], [], []
        for number in range(0, frames, 5):
            picture.seek(number)
            at_pass = coloured(picture, RED)
            bars = at_pass if len(at_pass) else coloured(picture, BAR)
            red.append(bool(len(at_pass)))
            found.append([bars.min(axis=0), bars.max(axis=0)])
            places = film.places[film.at(number / animation.FPS)][film.motion.links]
            wanted.append([places.min(axis=0), places.max(axis=0)])
    x, low = np.array(found)[:, 1, 0], np.array(wanted)[:, 1, 0]
    scale, offset = np.polyfit(low, x, 1)  # pixels per metre
    assert np.abs(scale * low + offset - x).max() < CIRCLE
    y, high = np.array(found)[:, 0, 1], np.array(wanted)[:, 1, 1]
    assert np.abs(np.polyval([-scale, np.mean(y + scale * high)], high) - y).max() < CIRCLE
    times = np.arange(0, frames, 5) / animation.FPS
    near = np.abs(times[:, None] - film.passes).min(axis=1) <= 0.12
    assert len(film.passes) and red == list(near)


def test_logs_stand_side_by_side_with_what_differs(planar: Path, tmp_path: Path) -> None:
    spatial = make(tmp_path / 'spatial', 'spatial_four_bar', ticks=50)[0].parent
    logs = [load(planar), load(spatial)]
    accounts = [account(log) for log in logs]
    solvers = [{'step': 1e-3, 'formulation': 'alf2'}, {'step': 1e-3, 'formulation': 'alf1'}]
    assert animation.titles(accounts, solvers) == ['slider_crank', 'spatial_four_bar']
    same = [accounts[0], accounts[0]]
    assert animation.titles(same, solvers) == ['formulation: alf2', 'formulation: alf1']
    films = [animation.film(each, 'x') for each in accounts]
    path = tmp_path / 'both.gif'
    assert animation.write(path, films, speed=2.0) == round(animation.FPS) + 1
    with Image.open(path) as picture:
        columns = coloured(picture, BAR)[:, 0]
        half = picture.size[0] / 2
        assert (columns < half).any() and (columns > half).any()


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['--speed', '2'], '--speed: has no meaning without --animation'),
        (['--animation', 'film.avi'], "got 'film.avi'; expected .gif, .webp, .mp4"),
        (['--animation', 'film.gif', '--speed', '0'], "--speed: no speed, got '0'"),
        (['--animation', 'film.gif', '--speed', 'nan'], "--speed: not a finite number: 'nan'"),
        (['--animation', 'film.gif', '--speed', '1e-4'], 'would have 500001 pictures'),
        (['--animation', 'none/film.gif'], 'none/film.gif: cannot be written: No such file'),
    ],
)
def test_what_cannot_be_drawn_is_one_line(
    planar: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        main([str(planar), '-o', 'page.html', *options])
    assert said in str(caught.value) and '\n' not in str(caught.value)


def test_a_wrong_format_is_told_before_the_page_is_written(
    planar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match='no format'):
        main([str(planar), '-o', 'page.html', '--animation', 'film.avi'])
    assert not any(tmp_path.iterdir())


def test_mp4_without_ffmpeg_names_the_program(
    planar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('PATH', str(tmp_path))
    film = animation.film(account(load(planar)), '')
    with pytest.raises(InputError, match='MP4 needs the program ffmpeg'):
        animation.write(tmp_path / 'film.mp4', [film])
