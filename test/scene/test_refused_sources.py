"""Files, mappings, parameters and settings that are refused as a whole: one line each."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from alf_ros.errors import InputError
from alf_ros.scene.scene import Solver, load_scene, scene_from_text
from alf_ros.scene.text import yaml_document


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        (b'', 'the file is empty'),
        (b'# only a comment\n', 'the file is empty'),
        (b'- a\n- b\n', 'a list of 2 given; expected a mapping'),
        (b'word', 'a text of 4 characters given; expected a mapping'),
        (b'~', "missing key 'mechanism'"),
        (b'mechanism: \xff\xfe', 'bad.yaml:1: not a text file in UTF-8'),
        (b'a: 1\nb: \xe9\n', 'bad.yaml:2: not a text file in UTF-8'),
        (b'\x7fELF\x02\x01\x00\x00', 'does not belong in a text'),
        (b'[' * 5000, 'nested more than 40 deep'),
        (b'{a: ' * 5000, 'nested more than 40 deep'),
        (b'- ' * 5000 + b'1', 'nested more than 40 deep'),
        (b'mechanism: "' + b'x' * 5000, 'not YAML'),
        (b'mechanism: &a [*a]', 'alias of nothing, or of itself'),
        (b'mechanism: slider_crnk', "no mechanism of this name.*did you mean 'slider_crank'"),
        (b'mechanism: gone/away.yaml', 'no such file.*away.yaml'),
        (b'mechanism: /dev/zero', 'no such file'),
        (b'mechanism: [slider_crank]', 'a list of 1 given; expected a name'),
        (b'%YAML 1.1\n---\nmechanism: x\n...\n', 'no mechanism of this name'),
    ],
)
@pytest.mark.parametrize(
    'loader', [yaml_document._Loader, yaml.SafeLoader], ids=['libyaml', 'python']
)
def test_whole_files(
    loader: type, content: bytes, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(yaml_document, '_Loader', loader)
    path = tmp_path / 'bad.yaml'
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_scene(path)
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 500
    assert str(path) in str(caught.value)


def test_aliases_cannot_grow_without_bound() -> None:
    lines = ['a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 10)}]' for n in range(1, 20)]
    with pytest.raises(InputError, match='aliases grow to more than'):
        scene_from_text('\n'.join(lines))


@pytest.mark.parametrize(
    ('source', 'message'),
    [
        ('slider_krank', "no scene of this name, got 'slider_krank'; did you mean 'slider_crank'"),
        ('', 'no scene of this name'),
        ('nowhere.yaml', 'nowhere.yaml: no such file'),
        ('/', '/: a folder; expected a file'),
        ('x' * 5000 + '.yaml', 'File name too long'),
        ('a\0b.yaml', 'not a path'),
        (Path('nowhere/x'), 'no such file'),
        ({'mechanism': {'alf': 1, 'points': {}, 'bodies': {}}}, 'a mechanism needs a body'),
        ({'mechanism': {'alf': object()}}, 'mechanism.alf: wrong kind of value'),
        ({'mechanism': 'slider_crank', 'solver': {'step': float('nan')}}, 'not a finite number'),
        ({'mechanism': 'slider_crank', 'parameters': {'L': 10**5000}}, 'too large'),
    ],
)
def test_sources(source: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_scene(source)  # type: ignore[arg-type]


def test_a_mapping_in_itself() -> None:
    endless: dict[str, object] = {}
    endless['mechanism'] = endless
    with pytest.raises(InputError, match='nested more than'):
        load_scene(endless)


def test_a_mechanism_is_not_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'mechanisms').mkdir()
    (tmp_path / 'scenes').mkdir()
    (tmp_path / 'mechanisms' / 'crane.yaml').touch()
    monkeypatch.setattr('alf_ros.resources.folder', lambda kind: [tmp_path / kind])
    with pytest.raises(InputError, match='a mechanism, not a scene; write .*"mechanism: crane"'):
        load_scene('crane')


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'l': 2.0}, "parameters.l: no such parameter of the mechanism, got 'l'"),
        ({'L': float('nan')}, 'parameters.L: not a finite number'),
        ({'L': '2*'}, 'parameters.L: not arithmetic'),
        ({'L': None}, 'parameters.L: nothing given; expected a number'),
        ({'m': -1}, 'slider_crank.yaml.*negative mass'),
    ],
)
def test_parameters_from_python(parameters: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_scene('slider_crank', parameters)


@pytest.mark.parametrize(
    ('settings', 'message'),
    [
        ({'step': 0.0}, 'step: not usable, got 0.0; expected s, from 1e-12'),
        ({'step': float('nan')}, 'step: not usable'),
        ({'step': '1e-3'}, 'step: not usable'),
        ({'integrator': 'rk44'}, "unknown integrator, got 'rk44'; did you mean 'rk4'"),
        ({'integrator': ['rk4']}, 'unknown integrator'),
        ({'formulation': 'alf3'}, "did you mean 'alf2'"),
        ({'penalty': -1.0}, 'penalty: not usable'),
        ({'iterations': 0}, 'iterations: not usable, got 0; expected a whole number from 1'),
        ({'iterations': 2.0}, 'iterations: not usable'),
        ({'iterations': True}, 'iterations: not usable'),
        ({'tolerance': -1e-9}, 'tolerance: not usable'),
    ],
)
def test_solver_from_python(settings: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        Solver(**settings)  # type: ignore[arg-type]
