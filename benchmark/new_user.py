"""The first hour of a new user, timed: from the README to an own mechanism and a pushed node.

    .venv/bin/python benchmark/new_user.py [--fresh | --warm]

Commands, files and programs are taken from README.md and doc/, in the order of doc/new_user.md.
Without `--fresh` they run in a temporary folder, with the environment of this interpreter and an
empty cache of compiled code. With `--fresh` they run in a new clone, where `make setup` first
makes a new environment (needs a package index). Prints the seconds of each step, and its processor
seconds, which other programs change less. Writes benchmark/results/new_user.csv, from which
benchmark/tables.py makes the table of doc/new_user.md. Reading and typing are not included.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import resource
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / 'benchmark' / 'results'
COLUMNS = ('step', 'page', 'command', 'seconds', 'processor_seconds')
LIMIT = 600.0  # s, of each command
# What stands between ``` lines, and its kind.
_BLOCK = re.compile(r'^```(\w+)\n(.*?)^```$', re.DOTALL | re.MULTILINE)
# The last step of a user has no block of its own: the call of doc/runs.md for the own mechanism.
PLOT = """from alf_ros import Simulation, load_scene, record

run = record(Simulation(load_scene('lambda.yaml')), 1.0, every=10)
run.plot('crank_pin.force', file='crank_pin.png')
"""


def blocks(page: str, kind: str) -> list[str]:
    """The blocks of a kind on a page of the repository."""
    return [
        text for each, text in _BLOCK.findall((ROOT / page).read_text('utf-8')) if each == kind
    ]


@dataclass
class User:
    """A user in `folder`, whose commands run with `python`.

    `rows` are the timed steps; `node` runs from `starts_the_node` to `ends_the_node`.
    """

    folder: Path
    python: str
    environment: dict[str, str]
    rows: list[tuple[str, str, str, float, float]] = field(default_factory=list)
    node: subprocess.Popen[str] | None = None

    def does(self, step: str, page: str, command: str, work: Callable[[], object]) -> None:
        """Time one step."""
        start, before = time.monotonic(), processor_seconds(self.node)
        work()
        seconds = time.monotonic() - start
        used = processor_seconds(self.node) - before
        self.rows.append((step, page, command, seconds, used))
        print(f'{seconds:8.1f} s, of a processor {used:6.1f} s: {step}, {command}', flush=True)

    def runs(self, *command: str) -> str:
        """Run a command; returns its output. Raises CalledProcessError if it fails."""
        return subprocess.run(
            command,
            cwd=self.folder,
            env=self.environment,
            text=True,
            check=True,
            stdout=subprocess.PIPE,
            timeout=LIMIT,
        ).stdout

    def saves(self, name: str, text: str) -> None:
        """Save a file in the folder."""
        (self.folder / name).write_text(text, 'utf-8')

    def starts_the_node(self) -> None:
        """Start the command of `make run`; returns when the node simulates."""
        command = [self.python, '-m', 'alf_ros', 'simulator', '--scene', 'slider_crank']
        self.node = subprocess.Popen(
            command,
            cwd=self.folder,
            env=self.environment | {'PYTHONUNBUFFERED': '1'},
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        assert self.node.stdout is not None
        shown = []
        for line in self.node.stdout:
            shown.append(line)
            if 'running:' in line:
                return
        raise RuntimeError('the node has ended: ' + ''.join(shown))

    def ends_the_node(self, number: int = signal.SIGINT) -> None:
        """End the node, if it runs. Raises RuntimeError if it fails."""
        if self.node is None:
            return
        node, self.node = self.node, None
        os.killpg(node.pid, number)
        shown, _ = node.communicate(timeout=LIMIT)
        if node.returncode and number == signal.SIGINT:
            raise RuntimeError(f'the node has failed: {shown}')


def processor_seconds(node: subprocess.Popen[str] | None) -> float:
    """Processor time of all ended children of this process, and of `node` while it runs."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    running = 0.0
    if node is not None:
        fields = Path(f'/proc/{node.pid}/stat').read_text().rpartition(')')[2].split()
        running = (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
    return ended.ru_utime + ended.ru_stime + running


def the_node_moves(user: User) -> None:
    """README to a moving mechanism, and the push of the tutorial."""
    page = 'doc/tutorial.md'
    push, look = (
        next(text for text in blocks(page, 'python') if text.startswith(f'# {name}'))
        for name in ('push.py', 'look.py')
    )
    user.saves('push.py', push)
    user.saves('look.py', look)
    try:
        user.does('a moving mechanism', 'README.md', 'make run', user.starts_the_node)
        pushed = partial(user.runs, user.python, 'push.py')
        user.does('a pushed node', page, 'push.py', pushed)
        user.ends_the_node()
    finally:
        user.ends_the_node(signal.SIGKILL)

    def looks() -> None:
        if 'force [0.0, 5.0] on coupler' not in user.runs(user.python, 'look.py'):
            raise RuntimeError('the log does not contain the push')

    user.does('the push in the log', page, 'look.py', looks)


def forces_are_plotted(user: User) -> None:
    """The minute of Python in the README."""
    (text,) = blocks('README.md', 'python')
    user.saves('pin_force.py', text)
    run = partial(user.runs, user.python, 'pin_force.py')
    user.does('a plot of a reaction', 'README.md', 'pin_force.py', run)


def an_own_mechanism_moves(user: User) -> None:
    """The page of the first own mechanism, and a plot of its reactions."""
    page = 'doc/first_mechanism.md'
    user.saves('lambda.yaml', blocks(page, 'yaml')[0])
    _, *check = shlex.split(blocks(page, 'sh')[0])
    checked = partial(user.runs, user.python, *check)
    user.does('an own mechanism, checked', page, 'check lambda.yaml', checked)
    user.saves('own.py', blocks(page, 'python')[0])
    moved = partial(user.runs, user.python, 'own.py')
    user.does('an own mechanism, moving', page, 'own.py', moved)
    user.saves('plot.py', PLOT)
    plotted = partial(user.runs, user.python, 'plot.py')
    user.does('its reactions, plotted', 'doc/runs.md', 'plot.py', plotted)
    if not (user.folder / 'crank_pin.png').is_file():
        raise RuntimeError('the picture of the reactions is missing')


PATHS = {'node': the_node_moves, 'plot': forces_are_plotted, 'own': an_own_mechanism_moves}


def new_user(folder: Path, fresh: bool, warm: bool) -> User:
    """A user in an empty folder. `fresh`: in a new clone, with the environment of `make setup`.

    `warm`: the solver is compiled already.
    """
    own = {'MPLBACKEND': 'Agg'}
    if not warm:
        own['NUMBA_CACHE_DIR'] = str(folder / 'compiled')
    # of a `make` around this process
    of_make = ('MAKEFLAGS', 'MAKEOVERRIDES', 'MAKELEVEL', 'MFLAGS', 'ARGS', 'PYTHONPATH')
    rest = {key: value for key, value in os.environ.items() if key not in of_make} | own
    rest.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    if not fresh:
        path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH', '')]))
        return User(folder, sys.executable, rest | {'PYTHONPATH': path})
    clone = folder / 'clone'
    user = User(folder, str(clone / '.venv' / 'bin' / 'python'), rest)
    address = ['git', 'clone', '--quiet', str(ROOT), str(clone)]
    user.does('a clone', 'README.md', 'git clone', partial(user.runs, *address))
    user.folder = clone
    setup = partial(user.runs, 'make', 'setup', f'PYTHON={sys.executable}')
    user.does('the environment', 'README.md', 'make setup', setup)
    return user


def main() -> None:
    """Run the paths, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--fresh', action='store_true', help='in a new clone, with make setup')
    parser.add_argument('--warm', action='store_true', help='use stored compiled code')
    parser.add_argument('--only', nargs='+', choices=PATHS, default=list(PATHS), metavar='PATH')
    parser.add_argument('--output', type=Path, default=RESULTS / 'new_user.csv', metavar='FILE')
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    from alf_ros.logs.provenance import about

    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix='alf_ros-new_user-') as folder:
        user = new_user(Path(folder), options.fresh, options.warm)
        for name in options.only:
            PATHS[name](user)
    with open(options.output, 'w', encoding='utf-8', newline='') as stream:
        load = f'{before:.1f} before, {os.getloadavg()[0]:.1f} after'
        print(f'{about()}; processes that were ready to run: {load}', file=stream)
        table = csv.writer(stream, lineterminator='\n')
        table.writerow(COLUMNS)
        table.writerows([*row[:3], f'{row[3]:.1f}', f'{row[4]:.1f}'] for row in user.rows)
    print(f'{sum(row[3] for row in user.rows):8.1f} s in all; {options.output}')


if __name__ == '__main__':
    main()
