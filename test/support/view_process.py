"""`python -m alf_ros view` in a process of its own."""

from __future__ import annotations

import signal
import subprocess
import sys

from support.paths import ROOT
from support.ros_node import LIMIT, START_LIMIT


class ViewProcess:
    """`python -m alf_ros view` at any free port; `url`."""

    def __init__(self, *options: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'alf_ros', 'view', '--port', '0', *options],
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().split()[-1]

    def __enter__(self) -> ViewProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def stop(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(LIMIT)


def view(*options: str) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    return subprocess.run(
        [sys.executable, '-m', 'alf_ros', 'view', *options],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=START_LIMIT,
    )
