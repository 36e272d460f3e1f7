"""The store keeps all finished chunks, and overwrites no files of others."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import alf_ros
from alf_ros import InputError
from alf_ros.__main__ import main
from alf_ros.studies.ensemble.chunk import REASON, run_chunk
from alf_ros.studies.ensemble.crews import ThisProcess
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.store import EnsembleStore
from alf_ros.studies.ensemble.study_reading import load_study
from support import forked
from support.ensemble_kills import (
    PATIENCE,
    begun,
    contents,
    ended,
    environment,
    seals,
    study_in,
    undisturbed,
)
from support.full_disk import small_files
from support.read_only import read_only

MANIFEST = '.alf_ros/manifest.json'


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Study file, study and the bytes of an undisturbed store."""
    folder = tmp_path_factory.mktemp('ensemble')
    file, study = study_in(folder)
    return file, study, undisturbed(folder, study), folder / 'undisturbed.zarr'


READER = """
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        assert not name.startswith('alf_ros'), name
sys.meta_path.insert(0, Block())
import xarray
found = xarray.open_zarr(sys.argv[1])
print(sorted(found.sizes.items()), found['coupler.mass'].dims, found['energy'].attrs['units'])
print(float(found['energy'].mean(skipna=True)), int((found['reason'] != '').sum()))
print(float(found['points.B'].sel(axis='x').isel(t=-1).max()))
"""


def test_xarray_alone_reads_it(whole):
    _, study, _, store = whole
    done = subprocess.run(
        [sys.executable, '-c', READER, str(store)], capture_output=True, text=True, check=True
    )
    with EnsembleStore(store, study) as opened:
        chunks = list(opened.finished())
    energy = np.concatenate([chunk.arrays['energy'] for chunk in chunks])
    ends = np.concatenate([chunk.arrays['points.B'][:, -1, 0] for chunk in chunks])
    failed = sum(chunk.failed for chunk in chunks)
    assert 2 < failed < 15
    shape, means, largest = done.stdout.splitlines()
    assert shape == "[('axis', 2), ('member', 23), ('t', 6)] ('member',) J"
    mean, said = means.split()
    assert float(mean) == pytest.approx(np.nanmean(energy), rel=1e-14) and int(said) == failed
    assert float(largest) == np.nanmax(ends)


def test_any_workers_make_the_same_bytes_and_the_dataset_is_that_of_no_store(whole, tmp_path):
    file, study, bytes_, _ = whole
    process = begun(file, tmp_path / 'two.zarr', '--workers', '2')
    code, said = ended(process)
    assert code == 0, said
    assert contents(tmp_path / 'two.zarr') == bytes_
    page = (tmp_path / 'two.html').read_text('utf-8')
    assert page.count('<svg') >= 6 and 'members failed' in page and 'http' not in page
    settings: dict[str, Any] = {
        'members': 5,
        'duration': 0.1,
        'outputs': ['energy', 'final(points.B)'],
        'chunk': 2,
    }
    vary = {'coupler.mass': {'normal': [1.0, 0.05]}, 'solver.integrator': ['rk4', 'dop853']}
    kept = alf_ros.ensemble('slider_crank', vary, store=tmp_path / 's', workers=0, **settings)
    none = alf_ros.ensemble('slider_crank', vary, workers=0, **settings)
    assert kept.load().equals(none)
    assert kept['energy'].attrs == none['energy'].attrs


def test_what_is_torn_or_damaged_is_made_again(whole, tmp_path):
    _, study, bytes_, _ = whole
    store = tmp_path / 'torn.zarr'
    conduct(study, store, ThisProcess())
    (store / 'energy' / '3.0').write_bytes(b'half')
    (store / '.alf_ros' / 'chunks' / '5.json').write_text('{')
    (store / '.alf_ros' / '123.tmp').write_bytes(b'left')
    (store / 'points.B' / '7.0.0').unlink()
    before = seals(store)
    with EnsembleStore(store, study) as opened:
        there = {chunk.number for chunk in opened.finished()}
    assert set(range(study.chunks)) - there == {3, 5, 7}
    conduct(study, store, ThisProcess())
    assert contents(store) == bytes_
    made_again = {name for name, stamp in seals(store).items() if before.get(name) != stamp}
    assert made_again == {'3.json', '5.json', '7.json'}


@pytest.mark.parametrize('damaged', ['energy/3.0', '.alf_ros/chunks/5.json', MANIFEST])
def test_a_folder_in_place_of_a_file_is_one_line(whole, tmp_path, damaged):
    _, study, _, _ = whole
    store = tmp_path / 'damaged.zarr'
    conduct(study, store, ThisProcess())
    (store / damaged).unlink()
    (store / damaged).mkdir()
    said = 'its manifest cannot be read' if damaged == MANIFEST else 'cannot be written: '
    with pytest.raises(InputError, match=f'^store: {said}'):
        conduct(study, store, ThisProcess())


def test_what_is_nested_too_deep_is_damaged(whole, tmp_path):
    _, study, bytes_, _ = whole
    store, deep = tmp_path / 'deep.zarr', '[' * 100_000
    conduct(study, store, ThisProcess())
    (store / '.alf_ros' / 'chunks' / '5.json').write_text(deep)
    conduct(study, store, ThisProcess())
    assert contents(store) == bytes_
    (store / MANIFEST).write_text(deep)
    with pytest.raises(InputError, match='its manifest cannot be read'):
        conduct(study, store, ThisProcess())


def test_another_study_or_other_versions_or_something_else_is_left_as_it_is(whole, tmp_path):
    file, study, bytes_, store = whole
    other = load_study(file, members=22)
    with pytest.raises(InputError, match=r'^store\.members: the store of another study, got 22; '):
        conduct(other, store, ThisProcess())
    with pytest.raises(InputError, match=r'expected 23, or a new folder$'):
        conduct(other, store, ThisProcess())
    assert contents(store) == bytes_
    foreign = tmp_path / 'foreign'
    foreign.mkdir()
    (foreign / 'thesis.tex').write_text('years of work')
    with pytest.raises(InputError, match='not a store of an ensemble, and left as it is'):
        conduct(study, foreign, ThisProcess())
    assert [path.name for path in foreign.iterdir()] == ['thesis.tex']
    old = tmp_path / 'old.zarr'
    with EnsembleStore(old, study):
        pass
    manifest = json.loads((old / '.alf_ros' / 'manifest.json').read_text())
    for name in ('numpy', 'sources'):
        versions = manifest['versions'] | {name: '1.0'}
        text = json.dumps(manifest | {'versions': versions})
        (old / '.alf_ros' / 'manifest.json').write_text(text)
        with pytest.raises(
            InputError, match=rf"^store\.{name}: the store of other versions, got '"
        ):
            conduct(study, old, ThisProcess())
    (old / '.alf_ros' / 'manifest.json').write_text('{')
    with pytest.raises(InputError, match='its manifest cannot be read'):
        conduct(study, old, ThisProcess())


def test_two_processes_do_not_write_into_one_store(whole, tmp_path):
    _, study, _, _ = whole
    with (
        EnsembleStore(tmp_path / 'one', study),
        pytest.raises(InputError, match='another process writes'),
    ):
        conduct(study, tmp_path / 'one', ThisProcess())


def _small_files() -> None:
    """Files cannot be longer than this: writing on is refused, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64))


def test_a_full_disk_is_one_line_and_what_is_finished_is_kept(whole, tmp_path):
    file, study, bytes_, _ = whole
    store = tmp_path / 'full.zarr'
    with EnsembleStore(store, study) as opened:
        for number in range(4):
            opened.put(run_chunk(study, number))
    before = seals(store)
    code = (
        'import sys; from alf_ros.__main__ import main; '
        f'sys.exit(main(["ensemble", {str(file)!r}, "--store", {str(store)!r}, "--workers", "0"]))'
    )
    done = subprocess.run(
        [sys.executable, '-c', code],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=_small_files,
        env=environment(),
    )
    assert done.returncode == 2
    assert (
        done.stderr.count('\n') == 1 and 'store: cannot be written: File too large' in done.stderr
    )
    assert before == seals(store)
    conduct(study, store, ThisProcess())
    assert contents(store) == bytes_


@pytest.mark.parametrize('there', [False, True], ids=['first', 'again'])
def test_a_report_that_finds_the_disk_full_is_whole_or_not_there(short, tmp_path, capsys, there):
    """The same command continues: no part of a report is taken for the file of somebody else."""
    report = tmp_path / 'run.html'
    assert short('--store', 'run.zarr') == 0
    before = report.read_text('utf-8')
    if not there:
        report.unlink()
    capsys.readouterr()
    with small_files(len(before) // 2):
        assert short('--store', 'run.zarr') == 2
    err = capsys.readouterr().err
    assert 'File too large' in err and err.count('\n') == 2  # its members, and why it ends
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ['run.zarr', 'short.yaml', *(['run.html'] if there else [])]
    )
    assert not there or report.read_text('utf-8') == before
    assert short('--store', 'run.zarr') == 0
    assert report.read_text('utf-8').endswith('</html>\n')


def test_a_finished_store_that_can_only_be_read_is_shown(short, tmp_path, capsys):
    folder, store = tmp_path / 'disk', tmp_path / 'disk' / 'run.zarr'
    folder.mkdir()
    assert short('--store', str(store)) == 0
    printed = capsys.readouterr().out
    before = contents(store)
    with read_only(folder):
        assert short('--store', str(store)) == 0
        out, err = capsys.readouterr()
        assert out == printed.replace(' and run.html', '')
        assert err.splitlines()[-1].startswith('no report: --store: ')
        assert err.endswith('; --report FILE writes it elsewhere\n')
        assert short('--store', str(store), '--report', 'here.html') == 0
        assert capsys.readouterr().out == printed.replace('run.html', 'here.html')
        assert short('--store', str(store), '--report', str(folder / 'there.html')) == 2
        assert 'alf_ros ensemble: --report: ' in capsys.readouterr().err
    assert contents(store) == before
    assert (tmp_path / 'here.html').read_text('utf-8').count('final_energy') > 0


def test_the_dataset_of_a_store_that_can_only_be_read(tmp_path):
    folder = tmp_path / 'disk'
    folder.mkdir()

    def found() -> Any:
        settings: dict[str, Any] = {'members': 1, 'duration': 0.01, 'workers': 0}
        vary = {'m': {'uniform': [0.9, 1.1]}}
        return alf_ros.ensemble('slider_crank', vary, store=folder / 's', **settings).load()

    before = found()
    with read_only(folder):
        assert found().identical(before)


@pytest.mark.parametrize('there', [False, True], ids=['none', 'some'])
def test_an_unfinished_store_that_can_only_be_read_is_one_line(
    whole, tmp_path, capsys, monkeypatch, there
):
    file, study, _, _ = whole
    folder, store = tmp_path / 'disk', tmp_path / 'disk' / 'run.zarr'
    folder.mkdir()
    if there:
        with EnsembleStore(store, study) as opened:
            for number in range(2):
                opened.put(run_chunk(study, number))
    monkeypatch.chdir(tmp_path)
    with read_only(folder):
        assert main(['ensemble', str(file), '--store', str(store), '--workers', '0']) == 2
        with pytest.raises(InputError, match='^store: cannot be written: '):
            conduct(study, store, ThisProcess())
    out, err = capsys.readouterr()
    assert err.startswith('alf_ros ensemble: --store: cannot be written: ')
    assert err.count('\n') == 1 and not out


def test_another_study_than_that_of_a_store_that_can_only_be_read_is_refused(whole, tmp_path):
    file, study, _, _ = whole
    folder = tmp_path / 'disk'
    conduct(study, folder / 'run.zarr', ThisProcess())
    other = load_study(file, members=22)
    with read_only(folder), pytest.raises(InputError, match='the store of another study'):
        conduct(other, folder / 'run.zarr', ThisProcess())


def test_a_chosen_report_leaves_other_files_as_they_are(short, tmp_path, capsys):
    (tmp_path / 'keep.html').write_text('years of work')
    for chosen, said in (
        (
            'keep.html',
            "--report: not the report of this store, and left as it is, got 'keep.html'",
        ),
        ('no/r.html', "--report: no such folder, got 'no'"),
    ):
        assert short('--store', 'run', '--report', chosen) == 2
        assert said in capsys.readouterr().err and not (tmp_path / 'run').exists()
    for _ in range(2):
        assert short('--store', 'run', '--report', 'r.html') == 0
    assert not (tmp_path / 'run.html').exists() and (tmp_path / 'r.html').is_file()
    assert short('--log', '0', '--report', 'r.html') == 2
    assert '--report: has no meaning with --log' in capsys.readouterr().err
    assert short('--store', 'run', '-o', 'logs') == 2
    assert '--output: has no meaning without --log' in capsys.readouterr().err


def test_a_chunk_on_which_workers_die_ends_the_study_in_one_line(tmp_path):
    def deadly(run):
        import os

        os._exit(9)

    with pytest.raises(alf_ros.AlfError, match='3 workers have died .* members 0 to 0') as caught:
        alf_ros.ensemble(
            'slider_crank',
            {'m': [1.0]},
            sampling='table',
            outputs={'deadly': deadly},
            duration=0.01,
            store=Path(tmp_path / 's'),
            workers=1,
        )
    assert 'exit code' in str(caught.value)


SHORT = """
scene: slider_crank
vary: {m: [1.0]}
sampling: table
duration: 0.01
outputs: [final(energy)]
"""


@pytest.fixture
def short(tmp_path, monkeypatch):
    """A folder to work in, with a short study; returns how the command ends, and what it says."""
    (tmp_path / 'short.yaml').write_text(SHORT, 'utf-8')
    monkeypatch.chdir(tmp_path)

    def command(*options: str) -> int:
        return main(['ensemble', str(tmp_path / 'short.yaml'), '--workers', '0', *options])

    return command


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['--members', '0'], 'alf_ros ensemble: --members: not usable, got 0; expected a whole'),
        (['--members', '2'], 'alf_ros ensemble: --members: a table has fewer, got 2; expected 1'),
        (['--log', '1'], 'alf_ros ensemble: --log: not usable, got 1; expected a whole number'),
    ],
)
def test_an_option_that_cannot_be_is_named(short, tmp_path, capsys, options, said):
    if '--log' in options:  # which writes messages of ROS
        pytest.importorskip('rclpy')
    text = (tmp_path / 'short.yaml').read_text()
    (tmp_path / 'short.yaml').write_text(f'{text}members: 1\n')
    assert short(*options) == 2
    assert capsys.readouterr().err.startswith(said)
    (tmp_path / 'short.yaml').write_text(f'{text}members: 0\n')
    assert short() == 2
    assert 'short.yaml:7: members: ' in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_one_line(short, capsys) -> None:
    """The message told of a folder that was removed while the study ran."""
    assert short('--store', '/proc/run.zarr') == 2
    told = capsys.readouterr().err
    assert told == (
        'alf_ros ensemble: --store: cannot be written: No such file or directory, got '
        "'/proc/run.zarr'\n"
    )


def test_a_single_member_has_no_deviation(short, tmp_path, capsys) -> None:
    assert short('--store', 'run.zarr') == 0
    told = capsys.readouterr()
    assert 'J, median ' in told.out and '±' not in told.out + told.err
    page = (tmp_path / 'run.html').read_text('utf-8')
    assert ' of 1 member<' in page and '±' not in page


def test_members_of_which_none_reaches_its_end_are_told_last(short, tmp_path, capsys) -> None:
    """The command ended with 0, and the reason was in the report alone."""
    (tmp_path / 'own.py').write_text("def bad(run):\n    raise ValueError('as said')\n", 'utf-8')
    study = SHORT.replace('final(energy)', "{function: 'own.py:bad', reads: [energy]}")
    (tmp_path / 'short.yaml').write_text(study, 'utf-8')
    said = 'no member has reached its end; the first one: function bad: ValueError: as said'
    for _ in ('first', 'again'):
        assert short('--store', 'run.zarr') == 1
        told = capsys.readouterr()
        assert told.err.splitlines()[-1] == said and '1 members, 1 failed' in told.out


def test_no_scheduler_is_one_line(short, tmp_path):
    pytest.importorskip('distributed')
    command = ['-m', 'alf_ros', 'ensemble', 'short.yaml', '--scheduler', 'nonsense']
    done = forked.ended(command, tmp_path, environment(), PATIENCE)
    expected = "--scheduler: no scheduler answers, got 'nonsense'; expected tcp://host:port"
    assert (done.returncode, done.stderr) == (2, f'alf_ros ensemble: {expected}\n')


def test_reports_have_the_names_of_their_stores(short, tmp_path):
    for store in ('run.1', 'run.2', 'run.zarr', 'run.zarr'):
        assert short('--store', store) == 0
    found = sorted(path.name for path in tmp_path.glob('*.html'))
    assert found == ['run.1.html', 'run.2.html', 'run.html']


@pytest.mark.parametrize('name', ['keep', '.'])
def test_a_store_may_be_this_folder(short, tmp_path, monkeypatch, name):
    folder = tmp_path / 'keep'
    folder.mkdir()
    monkeypatch.chdir(folder if name == '.' else tmp_path)
    assert short('--store', name) == 0
    assert (tmp_path / 'keep.html').is_file() and (folder / '.alf_ros').is_dir()


def test_a_chunk_has_no_more_members_than_the_study(short, tmp_path):
    text = (tmp_path / 'short.yaml').read_text()
    (tmp_path / 'short.yaml').write_text(f'{text}chunk: {10**14}\n')
    assert short('--store', 'run') == 0
    assert (tmp_path / 'run' / 'm' / '0').stat().st_size == 8


def test_what_is_no_report_of_this_store_is_left_as_it_is(short, tmp_path, capsys):
    assert short('--store', 'run') == 0
    (tmp_path / 'keep.html').write_text('years of work')
    capsys.readouterr()
    for store, said in (
        ('keep.zarr', "keep.html'; expected a store of another name"),
        ('run.zarr', "run.html'; expected a store of another name"),
        ('r.html', "the name of a report, got 'r.html'"),
        ('/', "not a folder of a store, got '/'"),
        ('.', 'not a store of an ensemble, and left as it is'),
    ):
        assert short('--store', store) == 2
        out, err = capsys.readouterr()
        assert said in err and err.count('\n') == 1 and not out
    assert (tmp_path / 'keep.html').read_text() == 'years of work'
    there = sorted(path.name for path in tmp_path.iterdir())
    assert there == ['keep.html', 'run', 'run.html', 'short.yaml']


def test_a_store_that_is_removed_while_a_study_runs(whole, tmp_path: Path) -> None:
    """It said that all that is finished is kept."""
    _, study, _, store = whole
    with EnsembleStore(store, study) as opened:
        chunk = next(iter(opened.finished()))
    with EnsembleStore(tmp_path / 'it.zarr', study) as mine:
        mine.put(chunk)
        (tmp_path / 'it.zarr').rename(tmp_path / 'other.zarr')
        with pytest.raises(InputError, match='it has been removed or renamed while the study'):
            mine.put(chunk)


def test_a_store_that_loses_a_part_or_its_place_ends_the_study(whole, tmp_path: Path) -> None:
    """With a file in its place the line promised finished members; a new folder was written into;
    and a removed array was made again, without the chunks before."""
    _, study, _, store = whole
    with EnsembleStore(store, study) as opened:
        first, second, *_ = opened.finished()
    folder = tmp_path / 'it.zarr'
    with EnsembleStore(folder, study) as mine:
        mine.put(first)
        array = folder / REASON.name
        array.rename(tmp_path / 'array')
        with pytest.raises(InputError, match='a part of it has been removed or renamed while'):
            mine.put(second)
        assert not array.exists()
        (tmp_path / 'array').rename(array)
        mine.put(second)
        folder.rename(tmp_path / 'other.zarr')
        folder.mkdir()
        with pytest.raises(InputError, match='it has been removed or renamed while the study'):
            mine.put(second)
        assert not list(folder.iterdir())
        folder.rmdir()
        folder.write_text('a file', 'utf-8')
        with pytest.raises(InputError, match='it has been removed or renamed while the study'):
            mine.put(second)
