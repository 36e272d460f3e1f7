"""How long the thread that steps runs and waits: N four-bars at 1 kHz, with readers and logs.

    .venv/bin/python benchmark/waits.py [--bars 1000] [--duration 10]

Writes benchmark/results/waits.csv: a row for each number of processes that read joint_states and
each log. `steps_run`, `steps_queued` and `steps_asleep` are parts (%) of the time of the thread
that steps and publishes. It runs; or it is ready, but other threads have the processors; or it
waits for something else, as for the next tick. `node`, `others` (all other processes, readers too)
and `idle` are in % of a core. Linux only: the system counts these times for each thread
(/proc/PID/task/TID/schedstat). Beside other work `steps_queued` is larger.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from real_time import ROOT, cpu_seconds, simulator  # sets the path and the domain

# isort: split
from large_node import SCENE, counted, reader
from message_path import Timed
from recording import RATE, gained

from alf_ros.logs.provenance import about

RESULTS = ROOT / 'benchmark/results/waits.csv'
READERS = 0, 3
LOGS = 'none', '100 Hz', 'all'
COLUMNS = (
    'readers,log,ticks_per_s,heard_per_s,steps_run,steps_queued,steps_asleep,node,others,idle'
).split(',')


def thread_seconds(pid: int) -> tuple[float, float]:
    """Time (s) in which the first thread of a process ran, and in which it could not but would."""
    run, queued, _ = Path(f'/proc/{pid}/task/{pid}/schedstat').read_text().split()
    return 1e-9 * int(run), 1e-9 * int(queued)


def machine_seconds() -> tuple[float, float]:
    """Time (s) that all processors of the machine together were busy, and idle."""
    first = Path('/proc/stat').read_text().split('\n', 1)[0].split()
    user, nice, system, idle, waiting = (int(text) for text in first[1:6])
    tick = os.sysconf('SC_CLK_TCK')
    return (user + nice + system) / tick, (idle + waiting) / tick


def times(pid: int) -> list[float]:
    """Wall time; of the first thread run and queued; of the process; of the machine busy, idle."""
    return [time.monotonic(), *thread_seconds(pid), cpu_seconds(pid), *machine_seconds()]


def run(bars: int, readers: int, log: str, duration: float) -> list[str]:
    """One row."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        listener = stack.enter_context(Timed())
        (folder / 'scene.yaml').write_text(SCENE.format(bars=bars))
        options = ['--scene', str(folder / 'scene.yaml')] + ['--no-record'] * (log == 'none')
        options += ['--ros-args', '-p', f'rate:={RATE}']
        options += ['-p', 'record.rate.all:=100.0'] if log == '100 Hz' else []
        heard = [reader(folder / f'heard{n}.txt', stack) for n in range(readers)]
        node = stack.enter_context(simulator(folder, *options))
        listener.until(lambda: len(listener.reports) > 2)
        listener.reports.clear()
        listener.times.clear()
        before, begun = [counted(path) for path in heard], times(node.pid)
        end = begun[0] + duration

        def heard_for() -> float:
            """s between the first and the last report: late ones come together."""
            return listener.times[-1] - listener.times[0] if listener.times else 0.0

        listener.until(lambda: time.monotonic() > end and heard_for() > 0.5 * duration, 300.0)
        ended = times(node.pid)
        gain = [counted(path) - n for path, n in zip(heard, before, strict=True)]
        ticks = gained([report['timing'] for report in listener.reports], 'ticks')
        span = heard_for()
    wall, ran, queued, used, busy, idle = (b - a for a, b in zip(begun, ended, strict=True))
    parts = [ran, queued, wall - ran - queued, used, busy - used, idle]
    numbers = [ticks / span, min(gain, default=0) / wall, *(100.0 * part / wall for part in parts)]
    return [str(readers), log, *(f'{number:.4g}' for number in numbers)]


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--bars', type=int, default=1000, metavar='N', help='four-bars')
    parser.add_argument('--duration', type=float, default=10.0, metavar='S', help='of each run')
    options = parser.parse_args()
    with open(RESULTS, 'w', newline='', encoding='utf-8') as stream:
        load = f'load of the machine at the start {os.getloadavg()[0]:.1f}'
        print(f'{about()}; N = {options.bars}; {load}', file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(COLUMNS)
        for readers in READERS:
            for log in LOGS:
                row = run(options.bars, readers, log, options.duration)
                writer.writerow(row)
                said = (f'{name} {value}' for name, value in zip(COLUMNS, row, strict=True))
                print(', '.join(said), flush=True)


if __name__ == '__main__':
    main()
