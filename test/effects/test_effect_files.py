"""Effects of users: a file beside the scene, or a package; the example of doc/effects.md."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from alf_ros import InputError, Simulation, StepError, effects, load_scene
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.scene.scene import scene_from_text
from support.documented_effect import BLOCKS, FILES
from support.forked import ended
from support.paths import ROOT
from support.reader import START_LIMIT


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, 'utf-8')
    return tmp_path


def output(folder: Path, program: str = 'orbit.py', modules: Path = ROOT) -> str:
    """The output of a program in the folder, with the default cache."""
    done = ended([program], folder, {**os.environ, 'PYTHONPATH': f'{ROOT}:{modules}'}, START_LIMIT)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_documented_effect_runs(folder: Path) -> None:
    """The orbit is a circle."""
    (told,) = (text for kind, text in BLOCKS if kind == 'text')
    assert output(folder) == told


@pytest.mark.parametrize('first', ['module', 'file'])
def test_a_file_that_is_also_a_module(folder: Path, first: str) -> None:
    """Both compile the same text: the code that one has saved is no code of the other."""
    text = FILES['magnet.py'] + f'\n# first as a {first}\n'
    (folder / 'magnet.py').write_text(text, 'utf-8')
    (told,) = (text for kind, text in BLOCKS if kind == 'text')
    (folder / 'use.py').write_text('import magnet\n', 'utf-8')  # which compiles its force
    for name in ('use', 'orbit') if first == 'module' else ('orbit', 'use'):
        said = output(folder, f'{name}.py')
        assert said == ('' if name == 'use' else told)


def test_an_edit_takes_effect_at_once(folder: Path) -> None:
    """In as many bytes, at the same time by the file's clock, and only in a constant."""
    ellipse = FILES['orbit.yaml'].replace('P: [0, 2]', 'P: [0, 1.8]')
    (folder / 'orbit.yaml').write_text(ellipse, 'utf-8')
    file, times, told = folder / 'magnet.py', (1e9, 1e9), []
    for power in (2, 3):
        file.write_text(FILES['magnet.py'].replace('length**2', f'length**{power}'), 'utf-8')
        os.utime(file, times)
        told.append(output(folder))
    assert told[0] != told[1]


def test_an_edit_of_a_module_elsewhere_takes_effect(folder: Path, tmp_path_factory: Any) -> None:
    """Of one that is neither beside the effect nor installed, and of one that it imports."""
    modules, told = tmp_path_factory.mktemp('modules'), []
    ellipse = FILES['orbit.yaml'].replace('P: [0, 2]', 'P: [0, 1.8]')
    (folder / 'orbit.yaml').write_text(ellipse, 'utf-8')
    text = FILES['magnet.py'].replace('length**2', 'length**law_of_orbit.POWER')
    text = text.replace('\nfrom ', '\nimport law_of_orbit\nfrom ', 1)
    (folder / 'magnet.py').write_text(text, 'utf-8')
    (modules / 'law_of_orbit.py').write_text('from power_of_orbit import POWER\n', 'utf-8')
    for edit, power in enumerate((2, 3, 2)):
        file = modules / 'power_of_orbit.py'
        file.write_text(f'POWER = {power}\n', 'utf-8')
        # Python itself overlooks an edit in as many bytes within a second
        os.utime(file, (1e9 + edit, 1e9 + edit))
        told.append(output(folder, modules=modules))
    assert told[0] == told[2] != told[1]


def test_documented_effect_takes_few_lines() -> None:
    _, _, code = FILES['magnet.py'].partition('\n')
    lines = [line for line in code.partition('@contract.potential')[0].splitlines() if line]
    assert len(lines) <= 30


def test_text_of_a_scene_says_which_file(folder: Path) -> None:
    scene = load_scene(folder / 'orbit.yaml')
    again = scene_from_text(scene.text)  # from anywhere
    assert again.effects == scene.effects and again.hash == scene.hash
    assert str(folder / 'magnet.py') in scene.text and '#sha256=' in scene.text
    assert scene.effects[0].label == 'magnet'
    sims = Simulation(scene), Simulation(again)
    for sim in sims:
        sim.step(100)
    assert sims[0].state.q.tobytes() == sims[1].state.q.tobytes()
    with open(folder / 'magnet.py', 'a') as file:
        file.write('# another\n')
    assert scene_from_text(scene.text).effects == scene.effects  # this text has run: it is known
    program = f'from alf_ros.scene.scene import scene_from_text; scene_from_text({scene.text!r})'
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert 'InputError' in done.stderr and 'this effect has changed' in done.stderr
    sims[0].apply_wrench('planet', force=[1.0, 0.0])  # packs again: a run goes on with its file
    sims[0].step()


@pytest.mark.parametrize(
    'old, new, message',
    [
        ('MULTIPLE = True', 'MULTIPLE = = True', r'magnet\.py:9: not Python'),
        ('def pack(', 'def unpack(', 'an effect without pack'),
        ("'kind': 'number', ", '', "no 'kind' and 'doc' in the metadata of 'strength'"),
        (
            "'doc': 's'",
            "'doc': 's', 'needs': ('at',)",
            "ONE_OF or 'needs' name no parameter: 'at'",
        ),
        ('MULTIPLE = True', "MULTIPLE, ONE_OF = True, ('s',)", "name no parameter: 's'"),
        ('import Measures,', 'import Mesures,', r'magnet\.py:7: ImportError'),
        ('@contract.force', '', 'force is not compiled by @contract.force'),
        ('length**2, Q)', 'breadth**2, Q)', 'numba cannot compile it: .*breadth'),
        ('@dataclass(frozen=True)', '', 'Parameters is no dataclass'),
        ('return measures.packed()', 'pass', 'pack returns no Packed'),
        ('return measures.packed()', 'return layout', 'pack returns no Packed'),
        ('measures = Measures(layout)', "{}['x']", r"magnet\.py:\d+: KeyError: 'x'"),
        ("'kind': 'number'", "'kind': 'numbr'", r"strength: .*'numbr'; did you mean 'number'"),
        ('    push(q', '    assert length > 0\n        push(q', r'magnet\.py:\d+: force raises'),
    ],
)
def test_what_is_no_effect_is_refused(folder: Path, old: str, new: str, message: str) -> None:
    assert old in FILES['magnet.py']
    (folder / 'magnet.py').write_text(FILES['magnet.py'].replace(old, new), 'utf-8')
    with pytest.raises(InputError, match=message) as caught:
        load_scene(folder / 'orbit.yaml')
    assert '\n' not in str(caught.value)


@pytest.mark.skipif(PLAIN, reason='nothing is compiled')
def test_what_a_compiled_function_calls_must_not_raise(folder: Path) -> None:
    """The run continued with part of the force."""
    helper = '@shared\ndef law(x):\n    if x < 2.0:\n        raise ValueError\n    return x\n\n\n'
    text = FILES['magnet.py'].replace('@contract.force', f'{helper}@contract.force')
    text = text.replace('scalars import ', 'scalars import shared, ')
    text = text.replace('/ length**2, Q)', '/ law(length) ** 2, Q)')
    (folder / 'magnet.py').write_text(text, 'utf-8')
    line = text[: text.index('        raise')].count('\n') + 1
    with pytest.raises(InputError, match=rf'magnet\.py:{line}: force raises an exception'):
        load_scene(folder / 'orbit.yaml')


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'dop853_adaptive', 'esdirk43'])
def test_a_law_that_gives_no_number_is_named(folder: Path, integrator: str) -> None:
    """The planet falls to where the root is none."""
    text = FILES['magnet.py'].replace('/ length**2, Q)', '/ np.sqrt(length - 0.6), Q)')
    (folder / 'magnet.py').write_text(f'import numpy as np\n{text}', 'utf-8')
    file = folder / 'orbit.yaml'
    file.write_text(FILES['orbit.yaml'].replace('{P: [0, 2]}', '{P: [-1, 0]}'), 'utf-8')
    simulation = Simulation(load_scene(file), integrator=integrator, step=0.01)
    with pytest.raises(StepError, match='the force of magnet is not finite'):
        simulation.step(100)
    assert 0.55 < simulation.sample().points['P'][0] < 0.7


@pytest.mark.parametrize(
    'other, message',
    [
        ('other/magnet.py', "another effect has this name, got 'magnet'$"),
        ('./magnet.py', 'another path to an effect that is named above'),
    ],
)
def test_effects_are_told_apart(folder: Path, other: str, message: str) -> None:
    """Powers had one of two effects of a name; the text of a scene, one of two paths to a file."""
    (folder / 'other').mkdir()
    (folder / 'other/magnet.py').write_text(FILES['magnet.py'], 'utf-8')
    scene, named = FILES['orbit.yaml'], '  magnet.py: {between: [Sun, P], strength: 8.0}\n'
    assert named in scene
    twice = scene.replace(named, named + named.replace('magnet.py', other))
    (folder / 'orbit.yaml').write_text(twice, 'utf-8')
    with pytest.raises(InputError, match=rf'orbit\.yaml:8: .*{message}'):
        load_scene(folder / 'orbit.yaml')


def test_no_such_file(folder: Path) -> None:
    (folder / 'magnet.py').unlink()
    with pytest.raises(InputError, match=r'orbit\.yaml:7: .*no such file of an effect'):
        load_scene(folder / 'orbit.yaml')


def test_effect_of_a_package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Registered by an entry point, it needs no path, and is not imported before it is named."""
    (folder / 'magnets-1.0.dist-info').mkdir()
    (folder / 'magnets-1.0.dist-info/METADATA').write_text('Name: magnets\nVersion: 1.0\n')
    points = '[alf_ros.effects]\nattraction = magnet\n'
    (folder / 'magnets-1.0.dist-info/entry_points.txt').write_text(points)
    monkeypatch.syspath_prepend(str(folder))
    assert 'attraction' in effects.kinds() and 'magnet' not in sys.modules
    text = FILES['orbit.yaml'].replace('magnet.py', 'attraction')
    scene = scene_from_text(text)
    try:
        assert scene_from_text(scene.text).effects == scene.effects
        assert Simulation(scene).sample().energy == pytest.approx(-4.0, abs=1e-12)
        sys.modules.pop('magnet')
        (folder / 'magnet.py').write_text('import nothing_of_this_name\n')
        with pytest.raises(InputError, match='cannot be loaded from its package: ModuleNotFound'):
            scene_from_text(text)
    finally:
        sys.modules.pop('magnet', None)
