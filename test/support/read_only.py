"""A folder that can only be read, for a while."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """The folder and all in it, as on a disk for reading only: mounted so where that is allowed,
    else by permissions, which do not bind root. Skips the test where neither does."""
    mount = ['mount', '--bind', '-o', 'ro', str(folder), str(folder)]
    if shutil.which('mount') and not subprocess.run(mount, capture_output=True).returncode:
        try:
            yield
        finally:
            subprocess.run(['umount', str(folder)], check=True)
        return
    if os.geteuid() == 0:
        pytest.skip('root may write wherever nothing can be mounted')
    before = {path: path.stat().st_mode for path in (folder, *folder.rglob('*'))}
    for path, mode in before.items():
        path.chmod(mode & ~0o222)
    try:
        yield
    finally:
        for path, mode in before.items():
            path.chmod(mode)
