"""A day of motion at 1 kHz, as fast as it can: energy against works, memory, and repeated bits.

    .venv/bin/python benchmark/day.py [--hours 24] [--seed 1]

A slider-crank with friction gets another random torque each second, and passes its singular
position in each half turn. Each minute a copy makes the next second, and the simulation makes it
twice, from its state restored: all to the bit. Each hour the simulation is pickled, and the run
continues with the new one. The ledger counts the work of everything that acts.

Prints a line for each simulated hour, and at the end writes benchmark/results/day.csv: quantity,
value, unit. Exit code 1 if bits differ or work is missing.
"""

from __future__ import annotations

import argparse
import copy
import csv
import os
import pickle
import random
import sys
import time
from pathlib import Path

from results_file import RESULTS  # sets the path

# isort: split
from alf_ros import Simulation, load_scene
from alf_ros.logs.provenance import about

SCENE = {
    'mechanism': 'slider_crank',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'joint_friction': {'joint': 'crank_pin', 'viscous': 0.5},
    },
    'initial': {'velocities': {'B': [-4.0, 0]}},
    'solver': {'step': 1e-3, 'integrator': 'rk4'},
}
TORQUE = 20.0  # N m, at most
SECOND, MINUTE, HOUR = 1_000, 60, 60  # steps, seconds, minutes
MOST_MISSING = 1e-6  # of the energy that went through


def held() -> tuple[int, int]:
    """Anonymous memory (kB) and open files of this process."""
    status = Path('/proc/self/status').read_text()
    memory = next(line.split()[1] for line in status.splitlines() if line.startswith('RssAnon'))
    return int(memory), len(os.listdir('/proc/self/fd'))


def bits(simulation: Simulation) -> bytes:
    """Of positions and velocities."""
    state = simulation.state
    return state.q.tobytes() + state.qd.tobytes()


class Day:
    """The run, and its faults."""

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)
        self._simulation = Simulation(load_scene(SCENE), ledger=True)
        self._began = self._simulation.sample().kinetic_energy
        self.compared = 0
        self.missing = self.through = 0.0
        self.faults: list[str] = []

    def hour(self) -> None:
        """Sixty minutes."""
        for _ in range(HOUR):
            for _ in range(MINUTE):
                self._simulation.apply_effort('crank_pin', self._chance.uniform(-TORQUE, TORQUE))
                self._simulation.step(SECOND)
            self._compare()
        self._simulation = pickle.loads(pickle.dumps(self._simulation))

    def _compare(self) -> None:
        sample = self._simulation.sample()
        works = dict(sample.works or {})
        self.through = sum(map(abs, works.values()))
        self.missing = max(
            self.missing, abs(sample.kinetic_energy - self._began - sum(works.values()))
        )
        twin = copy.deepcopy(self._simulation)
        state = self._simulation.state
        self._simulation.step(SECOND)
        twin.step(SECOND)
        self._simulation.restore(state)
        self._simulation.step(SECOND)
        self.compared += 1
        if bits(twin) != bits(self._simulation):
            self.faults.append(f'other bits after t = {state.step * self._simulation.h:g} s')

    def line(self) -> str:
        """The report so far."""
        return (
            f'{self._simulation.t / 3600.0:.2f} h simulated, {self.compared} comparisons, '
            f'{len(self.faults)} faults, work missing '
            f'{self.missing:.1e} of {self.through:.1e} J, memory {held()[0]} kB'
        )

    def is_sound(self) -> bool:
        """Whether no bits differed and no work was missing."""
        return not self.faults and self.missing <= MOST_MISSING * max(self.through, 1.0)


def main() -> int:
    """Run, print and store; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--hours', type=int, default=24, metavar='N')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--no-store', action='store_true', help='leave the results as they are')
    options = parser.parse_args()
    began, day, memory = time.monotonic(), Day(options.seed), []
    for _ in range(options.hours):
        day.hour()
        memory.append(held())
        print(day.line(), flush=True)
    half = memory[len(memory) // 2]
    rows = [
        ('simulated time', day._simulation.t / 3600.0, 'h'),
        ('real time', round((time.monotonic() - began) / 60.0, 1), 'min'),
        ('seconds repeated to the bit', day.compared, ''),
        ('faults', len(day.faults), ''),
        ('work and energy that went through', f'{day.through:.3g}', 'J'),
        ('largest work not accounted for', f'{day.missing:.1e}', 'J'),
        ('memory at half of the time', half[0], 'kB'),
        ('memory at the end', memory[-1][0], 'kB'),
        ('open files at half of the time', half[1], ''),
        ('open files at the end', memory[-1][1], ''),
    ]
    if not options.no_store:
        with open(RESULTS / 'day.csv', 'w', newline='', encoding='utf-8') as stream:
            stream.write(f'{about()}\n')
            writer = csv.writer(stream, lineterminator='\n')
            writer.writerows([('quantity', 'value', 'unit'), *rows])
    for fault in day.faults:
        print(fault)
    return int(not day.is_sound())


if __name__ == '__main__':
    sys.exit(main())
