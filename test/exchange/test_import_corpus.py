"""`import --corpus`: every file below a folder in one table, whatever one of them does."""

from __future__ import annotations

import multiprocessing
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest

from alf_ros.commands.import_ import main
from alf_ros.errors import InputError
from alf_ros.exchange import corpus
from alf_ros.inspection import soundness
from support.paths import DATA

FOLDER = DATA / 'robots'


def test_the_files_of_this_project() -> None:
    """All run, but for the two that need a wish; loops, freedoms and closure as they are."""
    pytest.importorskip('mujoco')
    pytest.importorskip('pxr')
    limits = corpus.ExaminationLimits(seconds=600.0, duration=0.02)
    found = {each.file: each for each in corpus.examined(FOLDER, {'scene': True}, limits)}
    refused = {'free_flyer.urdf': '--floating', 'impossible_inertia.urdf': '--repair-inertia'}
    for name, each in found.items():
        if name in refused:
            assert each.result == corpus.REFUSED and refused[name] in each.why
        else:
            assert each.result == corpus.OK, each
            assert each.closure is not None and each.closure < 1e-12
            assert each.evaluations is not None and each.evaluations >= 12.0 / 1e-3
    assert (found['four_bar_frames.sdf'].loops, found['four_bar_frames.sdf'].freedoms) == (1, 1)
    assert (found['nested.sdf'].loops, found['nested.sdf'].freedoms) == (0, 4)
    assert (found['four_bar_cm.usda'].loops, found['four_bar_cm.usda'].freedoms) == (1, 1)
    assert (found['leg.xml'].loops, found['leg.xml'].freedoms) == (1, 4)


def test_a_file_that_takes_too_long_or_is_broken(tmp_path: Path) -> None:
    (tmp_path / 'broken.urdf').write_text('<robot name="r"><link', encoding='utf-8')
    (tmp_path / 'part.xml').write_text('<mujocoinclude/>', encoding='utf-8')
    text = (FOLDER / 'fixed_without_axis.urdf').read_text(encoding='utf-8')
    (tmp_path / 'slow.urdf').write_text(text, encoding='utf-8')
    limits = corpus.ExaminationLimits(seconds=1e-6)
    stopped = list(corpus.examined(tmp_path, {'scene': True}, limits))
    assert [each.file for each in stopped] == ['broken.urdf', 'slow.urdf']
    assert all(each.result == corpus.LIMIT for each in stopped)
    (found,) = [
        each
        for each in corpus.examined(
            tmp_path, {'scene': True}, corpus.ExaminationLimits(seconds=600.0)
        )
        if each.file == 'broken.urdf'
    ]
    assert found.result == corpus.REFUSED and found.why.startswith('not XML')
    assert corpus.row(found).startswith('| broken.urdf | refused: not XML')
    assert corpus.row(replace(found, file='a|b\nc')).startswith('| a/b\\nc | refused')
    assert corpus.total([found]) == '1 files: 1 refused'


def test_an_examination_that_is_stopped_leaves_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'broken.urdf').write_text('<robot name="r"><link', encoding='utf-8')

    def stop(*_: object) -> None:
        assert len(multiprocessing.active_children()) == 1
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(corpus, '_answer', stop)
    with pytest.raises(KeyboardInterrupt):
        next(corpus.examined(tmp_path, {'scene': True}, corpus.ExaminationLimits()))
    assert not multiprocessing.active_children()


def test_a_mechanism_too_large_to_examine_is_not_unsound(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('pxr')
    monkeypatch.setattr(soundness, 'LARGEST', 1)
    path = FOLDER / 'four_bar_cm.usda'
    limits = corpus.ExaminationLimits(duration=0.02)
    *_, last = corpus._treated(str(path), path.name, {'scene': True}, limits)
    assert last.result == corpus.OK and 'too many to examine' in last.why


def test_a_plane_counts_for_the_formats_that_take_one(tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    path = tmp_path / 'ball.xml'
    path.write_text(
        '<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    limits = corpus.ExaminationLimits(duration=0.02)
    *_, last = corpus._treated(str(path), path.name, {'scene': True, 'ground': 0.0}, limits)
    assert last.result == corpus.OK


def test_the_command_writes_a_table(tmp_path: Path, capsys) -> None:
    (tmp_path / 'broken.urdf').write_text('<robot name="r"><link', encoding='utf-8')
    out = tmp_path / 'out.csv'
    assert main(['--corpus', str(tmp_path), '-o', str(out)]) == 1
    head, columns, row = out.read_text(encoding='utf-8').splitlines()
    assert head.startswith('# ') and columns.startswith('file,result,why,freedoms,loops,')
    assert row.startswith('broken.urdf,refused,"not XML') or row.startswith('broken.urdf,refused')
    assert '| broken.urdf | refused: not XML' in capsys.readouterr().out


def test_a_name_that_is_not_utf_8(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It has a row in both tables, which continue."""
    name = os.fsdecode(b'\xff.urdf')
    (tmp_path / name).write_text('<robot name="r"><link', encoding='utf-8')
    output = tmp_path / 'table.csv'
    assert main(['--corpus', str(tmp_path), '-o', str(output)]) == 1
    assert r'\udcff.urdf | refused' in capsys.readouterr().out
    assert r'\udcff.urdf,refused' in output.read_text(encoding='utf-8')


def test_mistakes_of_the_command(tmp_path: Path) -> None:
    for arguments, message in (
        ([], 'give a FILE, or a folder of them by --corpus'),
        (['it.urdf', '--corpus', str(tmp_path)], 'give a FILE'),
        (['--corpus', str(tmp_path / 'nowhere')], '--corpus: no such folder'),
        (['--corpus', str(tmp_path), '--set', 'a=1'], '--set: for one file only'),
        (['--corpus', str(tmp_path), '--limit', '0'], '--limit: not a time'),
        (['it.urdf', '--limit', '5'], '--limit: has no meaning without --corpus'),
    ):
        with pytest.raises(InputError, match=message):
            main(arguments)


def test_files_that_cannot_be_read_have_a_row(tmp_path: Path) -> None:
    (tmp_path / 'empty.urdf').write_text('')
    (tmp_path / 'bytes.sdf').write_bytes(bytes(range(200)))
    (tmp_path / 'macros.xacro').write_text('<nothing/>')  # what others include is no robot
    assert [path.name for path in corpus.files_below(tmp_path)] == ['bytes.sdf', 'empty.urdf']
