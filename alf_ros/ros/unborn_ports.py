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
_AGE, _LOOK = 5.0, 0.05  # s


def remove(folder: Path = _SHARED) -> list[Path]:
    """Remove the empty ports of the domain of this process (ROS_DOMAIN_ID) and say so on stderr.
    One that is younger than 5 s may be in the making, and is waited for. Returns their files."""
    text = os.environ.get('ROS_DOMAIN_ID') or '0'
    first = _FIRST + _PORTS * int(text) if text.isdecimal() else -_PORTS
    found: list[Path] = []
    seen: dict[Path, float] = {}
    while True:
        waits = False
        for path in _empty_ports(folder, range(first, first + _PORTS)):
            now = time.monotonic()
            with contextlib.suppress(OSError):  # it is gone by now
                age = max(time.time() - path.stat().st_mtime, now - seen.setdefault(path, now))
                if age <= _AGE:
                    waits = True
                    continue
                path.unlink()
                found.append(path)
                print(f'removed {path}: a killed process left it unfinished', file=sys.stderr)
        if not waits:
            return found
        time.sleep(_LOOK)


def _empty_ports(folder: Path, ports: range) -> list[Path]:
    """The files of these ports that have no size yet."""
    found = []
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            name = _NAME.fullmatch(path.name)
            if name and int(name[1]) in ports and path.stat().st_size == 0:
                found.append(path)
    return found
