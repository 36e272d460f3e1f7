"""Folders of strangers: a log, and beside it files that its scene might make somebody import.

Nobody's code runs from a log without `--trust`, whatever the scene names and wherever it lies.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from alf_ros import InputError, Simulation, load_scene
from alf_ros.__main__ import main
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.ros.replay.sources import Redriven, message_class
from alf_ros.simulation.saved_states import SavedStates
from support.log_files import make, rewritten
from support.thorough import combined

LIFT = """
from dataclasses import dataclass, field
import pathlib
import numpy as np
from alf_ros.effects.contract import Packed, force

pathlib.Path(OWNED).write_text('owned')
MULTIPLE = False

@dataclass(frozen=True)
class Parameters:
    strength: float = field(metadata={'kind': 'number', 'unit': 'N', 'doc': 'upwards, on block 0'})

def pack(effects, layout):
    return Packed(np.zeros(0, np.int64), np.array([effects[0].parameters.strength]))

@force
def force(t, q, qd, near, slots, params, Q):
    Q[1] += params[0]
"""


class Archive:
    """A folder with a log of a slider-crank whose scene has been replaced by another text.

    The file `owned` exists as soon as code of the folder has run.
    """

    def __init__(self, folder: Path, log: Path) -> None:
        self.folder, self._log = folder / 'archive', log
        self.owned = folder / 'owned'
        self.folder.mkdir()
        # Each archive has a text of its own: what has run once in a process may run again.
        self.code = LIFT.replace('OWNED', repr(str(self.owned)))
        self.digest = hashlib.sha256(self.code.encode()).hexdigest()

    def plant(self, *names: str) -> None:
        """Put the code into files."""
        for name in names:
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / name).write_text(self.code)

    def log(self, effect: str = '', old: str = '', new: str = '', **texts: object) -> Path:
        """The log, its scene naming `effect`, or with `new` in place of `old`; `texts` of its
        record."""

        def record(name: str, said: dict[str, str]) -> dict[str, str]:
            if name == 'alf_ros':
                scene = said['scene_text']
                if effect:
                    old, new = 'effects:\n', f'effects:\n  {json.dumps(effect)}: {{strength: 1}}\n'
                    assert old in scene
                    scene = scene.replace(old, new)
                else:
                    scene = change(scene)
                said['scene_text'] = scene
                said['scene_sha256'] = hashlib.sha256(scene.encode()).hexdigest()
                said.update({key: json.dumps(text) for key, text in texts.items()})
            return said

        def change(scene: str) -> str:
            assert old in scene
            return scene.replace(old, new)

        return rewritten(self._log, self.folder, record=record, name='log_0.mcap')


@pytest.fixture(scope='module')
def recorded(tmp_path_factory) -> Path:
    return make(tmp_path_factory.mktemp('logs'), 'slider_crank', 20, push_at=10)[0]


@pytest.fixture
def archive(tmp_path, recorded, monkeypatch) -> Archive:
    made = Archive(tmp_path, recorded)
    monkeypatch.chdir(made.folder)
    monkeypatch.setenv('HOME', str(made.folder))
    return made


def refused_everywhere(archive: Archive, log: Path, capsys, *options: str) -> str:
    """All that runs a log refuses this one in one line, and no code has run; the line."""
    said = ''
    for verb in (['verify'], ['fork', '--at', '0.01'], ['replay', '--redrive']):
        code = main([*verb, str(log), *options])
        said = capsys.readouterr().err
        assert code == 2 and len(said.splitlines()) == 1, (verb, code, said)
        assert not archive.owned.exists(), verb
    return said


NAMED = {  # what the scene names, with the digest of what lies there where {} stands
    'beside': 'notes.py',
    'here': './notes.py',
    'below': 'folder/notes.py',
    'above': 'folder/../notes.py',
    'absolute': '{folder}/notes.py',
    'at home': '~/notes.py',
    'of nobody': '~nobody-of-this-name/notes.py',
    'like an effect': 'gravity.py',
    'a link': 'link.py',
    'a link in a circle': 'circle.py',
    'beside, digest': 'notes.py#sha256={digest}',
    'absolute, digest': '{folder}/notes.py#sha256={digest}',
    'at home, digest': '~/notes.py#sha256={digest}',
    'like an effect, digest': 'gravity.py#sha256={digest}',
    'a link, digest': 'link.py#sha256={digest}',
    'another digest': 'notes.py#sha256={other}',
    'no digest': 'notes.py#sha256=1',
    'with a NUL': 'no\0tes.py',
    'with a NUL, digest': 'no\0tes.py#sha256={digest}',
    'half a character': '\ud800.py#sha256={digest}',
    'too long': 'a' * 300 + '.py',
    'a device': '/dev/zero.py',
    'a pipe': 'pipe.py',
}


@pytest.mark.parametrize(('trusted', 'case'), combined([False, True], NAMED))
def test_what_a_scene_names_is_never_looked_for(archive, capsys, case, trusted):
    """Also where code is trusted: the text has to be in the log."""
    archive.plant('notes.py', 'folder/notes.py', 'gravity.py', 'a.py')
    (archive.folder / 'link.py').symlink_to('notes.py')
    (archive.folder / 'circle.py').symlink_to('circle.py')
    os.mkfifo(archive.folder / 'pipe.py')
    places = {'folder': archive.folder, 'digest': archive.digest, 'other': '0' * 64}
    log = archive.log(NAMED[case].format(**places))
    refused_everywhere(archive, log, capsys, *(['--trust'] if trusted else []))
    assert main(['analyze', str(log)]) == 0 and main(['recover', str(log)]) == 0
    assert not archive.owned.exists()


@pytest.mark.parametrize('name', ['{}', '/home/a/{}', '../../{}', '{}/../spring.py', '\x1b[2J{}'])
def test_brought_code_needs_trust_and_is_that_of_the_log(archive, capsys, name):
    """The refusal names every file with its digest; a file beside the log is not used."""
    name = name.format('lift.py')
    (archive.folder / 'lift.py').write_text('raise SystemExit(7)')
    full = f'{name}#sha256={archive.digest}'
    log = archive.log(full, files={full: archive.code, 'other.py#sha256=1': 'raise SystemExit'})
    said = refused_everywhere(archive, log, capsys)
    assert archive.digest[:12] in said and '--trust' in said and 'py (sha256' in said
    assert '\x1b' not in said
    try:
        result = compare(load(log), trust=True)
    finally:
        ran = archive.owned.exists()
    assert ran and result.compared > 10 and not result.equal  # 1 N more than was recorded
    archive.owned.unlink()
    # What has run in this process may run again, and is not imported twice.
    assert compare(load(log)).compared == result.compared
    assert not archive.owned.exists()
    # It is not the scene that was run: what goes on from there would be another motion.
    assert main(['fork', str(log), '--at', '0.01', '-o', 'new']) == 2
    assert 'its two descriptions of the start differ' in capsys.readouterr().err


@pytest.mark.parametrize('text', ['pass', '', None, 7, '\ud800'])
def test_brought_code_of_another_digest_is_refused(archive, capsys, text):
    full = f'lift.py#sha256={archive.digest}'
    log = archive.log(full, files={full: text})
    refused_everywhere(archive, log, capsys, '--trust')


@pytest.mark.parametrize('told', [[], 7, 'lift.py', None])
def test_files_of_another_kind_are_no_traceback(archive, capsys, told):
    log = archive.log(f'lift.py#sha256={archive.digest}', files=told)
    refused_everywhere(archive, log, capsys, '--trust')


MECHANISM = 'mechanism:\n'


def test_a_log_reads_no_other_file(archive, capsys):
    """Neither a mechanism nor a table: the recorded run may have used another file."""
    (archive.folder / 'table.csv').write_text('0, 1\n1, secret of the folder\n')
    table = '  joint_effort: {joint: crank_pin, effort: table.csv}\n'
    log = archive.log(old='effects:\n', new=f'effects:\n{table}')
    said = refused_everywhere(archive, log, capsys)
    assert 'table.csv' in said and 'secret' not in said
    scene = load(log).scene_text
    start, end = scene.index(MECHANISM), scene.index('effects:')
    whole = scene[start:end]
    for name in ('slider_crank', str(archive.folder / 'm.yaml')):
        log = archive.log(old=whole, new=f'mechanism: {name}\n')
        assert 'a mechanism elsewhere' in refused_everywhere(archive, log, capsys)


def test_no_module_is_imported_from_the_folder_of_a_log(archive):
    """`python -m` puts the present folder before all others."""
    names = 'numpy scipy yaml zstandard lz4 numba mcap rclpy sitecustomize conftest usercustomize'
    archive.plant(*(f'{name}.py' for name in names.split()), 'evil.py')
    folder = archive.folder / 'evil-1.0.dist-info'
    folder.mkdir()
    (folder / 'METADATA').write_text('Name: evil\nVersion: 1.0\n')
    (folder / 'entry_points.txt').write_text('[alf_ros.effects]\nevil = evil\n')
    for effect, code in (('', 0), ('evil', 2)):
        log = archive.log(effect)
        done = subprocess.run(
            [sys.executable, '-m', 'alf_ros', 'verify', str(log)],
            cwd=archive.folder,
            env={k: v for k, v in os.environ.items() if k != 'PYTHONPATH'},
            capture_output=True,
            text=True,
        )
        assert done.returncode == code and 'Traceback' not in done.stderr, done.stderr
        assert not archive.owned.exists()


@pytest.mark.parametrize('name', ['antigravity/msg/A', 'evil/msg/A', 'a/b/c/d', 'os/msg/Path', ''])
def test_types_of_messages_import_only_packages_of_messages(archive, monkeypatch, name):
    monkeypatch.syspath_prepend(str(archive.folder))
    archive.plant('evil/__init__.py', 'evil/no.py')
    with pytest.raises(InputError, match='not installed'):
        message_class(name)
    assert not archive.owned.exists() and 'antigravity' not in sys.modules


def test_a_journal_changes_numbers_only(archive, recorded, capsys):
    """Settings of the journal that name a file, or another effect, are faults."""
    archive.plant('notes.py')
    (archive.folder / 'table.csv').write_text('0, 1\n1, 2\n')
    log = load(recorded)
    solver = log.info['solver']
    for effects in (
        {'notes.py': {'strength': 1}},
        {'effects.notes.py.strength': 1.0},
        {'effects.gravity.acceleration': 'table.csv'},
        {'effects.gravity.acceleration': {'notes.py': 1}},
    ):
        entry = {'kind': 'settings', 'step': 0, 't': 0.0, 'solver': solver, 'effects': effects}
        rerun = Redriven(log)._resumed.rerun
        with pytest.raises(InputError):
            rerun.act({**entry, 'steps_per_tick': 2})
    assert not archive.owned.exists()


def test_a_saved_state_names_no_code(archive):
    archive.plant('notes.py')
    scene = load_scene('slider_crank')
    simulation = Simulation(scene)
    kept = SavedStates(archive.folder)
    kept.save('mine', scene, simulation)
    path = archive.folder / scene.name / 'mine.json'
    document = json.loads(path.read_text())
    document['effects'] = document['scene'] = 'notes.py'
    document['state']['works'] = {'notes.py': 1.0}
    document['state']['effects'] = {'notes.py': {'strength': 1}}
    path.write_text(json.dumps(document))
    try:
        SavedStates(archive.folder).find('mine', scene, simulation.state)
    except InputError:
        pass
    assert not archive.owned.exists()
