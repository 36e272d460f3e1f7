"""The node for hours: two simulators, one folder for logs; commands, resets, stops and kills.

    .venv/bin/python benchmark/soak.py [--minutes 60] [--factor 0] [--seed 1]

Each simulator (slider_crank at 1 kHz, delta_robot_controlled at 100 Hz) runs as fast as it can
(--factor 0), with its work ledger and its log; two readers subscribe. At random instants it gets a
wrench, an effort, a pause, a reset, a saved or restored state, SIGSTOP for a second, or a limit of
64 open files. The first also gets Ctrl-C, SIGKILL, a full disk, or a folder of its log that
vanishes, and is started again. The second lives for the whole time: its memory and open files are
the measured ones. A log that has ended is recovered if it was cut, verified, and removed if every
message of the run came out again; one that differs is named.

Prints a line each minute, and at the end writes benchmark/results/soak.csv: quantity, value, unit.
Exit code 1 if a log differs, a process ends with another code than it should, or work is missing.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]
# A domain away from the default one, on this machine only; child processes inherit it.
os.environ.setdefault('ROS_DOMAIN_ID', '96')
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

import numpy as np  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import WrenchStamped  # noqa: E402
from sensor_msgs.msg import JointState, MultiDOFJointState  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.errors import AlfError  # noqa: E402
from alf_ros.logs import load  # noqa: E402
from alf_ros.logs.comparison import compare, told  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.ros.recording.recover import recover  # noqa: E402
from support.ros_node import Peer, SimulatorProcess  # noqa: E402

RESULTS = ROOT / 'benchmark/results/soak.csv'
SCENES = {'left': 'slider_crank', 'right': 'delta_robot_controlled'}
LASTING = 'right'
RATES = {'left': 1000.0, 'right': 100.0}  # Hz
LARGEST_MISSING = 1e-3  # J, of runs of some ten joules
SETTLED = 20.0  # s after a start, from which on memory counts
PAUSE = 0.5  # s between two acts, on average
FEW_FILES = 64


@dataclass
class Totals:
    """The counts and faults of all simulators."""

    acts: Counter[str] = field(default_factory=Counter)
    simulated: float = 0.0
    missing: float = 0.0
    logs: int = 0
    faults: list[str] = field(default_factory=list)
    # of the process that lasts: s since its start, anonymous memory kB, open files
    watched: list[tuple[float, int, int]] = field(default_factory=list)


class Simulated:
    """One simulator: its process, and what this one says to it and hears of it."""

    def __init__(
        self, side: str, scene: str, folder: Path, factor: float, peer: Peer, totals: Totals
    ) -> None:
        self.side, self.scene, self.folder = side, scene, folder
        self._factor, self._peer, self._totals = factor, peer, totals
        self._heard = 0.0  # stamp, s
        self._listen('joint_states', JointState, self._on_joints)
        self._listen('simulator/reactions', MultiDOFJointState, lambda _: None)
        self._listen('/diagnostics', DiagnosticArray, self._on_reports)
        model = Simulation(load_scene(scene)).model
        self._wrenches = {
            body.name: peer.node.create_publisher(
                WrenchStamped, f'/{side}/simulator/wrench/{body.name}', 10
            )
            for body in model.mechanism.bodies
        }
        self._efforts = peer.node.create_publisher(JointState, f'/{side}/joint_commands', 10)
        self._joints = [each.name for each in model.coordinates if each.is_angle]
        self._ready: Any = None
        self.start()

    def _listen(self, topic: str, kind: type, hear: Callable[[Any], None]) -> None:
        name = topic if topic.startswith('/') else f'/{self.side}/{topic}'
        self._peer.node.create_subscription(kind, name, hear, 100)

    def _on_joints(self, message: JointState) -> None:
        at = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        self._totals.simulated += max(0.0, at - self._heard)
        self._heard = at

    def _on_reports(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f'{self.side}/simulator: work':
                values = {each.key: each.value for each in status.values}
                self._totals.missing = max(self._totals.missing, abs(float(values['missing_j'])))

    def start(self) -> None:
        """Start the process; it logs into the folder that all share."""
        folder = self.folder / f'{self.side}{self._totals.acts["start"]}'
        ros = ['--ros-args', '-r', f'__ns:=/{self.side}', '-p', 'ledger:=true']
        ros += ['-p', f'real_time_factor:={self._factor}', '-p', f'rate:={RATES[self.side]}']
        options = ['--log-folder', str(self.folder), '--scene', self.scene]
        self._process = SimulatorProcess(folder, *options, *ros).wait_running()
        self._began, self._heard = time.monotonic(), 0.0
        self._totals.acts['start'] += 1

    def act(self, chance: random.Random) -> None:
        """One act, drawn with its weight."""
        acts = {
            self.push: 20,
            self.effort: 20,
            self.pause: 5,
            self.ask: 10,
            self.freeze: 2,
            self.few_files: 1,
        }
        if self.side != LASTING:
            acts |= {self.end: 1, self.kill: 1, self.fill: 1, self.vanish: 1}
        (act,) = chance.choices(list(acts), list(acts.values()))
        self._totals.acts[act.__name__] += 1
        try:
            act(chance)
        except AssertionError as error:  # no answer, or no end, within its time
            self._totals.faults.append(f'{self.side}, {act.__name__}: {error}')

    def push(self, chance: random.Random) -> None:
        """A wrench on a body."""
        message = WrenchStamped()
        message.wrench.force.x = chance.gauss(0.0, 0.5)
        message.wrench.force.y = chance.gauss(0.0, 0.5)
        chance.choice(list(self._wrenches.values())).publish(message)

    def effort(self, chance: random.Random) -> None:
        """An effort on a joint."""
        name = chance.choice(self._joints)
        self._efforts.publish(JointState(name=[name], effort=[chance.gauss(0.0, 0.1)]))

    def pause(self, _: random.Random) -> None:
        """A pause of half a second."""
        self._call(SetBool, 'pause', data=True)
        time.sleep(0.5)
        self._call(SetBool, 'pause', data=False)

    def ask(self, chance: random.Random) -> None:
        """A reset, or a state kept or taken back; there may be none yet."""
        names = ('save_state', 'save_state', 'restore_state', 'reset', 'reset_state')
        self._call(Trigger, chance.choice(names))

    def freeze(self, _: random.Random) -> None:
        """SIGSTOP for a second."""
        os.killpg(self._process.process.pid, signal.SIGSTOP)
        time.sleep(1.0)
        os.killpg(self._process.process.pid, signal.SIGCONT)

    def few_files(self, _: random.Random) -> None:
        """A second with 64 file handles, in which a new log begins, or cannot."""
        pid = self._process.process.pid
        before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (FEW_FILES, before[1]))
        self._call(Trigger, 'reset_state')
        time.sleep(1.0)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)

    def fill(self, _: random.Random) -> None:
        """A disk that is full soon, Ctrl-C, and a new start."""
        size = sum(file.stat().st_size for file in self._log.glob('*.mcap'))
        pid, limit = self._process.process.pid, resource.RLIMIT_FSIZE
        resource.prlimit(pid, limit, (size + 4096, resource.RLIM_INFINITY))
        time.sleep(2.0)
        self.stop(0, 1)
        self.start()

    def vanish(self, _: random.Random) -> None:
        """The folder of the log is removed; Ctrl-C, and a new start."""
        shutil.rmtree(self._log)
        time.sleep(1.0)
        self.stop(0, 1)
        self.start()

    @property
    def _log(self) -> Path:
        """The folder of the log that is written now."""
        return max(self.folder.glob(f'{self.scene}_*'))  # the time is in the name

    def end(self, _: random.Random) -> None:
        """Ctrl-C, and a new start."""
        self.stop()
        self.start()

    def kill(self, _: random.Random) -> None:
        """SIGKILL, and a new start."""
        os.killpg(self._process.process.pid, signal.SIGKILL)
        self._process.process.wait()
        self.start()

    def _call(self, kind: Any, name: str, **request: Any) -> None:
        self._peer.call(kind, f'/{self.side}/simulator/{name}', **request)

    def stop(self, *codes: int) -> None:
        """End the process, whose exit code must be 0, or one of these."""
        code = self._process.stop()
        if code not in (codes or (0,)):
            last = self._process.output.splitlines()[-1:]
            self._totals.faults.append(f'{self.side} ended with {code}: {last}')

    def watch(self) -> None:
        """Note memory and open files of the process that lasts (Linux)."""
        if self.side != LASTING:
            return
        pid, age = self._process.process.pid, time.monotonic() - self._began
        lines = Path(f'/proc/{pid}/status').read_text().splitlines()
        memory = next(int(line.split()[1]) for line in lines if line.startswith('RssAnon'))
        if age > SETTLED:
            files = len(list(Path(f'/proc/{pid}/fd').iterdir()))
            self._totals.watched.append((age, memory, files))


def judged(log: Path, totals: Totals) -> None:
    """Recover a log if it was cut, verify it, and remove it if all came out again."""
    try:
        read = load(log)
        if read.damage:
            recover(read, log / 'recovered')
            read = load(log / 'recovered')
        result = compare(read)
        said = '' if result.equal else told(read, result)
    except AlfError as error:
        said = str(error)
    if said:
        totals.faults.append(f'{log}: {said}')
        return
    totals.logs += 1
    shutil.rmtree(log)


def ended(folder: Path) -> list[Path]:
    """Folders of logs in which nobody writes any more: all but the newest two of each scene."""
    found = []
    for scene in SCENES.values():
        found += sorted(folder.glob(f'{scene}_*'))[:-2]  # the time is in the name
    return found


def growth(totals: Totals) -> tuple[float, int]:
    """(kB a minute, open files more) of the process that lasts: of the second half of its time,
    memory by the straight line of least squares."""
    rows = np.array(totals.watched[len(totals.watched) // 2 :])
    if len(rows) < 3:
        return 0.0, 0
    slope = np.polynomial.Polynomial.fit(rows[:, 0], rows[:, 1], 1).convert().coef[-1]
    return 60.0 * float(slope), int(rows[-1, 2] - rows[0, 2])


def soak(options: argparse.Namespace, folder: Path) -> Totals:
    """Run as the command line says; logs below `folder`."""
    totals, chance = Totals(), random.Random(options.seed)
    most = options.acts or sys.maxsize
    waiting: dict[Path, Future[None]] = {}  # logs that are judged, one at a time, meanwhile
    with Peer() as peer, ThreadPoolExecutor(1) as judge:
        sides = [
            Simulated(side, scene, folder, options.factor, peer, totals)
            for side, scene in SCENES.items()
        ]
        end, printed = time.monotonic() + 60.0 * options.minutes, time.monotonic()
        try:
            while time.monotonic() < end and totals.acts.total() < most:
                until = time.monotonic() + chance.expovariate(1.0 / PAUSE)
                while time.monotonic() < until:
                    peer.executor.spin_once(timeout_sec=0.05)
                side = chance.choice(sides)
                side.act(chance)
                side.watch()
                for log in ended(folder):
                    if log not in waiting:
                        waiting[log] = judge.submit(judged, log, totals)
                if time.monotonic() - printed > 60.0:
                    printed = time.monotonic()
                    print(line(totals), flush=True)
        finally:
            for side in sides:
                side.stop()
        for scene in SCENES.values():
            for log in folder.glob(f'{scene}_*'):
                if log not in waiting:
                    waiting[log] = judge.submit(judged, log, totals)
        for each in waiting.values():
            each.result()
    return totals


def line(totals: Totals) -> str:
    """The report so far, in one line."""
    memory, files = growth(totals)
    return (
        f'{totals.simulated / 3600.0:.2f} h simulated, {totals.acts.total()} acts, '
        f'{totals.logs} logs verified, {len(totals.faults)} faults, '
        f'work missing {totals.missing:.1e} J, memory {memory:+.0f} kB/min, files {files:+d}'
    )


def main() -> int:
    """Run, print and store; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--minutes', type=float, default=60.0, metavar='N')
    parser.add_argument('--acts', type=int, default=0, help='end after so many, if not before')
    parser.add_argument('--factor', type=float, default=0.0, help='real-time factor; 0: as it can')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--no-store', action='store_true', help='leave the results as they are')
    options = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        totals = soak(options, Path(folder))
    print(line(totals))
    for fault in totals.faults:
        print(fault)
    memory, files = growth(totals)
    rows: list[tuple[str, object, str]] = [
        ('real-time factor', options.factor or 'as fast as it can', ''),
        ('real time', round((time.monotonic() - began) / 60.0, 1), 'min'),
        ('simulated time', round(totals.simulated / 3600.0, 3), 'h'),
        *((f'acts: {name}', count, '') for name, count in sorted(totals.acts.items())),
        ('logs verified equal', totals.logs, ''),
        ('faults', len(totals.faults), ''),
        ('largest work not accounted for', f'{totals.missing:.1e}', 'J'),
        ('growth of memory, second half', round(memory, 1), 'kB/min'),
        ('growth of open files, second half', files, ''),
    ]
    if totals.watched:
        half, end = totals.watched[len(totals.watched) // 2], totals.watched[-1]
        rows += [
            ('memory at half of the time', half[1], 'kB'),
            ('memory at the end', end[1], 'kB'),
        ]
    if not options.no_store:
        with open(RESULTS, 'w', newline='') as stream:
            stream.write(f'{about()}\n')
            writer = csv.writer(stream, lineterminator='\n')
            writer.writerows([('quantity', 'value', 'unit'), *rows])
    return int(bool(totals.faults) or totals.missing > LARGEST_MISSING)


if __name__ == '__main__':
    sys.exit(main())
