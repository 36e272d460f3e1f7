"""The files that CONTRIBUTING.md and design.md name exist, and the plan is drawn from the code."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from support.paths import ROOT


@pytest.mark.parametrize('page', ['CONTRIBUTING.md', 'doc/design.md', 'doc/method.md'])
def test_files_that_it_names_are_there(page: str) -> None:
    text = (ROOT / page).read_text(encoding='utf-8')
    named = set(re.findall(r'`([\w./]+\.(?:py|yaml|md))`', text))
    assert named
    below = ('', 'alf_ros', 'test', 'alf_ros/kernel', 'alf_ros/simulation', 'alf_ros/model/joints')
    roots = [ROOT / folder for folder in (*below, 'alf_ros/effects')]
    gone = sorted(name for name in named if not any((root / name).exists() for root in roots))
    assert not gone


@pytest.mark.thorough
def test_the_plan_is_drawn_from_the_code(tmp_path: Path) -> None:
    code = (
        'import sys; sys.path.insert(0, "doc/pictures"); import plan, pathlib; '
        'assert set(plan.ORDER) == {p.name for p in plan.PACKAGE.iterdir() if p.is_dir()} - '
        '{"__pycache__"}; plan.draw(pathlib.Path(sys.argv[1]))'
    )
    picture = tmp_path / 'plan.svg'
    subprocess.run([sys.executable, '-c', code, str(picture)], cwd=ROOT, check=True)
    drawn = picture.read_text(encoding='utf-8')
    for package in ('kernel', 'commands'):
        assert f'>{package}<' in drawn
