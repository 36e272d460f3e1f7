"""The README, the documents and the code number equations as the paper does."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from pathlib import Path

from support.paths import ROOT

METHOD = (ROOT / 'doc/method.md').read_text(encoding='utf-8')
NUMBER = r'(?<!\w)\((\d{1,2})[a-z]?\)'


def numbers(text: str) -> set[int]:
    """Numbers of equations in a text, (24)-(27) as all four."""
    found = {int(n) for n in re.findall(NUMBER, text)}
    for first, last in re.findall(rf'{NUMBER}\s*-\s*{NUMBER}', text):
        found.update(range(int(first), int(last) + 1))
    return found


def said(path: Path) -> str:
    """Comments and docstrings of a file."""
    source = path.read_text(encoding='utf-8')
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    texts = [token.string for token in tokens if token.type == tokenize.COMMENT]
    kinds = ast.Module, ast.ClassDef, ast.FunctionDef
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds))
    return '\n'.join([*texts, *(ast.get_docstring(node) or '' for node in nodes)])


def table() -> dict[str, str]:
    """The rows of the list in method.md: where an equation is, by what its first cell says."""
    section = METHOD.partition('### Numbers of equations')[2].partition('\n## ')[0]
    rows = re.findall(r'^\| (\(.*?) \| .* \| (.*) \|$', section, re.MULTILINE)
    return dict(rows)


def test_each_number_in_the_code_and_the_readme_is_in_the_list() -> None:
    listed = numbers(' '.join(table()))
    assert {26, 30, 33, 35, 38} <= listed
    files = [*(ROOT / 'alf_ros/kernel').rglob('*.py')]
    files += (ROOT / 'alf_ros/simulation/formulations').glob('*.py')
    for path in files:
        assert numbers(said(path)) <= listed, path
    for page in (ROOT / 'README.md', *(ROOT / 'doc').glob('*.md')):
        assert numbers(page.read_text(encoding='utf-8')) <= listed, page


def test_each_file_of_the_list_has_the_number() -> None:
    for cell, where in table().items():
        for name in re.findall(r'`(kernel/\w+\.py)`', where):
            assert numbers(said(ROOT / 'alf_ros' / name)) & numbers(cell), (name, cell)
