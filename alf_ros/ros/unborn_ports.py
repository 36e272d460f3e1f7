"""Ports of Fast DDS that no process will finish: a node would wait for them without end.

Fast DDS makes a file in shared memory for each port of a domain, then gives it a size. A process
that is killed in between leaves an empty file, and every later participant with this port waits
for its size (Fast DDS 3.2, `open_port_internal`). No living process takes seconds in between.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
import time
from pathlib import Path

_SHARED = Path('/dev/shm')
_NAME = re.compile(r'(?:fastdds|fastrtps)_port(\d+)')
_FIRST, _PORTS = 7400, 250  # of domain 0, and of each domain (RTPS 2.2, 9.6.1.1)
_AGE = 5.0  # s


def remove(folder: Path = _SHARED) -> list[Path]:
    """Remove the empty ports of the domain of this process (ROS_DOMAIN_ID), older than 5 s, and
    say so on stderr. Returns their files."""
    text = os.environ.get('ROS_DOMAIN_ID') or '0'
    first = _FIRST + _PORTS * int(text) if text.isdecimal() else -_PORTS
    found = []
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            name = _NAME.fullmatch(path.name)
            if name and first <= int(name[1]) < first + _PORTS and _is_unborn(path):
                path.unlink()
                found.append(path)
                print(f'removed {path}: a killed process left it unfinished', file=sys.stderr)
    return found


def _is_unborn(path: Path) -> bool:
    about = path.stat()
    return about.st_size == 0 and time.time() - about.st_mtime > _AGE
