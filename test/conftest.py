"""Every test process is alone: its own ROS domain, this machine only, temporary logs."""

from __future__ import annotations

import fcntl
import gc
import importlib
import os
import re
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING

import pytest
from hypothesis import settings

from support.thorough import LONG
from support.traced import leave_children_alone

if TYPE_CHECKING:
    from support.ros_node import Peer

# Hundreds of test files make objects that stay: the collector of cycles passes over them in vain,
# which takes a fifth of the time of a start. It begins when all are there.
gc.disable()

# Set at import: rclpy reads them when it is first initialised, and child processes inherit them.


def _reserve_domain() -> tuple[int, IO[str]]:
    """Return a ROS domain and the lock that keeps it ours until this process ends.

    0 is everybody's default; above 101 the ports can collide with ephemeral ones on Linux.
    """
    for turn in range(101):
        domain = 1 + (os.getpid() + turn) % 101
        lock = open(Path(tempfile.gettempdir()) / f'alf_ros-{os.getuid()}-{domain}.lock', 'w')
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return domain, lock
        except BlockingIOError:
            lock.close()
    raise RuntimeError('all 101 ROS domains are taken by other test processes')


_DOMAIN, _LOCK = _reserve_domain()
_LOGS = tempfile.TemporaryDirectory(prefix='alf_ros-test-')
os.environ['ROS_DOMAIN_ID'] = str(_DOMAIN)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_LOG_DIR'] = _LOGS.name
# Before anything imports numpy. Threads of BLAS wait by spinning. Matrices here are small: beside
# other workers such threads multiply their time.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
# A shell's `&`, or nohup, has these ignored, and children inherit that, but no handler.
for _number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(_number) == signal.SIG_IGN:
        signal.signal(_number, lambda number, frame: None)
if 'PYTEST_XDIST_WORKER' in os.environ:  # the process that starts the workers has them traced
    leave_children_alone()


def pytest_addoption(parser: pytest.Parser) -> None:
    """How many scene files with mistakes test/scene/test_mutants.py tries, how often each process
    of an ensemble is killed (test/studies/test_ensemble_kills.py), and whether files that need ROS
    are left out."""
    parser.addoption('--mutants', type=int, default=100, metavar='N')
    parser.addoption('--kills', type=int, default=1, metavar='N')
    parser.addoption('--without-ros', action='store_true')


_WITH_ROS = ('commands', 'project', 'ros')
_ROS = re.compile(r'rclpy|_msgs|ros\.simulator|support\.(balance|log_files|ros_node)')


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files that need ROS, and tests of the whole project, with `--without-ros`."""
    if not config.getoption('--without-ros'):
        return None
    if collection_path.parent.name in _WITH_ROS:
        return True
    if collection_path.suffix != '.py':
        return None
    return bool(_ROS.search(collection_path.read_text('utf-8'))) or None


# What is drawn is the same every time: a failure is of the change, not of the day. `make fuzz` and
# `make thorough` draw anew.
settings.register_profile('same', derandomize=True, database=None)
if not LONG:
    settings.load_profile('same')

# Long files, also those that would begin late: a file that begins last should be short.
_FIRST = (
    'simulation/test_tangents.py',
    'project/test_pages.py',
    'effects/test_effect_contract.py',
    'project/test_docs.py',
    'simulation/test_side_by_side.py',
    'studies/test_gradient.py',
    'project/test_install.py',
    'studies/test_equilibrium_path.py',
    'studies/test_optimise.py',
    'kernel/test_cache_attacks.py',
    'inspection/test_check.py',
    'studies/test_hard_cases.py',
    'project/test_packaging.py',
    'studies/test_ensemble_kills.py',
    'model/test_softest.py',
    'studies/test_work_precision.py',
    'ros/test_view.py',
)
# Tests of these folders start processes and wait for them; others compute.
_WAITING = ('commands', 'project', 'ros')


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out tests of `make thorough`. Mix files that wait with files that compute, so that
    workers share the processor evenly.

    Workers take the files in this order (`--no-loadscope-reorder`).
    """
    if not LONG:
        left = [item for item in items if item.get_closest_marker('thorough')]
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if not item.get_closest_marker('thorough')]
    folder = Path(__file__).parent
    files = list(dict.fromkeys(item.path for item in items))
    kinds: tuple[list[Path], list[Path]] = [], []
    for path in files:
        kinds[path.parent.name in _WAITING].append(path)
    place = {path: (n + 0.5) / len(kind) for kind in kinds for n, path in enumerate(kind)}
    place |= {folder / name: n - len(_FIRST) for n, name in enumerate(_FIRST)}
    items.sort(key=lambda item: place[item.path])


def pytest_sessionstart(session: pytest.Session) -> None:
    """Import the test files, each worker in another order.

    pytest keeps the code of a file after it has rewritten its assertions, half of the time of a
    first collection. All workers collect in one order, so that each would rewrite each file.
    """
    worker = getattr(session.config, 'workerinput', None)
    if worker is None:
        return
    if session.config.getoption('--without-ros'):
        return
    named = [Path(argument.partition('::')[0]).absolute() for argument in session.config.args]
    files = [file for path in named for file in sorted(path.rglob('test_*.py')) or [path]]
    start = len(files) * int(worker['workerid'].removeprefix('gw')) // worker['workercount']
    for path in files[start:] + files[:start]:
        if str(path.parent) not in sys.path:
            sys.path.insert(0, str(path.parent))
        # whatever a file raises, it raises again when it is collected, and that says it
        with suppress(Exception, pytest.skip.Exception):
            importlib.import_module(path.stem)


def pytest_collection_finish() -> None:
    """Tests and modules stay: the collector of cycles need not pass over them again."""
    gc.freeze()
    gc.enable()


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    """Name a test when it fails: a run that is stopped from outside has no summary."""
    if not report.failed:
        return None
    if report.when in ('setup', 'teardown'):
        return 'error', f'\nerror: {report.nodeid}\n', 'ERROR'
    return 'failed', f'\nfailed: {report.nodeid}\n', 'FAILED'


@pytest.fixture
def peer() -> Iterator[Peer]:
    """A node in this process; what needs none imports no rclpy."""
    from support.ros_node import Peer

    with Peer() as peer:
        yield peer
