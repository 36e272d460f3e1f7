"""Every line of the threat model names a module and a test that are there."""

from __future__ import annotations

import re

from support.paths import ROOT

TEXT = (ROOT / 'doc/security.md').read_text('utf-8')
LINES = [
    line.strip('| ').split(' | ')
    for line in TEXT.splitlines()
    if line.startswith('| ') and '::' in line
]


def test_each_line_has_its_test() -> None:
    assert len(LINES) >= 15
    for *_, tests in LINES:
        found = re.findall(r'`([\w/]+\.py)::(\w+)`', tests)
        assert found, tests
        for file, name in found:
            assert f'\ndef {name}(' in (ROOT / 'test' / file).read_text('utf-8'), (file, name)


def test_each_line_says_where_it_is_checked() -> None:
    for *_, where, _ in LINES:
        named = re.findall(r'`([\w/.]+)`', where)
        assert named or where == 'the same'
        assert all((ROOT / 'alf_ros' / name).exists() for name in named), where
