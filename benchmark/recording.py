"""The cost of recording at 1 kHz: lateness of ticks with and without it, bytes, processor.

    .venv/bin/python benchmark/recording.py [--duration 600] [--scene slider_crank]

Writes benchmark/results/recording.csv: quantity, value, unit. The node runs twice for `duration`
seconds, in a process of its own; nothing else should run beside it.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
import time
from pathlib import Path

from real_time import ROOT, Listener, Rows, cpu_seconds, simulator  # sets the path and the domain

# isort: split
from diagnostic_msgs.msg import DiagnosticArray

from alf_ros.logs import load
from alf_ros.logs.provenance import versions

RATE = 1000.0


class Reports(Listener):
    """Listens to the diagnostics as well: the values of each report by task."""

    def __init__(self) -> None:
        super().__init__()
        self.reports: list[dict[str, dict[str, str]]] = []
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._report, 10)

    def _report(self, message: DiagnosticArray) -> None:
        tasks = {
            status.name.rpartition(': ')[2]: {entry.key: entry.value for entry in status.values}
            for status in message.status
        }
        self.reports.append(tasks)


def run(scene: str, duration: float, recorded: bool) -> Rows:
    """One run of `duration` s of wall time after two seconds; rows of what it cost."""
    options = ['--scene', scene] + ([] if recorded else ['--no-record'])
    options += ['--ros-args', '-p', f'rate:={RATE}']
    with Reports() as listener, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with simulator(folder, *options) as process:
            listener.until(lambda: len(listener.reports) > 2)
            listener.reports.clear()
            cpu, wall = cpu_seconds(process.pid), time.monotonic()
            end = wall + duration
            listener.until(lambda: time.monotonic() > end, duration + 300.0)
            wall = time.monotonic() - wall
            cpu = cpu_seconds(process.pid) - cpu
        timing = [report['timing'] for report in listener.reports]
        label = 'with a log' if recorded else 'without'
        rows: Rows = [
            (f'ticks, {label}', int(timing[-1]['ticks']) - int(timing[0]['ticks']), '1'),
            (f'overruns, {label}', gained(timing, 'overruns'), '1'),
            (f'real time lost, {label}', gained(timing, 'lost_real_time_s'), 's'),
            (f'lateness p50, {label}', 1e6 * mean(timing, 'lateness_p50_s'), 'us'),
            (f'lateness p99, {label}', 1e6 * mean(timing, 'lateness_p99_s'), 'us'),
            (f'worst p99 of a second, {label}', 1e6 * worst(timing, 'lateness_p99_s'), 'us'),
            (f'processor, {label}', 100.0 * cpu / wall, '% of one core'),
        ]
        if recorded:
            (path,) = folder.glob('*/*.mcap')
            count = sum(load(path).survey.counts.values())
            dropped = listener.reports[-1]['record']['dropped_messages']
            rows += [
                ('messages logged', count, '1'),
                ('messages dropped', int(dropped), '1'),
                ('bytes per message', path.stat().st_size / count, 'B'),
                ('bytes per second', path.stat().st_size / load(path).end, 'B/s'),
            ]
    return rows


def gained(reports: list[dict[str, str]], key: str) -> float:
    """By how much a count has grown."""
    return float(reports[-1][key]) - float(reports[0][key])


def mean(reports: list[dict[str, str]], key: str) -> float:
    """Of the values of each second."""
    return sum(float(report[key]) for report in reports) / len(reports)


def worst(reports: list[dict[str, str]], key: str) -> float:
    """The largest of the values of each second."""
    return max(float(report[key]) for report in reports)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--duration', type=float, default=600.0, metavar='S', help='of each run')
    parser.add_argument('--scene', default='slider_crank')
    options = parser.parse_args()
    rows: Rows = [
        ('load average before the start', os.getloadavg()[0], '1'),
        ('duration of each run', options.duration, 's'),
    ]
    for recorded in (False, True):
        rows += run(options.scene, options.duration, recorded)
    path = ROOT / 'benchmark/results/recording.csv'
    path.parent.mkdir(exist_ok=True)
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(['quantity', 'value', 'unit'])
        for name, value, unit in rows:
            shown = f'{value:.4g}' if isinstance(value, float) else value
            print(f'{name:41} {shown:>10} {unit}')
            writer.writerow([name, shown, unit])
        about = {**versions(), 'scene': options.scene, 'cores': os.cpu_count()}
        writer.writerows([name, value, ''] for name, value in about.items())
        writer.writerow(['date', time.strftime('%Y-%m-%d'), ''])
    print(path.relative_to(ROOT))
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
