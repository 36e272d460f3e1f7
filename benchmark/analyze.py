"""The cost of the page of a long log: time, memory, size.

    .venv/bin/python benchmark/analyze.py [--size 1000] [--scene slider_crank] [--folder DIR]

Makes a log of `size` MB, and `analyze` shows it, in a process of its own. Writes
benchmark/results/analyze.csv: quantity, value, unit. --folder: where the log and the page are made
and kept; else they are removed at the end.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import load_scene  # noqa: E402
from alf_ros.logs import load  # noqa: E402
from alf_ros.logs.provenance import versions  # noqa: E402
from alf_ros.ros.recording.run_writer import RECORDED, LogRun, RunWriter, full_names  # noqa: E402
from alf_ros.simulation import setup as settings  # noqa: E402

Rows = list[tuple[str, Any, str]]
RUN = 60.0  # s, the part that is repeated
PUSH = 500  # ticks between two commands


def make(folder: Path, scene: str, size: float) -> Path:
    """A log of about `size` bytes: RUN s of the scene with commands, again and again with later
    stamps, because simulating all of it would take far longer than reading it."""
    setup = settings.made(load_scene(scene), {})
    log = LogRun(folder, setup)
    messages: list[Any] = []

    def keep(
        topic: str, kind: type, qos: Any, stamp: int, data: bytes, essential: bool = False
    ) -> None:
        messages.append((topic, kind, qos, stamp, data))

    run, simulation = RunWriter(keep, setup, 0, full_names(), RECORDED), setup.simulation
    messages.clear()  # the scene
    body = simulation.model.body_names[-1]
    rest = [0.0] * (simulation.model.layout.dimension - 1)
    for tick in range(round(RUN / setup.tick)):
        simulation.step(setup.steps)
        run.send()
        if tick % PUSH == 0:
            force = [0.1 * (-1.0) ** (tick // PUSH), *rest]
            wrench: dict[str, Any] = {
                'name': body,
                'force': force,
                'torque': 0.0,
                'frame': 'world',
            }
            simulation.apply_wrench(**wrench)
            run.note({'kind': 'wrench', 'cause': 'command', **wrench})
    recorder, shift = log.recorder, 0
    while recorder.path.stat().st_size < size:
        for topic, kind, qos, stamp, data in messages:
            recorder.write(topic, kind, qos, stamp + shift, data)
            if recorder.waiting > recorder.queue_size // 2:
                time.sleep(0.01)
        shift += round(1e9 * RUN)
    log.close()
    return recorder.path.parent


def analyze(log: Path, page: Path) -> tuple[float, float]:
    """Wall time (s) and peak memory (MB) of `analyze`."""
    begin = time.monotonic()
    command = [sys.executable, '-m', 'alf_ros', 'analyze', str(log), '-o', str(page)]
    process = subprocess.Popen(command, cwd=ROOT)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f'analyze failed: {status}')
    return time.monotonic() - begin, usage.ru_maxrss / 1024.0


def measure(folder: Path, scene: str, size: float) -> Rows:
    """Rows of what it cost."""
    begin = time.monotonic()
    log, page = make(folder, scene, size), folder / 'page.html'
    made = time.monotonic() - begin
    counts = load(log).survey.counts
    total = sum(path.stat().st_size for path in log.glob('*.mcap'))
    wall, memory = analyze(log, page)
    return [
        ('log', total / 1e6, 'MB'),
        ('messages', sum(counts.values()), '1'),
        ('time to make the log', made, 's'),
        ('time of analyze', wall, 's'),
        ('peak memory of analyze', memory, 'MB'),
        ('page', page.stat().st_size / 1e6, 'MB'),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--size', type=float, default=1000.0, metavar='MB', help='of the log')
    parser.add_argument('--scene', default='slider_crank')
    parser.add_argument('--folder', type=Path, metavar='DIR', help='keep log and page there')
    options = parser.parse_args()
    load_before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        rows = measure(options.folder or Path(name), options.scene, 1e6 * options.size)
    rows.insert(0, ('load average before the start', load_before, '1'))
    about = {**versions(), 'scene': options.scene, 'cores': os.cpu_count()}
    path = ROOT / 'benchmark/results/analyze.csv'
    path.parent.mkdir(exist_ok=True)
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(['quantity', 'value', 'unit'])
        for quantity, value, unit in rows:
            shown = f'{value:.4g}' if isinstance(value, float) else value
            print(f'{quantity:30} {shown:>10} {unit}')
            writer.writerow([quantity, shown, unit])
        writer.writerows([key, value, ''] for key, value in about.items())
        writer.writerow(['date', time.strftime('%Y-%m-%d'), ''])
    print(path.relative_to(ROOT))
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
