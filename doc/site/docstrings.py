"""Docstrings of this package, which are plain text with `code`, for Sphinx and for Markdown."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

_CODE = re.compile(r'(`[^`]+`)')
_RST = re.compile(r'([\\*|_])')
_MARKDOWN = re.compile(r'([\\*|_<>\[\]#])')


def restructured(lines: Sequence[str]) -> list[str]:
    """The lines as reStructuredText that shows them as they are."""
    text = _each('\n'.join(lines), _rst_code, lambda plain: _RST.sub(r'\\\1', plain))
    return text.split('\n')


def _rst_code(code: str) -> str:
    # a literal may not touch a letter: '\ ' is an end of a word that is not seen
    return rf'\ ``{code.strip("`")}``\ '


def markdown(text: str) -> str:
    """Text as Markdown that shows it as it is, also in the cell of a table."""
    return _each(
        text, lambda code: code.replace('|', r'\|'), lambda plain: _MARKDOWN.sub(r'\\\1', plain)
    )


def _each(text: str, code: Callable[[str], str], plain: Callable[[str], str]) -> str:
    """The text with `code` in backticks changed by `code`, and the text between by `plain`."""
    parts = _CODE.split(text)
    return ''.join(code(part) if n % 2 else plain(part) for n, part in enumerate(parts))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown; its cells are Markdown."""
    lines = [head, ['---'] * len(head), *rows]
    return ''.join(f'| {" | ".join(" ".join(cell.split()) for cell in row)} |\n' for row in lines)


def paragraphs(docstring: str) -> str:
    """A docstring as Markdown; indented paragraphs keep their layout."""
    found = []
    for part in docstring.strip().split('\n\n'):
        lines = part.strip('\n').splitlines()
        if all(line.startswith('    ') for line in lines):
            found.append('\n'.join(['```text', *(line[4:] for line in lines), '```']))
        else:
            found.append(markdown(' '.join(line.strip() for line in lines)))
    return '\n\n'.join(found) + '\n'
