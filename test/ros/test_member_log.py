"""`ensemble --log K`: a member as a log that the other commands take."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError
from alf_ros.__main__ import main
from alf_ros.logs import load
from alf_ros.studies.ensemble.member import run_member
from alf_ros.studies.ensemble.study_reading import load_study

STUDY = """
scene: slider_crank
vary:
  coupler.mass: {normal: [1.0, 0.05]}
  solver.integrator: [rk4, dop853]
members: 5
duration: 0.2
period: 0.05
outputs: [energy]
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    file = tmp_path / 'study.yaml'
    file.write_text(STUDY, 'utf-8')
    return file


def test_a_member_is_a_log_that_verifies_and_can_be_forked(study, tmp_path, capsys):
    assert main(['ensemble', str(study), '--log', '3', '-o', str(tmp_path / 'logs')]) == 0
    shown = capsys.readouterr().out
    assert 'slider_crank_member_3: member 3, coupler.mass = ' in shown
    (folder,) = (tmp_path / 'logs').iterdir()
    log = load(folder)
    values = load_study(study).samples.values(3)
    assert log.info['ensemble'] == {
        'study': load_study(study).digest,
        'member': 3,
        'values': values,
    }
    assert log.end == pytest.approx(0.2)
    assert main(['verify', str(folder)]) == 0
    assert 'EQUAL' in capsys.readouterr().out
    # the same bits as the row of the ensemble
    member = run_member(load_study(study), 3).arrays[0]
    assert np.isin(member, log.read('~/energy').columns['data']).all()
    assert main(['fork', str(folder), '--at', '0.1', '--set', 'm=2']) == 0


def test_a_log_that_is_there_is_left_as_it_is(study, tmp_path, capsys):
    command = ['ensemble', str(study), '--log', '1', '-o']
    there = tmp_path / 'l' / 'slider_crank_member_1'
    there.mkdir(parents=True)
    assert main([*command, str(tmp_path / 'l')]) == 2
    error = capsys.readouterr().err
    assert 'ensemble: --output: exists already, and is left as it is, got ' in error
    assert f"{there.name}'; expected another folder: -o" in error and error.count('\n') == 1
    assert not list(there.iterdir())
    assert main([*command, str(tmp_path / 'other')]) == 0


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        (['--log', '5'], 'log: '),
        (['--log', '-1'], 'log: '),
    ],
)
def test_a_member_that_there_is_not(study, tmp_path, capsys, options, said):
    assert main(['ensemble', str(study), *options, '-o', str(tmp_path)]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ('before', 'after', 'said'),
    [
        (
            'duration: 0.2',
            'durations: 0.2',
            "study.yaml:7: durations: unknown key, got 'durations'",
        ),
        (
            'normal: [1.0, 0.05]',
            'normal: [1.0]',
            'study.yaml:4: vary.coupler.mass: normal: wrong parameters',
        ),
        ('coupler.mass', 'couple.mass', 'study.yaml'),
        (
            'outputs: [energy]',
            'outputs: [max(energie)]',
            'study.yaml:9: outputs.max_energie: no such quantity',
        ),
        ('scene: slider_crank', 'scene: slider_crunk', 'study.yaml:2: '),
        ('members: 5', 'members: many', 'study.yaml:6: members: '),
    ],
)
def test_mistakes_in_a_file_are_one_line_with_its_number(
    study, capsys, tmp_path, before, after, said
):
    study.write_text(STUDY.replace(before, after), 'utf-8')
    assert main(['ensemble', str(study), '--store', str(tmp_path / 's'), '--workers', '0']) == 2
    shown = capsys.readouterr().err
    assert shown.count('\n') == 1 and said in shown, shown


def test_the_command_says_what_it_has_found(study, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(['ensemble', str(study), '--members', '3', '--workers', '0']) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[-1] == 'study.zarr and study.html: 3 members, 0 failed'
    with pytest.raises(InputError, match='no scheduler answers'):
        from alf_ros.studies.ensemble.cluster import Cluster

        Cluster('tcp://127.0.0.1:9')
