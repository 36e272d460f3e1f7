"""Draw the plan of the package: `.venv/bin/python doc/pictures/plan.py` writes plan.svg.

A row for each package of alf_ros: its contract (first line of its docstring), files and lines of
code. On the right a dot where it imports from another: all dots lie below the diagonal.
"""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import matplotlib

matplotlib.use('Agg')

import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parents[1] / 'alf_ros'
# Each imports from those before it: test/project/test_import_order.py holds it.
ORDER = (
    'kernel',
    'mechanism',
    'model',
    'effects',
    'scene',
    'simulation',
    'inspection',
    'exchange',
    'logs',
    'studies',
    'ros',
    'commands',
)
INK, PALE, BAND, BLUE = '#22303c', '#8b98a3', '#f1f4f6', '#1f6fb2'


def contract(package: str) -> str:
    """The first line of its docstring."""
    text = (PACKAGE / package / '__init__.py').read_text('utf-8')
    return (ast.get_docstring(ast.parse(text)) or '').partition('\n')[0].rstrip('.')


def imported(package: str) -> Counter[str]:
    """How many files of a package import from each other one."""
    found: Counter[str] = Counter()
    for path in (PACKAGE / package).rglob('*.py'):
        names: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text('utf-8'))):
            if isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                names.update(f'{node.module}.{alias.name}' for alias in node.names)
        parts = (name.split('.') for name in names)
        found.update({part[1] for part in parts if part[0] == 'alf_ros' and part[1] in ORDER})
    return found


def draw(path: Path) -> None:
    """Write the plan."""
    plt.rcParams.update({'svg.fonttype': 'none', 'svg.hashsalt': 'plan', 'font.size': 10})
    plt.rcParams['font.family'] = 'sans-serif'
    count = len(ORDER)
    figure, axes = plt.subplots(figsize=(11.0, 4.9))
    figure.subplots_adjust(0.0, 0.0, 1.0, 1.0)
    axes.set(xlim=(0.0, 23.0), ylim=(count - 0.3, -2.5))
    axes.axis('off')
    left = 22.0 - 0.55 * count
    for row, package in enumerate(ORDER):
        files = list((PACKAGE / package).rglob('*.py'))
        lines = sum(len(file.read_text('utf-8').splitlines()) for file in files)
        if row % 2 == 0:
            axes.axhspan(row - 0.5, row + 0.5, color=BAND, zorder=0)
        axes.text(0.2, row, package, weight='bold', color=INK, va='center')
        axes.text(2.3, row, contract(package), color=INK, va='center', size=8.5)
        axes.text(13.9, row, f'{len(files)}', color=PALE, va='center', ha='right', size=8.5)
        axes.text(15.1, row, f'{lines:,}', color=PALE, va='center', ha='right', size=8.5)
        for other, number in imported(package).items():
            column = left + 0.55 * (ORDER.index(other) + 0.5)
            own = other == package
            axes.scatter(column, row, 12.0 * number**0.6, color=PALE if own else BLUE, lw=0)
        axes.text(
            left + 0.55 * (row + 0.5),
            -0.75,
            package,
            color=INK,
            rotation=60,
            rotation_mode='anchor',
            va='center',
            size=8.5,
        )
    for x, text in ((13.9, 'files'), (15.1, 'lines')):
        axes.text(x, -0.9, text, color=PALE, ha='right', size=8.5)
    axes.text(left - 0.1, -1.9, 'imports from', color=PALE, ha='right', size=8.5)
    figure.savefig(path, metadata={'Date': None})
    plt.close(figure)


if __name__ == '__main__':
    draw(HERE / 'plan.svg')
