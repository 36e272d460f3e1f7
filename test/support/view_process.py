"""`python -m alf_ros view` in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess

from support.forked import ended, started
from support.paths import ROOT
from support.ros_node import LIMIT, START_LIMIT


class ViewProcess:
    """`python -m alf_ros view` at any free port; `url`.

    new: it imports the package itself.
    """

    def __init__(self, *options: str, new: bool = False) -> None:
        reader, writer = os.pipe()
        self.said = open(reader)
        with open(writer, 'w') as output:
            command = ['-m', 'alf_ros', 'view', '--port', '0', *options]
            self.process = started(command, ROOT, dict(os.environ), output, new=new)
        self.url = self.said.readline().split()[-1]

    def __enter__(self) -> ViewProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self.said.close()

    def stop(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(LIMIT)


def view(*options: str) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    command = ['-m', 'alf_ros', 'view', *options]
    return ended(command, ROOT, dict(os.environ), START_LIMIT)
