"""Notebooks of the pages whose code runs by itself: the page's text, its code, its output.

A page says what to save and which command to run; a notebook does it in Python. What a cell prints
is stored with it, as the page shows it.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import nbformat
from nbformat import v4
from sources import ROOT

# Of tutorial.md most needs a second terminal.
PAGES = ('first_mechanism', 'runs')
_BLOCK = re.compile(r'^```(\w+)\n(.*?)^```\n', re.DOTALL | re.MULTILINE)
_SAVE = re.compile(r'Save this as `([\w.]+)`')
_IMAGE = re.compile(r'!\[[^\]]*\]\([^)]*\)\n?')
_LINK = re.compile(r'\[([^\]]+)\]\([^)]*\)')


def notebook(page: str) -> str:
    """The text of the notebook (.ipynb) of a page of doc/."""
    cells: list[dict[str, Any]] = []
    text, end, saved = (ROOT / 'doc' / f'{page}.md').read_text('utf-8'), 0, ''
    for block in _BLOCK.finditer(text):
        before, (kind, code) = text[end : block.start()], block.groups()
        end = block.end()
        saved = (_SAVE.findall(before) or [''])[-1]
        printed = kind == 'text' and not before.strip() and cells and cells[-1]['code']
        _add_text(cells, before)
        if printed:
            cells[-1]['output'] = code
        elif kind == 'python':
            cells.append({'code': code})
        elif kind == 'yaml' and saved:
            cells.append({'code': _saving(saved, code)})
        elif kind == 'sh' and code.startswith('python -m alf_ros '):
            cells.append({'code': _command(code)})
        else:
            _add_text(cells, block[0])
    _add_text(cells, text[end:])
    made = _made(cells)
    nbformat.validate(made)
    return str(nbformat.writes(made)) + '\n'


def _saving(name: str, text: str) -> str:
    """Code that saves the text; the ';' hides how many characters these were."""
    return f'from pathlib import Path\n\nPath({name!r}).write_text("""{text}""");\n'


def _command(line: str) -> str:
    """A command of the package, called in this process; the ';' hides its exit code."""
    arguments = shlex.split(line)[3:]
    return f'from alf_ros.__main__ import main\n\nmain({arguments!r});\n'


def _add_text(cells: list[dict[str, Any]], text: str) -> None:
    """Join adjacent texts in a cell. A notebook travels alone: pictures and links stay behind."""
    text = _LINK.sub(r'\1', _IMAGE.sub('', text)).strip()
    if not text:
        return
    if cells and not cells[-1]['code']:
        cells[-1]['text'] += f'\n\n{text}'
    else:
        cells.append({'code': '', 'text': text})


def _made(cells: list[dict[str, Any]]) -> Any:
    """As a notebook. Numbers of cells are their names, so that a page gives one text."""
    made = []
    for n, cell in enumerate(cells):
        if not cell['code']:
            made.append(v4.new_markdown_cell(cell['text'], id=f'cell-{n}'))
            continue
        printed = cell.get('output')
        outputs = [v4.new_output('stream', text=printed)] if printed else []
        made.append(v4.new_code_cell(cell['code'].strip(), outputs=outputs, id=f'cell-{n}'))
    kernel = {'name': 'python3', 'language': 'python', 'display_name': 'Python 3'}
    return v4.new_notebook(cells=made, metadata={'kernelspec': kernel})


def write(target: Path) -> None:
    """Write all notebooks, and a link to each below the title of its page, where sources are."""
    (target / 'notebooks').mkdir()
    for page in PAGES:
        (target / 'notebooks' / f'{page}.ipynb').write_text(notebook(page), 'utf-8')
        path = target / f'{page}.md'
        title, _, rest = path.read_text('utf-8').partition('\n')
        link = f'[This page as a notebook](notebooks/{page}.ipynb)'
        path.write_text(f'{title}\n\n{link}\n{rest}', 'utf-8')
