"""Notebooks of tutorials: jupytext makes them from the pages, with text, code and output.

A page says what to save and which command to run; a notebook does it in Python. What a cell prints
is stored with it, as the page shows it.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from nbformat import v4
from sources import ROOT

# All blocks of these pages run one after another. Of tutorial.md most needs a second terminal.
PAGES = (
    'first_mechanism',
    'from_urdf',
    'ros2_control',
    'singular_position',
    'fit_friction',
    'thousand_runs',
    'runs',
)
_BLOCK = re.compile(r'^```(\w+)\n(.*?)^```\n', re.DOTALL | re.MULTILINE)
_SAVE = re.compile(r'Save this as `([\w.]+)`[^`]*\Z')
_IMAGE = re.compile(r'!\[[^\]]*\]\([^)]*\)\n?')
_LINK = re.compile(r'\[([^\]]+)\]\([^)]*\)')
_PRINTED = re.compile(r'```text\n(.*?)^```\s*', re.DOTALL | re.MULTILINE)
_KERNEL = {'name': 'python3', 'language': 'python', 'display_name': 'Python 3'}


def notebook(page: str) -> str:
    """The text of the notebook (.ipynb) of a page of doc/."""
    text, end, parts = (ROOT / 'doc' / f'{page}.md').read_text('utf-8'), 0, []
    for block in _BLOCK.finditer(text):
        before = text[end : block.start()]
        parts += [_plain(before), _runnable(before, block)]
        end = block.end()
    made = jupytext.reads(''.join([*parts, _plain(text[end:])]), fmt='md')
    made.cells = _with_outputs(made.cells)
    made.metadata = {'kernelspec': _KERNEL}
    for n, cell in enumerate(made.cells):  # so that a page gives one text
        cell.id = f'cell-{n}'
    nbformat.validate(made)
    return str(nbformat.writes(made)) + '\n'


def _plain(text: str) -> str:
    """Text of a page. A notebook travels alone: pictures and links stay behind."""
    return _LINK.sub(r'\1', _IMAGE.sub('', text))


def _runnable(before: str, block: re.Match[str]) -> str:
    """A block of a page as Markdown of jupytext, in which blocks of Python become cells."""
    kind, code = block.groups()
    name = _SAVE.search(before)
    if kind in ('yaml', 'xml') and name:
        code = _saving(name[1], code)
    elif kind == 'sh' and code.startswith('python -m alf_ros '):
        code = _command(code)
    elif kind == 'sh' and code.startswith('make run '):
        code = _node(code)
    else:
        return block[0]
    return f'```python\n{code}```\n'


def _saving(name: str, text: str) -> str:
    """Code that saves the text; the ';' hides how many characters these were."""
    return f'from pathlib import Path\n\nPath({name!r}).write_text("""{text}""");\n'


def _command(line: str) -> str:
    """A command of the package, called in this process; the ';' hides its exit code."""
    arguments = shlex.split(line)[3:]
    return f'from alf_ros.__main__ import main\n\nmain({arguments!r});\n'


def _node(line: str) -> str:
    """`make run` of a clone, as a process beside the notebook. It ends after its duration."""
    given = dict(part.split('=') for part in shlex.split(line)[2:])
    command = f"'simulator', '--scene', {given['SCENE']!r}, '--duration', {given['DURATION']!r}"
    return (
        'import subprocess\nimport sys\n\n'
        "screen = open('node.txt', 'w')\n"
        'node_process = subprocess.Popen(\n'
        f"    [sys.executable, '-m', 'alf_ros', {command}],\n"
        '    stdout=screen,\n    stderr=screen,\n)\n'
    )


def _with_outputs(cells: list[Any]) -> list[Any]:
    """The cells, in which text that follows code immediately is the output of this code."""
    kept: list[Any] = []
    for cell in cells:
        printed = _PRINTED.match(cell.source)
        if printed and kept and kept[-1].cell_type == 'code':
            kept[-1].outputs = [v4.new_output('stream', text=printed[1])]
            cell.source = cell.source[printed.end() :]
        if cell.source:
            kept.append(cell)
    return kept


def write(target: Path) -> None:
    """Write all notebooks, and a link to each below the title of its page, where sources are."""
    (target / 'notebooks').mkdir()
    for page in PAGES:
        (target / 'notebooks' / f'{page}.ipynb').write_text(notebook(page), 'utf-8')
        path = target / f'{page}.md'
        title, _, rest = path.read_text('utf-8').partition('\n')
        link = f'[This page as a notebook](notebooks/{page}.ipynb)'
        path.write_text(f'{title}\n\n{link}\n{rest}', 'utf-8')
