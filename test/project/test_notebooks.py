"""Notebooks of tutorials print what their pages say, cell by cell."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from support.paths import ROOT
from support.reader import environment, shown_by

SITE = ROOT / 'doc' / 'site'
# Pages, the cells of their notebooks, and the pictures that these draw.
PAGES = {
    'first_mechanism': (3, ['check/lambda.png']),
    'from_urdf': (5, ['check/leg.png', 'bolt.png']),
    'ros2_control': (4, []),
    'singular_position': (5, ['check/parallelogram.png', 'distance.png']),
    'fit_friction': (3, []),
    'thousand_runs': (4, []),
    'runs': (2, ['pin.png']),
}
MADE = """
import json, notebooks

print(json.dumps({page: json.loads(notebooks.notebook(page)) for page in notebooks.PAGES}))
"""
# A notebook's cells as they would run there one after another; no kernel is needed for that. A
# reader sees errors too, so they count as output. A node of the notebook is ended as by Ctrl-C.
RUN = """
import contextlib, io, json, signal, sys

namespace = {'__name__': '__main__'}
try:
    for cell in json.load(open(sys.argv[1], encoding='utf-8'))['cells']:
        if cell['cell_type'] == 'code':
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
                exec(''.join(cell['source']), namespace)
            shown = ''.join(line for output in cell['outputs'] for line in output['text'])
            assert printed.getvalue() == shown, (printed.getvalue(), shown)
            print('cell')
finally:
    if node := namespace.get('node_process'):
        node.send_signal(signal.SIGINT)
        print('node', node.wait())
"""


@pytest.fixture(scope='module')
def notebooks() -> Any:
    """All notebooks as they are stored, by page."""
    done = subprocess.run(
        [sys.executable, '-c', MADE],
        capture_output=True,
        text=True,
        env=os.environ | {'PYTHONPATH': os.pathsep.join([str(SITE), str(ROOT)])},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize('page', PAGES)
def test_a_notebook_prints_what_is_stored_in_it(notebooks: Any, page: str, tmp_path: Path) -> None:
    cells, pictures = PAGES[page]
    (tmp_path / 'it.ipynb').write_text(json.dumps(notebooks[page]), 'utf-8')
    (tmp_path / 'cells.py').write_text(RUN, 'utf-8')
    node = 'node 0\n' if page == 'ros2_control' else ''
    shown = shown_by(['cells.py', 'it.ipynb'], tmp_path, MPLBACKEND='Agg')
    assert shown == ('cell\n' * cells + node, '')
    for picture in pictures:
        assert (tmp_path / picture).stat().st_size > 10_000


def test_every_block_that_runs_is_a_cell(notebooks: Any) -> None:
    assert notebooks.keys() == PAGES.keys()
    for page, (cells, _) in PAGES.items():
        text = (ROOT / 'doc' / f'{page}.md').read_text('utf-8')
        blocks = text.count('```python\n') + text.count('```sh\n') + text.count('Save this as `')
        code = [cell for cell in notebooks[page]['cells'] if cell['cell_type'] == 'code']
        assert len(code) == cells == blocks, page
        printed = sum(bool(cell['outputs']) for cell in code)
        assert printed == text.count('```text\n') - (page == 'first_mechanism'), page


def test_a_node_begins_as_make_begins_it(notebooks: Any) -> None:
    text = (ROOT / 'doc' / 'ros2_control.md').read_text('utf-8')
    (line,) = (line for line in text.splitlines() if line.startswith('make run '))
    made = subprocess.run(
        ['make', '--dry-run', '--no-print-directory', '-C', str(ROOT), *line.split()[1:]],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()[-1]
    (cell,) = (
        ''.join(cell['source'])
        for cell in notebooks['ros2_control']['cells']
        if 'node_process = ' in ''.join(cell['source'])
    )
    arguments = made.replace("'", '').split()[1:]
    assert ', '.join(repr(argument) for argument in arguments) in cell


def test_the_block_for_controllers_is_the_one_of_the_package() -> None:
    text = (ROOT / 'doc' / 'ros2_control.md').read_text('utf-8')
    shown = text.partition('```xml\n')[2].partition('```')[0]
    assert shown in (ROOT / 'config/ros2_control/slider_crank.xml').read_text('utf-8')
