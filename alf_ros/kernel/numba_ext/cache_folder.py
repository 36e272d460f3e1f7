"""Folders of machine code, one for each digest: read without a lock, written with one a file."""

from __future__ import annotations

import contextlib
import fcntl
import glob
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
        self._lock: int | None = None  # its file of locks: a byte for each name
        self._held: set[str] = set()  # names that this process has locked
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
    def locked(self, name: str) -> Iterator[None]:
        """Exclude other processes from compiling the function of a file, unless they run out of
        patience.

        name: of the file. This process may lock it again, and other names inside.
        """
        mine = False
        self._depth += 1
        try:
            mine = name not in self._held and self._enter(name)
            yield
        finally:
            self._depth -= 1
            if mine:
                self._held.discard(name)
                if self._lock is not None:
                    fcntl.lockf(self._lock, fcntl.LOCK_UN, 1, _place_in_lock(name))
            if self._depth == 0:
                self._leave()

    def _enter(self, name: str) -> bool:
        """Lock a name; False if another process has it and shows no progress."""
        if self._lock is not None:
            with contextlib.suppress(OSError):
                return self._take(name)
            return False
        for place in self._places:
            try:
                new = not place.exists()
                place.mkdir(parents=True, exist_ok=True)
                self._lock = os.open(place / 'lock', os.O_RDWR | os.O_CREAT, 0o666)
                self._open = place
                mine = self._take(name)
            except OSError:
                self._leave()
                continue
            if place not in self._kept:
                self._keep(place)
            if new:
                _remove_older(place)
            return mine
        return False

    def _leave(self) -> None:
        """Close the file of locks: whatever this process has locked in it is free then."""
        handle, self._lock, self._open = self._lock, None, None
        self._held.clear()
        if handle is not None:
            os.close(handle)

    def _take(self, name: str) -> bool:
        """Lock a name; False if nobody has saved anything for long: its owner is stopped or hangs.

        Writing is safe nevertheless: files are replaced as wholes, by equal ones.
        """
        assert self._lock is not None and self._open is not None
        saved, since = None, 0.0
        while True:
            with contextlib.suppress(BlockingIOError):
                fcntl.lockf(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _place_in_lock(name))
                os.utime(self._lock)
                self._patient = True
                self._held.add(name)
                _remove_unfinished(self._open, name)
                return True
            last, now = os.stat(self._lock).st_mtime_ns, time.monotonic()
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
        other = self._open / f'{name}.{uuid.uuid4().hex}.new'
        try:
            other.write_bytes(_head(key, data) + data)
            other.replace(self._open / name)
            if name in self._held and self._lock is not None:
                os.utime(self._lock)  # shows progress to waiting processes
        except OSError:
            with contextlib.suppress(OSError):
                other.unlink()


def _place_in_lock(name: str) -> int:
    """The byte of the file of locks that stands for a name. The file need not be that long."""
    return int(digest_of(name.encode())[:15], 16)


def _head(key: str, data: bytes) -> bytes:
    """How a file begins: whatever its content loses or changes on the way shows in it."""
    return f'{key}\n{digest_of(data)}\n'.encode()


_HEAD = len(_head(digest_of(b''), b''))


def _remove_unfinished(place: Path, name: str) -> None:
    """Remove what processes that were killed while they saved this have left."""
    for path in place.glob(f'{glob.escape(name)}.*.new'):
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
