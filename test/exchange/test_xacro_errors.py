"""The error of a xacro names the file that is wrong, its macros, and each cause once."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from support.imported_motions import saved

pytest.importorskip('xacro')
ROBOT = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
INCLUDE = '<xacro:include filename="{}"/>'
MACRO = '<xacro:macro name="{}" params="n">{}</xacro:macro>'
OUTER = MACRO.format('outer', '<xacro:inner n="${n}"/>')
ENDLESS = MACRO.format('again', '<xacro:again n="1"/>') + '<xacro:again n="1"/>'


def refusal(tmp_path: Path, inside: str) -> str:
    """The message for a robot; of paths only the names of files."""
    path = saved(tmp_path, 'it.xacro', ROBOT.format(inside))
    with pytest.raises(InputError) as caught:
        imported(path)
    return re.sub(r'[^\s(]*/', '', str(caught.value))


@pytest.mark.parametrize(
    ('part', 'where'),
    [
        ('<link name="${none}"/>', 'part.xacro: xacro cannot expand it: name '),
        ('\n<link name=b/>', 'part.xacro:2: xacro cannot expand it: not well-formed'),
    ],
)
def test_the_included_file_is_named(part: str, where: str, tmp_path: Path) -> None:
    saved(tmp_path, 'part.xacro', ROBOT.format(part))
    saved(tmp_path, 'middle.xacro', ROBOT.format(INCLUDE.format('part.xacro')))
    assert refusal(tmp_path, INCLUDE.format('middle.xacro')).startswith(where)


def test_the_macros_are_named_with_their_files(tmp_path: Path) -> None:
    saved(tmp_path, 'part.xacro', ROBOT.format(MACRO.format('inner', '<link name="${n / 2}"/>')))
    inside = INCLUDE.format('part.xacro') + OUTER + '<xacro:outer n="a"/>'
    where = (
        'it.xacro: xacro cannot expand it in the macro inner (part.xacro) of outer (it.xacro): '
    )
    assert refusal(tmp_path, inside).startswith(where)


@pytest.mark.parametrize(
    ('inside', 'cause'),
    [
        (
            INCLUDE.format('it.xacro'),
            'an include inside itself too often for Python: it.xacro;',
        ),
        (ENDLESS, 'a macro inside itself too often for Python: again (it.xacro);'),
        (
            '<link name="${(lambda f: f(f))(lambda f: f(f))}"/>',
            'maximum recursion depth exceeded when evaluating expression',
        ),
    ],
)
def test_without_an_end(inside: str, cause: str, tmp_path: Path) -> None:
    assert f'xacro cannot expand it: {cause}' in refusal(tmp_path, inside)


def test_a_cause_is_told_once(tmp_path: Path) -> None:
    said = refusal(tmp_path, '<link name="$(env ALF_NONE)"/>')
    cause = "environment variable 'ALF_NONE' is not set"
    assert said == f'it.xacro: xacro cannot expand it: {cause}'


def test_no_package_of_a_comment_is_missing(tmp_path: Path) -> None:
    inside = '<!-- $(find not_here) -->' + INCLUDE.format('$(find nowhere)/a.xacro')
    assert "got 'nowhere';" in refusal(tmp_path, inside)
