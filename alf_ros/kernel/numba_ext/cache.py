"""Where machine code is kept between processes, so that it is compiled once.

numba's own cache looks only at the file of the function that is called, and two processes that
fill it at once can take each other's code. Here a folder holds the code of one state of the
sources: its name has the digest of all that goes into the code. Nothing in it is ever changed, so
nothing in it can be old.

- The digest is of alf_ros/kernel, of the folder of this package that the function lies in, of the
  versions of Python, numba, llvmlite and numpy, of the processor, and of numba's settings. For a
  function of somebody else's file: of that file, of the modules beside or below it that it
  imports, of alf_ros/kernel and of alf_ros/effects/contract. It is taken when the file is
  imported; if the sources are no longer the same when the code is saved, it is not saved.
- A file holds one overload. Its name has the digest of the types of the arguments. It is written
  under another name, then renamed: who reads it reads all of it.
- One process compiles at a time: on a miss it locks the folder, looks again, compiles and saves.
  A hit takes no lock. Folders are locked in the order of imports, which has no circle.
- The folder lies below NUMBA_CACHE_DIR if that is set; else in `__pycache__` of the package; else,
  where that cannot be written, in the cache folder of the user. What cannot be written is read all
  the same. Where no folder can be written, each process compiles for itself.
- Who creates a folder removes older ones of the same name, but for the last `KEPT`, which other
  versions of Python, other processors or another branch may use, and those in use: each process
  holds a shared lock on the folders that it reads.
"""

from __future__ import annotations

import ast
import contextlib
import fcntl
import functools
import hashlib
import importlib.util
import os
import pickle
import platform
import shutil
import sys
import uuid
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import config
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.serialize import dumps

from alf_ros.digest import digest, digest_now

KEPT = 4  # folders of one name, besides those in use
PACKAGE = Path(__file__).resolve().parents[2]
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


# ------------------------------------------------------------------------------ what is compiled


class _Sources:
    """What the code of a function is made of: digest when it was imported, and now."""

    _known: dict[str, _Sources | None] = {}  # by the file, of this package

    def __init__(self, label: str, package: tuple[str, ...], files: dict[Path, str]) -> None:
        self.label = label
        self.package = package
        self._files = files
        parts = [digest(*package)]
        if files:
            folder = next(iter(files)).parent
            parts += (f'{path.relative_to(folder)}\0{text}' for path, text in files.items())
        self.digest = _digest('\n'.join(parts).encode())

    @classmethod
    def of(cls, function: Callable[..., Any]) -> _Sources | None:
        """Of one function; None if it was typed, not imported."""
        name = function.__code__.co_filename
        if name in cls._known:
            return cls._known[name]
        file = Path(name).resolve()
        if not file.is_file():
            return None
        if not file.is_relative_to(PACKAGE):
            ours = 'kernel', 'effects/contract'
            return cls(file.stem, ours, _with_imported(file, function.__globals__))
        parts = file.relative_to(PACKAGE).parts[:-1]
        folder = '/'.join(parts[:1] if parts[0] == 'kernel' else parts)
        ours = tuple(dict.fromkeys(('kernel', folder)))
        cls._known[name] = cls(folder.replace('/', '.'), ours, {})
        return cls._known[name]

    def changed(self) -> bool:
        """Whether the sources are no longer what was imported."""
        try:
            if digest_now(*self.package) != digest(*self.package):
                return True
            return any(_digest(path.read_bytes()) != text for path, text in self._files.items())
        except OSError:
            return True


def _digest(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()


_texts: dict[Path, tuple[str, object, str]] = {}


def _as_imported(path: Path, module: dict[str, Any]) -> str:
    """Digest of a file, as it was when the module was imported: about when it is first seen."""
    name, spec = module['__name__'], module.get('__spec__')
    known = _texts.get(path)
    if known is None or known[0] != name or known[1] is not spec:  # not seen, or another import
        known = _texts[path] = name, spec, _digest(path.read_bytes())
    return known[2]


def _with_imported(file: Path, module: dict[str, Any]) -> dict[Path, str]:
    """Digests of a file, and of the modules beside or below it that it imports, and those do."""
    found = {file: _as_imported(file, module)}
    left = [(file, module)]
    while left:
        path, importing = left.pop()
        for name in _imported(path, importing.get('__package__') or ''):
            other = getattr(sys.modules.get(name), '__dict__', {})
            origin = Path(other.get('__file__') or '/').resolve()
            if origin.suffix != '.py' or origin in found or origin.is_relative_to(PACKAGE):
                continue
            if origin.is_relative_to(file.parent):
                found[origin] = _as_imported(origin, other)
                left.append((origin, other))
    return {file: found.pop(file), **dict(sorted(found.items()))}


def _imported(path: Path, package: str) -> set[str]:
    """Names that may be modules."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = '.' * node.level + (node.module or '')
            if node.level:
                base = importlib.util.resolve_name(base, package)
            names.update(f'{base}.{alias.name}' for alias in node.names)
    parts = [name.split('.') for name in names]
    return {'.'.join(part[:n]) for part in parts for n in range(1, len(part) + 1)}


def _versions(magic: tuple[Any, ...]) -> str:
    parts = [platform.python_implementation(), sys.version, numba.__version__]
    parts += [llvmlite.__version__, np.__version__, *map(str, magic)]
    parts += [f'{name}={getattr(config, name, None)}' for name in _SETTINGS]
    return '\n'.join(parts)


# --------------------------------------------------------------------------------------- folders


class _Folder:
    """The code of one digest: below several roots, of which the first that can be is written."""

    _known: dict[str, _Folder] = {}

    def __init__(self, name: str) -> None:
        self._places = [root / name for root in roots()]
        self._kept: dict[Path, int] = {}  # open, with a shared lock, as long as the process runs
        self._depth = 0
        self._open: Path | None = None  # the place that is locked
        for place in self._places:
            self._keep(place)

    @classmethod
    def of(cls, sources: _Sources, magic: tuple[Any, ...]) -> _Folder:
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
        """What was saved under a name and a key, or None."""
        head = f'{key}\n'.encode()
        for place in self._places:
            try:
                data = (place / name).read_bytes()
            except OSError:
                continue
            if data.startswith(head) and data.endswith(head):  # all of it reached the disk
                return pickle.loads(data[len(head) : -len(head)])
        return None

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """No other process compiles for this folder meanwhile; this one may lock it again."""
        handle = None
        if self._depth == 0:
            self._open, handle = self._locked_place()
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1
            if handle is not None:
                self._open = None
                fcntl.flock(handle, fcntl.LOCK_UN)
                os.close(handle)

    def _locked_place(self) -> tuple[Path | None, int | None]:
        for place in self._places:
            handle = None
            try:
                new = not place.exists()
                place.mkdir(parents=True, exist_ok=True)
                handle = os.open(place / 'lock', os.O_RDWR | os.O_CREAT, 0o666)
                fcntl.flock(handle, fcntl.LOCK_EX)
            except OSError:
                if handle is not None:
                    os.close(handle)
                continue
            if place not in self._kept:
                self._keep(place)
            if new:
                _remove_older(place)
            return place, handle
        return None, None

    def write(self, name: str, key: str, data: bytes) -> None:
        """Save, where that is possible and the folder is locked by this process."""
        if self._open is None:
            return
        head, other = f'{key}\n'.encode(), self._open / f'{uuid.uuid4().hex}.new'
        try:
            other.write_bytes(head + data + head)
            other.replace(self._open / name)
        except OSError:
            with contextlib.suppress(OSError):
                other.unlink()


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


# ------------------------------------------------------------------------------ what numba calls


class Cache(_Cache):
    """The overloads of one function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        code = function.__code__
        self._function = function
        self._enabled = True
        self._sources = _Sources.of(function)
        stem, _ = os.path.splitext(os.path.basename(code.co_filename))
        name = f'{stem}.{function.__qualname__}-{code.co_firstlineno}'
        self._name = name.replace('<', '').replace('>', '')
        self._folder: _Folder | None = None
        self._turns: list[contextlib.ExitStack] = []

    def guarded(self, compile: Callable[..., Any]) -> Callable[..., Any]:
        """`compile`, in which a miss locks the folder until it ends, however it ends."""

        @functools.wraps(compile)
        def wrapper(*args: Any) -> Any:
            with global_compiler_lock, contextlib.ExitStack() as turn:
                self._turns.append(turn)
                try:
                    return compile(*args)
                finally:
                    self._turns.pop()

        return wrapper

    @property
    def cache_path(self) -> str | None:
        """Where the code was read or saved last."""
        return None if self._folder is None else str(self._folder._places[0])

    def _key(self, signature: Any) -> tuple[str, str]:
        """Name of the file of an overload, and what must stand in it."""
        cells = [cell.cell_contents for cell in self._function.__closure__ or ()]
        text = f'{self._name}\n{signature}\n'.encode() + (dumps(cells) if cells else b'')
        key = hashlib.sha256(text).hexdigest()
        return f'{self._name}-{key[:16]}', key

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for a signature, or None: then the folder is locked, and nobody has it."""
        target_context.refresh()
        if not self._enabled or self._sources is None:
            return None
        if self._folder is None:
            magic = target_context.codegen().magic_tuple()
            self._folder = _Folder.of(self._sources, magic)
        name = self._key(sig)
        data = self._folder.read(*name)
        if data is None and self._turns:
            self._turns[-1].enter_context(self._folder.locked())
            data = self._folder.read(*name)
        return None if data is None else CompileResult._rebuild(target_context, *data)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save code, unless it holds addresses or the sources are no longer what was compiled."""
        if not self._enabled or self._folder is None or self._sources is None:
            return
        if data.library.has_dynamic_globals or any(not one.can_cache for one in data.lifted):
            warnings.warn(f'{self._name} holds addresses and is not cached', stacklevel=2)
        elif not self._sources.changed():
            self._folder.write(*self._key(sig), dumps(data._reduce()))

    def enable(self) -> None:
        """Begin to look for code, and to save it."""
        self._enabled = True

    def disable(self) -> None:
        """Compile always."""
        self._enabled = False

    def flush(self) -> None:
        """Nothing: what the folder holds is right."""
