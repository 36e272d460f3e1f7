"""How long a large mechanism takes from its file to the first step.

    .venv/bin/python benchmark/first_step.py [--runs 5] [--four-bars 1000 100000]

The N four-bars of the library, once from a file that states N, which the loader expands, and once
from a file that has every point, link and joint in a line of its own. Each run is a process of its
own; a small scene is run before, so that what numba compiles is in its cache. Medians of the runs
go to benchmark/results/first_step.csv: imports, parsing the YAML, the rest until there is a scene,
the simulation made of it, its first step; and all but the imports.
"""

from __future__ import annotations

import argparse
import csv
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / 'benchmark' / 'results'
SCENE = """mechanism: n_four_bar
parameters: {{N: {n}}}
effects:
  gravity: {{acceleration: [0, -9.81]}}
initial:
  velocities: {{B0: [1, 0]}}
solver: {{step: 1.0e-4, penalty: 1.0e+10}}
"""
TIMES = 'imports_s parse_s scene_s model_s step_s total_s memory_mb'.split()
COLUMNS = ['file', 'four_bars', 'links', 'yaml_kb', 'runs', *TIMES]


def measured(path: Path) -> dict[str, float]:
    """One run, in this process."""
    started = time.perf_counter()
    sys.path.insert(0, str(ROOT))
    from alf_ros import Simulation, load_scene
    from alf_ros.scene.text import yaml_document

    parsing, read = [0.0], yaml_document.read

    def timed(path: Path) -> yaml_document.Entry:
        began = time.perf_counter()
        try:
            return read(path)
        finally:
            parsing.append(time.perf_counter() - began)

    yaml_document.read = timed  # of the scene, and of the mechanism that it names
    marks = [time.perf_counter()]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    scene = load_scene(path)
    marks.append(time.perf_counter())
    simulation = Simulation(scene)
    marks.append(time.perf_counter())
    simulation.step()
    marks.append(time.perf_counter())
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    parse = sum(parsing)
    return {
        'links': len(scene.mechanism.bodies),
        'imports_s': marks[0] - started,
        'parse_s': parse,
        'scene_s': marks[1] - marks[0] - parse,
        'model_s': marks[2] - marks[1],
        'step_s': marks[3] - marks[2],
        'total_s': marks[3] - marks[0],
        'memory_mb': memory / 1024,
    }


def write_out(path: Path) -> None:
    """Put every item of the mechanism in a scene file in a line of its own."""
    sys.path.insert(0, str(ROOT))
    from alf_ros import load_scene
    from alf_ros.scene.text.yaml_writer import entry, serialise

    mechanism = load_scene(path).mechanism
    points = {p.name: {'at': list(p.at), 'fixed': p.fixed} for p in mechanism.points}
    bodies = {
        b.name: {'points': list(b.points), 'mass': b.mass, 'inertia': 'rod'}
        for b in mechanism.bodies
    }
    joints = {
        j.name: {'type': j.kind, 'between': [j.parent, j.child], 'at': j.point}
        for j in mechanism.joints
    }
    whole = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    _, _, rest = path.read_text(encoding='utf-8').partition('effects:')
    text = f'{serialise(entry({"mechanism": whole}))}effects:{rest}'
    path.write_text(text, encoding='utf-8')


def asked(what: str, path: Path) -> str:
    """The output of a separate process: a child of a large process would begin with its memory."""
    command = [sys.executable, __file__, what, str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--four-bars', nargs='+', type=int, default=[1000, 100_000], metavar='N')
    parser.add_argument('--runs', type=int, default=5, help='of each file')
    parser.add_argument('--one', type=Path, help=argparse.SUPPRESS)
    parser.add_argument('--write-out', type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(options.one)))
        return
    if options.write_out:
        write_out(options.write_out)
        return
    sys.path.insert(0, str(ROOT))
    from alf_ros.logs.provenance import about

    found: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'scene.yaml'
        path.write_text(SCENE.format(n=2), encoding='utf-8')
        asked('--one', path)
        for n in options.four_bars:
            path.write_text(SCENE.format(n=n), encoding='utf-8')
            for file in ('states N', 'written out'):
                if file == 'written out':
                    asked('--write-out', path)
                runs = [json.loads(asked('--one', path)) for _ in range(options.runs)]
                row = {key: statistics.median(run[key] for run in runs) for key in TIMES}
                row |= {'file': file, 'four_bars': n, 'links': runs[0]['links']}
                row |= {'yaml_kb': path.stat().st_size / 1024, 'runs': options.runs}
                found.append(row)
                print(
                    f'{n:7} four-bars, {file}: {row["total_s"]:.3g} s to the first step '
                    f'(YAML {row["parse_s"]:.3g}, scene {row["scene_s"]:.3g}, simulation '
                    f'{row["model_s"]:.3g}, step {row["step_s"]:.3g}) after imports of '
                    f'{row["imports_s"]:.2g} s; {row["memory_mb"]:.0f} MB',
                    flush=True,
                )
    with open(RESULTS / 'first_step.csv', 'w', encoding='utf-8', newline='') as stream:
        print(about(), file=stream)
        table = csv.writer(stream, lineterminator='\n')
        table.writerow(COLUMNS)
        for row in found:
            cells = [row[key] for key in COLUMNS]
            table.writerow([f'{c:.4g}' if isinstance(c, float) else c for c in cells])


if __name__ == '__main__':
    main()
