"""doc/identification.md done as a reader does it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np

from support.foreign_bags import joints, written
from support.paths import ROOT
from support.reader import programs, shown_by
from support.recordings import Machine, pushes

TEXT = (ROOT / 'doc' / 'identification.md').read_text('utf-8')
PROGRAMS = programs(TEXT)
COMMANDS = re.findall(
    r'^```bash\n\.venv/bin/python (.*?)\n^```\n\n^```text\n(.*?)^```$', TEXT, re.M | re.S
)


def test_the_commands_print_what_the_page_says(tmp_path: Path) -> None:
    """Of a bag of the machine of the page; `verify` repeats the log of the fitted run."""
    press = re.search(r'^def press.*?\n\n\n', PROGRAMS[0][0], re.M | re.S)
    assert press is not None
    known: dict[str, Any] = {}
    exec(f'from alf_ros import load_scene\n{press[0]}', known)
    model, machine = (known['press'](*numbers) for numbers in ((0.2, 0.2), (0.4, 0.25)))
    (tmp_path / 'press.yaml').write_text(model.text, 'utf-8')
    motion = Machine(machine, ('crank_pin', 'guide'), 4.0)
    noisy = motion.x + 1e-3 * np.random.default_rng(1).normal(size=motion.x.shape)
    written(
        tmp_path / 'bag',
        [
            joints('/joint_states', 10**18 + round(t * 1e9), motion.joints, position=x)
            for t, x in zip(motion.t, noisy, strict=True)
        ],
    )
    planned = [
        joints('/joint_commands', round(each.t * 1e9), ['crank_pin'], effort=[each.said['effort']])
        for each in pushes('crank_pin', 4.0, 4.0)
    ]
    written(tmp_path / 'pushes', planned)
    for command, shown in reversed(COMMANDS):
        told, errors = shown_by(shlex.split(command), tmp_path)
        assert re.sub(r'press_\w+', 'press_…', told) == shown
        assert all(line.startswith('identify ') for line in errors.splitlines())  # of progress
    assert (tmp_path / 'further' / 'design.json').exists()
    (log,) = (tmp_path / 'identified').glob('press_*Z')
    told, _ = shown_by(['-m', 'alf_ros', 'verify', str(log)], tmp_path)
    assert 'EQUAL' in told
    report = (tmp_path / 'identified' / 'report.html').read_text('utf-8')
    assert 'pin.viscous' in report and 'http' not in report


def test_all_blocks_are_tried() -> None:
    assert [name for _, name, _ in PROGRAMS] == re.findall(r'^# (\w+\.py)$', TEXT, re.M)
    assert len(COMMANDS) == TEXT.count('```bash') == 2
