"""The documentation site builds without a warning, and says what the package says of itself."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import alf_ros
from alf_ros import effects, resources
from alf_ros.commands import COMMANDS
from alf_ros.model import joints
from support.paths import ROOT
from support.some_scenes import SOME_SCENES
from support.thorough import LONG

SITE = ROOT / 'doc' / 'site'
BUILD = [sys.executable, str(SITE / 'build.py')]
SCENES = SOME_SCENES if LONG else ['bricard']  # of the gallery


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site of `make docs`, without films and with a part of the gallery: warnings are errors,
    and links are followed."""
    folder = tmp_path_factory.mktemp('docs')
    done = subprocess.run(
        [*BUILD, '--no-films', '--folder', str(folder), '--scenes', *SCENES],
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert (done.returncode, done.stderr) == (0, ''), done.stderr
    assert done.stdout.strip() == str(folder / 'html' / 'index.html')
    return folder / 'html'


class Text(HTMLParser):
    """The texts of a page, and the ids in it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.text, self.ids = '', set[str]()
        self.feed(path.read_text('utf-8'))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.ids |= {value or '' for name, value in attributes if name == 'id'}

    def handle_data(self, text: str) -> None:
        self.text += text


def test_every_page_of_the_repository_is_in_a_table_of_contents(site: Path) -> None:
    index = (site / 'index.html').read_text('utf-8')
    names = [path.stem for path in (ROOT / 'doc').glob('*.md')]
    assert len(names) > 15
    assert [name for name in names if f'href="{name}.html"' not in index] == []


def test_every_public_name_is_in_the_python_api(site: Path) -> None:
    page = Text(site / 'reference' / 'python_api.html')
    assert [name for name in alf_ros.__all__ if f'alf_ros.{name}' not in page.ids] == []
    for member in ('Simulation.run', 'Sample.reactions', 'Sample.qdd', 'Run.plot'):
        assert f'alf_ros.{member}' in page.ids
    assert 'With file (.png, .svg, .pdf) the picture is written there' in ' '.join(
        page.text.split()
    )


def test_every_command_is_there_with_its_options(site: Path) -> None:
    page = Text(site / 'reference' / 'commands.html')
    assert [name for name in COMMANDS if name.replace('_', '-') not in page.ids] == []
    shown = subprocess.run(
        [sys.executable, '-m', 'alf_ros', 'analyze', '--help'], capture_output=True, text=True
    ).stdout
    options = re.findall(r'^  (--\w+)', shown, re.MULTILINE)
    assert len(options) >= 4 and [each for each in options if each not in page.text] == []


def test_every_joint_effect_and_key_is_there(site: Path) -> None:
    of_joints, of_effects = (Text(site / 'reference' / f'{n}.html') for n in ('joints', 'effects'))
    for page, kinds in ((of_joints, joints.kinds()), (of_effects, effects.own())):
        assert [kind for kind in kinds if kind.replace('_', '-') not in page.ids] == []
    assert 'advance per turn (m), negative for a left-handed thread' in of_joints.text
    keys = Text(site / 'reference' / 'scene_keys.html').text
    for key in ('about_com', 'integrator', 'dop853_adaptive', 'couplings', 'velocities', '1e+08'):
        assert key in keys


def test_every_scene_is_in_the_gallery(site: Path) -> None:
    scenes = resources.library('scenes')
    for name in SCENES:
        page = Text(site / 'gallery' / f'{name}.html')
        assert scenes[name].read_text('utf-8').splitlines()[-1] in page.text
        assert (site / '_images' / f'{name}.png').stat().st_size > 5_000
    numbers = Text(site / 'gallery' / 'bricard.html').text
    expected = 'bodies 5 joints 6 coordinates 24 constraint rows 24 redundant rows 1 freedoms 1'
    assert expected in ' '.join(numbers.split())


def test_notebooks_are_linked_from_their_pages(site: Path) -> None:
    """test_notebooks.py runs them."""
    notebooks = sorted(path.stem for path in site.rglob('*.ipynb'))
    assert len(notebooks) > 5
    for page in notebooks:
        assert f'{page}.ipynb' in (site / f'{page}.html').read_text('utf-8')


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    (tmp_path / 'there.html').write_text('<h1 id="here">a</h1>', 'utf-8')
    links = ('there.html#here', '#top', 'https://example.org/x', 'there.html#gone', 'gone.html')
    lines = [f'<a href="{link}" id="top">x</a>' for link in (*links, '/etc/passwd', 'file:///x')]
    (tmp_path / 'index.html').write_text(''.join(lines), 'utf-8')
    code = 'import sys, pathlib, links; print(*links.broken(pathlib.Path(sys.argv[1])), sep="\\n")'
    done = subprocess.run(
        [sys.executable, '-c', code, str(tmp_path)],
        capture_output=True,
        text=True,
        env=os.environ | {'PYTHONPATH': str(SITE)},
    )
    assert done.stdout.splitlines() == [
        'index.html: /etc/passwd: not a place of this site',
        'index.html: file:///x: not a place of this site',
        'index.html: gone.html: no such file',
        'index.html: there.html#gone: no such place in the page',
    ]
