"""Photograph the delta robot in the page of `analyze`: `.venv/bin/python doc/pictures/solid.py`.

Needs chromium.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

from alf_ros import load_scene
from alf_ros.commands.analyze import main as analyze
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation import setup

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / 'test'))

from support.browser import Browser  # noqa: E402

SHOWN_AT, TICKS = 0.35, 200  # s
WINDOW = (880, 700)  # pixels


def main() -> None:
    """Write solid.png."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = LogRun(folder / 'log', setup.made(load_scene('delta_robot'), {}))
        run.send()
        for _ in range(TICKS):
            run.setup.simulation.step(run.setup.steps)
            run.send()
        run.close()
        page = folder / 'page.html'
        analyze([str(run.recorder.path), '-o', str(page)])
        with Browser(page.as_uri(), folder / 'profile', WINDOW) as browser:
            browser.until('!!stage.solids')
            browser.run("$('trails').checked = true; stage.camera.zoom = 1.3; stage.camera.y = 30")
            browser.run(f'goTo({SHOWN_AT}); drawStage()')
            browser.screenshot(folder / 'page.png')
            x, y, width, height = browser.run(
                '(({x, y, width, height}) => [x, y, width, height])'
                "(document.querySelector('section.stage').getBoundingClientRect())"
            )
        with Image.open(folder / 'page.png') as picture:
            picture.crop((x, y, x + width, y + height)).save(HERE / 'solid.png', optimize=True)


if __name__ == '__main__':
    main()
