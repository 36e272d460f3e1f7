"""The command optimise: a scene and a report, and errors of one line with their place."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from alf_ros import InputError, load_scene
from alf_ros.__main__ import main
from alf_ros.studies.optimisation.optimisation_reading import read_study
from support.design_scenes import sprung_block
from support.full_disk import small_files

STUDY = """scene: block.yaml
vary: {main.stiffness: [10, 100]}
minimise: {crossing: rail.position, value: 0.2}
subject_to: {max(abs(rail.velocity)): [~, 2.0 + 0.5]}
duration: 0.6
period: 0.02
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With a scene and a study of it."""
    (tmp_path / 'block.yaml').write_text(yaml.safe_dump(sprung_block()), 'utf-8')
    (tmp_path / 'study.yaml').write_text(STUDY, 'utf-8')
    return tmp_path


def test_a_scene_within_a_study_is_read_as_a_file_is(tmp_path: Path) -> None:
    """Its paths begin in the folder of the study, and a point called e is no number."""
    block = sprung_block()
    (tmp_path / 'block.yaml').write_text(yaml.safe_dump(block.pop('mechanism')), 'utf-8')
    block['mechanism'] = 'block.yaml'
    scene = yaml.safe_dump(block).replace('\n', '\n  ')
    text = STUDY.replace('scene: block.yaml', f'scene:\n  {scene}').replace('B', 'e')
    (tmp_path / 'study.yaml').write_text(text, 'utf-8')
    renamed = (tmp_path / 'block.yaml').read_text('utf-8').replace('B', 'e')
    (tmp_path / 'block.yaml').write_text(renamed, 'utf-8')
    study = read_study(tmp_path / 'study.yaml')
    assert study.scene.mechanism.points[0].name == 'e'
    study_text = text.replace('stiffness: 50.0', 'stifness: 50.0')
    (tmp_path / 'study.yaml').write_text(study_text, 'utf-8')
    with pytest.raises(InputError, match=r'study.yaml:\d+: .*stifness: unknown'):
        read_study(tmp_path / 'study.yaml')


def test_it_writes_a_scene_and_a_report(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """k = m (v / 0.4)² of a block of 2 kg with a speed of 2.5 m/s at most."""
    out = folder / 'out'
    given = [
        'optimise',
        str(folder / 'study.yaml'),
        '--starts',
        '2',
        '--workers',
        '0',
        '--output',
        str(out),
    ]
    assert main(given) == 0
    told = capsys.readouterr().out
    assert 'main.stiffness  50 -> 78.125\n' in told and 'at its limit' in told
    assert '2 starts, 0 failed' in told
    (spring,) = load_scene(out / 'block.yaml').effects
    assert spring.parameters.stiffness == pytest.approx(78.125, rel=1e-6)
    report = (out / 'report.html').read_text('utf-8')
    assert 'main.stiffness' in report and report.count('<svg') == 3 and 'http' not in report
    assert main(given) == 0  # in place of its own files


def test_a_disk_that_was_full_leaves_a_folder_for_the_same_command(folder: Path) -> None:
    """A scene without its report would be taken for the file of somebody else."""
    given = ['optimise', str(folder / 'study.yaml'), '--workers', '0']
    given += ['--output', str(folder / 'out')]
    with small_files(4096):  # more than the scene has, and less than the report
        assert main(given) == 2
    assert not list((folder / 'out').iterdir())
    assert main(given) == 0
    assert (folder / 'out' / 'block.yaml').stat().st_size < 4096
    assert (folder / 'out' / 'report.html').stat().st_size > 4096


@pytest.mark.parametrize(
    ('output', 'expected'),
    [
        ('', "block.yaml'; expected another folder"),
        ('study.yaml', 'Not a directory'),
        ('study.yaml/below', 'Not a directory'),
        ('others', "report.html'; expected another folder"),
    ],
)
def test_what_cannot_be_written_is_told_before_the_search(
    folder: Path, output: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """This study fails, but its folder is examined first; the scene stays as it is."""
    (folder / 'study.yaml').write_text(STUDY.replace('value: 0.2', 'value: -0.5'), 'utf-8')
    (folder / 'others').mkdir()
    (folder / 'others' / 'report.html').write_text('<title>Optimisation of fish</title>', 'utf-8')
    before = (folder / 'block.yaml').read_bytes()
    assert main(['optimise', str(folder / 'study.yaml'), '-o', str(folder / output)]) == 2
    told = capsys.readouterr().err
    assert told.count('\n') == 1 and '--output: ' in told and expected in told
    assert (folder / 'block.yaml').read_bytes() == before


@pytest.mark.parametrize(
    ('before', 'after', 'expected'),
    [
        ('vary:', 'very:', 'study.yaml:2: very: unknown key'),
        ('main.stiffness', 'main.stifness', 'study.yaml:2: vary.main.stifness'),
        ('rail.position', 'rail.positon', 'study.yaml:3: minimise.crossing'),
        (' {main.stiffness: [10, 100]}', '\n  main.stifness: [1, 2]', 'study.yaml:3: vary.main'),
        (' value: 0.2', '\n  value: x', 'study.yaml:4: minimise.value'),
        ('[~, 2.0 + 0.5]', '[3, 2]', 'study.yaml:4: subject_to'),
        ('0.6', '-1', 'study.yaml:5: duration'),
        ('block.yaml', 'blocks.yaml', 'study.yaml:1: scene: no such file, got '),
        ('value: 0.2', 'value: -0.5', 'rail.position does not cross -0.5'),
    ],
)
def test_errors_are_one_line(
    folder: Path, before: str, after: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / 'study.yaml').write_text(STUDY.replace(before, after, 1), 'utf-8')
    code = main(['optimise', str(folder / 'study.yaml'), '-o', str(folder / 'none')])
    told = capsys.readouterr().err
    assert code in (1, 2) and told.count('\n') == 1
    assert expected in told
    assert not (folder / 'none').exists()
