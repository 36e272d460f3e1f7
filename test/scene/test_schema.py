"""The JSON schemas: the shipped files describe the loader, and they accept all that it accepts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest

from alf_ros import effects
from alf_ros.commands import schema as schema_command
from alf_ros.errors import InputError
from alf_ros.scene import json_schema
from alf_ros.scene.scene import load_scene, scene_from_text
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry
from support.paths import ROOT
from support.yaml_core import data

CONFIG = ROOT / 'config'
MADE = {
    'mechanism': json_schema.mechanism_schema(),
    'scene': json_schema.scene_schema(effects.own()),
}
JUDGE = {kind: jsonschema.Draft7Validator(made) for kind, made in MADE.items()}
FILES = [(kind, path) for kind in MADE for path in sorted((CONFIG / f'{kind}s').glob('*.yaml'))]
EACH_FILE = pytest.mark.parametrize(
    ('kind', 'path'), FILES, ids=[f'{kind}-{path.stem}' for kind, path in FILES]
)
# Below these keys stand names that the author of a file chose, not keys of the format.
NAMED = re.compile(
    r'(mechanism\.)?(parameters|points|vectors|bodies|joints|couplings|drives)\.[^.]+'
    r'|(mechanism\.)?couplings\.[^.]+\.joints\.[^.]+'
    r'|.*\.for\.[^.]+|initial\.(positions|velocities)\.[^.]+'
)
DOCUMENTED = re.compile(r'^```yaml\n(.*?)^```', re.M | re.S)


@pytest.mark.parametrize('kind', MADE)
def test_what_is_shipped_is_what_the_loader_reads(kind: str) -> None:
    jsonschema.Draft7Validator.check_schema(MADE[kind])
    shipped = (CONFIG / 'schema' / f'{kind}.json').read_text(encoding='utf-8')
    message = 'run: python -m alf_ros schema --folder config/schema'
    assert shipped == json_schema.text(MADE[kind]), message


@EACH_FILE
def test_every_file_of_the_library_validates(kind: str, path: Path) -> None:
    JUDGE[kind].validate(data(yaml_document.read(path)))


@pytest.mark.parametrize('page', ['doc/tutorial.md', 'doc/first_mechanism.md'])
def test_files_of_the_tutorials_validate(page: str) -> None:
    text = (CONFIG.parent / page).read_text(encoding='utf-8')
    found = [yaml_document.parse(block, page) for block in DOCUMENTED.findall(text)]
    scenes = [entry for entry in found if 'mechanism' in entry.mapping()]
    assert scenes
    for entry in scenes:
        JUDGE['scene'].validate(data(entry))


def test_the_command_writes_what_is_shipped(tmp_path: Path, capsys) -> None:
    schema_command.main(['--folder', str(tmp_path / 'new')])
    assert capsys.readouterr().out == f'mechanism.json and scene.json in {tmp_path}/new\n'
    for kind in MADE:
        assert json.loads((tmp_path / 'new' / f'{kind}.json').read_text('utf-8')) == MADE[kind]


def test_a_folder_that_cannot_be_is_one_line(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(InputError, match='--folder: '):
        schema_command.main(['--folder', str(tmp_path / 'file' / 'below')])


def keys(entry: Entry) -> Iterator[tuple[str, Entry, tuple[str, ...]]]:
    """Every key of the format in a document, with its entry, and all keys beside it."""
    if isinstance(entry.value, dict):
        for key, item in entry.value.items():
            one_of_several = re.fullmatch(r'effects\.[^.]+\.[^.]+', item.path)
            if not NAMED.fullmatch(item.path) and not (
                one_of_several and isinstance(item.value, dict)
            ):
                yield key, item, tuple(sorted(entry.value))
            yield from keys(item)
    elif isinstance(entry.value, tuple):
        for item in entry.value:
            yield from keys(item)


def misspelt(text: str, key: str, line: int) -> Iterator[str]:
    """The text with a key misspelt where it stands in its line, for each such place."""
    lines = text.split('\n')
    swapped = key[:-2] + key[-1] + key[-2]
    wrong = swapped if len(key) > 3 and swapped != key else key + key[-1]
    for place in re.finditer(rf'(?<![\w<]){key}(?=\s*:)', lines[line - 1]):
        changed = lines[line - 1][: place.start()] + wrong + lines[line - 1][place.end() :]
        yield '\n'.join([*lines[: line - 1], changed, *lines[line:]])


def different_keys(kind: str) -> Iterator[tuple[Path, str, str, int]]:
    """File, its text, key and line of every key of the library's files.

    A key of a section comes once beside the same other keys, in all files together.
    """
    known = set[tuple[object, ...]]()
    for path in (path for of, path in FILES if of == kind):
        text = path.read_text(encoding='utf-8')
        for key, entry, beside in keys(yaml_document.parse(text, None)):
            section, depth = entry.path.partition('.')[0], entry.path.count('.')
            place = section, depth, key, beside if depth > 1 else ()
            if place not in known:
                known.add(place)
                assert entry.line is not None
                yield path, text, key, entry.line


@pytest.mark.parametrize(('kind', 'least'), [('mechanism', 150), ('scene', 100)])
def test_every_misspelt_key_has_line_and_suggestion(kind: str, least: int, tmp_path: Path) -> None:
    """By the loader; and an editor underlines it."""
    found = 0
    for path, text, key, line in different_keys(kind):
        source = tmp_path / path.name
        for wrong in misspelt(text, key, line):
            source.write_text(wrong, encoding='utf-8')
            with pytest.raises(InputError) as caught:
                load_scene(source if kind == 'scene' else {'mechanism': str(source)})
            said = str(caught.value)
            assert said.startswith(f'{source}:{line}: ') and '\n' not in said
            assert f'did you mean {key!r}?' in said, said
            assert not JUDGE[kind].is_valid(data(yaml_document.parse(wrong, None))), said
            found += 1
    assert found >= least


@pytest.mark.parametrize(
    'effect',
    [
        'drag: {on: coupler}',
        'drag: {on: coupler, spin: 1, wind: [1, 0]}',
        'joint_friction: {joint: crank_pin, load: 1}',
        'joint_friction: [{joint: crank_pin, viscous: 1, slip: 1}]',
        'user_table: {push: {joint: crank_pin, table: [[0, 1]], frame: body}}',
    ],
)
def test_an_editor_underlines_what_has_no_effect(effect: str) -> None:
    text = f'mechanism: slider_crank\neffects: {{{effect}}}\n'
    with pytest.raises(InputError, match='has no (effect|meaning here)'):
        scene_from_text(text)
    assert not JUDGE['scene'].is_valid(data(yaml_document.parse(text, None)))
