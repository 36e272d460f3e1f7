"""Paths that lead nowhere, or to what never ends; names that a terminal would obey."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from alf_ros import InputError, load_scene, paths
from alf_ros.__main__ import main
from alf_ros.errors import StepError
from alf_ros.scene.scene import scene_from_text
from alf_ros.scene.text import number_table, yaml_document
from support.full_disk import small_files

NOWHERE = [
    '~nobody-of-this-name/x.yaml',
    'a\0b.yaml',
    '\ud800.yaml',
    'a' * 300 + '.yaml',
    '/'.join(['a' * 200] * 30) + '.yaml',
    'circle.yaml',
    'circle.yaml/x.yaml',
    'pipe.yaml',
    'folder.yaml',
    '/dev/zero',
    '/dev/stdin',
    '/proc/self/mem',
    'missing.yaml',
    'secret.yaml',
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path('circle.yaml').symlink_to('circle.yaml')
    os.mkfifo('pipe.yaml')
    Path('folder.yaml').mkdir()
    Path('secret.yaml').write_text('hunter2\n')
    return tmp_path


@pytest.mark.parametrize('path', NOWHERE)
def test_what_is_no_file_is_one_line(folder: Path, path: str) -> None:
    text = path.replace('\0', '\\0').replace('\ud800', '\\ud800')
    effort = f'{{joint: crank_pin, effort: "{text.replace(".yaml", ".csv")}"}}'
    for ask in (
        lambda: load_scene(path),
        lambda: scene_from_text(f'mechanism: "{text}"\n'),
        lambda: scene_from_text(f'mechanism: slider_crank\neffects: {{joint_effort: {effort}}}\n'),
        lambda: scene_from_text(f'mechanism: slider_crank\neffects: {{"{text}.py": {{}}}}\n'),
    ):
        with pytest.raises(InputError) as caught:
            ask()
        assert str(caught.value).isprintable() and 'hunter2' not in str(caught.value)


@pytest.mark.parametrize('path', [path for path in NOWHERE if '\0' not in path])
@pytest.mark.parametrize('verb', ['check', 'verify', 'recover', 'analyze', 'import', 'export'])
def test_commands_end_in_one_line(folder: Path, verb: str, path: str, capsys) -> None:
    assert main([verb, path]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1 and said.strip().isprintable() and 'hunter2' not in said


def test_a_file_larger_than_stated_is_not_taken_in(tmp_path: Path) -> None:
    """A sparse file occupies no disk space, and would occupy 1 TB of memory."""
    path = tmp_path / 'large.yaml'
    with open(path, 'wb') as stream:
        stream.truncate(1 << 40)
    for read in (yaml_document.read, number_table.read):
        with pytest.raises(InputError, match='larger than 64 MB'):
            read(path)
    with pytest.raises(InputError, match='larger than 1 MB'):
        paths.content(path, 1 << 20)


def test_more_values_than_stated_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also without aliases."""
    monkeypatch.setattr(yaml_document, 'MOST_NODES', 1000)
    with pytest.raises(InputError, match='more than 1000 values'):
        yaml_document.parse(f'a: [{"0," * 1001}]', None)
    yaml_document.parse(f'a: [{"0," * 990}]', None)


@pytest.mark.parametrize(
    'name', ['\x1b[2J', '\x9b31m', '\r', '\u202e', '\u200b', '\ud800', '\x7f']
)
def test_names_cannot_move_the_cursor(name: str) -> None:
    for error in (
        InputError(f'no {name}', file=f'{name}.yaml', key=name, value=name, choices=[name]),
        InputError('no such name', value='x', expected=name, choices=[f'{name}1', f'{name}2']),
        StepError(f'at {name}', name, 0.0),
    ):
        assert str(error).isprintable()
        assert str(error).encode()  # whatever the terminal, it can be written


def test_a_file_is_replaced_as_a_whole_or_not_at_all(folder: Path) -> None:
    """Where a link leads, with the permissions it had; nothing stays beside it."""
    place, link = folder / 'place.txt', folder / 'link.npz'
    place.write_text('before')
    place.chmod(0o640)
    link.symlink_to(place)
    with pytest.raises(KeyboardInterrupt), paths.replacing(link) as target:
        assert target.suffix == '.npz'
        target.write_text('half')
        assert place.read_text() == 'before'
        raise KeyboardInterrupt
    assert place.read_text() == 'before'
    paths.put(link, 'after')
    assert link.is_symlink() and place.read_text() == 'after'
    assert place.stat().st_mode & 0o777 == 0o640
    with pytest.raises(IsADirectoryError):
        paths.put(folder / 'folder.yaml', 'text')
    with pytest.raises(OSError):
        paths.put(folder / 'circle.yaml', 'text')
    assert (folder / 'circle.yaml').is_symlink()
    assert not list(folder.glob('.*'))


@pytest.mark.parametrize('suffix', ['.csv', ''])
def test_a_name_as_long_as_names_can_be_is_replaced(folder: Path, suffix: str) -> None:
    most = os.pathconf(folder, 'PC_NAME_MAX')
    for name in ('n' * (most - len(suffix)) + suffix, 'n.' + 's' * (most - 2)):
        paths.put(folder / name, 'text')
        paths.put(folder / name, 'again')
        assert (folder / name).read_text() == 'again'
    assert not list(folder.glob('.*'))


def test_files_that_are_replaced_at_once_do_not_meet(folder: Path) -> None:
    with paths.replacing(folder / 'a.csv') as one, paths.replacing(folder / 'b.csv') as other:
        assert one != other
        one.write_text('a')
        other.write_text('b')
    assert (folder / 'a.csv').read_text() == 'a' and (folder / 'b.csv').read_text() == 'b'


def test_what_is_no_file_is_written_itself(folder: Path) -> None:
    """A pipe stays one, as /dev/null does."""
    reader = os.open('pipe.yaml', os.O_RDONLY | os.O_NONBLOCK)
    try:
        paths.put(Path('pipe.yaml'), 'a text')
        assert os.read(reader, 100) == b'a text'
    finally:
        os.close(reader)
    assert Path('pipe.yaml').is_fifo() and not list(folder.glob('.*'))
    reader, writer = os.pipe()
    try:
        paths.put(Path(f'/dev/fd/{writer}'), 'a text')  # as /dev/stdout, which leads to no name
        assert os.read(reader, 100) == b'a text'
    finally:
        os.close(reader)
        os.close(writer)
    before = os.stat('/dev/null')
    paths.put(Path('/dev/null'), 'a text')
    assert os.stat('/dev/null').st_rdev == before.st_rdev


def test_results_that_find_the_disk_full_keep_what_was_there(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    over = ['--over', 'gravity.acceleration.1', '--to', '-9.7']
    for verb, arguments, option in (
        ('equilibrium', ['double_four_bar'], '--json'),
        ('equilibrium', ['double_four_bar', *over], '--csv'),
        ('modes', ['double_four_bar'], '--html'),
        ('linearise', ['double_four_bar'], '--output'),
        ('atlas', ['slider_crank'], '--csv'),
        ('export', ['slider_crank'], '-o'),
        ('schema', [], '--folder'),
    ):
        place = folder / 'results'
        place.mkdir(exist_ok=True)
        given = [verb, *arguments, option, str(place if verb == 'schema' else place / 'it.json')]
        assert main(given) == 0
        before = {file: file.read_bytes() for file in place.iterdir()}
        capsys.readouterr()
        with small_files(64):
            assert main(given) == 2
        told = capsys.readouterr().err
        assert told.count(f'{option}: ') == 1 and told.endswith('\n'), told
        assert {file: file.read_bytes() for file in place.iterdir()} == before
