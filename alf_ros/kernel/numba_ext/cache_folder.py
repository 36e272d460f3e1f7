"""Folders of machine code: one for each digest, read without a lock, filled under one."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import pickle
import platform
import shutil
import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import config

from alf_ros.kernel.numba_ext.cache_sources import PACKAGE, Sources, digest_of

KEPT = 4  # folders of one name, besides those in use
PATIENCE = 60.0  # s in which the process that compiles saves nothing: then nobody waits for it
_LOOK = 0.05  # s between two looks at a lock

# what changes the code besides the sources and the processor
_SETTINGS = (
    'OPT',
    'LOOP_VECTORIZE',
    'SLP_VECTORIZE',
    'BOUNDSCHECK',
    'DEBUGINFO_DEFAULT',
    'DISABLE_INTEL_SVML',
    'USING_SVML',
    'FULL_TRACEBACKS',
)


def roots() -> list[Path]:
    """Folders of folders: all are read, the first that can be written is."""
    if config.CACHE_DIR:
        return [Path(config.CACHE_DIR) / 'alf_ros']
    found = [PACKAGE / '__pycache__' / 'compiled']
    with contextlib.suppress(RuntimeError):  # nobody's home
        if sys.platform == 'darwin':
            user = Path.home() / 'Library' / 'Caches'
        else:
            given = os.environ.get('XDG_CACHE_HOME', '')
            user = Path(given) if os.path.isabs(given) else Path.home() / '.cache'
        found.append(user / 'alf_ros')
    return found


def _versions(magic: tuple[Any, ...]) -> str:
    parts = [platform.python_implementation(), sys.version, numba.__version__]
    parts += [llvmlite.__version__, np.__version__, *map(str, magic)]
    parts += [f'{name}={getattr(config, name, None)}' for name in _SETTINGS]
    return '\n'.join(parts)


# --------------------------------------------------------------------------------------- folders


class Folder:
    """The code of one digest: below several roots, of which the first that can be is written."""

    _known: dict[str, Folder] = {}

    def __init__(self, name: str) -> None:
        self._places = [root / name for root in roots()]
        self._kept: dict[Path, int] = {}  # open, with a shared lock, as long as the process runs
        self._depth = 0
        self._open: Path | None = None  # the place that may be written
        self._lock: int | None = None  # its lock, if this process has it
        self._patient = True
        for place in self._places:
            self._keep(place)

    @classmethod
    def of(cls, sources: Sources, magic: tuple[Any, ...]) -> Folder:
        """The one for these sources on this processor."""
        whole = hashlib.sha256(f'{sources.digest}\n{_versions(magic)}'.encode()).hexdigest()
        name = f'{sources.label}-{whole[:24]}'
        if name not in cls._known:
            cls._known[name] = cls(name)
        return cls._known[name]

    def _keep(self, place: Path) -> None:
        """Nobody removes a folder that is in use; and it is one of those used last."""
        with contextlib.suppress(OSError):
            handle = os.open(place, os.O_RDONLY)
            self._kept[place] = handle
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
            os.utime(place)

    def read(self, name: str, key: str) -> Any:
        """Data saved under a name and a key; None if absent or damaged."""
        for place in self._places:
            try:
                whole = (place / name).read_bytes()
            except OSError:
                continue
            head, data = whole[:_HEAD], whole[_HEAD:]
            if head == _head(key, data):
                return pickle.loads(data)
        return None

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Exclude other processes from compiling for this folder, unless they run out of patience.

        This one may lock it again.
        """
        handle = None
        if self._depth == 0:
            self._open, handle = self._locked_place()
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1
            if handle is not None:
                self._open = self._lock = None
                os.close(handle)

    def _locked_place(self) -> tuple[Path | None, int | None]:
        for place in self._places:
            handle = None
            try:
                new = not place.exists()
                place.mkdir(parents=True, exist_ok=True)
                handle = os.open(place / 'lock', os.O_RDWR | os.O_CREAT, 0o666)
                mine = self._take(handle)
            except OSError:
                if handle is not None:
                    os.close(handle)
                continue
            if place not in self._kept:
                self._keep(place)
            if new:
                _remove_older(place)
            if mine:
                self._lock = handle
                _remove_unfinished(place)
            return place, handle
        return None, None

    def _take(self, handle: int) -> bool:
        """Lock; False if the owner of the lock has saved nothing for long: it is stopped, or
        hangs.

        Writing is safe nevertheless: files are replaced as wholes, by equal ones.
        """
        saved, since = None, 0.0
        while True:
            with contextlib.suppress(BlockingIOError):
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.utime(handle)
                self._patient = True
                return True
            last, now = os.stat(handle).st_mtime_ns, time.monotonic()
            if last != saved:
                saved, since = last, now
            if now - since >= PATIENCE or not self._patient:
                self._patient = False  # nor the next time
                return False
            time.sleep(_LOOK)

    def write(self, name: str, key: str, data: bytes) -> None:
        """Save, where that is possible and this process is in `locked`."""
        if self._open is None:
            return
        other = self._open / f'{uuid.uuid4().hex}.new'
        try:
            other.write_bytes(_head(key, data) + data)
            other.replace(self._open / name)
            if self._lock is not None:
                os.utime(self._lock)  # shows progress to waiting processes
        except OSError:
            with contextlib.suppress(OSError):
                other.unlink()


def _head(key: str, data: bytes) -> bytes:
    """How a file begins: whatever its content loses or changes on the way shows in it."""
    return f'{key}\n{digest_of(data)}\n'.encode()


_HEAD = len(_head(digest_of(b''), b''))


def _remove_unfinished(place: Path) -> None:
    """Remove what processes that were killed while they saved have left."""
    for path in place.glob('*.new'):
        with contextlib.suppress(OSError):
            path.unlink()


def _remove_older(place: Path) -> None:
    """Remove the folders of the same name but for the last ones, and those that somebody uses."""
    label, _, _ = place.name.rpartition('-')
    with contextlib.suppress(OSError):
        others = [p for p in place.parent.iterdir() if p.name.rpartition('-')[0] == label]
        others.sort(key=lambda other: other.stat().st_mtime, reverse=True)
        for other in others[KEPT:]:
            handle = os.open(other, os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                away = other.rename(other.parent / f'{uuid.uuid4().hex}.old')
                shutil.rmtree(away, ignore_errors=True)
            except OSError:
                pass  # in use, or another process was quicker
            finally:
                os.close(handle)
