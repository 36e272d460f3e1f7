"""Command lines: commands with options left out, doubled and given values nobody expects.

Each runs in a folder of its own, with a scene, a log that is cut off and a saved state in it; what
needs a node is left out, and what takes minutes by its purpose.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
from pathlib import Path
from random import Random

from spoiling import TEXTS, number, scratch

OPTIONS = {
    'check': ['--set', '--output', '-o', '--json', '--help'],
    'effects': ['--set', '--folder', '--help'],
    'export': ['--set', '-o', '--help'],
    'import': ['--loops', '-o', '--scene', '--stops', '--floating', '--set'],
    'schema': ['--folder', '--help'],
    'verify': ['--trust', '--help'],
    'fork': ['--at', '--set', '--duration', '-o', '--trust'],
    'recover': ['-o'],
    'analyze': ['-o', '--csv', '--parquet'],
    'figures': ['--help'],
    '': ['--version', '-h'],
}
PLACES = (
    'scene.yaml',
    'log_0.mcap',
    'state.json',
    'out',
    '.',
    '..',
    'missing',
    'link',
    'circle',
    'pipe',
)
SCENE = 'mechanism: slider_crank\nsolver: {step: 1e-3}\n'


class Harness:
    SUFFIX = '.json'

    def __init__(self) -> None:
        from alf_ros import load_scene
        from alf_ros.ros.recording.run_writer import LogRun
        from alf_ros.simulation import setup as settings

        self._folder = scratch('commands')
        setup = settings.made(load_scene('slider_crank'), {})
        run = LogRun(self._folder, setup, name='log')
        run.send()
        for _ in range(5):
            setup.simulation.step(setup.steps)
            run.send()
        run.close()
        self._log = run.recorder.path.read_bytes()
        shutil.rmtree(self._folder)

    def make(self, random: Random) -> bytes:
        """The arguments, as JSON."""
        verb = random.choice(sorted(OPTIONS))
        words = [verb] if verb else []
        for _ in range(random.choice((0, 1, 1, 2, 3, 5))):
            kind = random.randrange(6)
            if kind <= 1:
                words.append(random.choice(OPTIONS[verb]))
            elif kind <= 3:
                words.append(random.choice(PLACES))
            elif kind == 4:
                words.append(
                    random.choice(('crank.mass=2', 'L=1', 'solver.step=5e-4', '0.004', '='))
                )
            else:
                words.append(random.choice((str(number(random)), *TEXTS)))
        if verb == 'fork' and random.randrange(2):
            words += ['--at', random.choice(('0', '0.004', str(number(random))))]
        if words == ['figures']:  # a minute of drawing
            words += ['--help']
        return json.dumps(words).encode()

    def check(self, case: bytes) -> str:
        """Exit code 0, 1 or 2, and for 2 one line."""
        from alf_ros.__main__ import main

        words = [word.replace('\0', '') for word in json.loads(case)]  # as a system would have it
        here = os.getcwd()
        self._folder.mkdir(parents=True)
        try:
            os.chdir(self._folder)
            self._prepare()
            told, said = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(told), contextlib.redirect_stderr(said):
                try:
                    code = main(words)
                except SystemExit as ended:  # --help of argparse
                    assert ended.code == 0, f'SystemExit {ended.code}'
                    code = 0
            assert code in (0, 1, 2), f'exit code {code}'
            lines = said.getvalue().strip().splitlines()
            assert all(line.isprintable() for line in lines), lines
            assert 'Traceback' not in said.getvalue()
            if code == 2 and ''.join(words[:1]):  # without a command there is help
                assert len(lines) == 1, lines
            return 'ran' if code == 0 else 'refused'
        finally:
            os.close(self._pipe)
            os.chdir(here)
            shutil.rmtree(self._folder)

    def _prepare(self) -> None:
        Path('scene.yaml').write_text(SCENE)
        Path('log_0.mcap').write_bytes(self._log)
        Path('state.json').write_text('{}')
        Path('link').symlink_to('scene.yaml')
        Path('circle').symlink_to('circle')
        os.mkfifo('pipe')
        self._pipe = os.open('pipe', os.O_RDWR)  # so that who writes to it need not wait
