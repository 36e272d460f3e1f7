"""The pages of the repository, copied side by side into the folder from which Sphinx builds."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
# Beside those of doc/: where they are in the repository, and their names on the site
_MORE = {'CONTRIBUTING.md': 'contributing.md', 'SECURITY.md': 'reporting.md'}
_LINK = re.compile(r'(\]\()([^)\s]+)(\))')
_FENCE = re.compile(r'^```.*?^```$', re.DOTALL | re.MULTILINE)


def pages() -> dict[Path, str]:
    """Every page by its file, with its name on the site."""
    found = {path: path.name for path in sorted((ROOT / 'doc').glob('*.md'))}
    return found | {ROOT / name: new for name, new in _MORE.items() if (ROOT / name).is_file()}


def copy(target: Path) -> None:
    """Copy all pages, and the files to which they link; links lead where the copies are."""
    for path, name in pages().items():
        text = path.read_text('utf-8')
        (target / name).write_text(_relinked(text, path.parent, target), 'utf-8')
    shutil.copy(ROOT / 'CHANGELOG.rst', target / 'changes.rst')
    index = (HERE / 'index.md').read_text('utf-8')
    (target / 'index.md').write_text(_relinked(index, ROOT / 'doc', target), 'utf-8')


def _relinked(text: str, folder: Path, target: Path) -> str:
    """The text with its links, but for code in it."""
    parts, end = [], 0
    for fence in _FENCE.finditer(text):
        parts += [_LINK.sub(_to_copies(folder, target), text[end : fence.start()]), fence[0]]
        end = fence.end()
    return ''.join([*parts, _LINK.sub(_to_copies(folder, target), text[end:])])


def _to_copies(folder: Path, target: Path) -> Callable[[re.Match[str]], str]:
    """A function that replaces a link of a page in `folder`, and copies the file of the link."""
    names = pages()

    def lead(match: re.Match[str]) -> str:
        link, hash_, anchor = match[2].partition('#')
        if not link or '://' in link or link.startswith('mailto:'):
            return match[0]
        path = Path(os.path.normpath(folder / link))
        if path in names:
            new = names[path]
        elif path.is_file():
            new = f'files/{path.relative_to(ROOT).as_posix()}'
            (target / new).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, target / new)
        else:
            new = link  # Sphinx warns of it
        return f'{match[1]}{new}{hash_}{anchor}{match[3]}'

    return lead
