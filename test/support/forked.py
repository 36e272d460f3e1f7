"""Processes of this package that start without a second of imports: see `support.fork_server`.

They begin where the imports end. New processes are for tests of the start itself, of other
environments and caches, and of commands as a shell starts them.
"""

from __future__ import annotations

import atexit
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO, Any

from support.fork_server import NUMBER
from support.paths import ROOT

# variables that are read after the package is imported, or never
_READ_LATE = tuple(
    'ROS_ RMW_ MAKE MFLAGS MPL PYTEST_ PYTHONPATH PYTHONFAULTHANDLER ARGS SCENE DURATION'.split()
)
_server: _Server | None = None


class _Server:
    """The process that forks; one for each process that runs tests."""

    def __init__(self) -> None:
        self.control, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.environment = dict(os.environ)
        self.process = subprocess.Popen(
            [sys.executable, str(ROOT / 'test/support/fork_server.py'), str(other.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=[other.fileno()],
            start_new_session=True,
        )
        other.close()
        atexit.register(self.close)

    def close(self) -> None:
        self.control.close()
        self.process.wait()


class ForkedProcess:
    """`python` with `arguments`, in its own session, with methods of `subprocess.Popen`."""

    def __init__(
        self,
        arguments: list[str],
        folder: Path | str,
        environment: dict[str, str],
        streams: tuple[int, int, int],
    ) -> None:
        global _server
        if _server is None:
            _server = _Server()
        self.args = arguments
        self.returncode: int | None = None
        self._status, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        request = {
            'arguments': arguments,
            'folder': str(folder),
            'environment': environment,
        }
        with other:
            text = json.dumps(request).encode()
            socket.send_fds(_server.control, [text], [*streams, other.fileno()])
        self.pid = self._number()

    def _number(self) -> int:
        number: int
        told = self._status.recv(NUMBER.size)
        if not told:
            raise RuntimeError(f'{ROOT}/test/support/fork_server.py has ended')
        (number,) = NUMBER.unpack(told)
        return number

    def poll(self) -> int | None:
        """The exit code, if it has ended."""
        if self.returncode is None and select.select([self._status], [], [], 0)[0]:
            self.wait()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; the exit code."""
        if self.returncode is None:
            if not select.select([self._status], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            self.returncode = os.waitstatus_to_exitcode(self._number())
            self._status.close()
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it."""
        self.send_signal(signal.SIGKILL)


Process = ForkedProcess | subprocess.Popen[Any]


def started(
    arguments: list[str],
    folder: Path | str,
    environment: dict[str, str],
    output: IO[str],
    errors: IO[str] | None = None,
    *,
    new: bool = False,
) -> Process:
    """`python` with arguments (`-m module ...` or a file), in a session of its own; it writes to
    the files `output` and `errors` (or both streams to `output`).

    It is a new process if that is asked for, and where a variable differs that is read while the
    package is imported.
    """
    if new or not _may_fork(environment):
        return subprocess.Popen(
            [sys.executable, *arguments],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=errors or output,
            start_new_session=True,
        )
    with open(os.devnull) as nothing:
        streams = nothing.fileno(), output.fileno(), (errors or output).fileno()
        return ForkedProcess(arguments, folder, environment, streams)


def _may_fork(environment: dict[str, str]) -> bool:
    ours = os.environ if _server is None else _server.environment
    differing = {
        name
        for name in {*environment, *ours}
        if environment.get(name) != ours.get(name) and not name.startswith(_READ_LATE)
    }
    return sys.platform == 'linux' and not differing


def ended(
    arguments: list[str],
    folder: Path | str,
    environment: dict[str, str],
    timeout: float,
    *,
    new: bool = False,
) -> subprocess.CompletedProcess[str]:
    """Run `python` with arguments to its end, `new` as in `started`; return what it wrote."""
    if new or not _may_fork(environment):
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=timeout,
        )
    with (
        open(os.devnull) as nothing,
        tempfile.TemporaryFile('w+') as out,
        tempfile.TemporaryFile('w+') as errors,
    ):
        streams = nothing.fileno(), out.fileno(), errors.fileno()
        process = ForkedProcess(arguments, folder, environment, streams)
        try:
            code = process.wait(timeout)
        finally:
            process.kill()
        out.seek(0)
        errors.seek(0)
        return subprocess.CompletedProcess(arguments, code, out.read(), errors.read())
