"""No class and no file has a name that another has, unless both are about the same thing."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

from support.paths import ROOT
from support.syntax import parsed, statements

PACKAGE = ROOT / 'alf_ros'
# Files of one name that are about one thing, and why there are two.
SAME = {
    # the compiled half and the half that prepares or reads it
    'mass': {'kernel/mass.py', 'model/mass.py'},
    'prescribed': {'kernel/prescribed.py', 'model/prescribed.py'},
    'force_columns': {'kernel/force_columns.py', 'simulation/force_columns.py'},
    'sample_limits': {'kernel/sample_limits.py', 'simulation/sample_limits.py'},
    'softest_modes': {'kernel/softest_modes.py', 'model/softest_modes.py'},
    'work_ledger': {'kernel/work_ledger.py', 'simulation/work_ledger.py'},
    'joint_efforts': {'kernel/joint_efforts.py', 'simulation/joint_efforts.py'},
    # the rows of joint coordinates and the pass that reads them
    'joint_coordinates': {
        'kernel/joint_coordinates.py',
        'model/constraints/joint_coordinates.py',
    },
    # the section of a mechanism file and the constraint rows that it becomes
    'couplings': {'model/constraints/couplings.py', 'scene/mechanism_file/couplings.py'},
    'drives': {'model/constraints/drives.py', 'scene/mechanism_file/drives.py'},
    # the type of a joint and what such types share
    'rolling': {'model/joints/rolling.py', 'model/joints/contract/rolling.py'},
    # a verb of the command line and the work that it calls
    'ensemble': {'commands/ensemble.py', 'studies/ensemble/ensemble.py'},
    'export': {'commands/export.py', 'exchange/export.py'},
    'figures': {'commands/figures.py', 'studies/paper/figures.py'},
    'gradient': {'commands/gradient.py', 'studies/gradients/gradient.py'},
    'fork': {'commands/fork.py', 'ros/recording/fork.py'},
    'recover': {'commands/recover.py', 'ros/recording/recover.py'},
    'progress': {'commands/progress.py', 'logs/progress.py'},
}


def files() -> list[Path]:
    return sorted(PACKAGE.rglob('*.py'))


def test_files() -> None:
    found: dict[str, set[str]] = defaultdict(set)
    for path in files():
        if not path.stem.startswith('__'):
            found[path.stem].add(path.relative_to(PACKAGE).as_posix())
    assert {name: paths for name, paths in found.items() if len(paths) > 1} == SAME


def test_classes() -> None:
    found: dict[str, list[str]] = defaultdict(list)
    for path in files():
        for node in statements(parsed(path)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith('_'):
                found[node.name].append(path.relative_to(PACKAGE).as_posix())
    twice = {name: paths for name, paths in found.items() if len(paths) > 1}
    # each effect is a file with `Parameters`: the contract asks for that name
    assert all(path.startswith('effects/') for path in twice.pop('Parameters'))
    assert twice == {}
