"""A module that the effect of a study imports is edited during it: results of the old code and of
the new one are never mixed. A log that was made with the old one says so."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from alf_ros import AlfError
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.studies.ensemble.crews import Processes, ThisProcess
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.study_reading import load_study
from support.documented_effect import FILES
from support.forked import ended
from support.log_files import make
from support.paths import ROOT
from support.reader import START_LIMIT

STUDY = """
scene: orbit.yaml
vary: {magnet.strength: [7.0, 8.0, 9.0, 10.0]}
sampling: grid
chunk: 2
duration: 0.3
outputs: {end: final(points.P.x)}
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file of a module that has a factor for the effect of a study."""
    modules = tmp_path / 'modules'
    modules.mkdir()
    monkeypatch.syspath_prepend(str(modules))
    monkeypatch.chdir(tmp_path)
    name = f'factor_{tmp_path.name}'
    text = FILES['magnet.py'].replace('-params[', f'-{name}.FACTOR * params[', 1)
    text = text.replace('\nfrom ', f'\nimport {name}\nfrom ', 1)
    Path('magnet.py').write_text(text, 'utf-8')
    Path('orbit.yaml').write_text(FILES['orbit.yaml'], 'utf-8')
    Path('study.yaml').write_text(STUDY, 'utf-8')
    file = modules / f'{name}.py'
    file.write_text('FACTOR = 1.0\n')
    return file


@pytest.mark.thorough
def test_a_worker_with_other_code_ends_the_study(module: Path) -> None:
    """It would have begun again for a worker that died, say."""
    study = load_study('study.yaml')
    whole = conduct(study, None, ThisProcess())
    module.write_text('FACTOR = 2.0\n')
    told = f'^module {module.stem}: not as when the study began; begin it again$'
    with pytest.raises(AlfError, match=told):
        conduct(study, None, Processes(1))
    module.write_text('FACTOR = 1.0\n')
    again = conduct(study, None, Processes(1))
    assert again['end'].tobytes() == whole['end'].tobytes() and not any(whole['reason'])


def test_a_store_is_not_continued_with_other_code(module: Path) -> None:
    command = ['-m', 'alf_ros', 'ensemble', 'study.yaml', '--workers', '0']
    path = {**os.environ, 'PYTHONPATH': f'{ROOT}:{module.parent}'}

    def run() -> subprocess.CompletedProcess[str]:
        return ended(command, Path.cwd(), path, START_LIMIT)

    assert run().returncode == 0
    seal = Path('study.zarr/.alf_ros/chunks/1.json')
    seal.unlink()  # as if it had been interrupted
    module.write_text('FACTOR = 2.0\n')
    refused = run()
    assert refused.returncode == 2 and not seal.exists()
    (line,) = [each for each in refused.stderr.splitlines() if 'alf_ros ensemble:' in each]
    assert 'the store of another study' in line and module.stem in line
    module.write_text('FACTOR = 1.0\n')
    assert run().returncode == 0 and seal.exists()


def test_a_log_tells_the_modules_it_was_made_with(module: Path, tmp_path: Path) -> None:
    log = load(make(tmp_path / 'logs', 'orbit.yaml', ticks=20)[0])
    name = f'module {module.stem}'
    assert set(log.info['effects']) == {name}
    assert not compare(log, trust=True).versions
    log.info['effects'][name] = 'sha256=0'
    assert [*compare(log, trust=True).versions] == [name]
