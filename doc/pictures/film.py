"""Record the two runs of passing.gif and draw it: `.venv/bin/python doc/pictures/film.py`.

The four-bar `change_point` with rk4 at 2.5 ms, once with alf2 and once with Lagrange multipliers
and Baumgarte's stabilisation, the method of many multibody codes. Everything else is equal.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from alf_ros import load_scene
from alf_ros.commands.analyze import main as analyze
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation import setup

HERE = Path(__file__).resolve().parent
DURATION, RATE = 4.0, 200.0  # s, Hz


def record(folder: Path, formulation: str) -> Path:
    """The log of one run."""
    solver = {'formulation': formulation, 'integrator': 'rk4', 'step': 2.5e-3}
    made = setup.made(load_scene('change_point'), solver, RATE)
    run = LogRun(folder / formulation, made)
    run.send()
    for _ in range(round(DURATION * RATE)):
        made.simulation.step(made.steps)
        run.send()
    run.close()
    return run.recorder.path


def main() -> None:
    """Write passing.gif, at half speed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = [str(record(folder, each)) for each in ('alf2', 'baumgarte')]
        film = str(HERE / 'passing.gif')
        analyze([*logs, '-o', str(folder / 'page.html'), '--animation', film, '--speed', '0.5'])


if __name__ == '__main__':
    main()
