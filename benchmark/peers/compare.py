"""Other engines and this one through the same singular positions: survival and cost.

    .venv/bin/python benchmark/peers/compare.py [--venv DIR]

Makes an environment of its own for them (requirements.txt), and writes
benchmark/results/peers.csv, a line for each run. The same physics
everywhere: rods with inertia, no friction, no damping; each model is checked by its energy, and at
tiny steps by the exact motion. Settings are in each peer_<name>.py.
A run takes 2.5 s of processor time at most: the sweep of an engine ends before the first step that
would need more. With ten four-bars Exudyn gets to about k = 17, Pinocchio to 40.
One process at a time; times are of the processor, medians of 1 to 3 runs.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.studies.exact import motions  # noqa: E402

SURVIVAL = range(5, 61)  # k of h = 0.01 s / k
COARSE, FINE = (1, 2, 3, 4), (80, 120, 160, 240)
TEN = motions.four_bars(10, motions.TEN_SECONDS)  # as many as in the library
# motion, and angle (rad) and rate (rad/s) of the cranks at the start
STARTS = {
    'slider_crank': (motions.paper('slider_crank'), math.pi / 4, 2.0 * math.sqrt(2.0)),
    'double_four_bar': (motions.paper('double_four_bar'), math.pi / 2, -1.0),
    'n_four_bar': (TEN, math.pi / 2, -1.0),
}
LONGEST = 2.5  # s of processor time that a run may take; smaller steps are left out
COLUMNS = 'peer,about,mechanism,step_s,tolerance,position_error_m,cpu_ms_per_s,failure'.split(',')


def plan() -> dict[str, Any]:
    """The mechanisms with their exact motions, and the steps."""
    cases = {}
    for name, (motion, theta, rate) in STARTS.items():
        cases[name] = {
            'exact': motion.exact().tolist(),
            'spacing': motion.times[1],
            'theta': theta,
            'rate': rate,
            'energy': Simulation(load_scene(name)).sample().energy,
        }
    numbers = {
        'all': [*COARSE, *SURVIVAL, *FINE],
        # its loop is in Python: every fifth
        'pinocchio': [*COARSE, *SURVIVAL[::5], 80, 120],
    }
    return {'cases': cases, 'numbers': numbers, 'longest': LONGEST}


def environment(folder: Path) -> Path:
    """The interpreter of the peers, with what requirements.txt says."""
    python = folder / 'bin' / 'python'
    if not python.is_file():
        venv.create(folder, with_pip=True)

    subprocess.run(
        [python, '-m', 'pip', 'install', '--quiet', '-r', HERE / 'requirements.txt'], check=True
    )
    return python


def lines(theirs: Path) -> list[dict[str, Any]]:
    """The results of all engines; an engine that does not run is named and left out."""
    with tempfile.TemporaryDirectory() as folder:
        asked, said = Path(folder, 'plan.json'), Path(folder, 'results.jsonl')
        asked.write_text(json.dumps(plan()), encoding='utf-8')
        for name in ('alf_ros', 'mujoco', 'exudyn', 'pinocchio'):
            python = sys.executable if name == 'alf_ros' else str(theirs)
            started = time.monotonic()
            command = [python, '-W', 'ignore', f'peer_{name}.py', str(asked), str(said)]
            code = subprocess.run(command, cwd=HERE, stdout=subprocess.DEVNULL).returncode
            note = f'ended with {code}' if code else 'done'
            print(f'{name}: {note} in {time.monotonic() - started:.0f} s', flush=True)
        return [json.loads(line) for line in said.read_text(encoding='utf-8').splitlines()]


def main() -> None:
    """Run all and write the results."""
    parser = argparse.ArgumentParser(description='Compare with other engines.')
    parser.add_argument('--venv', type=Path, default=HERE / '.venv', metavar='DIR')
    found = lines(environment(parser.parse_args().venv))
    with open(ROOT / 'benchmark/results/peers.csv', 'w', newline='', encoding='utf-8') as stream:
        print(about(), file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(COLUMNS)
        for line in found:
            step = f'{0.01 / line["k"]:.9g}' if 'k' in line else ''
            tolerance = f'{line["tolerance"]:.3g}' if 'tolerance' in line else ''
            numbers = [line['error'], line['cpu']]
            shown = ['' if number is None else f'{number:.4g}' for number in numbers]
            head = [line['peer'], line['about'], line['mechanism'], step, tolerance]
            writer.writerow([*head, *shown, line['failure']])


if __name__ == '__main__':
    main()
