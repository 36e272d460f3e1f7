"""The page of modes: its frames keep all lengths, and a browser shows them without network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import equilibrium, modes
from alf_ros.commands.modes import main
from alf_ros.studies.statics.modes_page import page
from support.browser import CHROMIUM, Browser
from support.statics_scenes import chain


def test_no_bar_is_longer_in_a_frame() -> None:
    from alf_ros.studies.statics import modes_page

    found = modes(equilibrium(chain(3)))
    names = found.instant.model.point_names
    order = [names.index(f'P{k}') for k in range(4)]
    for k in range(3):
        frames = modes_page._film(found, k)[:, order]
        lengths = np.linalg.norm(np.diff(frames, axis=1), axis=2)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-9)
        assert len(frames) == 17 and np.abs(np.diff(frames, axis=0)).max() > 0.01
    assert (
        '</script>' not in page(found, '</script>', ()).split('type="application/json">')[1][:40]
    )


@pytest.mark.skipif(not CHROMIUM, reason='no chromium here: apt install chromium')
def test_the_page_in_a_browser(tmp_path: Path) -> None:
    scene = tmp_path / 'chain.yaml'
    scene.write_text(chain(3).text, 'utf-8')
    target = tmp_path / 'modes.html'
    assert main([str(scene), '--html', str(target)]) == 0
    with Browser(target.as_uri(), tmp_path / 'profile') as browser:
        assert browser.run("document.getElementById('modes').rows.length") == 3
        browser.run("playing && document.getElementById('play').click()")
        picture = "phase = 0.25, draw(), document.getElementById('stage').toDataURL()"
        browser.click('#modes tr:nth-child(1)')
        first = browser.run(picture)
        browser.click('#modes tr:nth-child(2)')
        assert browser.run('chosen') == 1 and browser.run(picture) != first
        assert browser.complaints == []
