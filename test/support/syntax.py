"""Python files of the repository as syntax trees."""

from __future__ import annotations

import ast
import functools
from collections import deque
from collections.abc import Iterator
from pathlib import Path

from alf_ros.gc_pause import paused

# The fields of a syntax tree that hold statements, or parts of `try` and `match` with statements.
BLOCKS = 'body', 'orelse', 'handlers', 'finalbody', 'cases'


@functools.cache
def parsed(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    with paused():
        return ast.parse(path.read_text('utf-8'))


def statements(tree: ast.AST) -> Iterator[ast.AST]:
    """A node and the statements below it, also in functions and classes, like `ast.walk` without
    the expressions: nine tenths of a tree."""
    left = deque([tree])
    while left:
        node = left.popleft()
        yield node
        for name in BLOCKS:
            left.extend(getattr(node, name, ()))
