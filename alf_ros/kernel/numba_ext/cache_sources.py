"""The sources of machine code: their digest, as they were imported.

The process keeps one picture of the sources of each package: as they were when the first compiled
function of the package was imported. Later edits change no digest of this process, so its code is
neither used nor saved as new code. A file that is imported after an edit would not fit the
compiled code: AlfError.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from alf_ros.errors import AlfError

PACKAGE = Path(__file__).resolve().parents[2]
_INSTALLED = frozenset({'site-packages', 'dist-packages'})
_LIBRARY = Path(os.__file__).resolve().parent  # of Python itself


def digest_of(data: bytes) -> str:
    """SHA-256, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


_read: dict[str, tuple[tuple[int, ...], str]] = {}  # by file: what told its state, and its digest
_SETTLED = 2_000_000_000  # ns, far above the resolution of the times of files


def _digest(path: str) -> str:
    """Digest of a file. It is read again if its size, its times or its place have changed.

    An edit may come within the resolution of the times: of a file that has just changed they tell
    nothing. Nobody can set the time of a change (`ctime`).
    """
    state = os.stat(path)
    told = state.st_mtime_ns, state.st_ctime_ns, state.st_size, state.st_ino
    known = _read.get(path)
    if known is not None and known[0] == told:
        return known[1]
    now = time.time_ns()
    with open(path, 'rb') as file:
        found = digest_of(file.read())
    if now - state.st_ctime_ns > _SETTLED:
        _read[path] = told, found
    return found


def _now(folder: str) -> dict[str, str]:
    """Digests of the sources below a folder of this package, by their names relative to it."""
    found = {}
    for place, folders, names in os.walk(PACKAGE / folder):
        folders[:] = sorted(name for name in folders if name != '__pycache__')
        within = Path(place).relative_to(PACKAGE).as_posix()
        for name in sorted(names):
            if name.endswith('.py'):
                found[f'{within}/{name}'] = _digest(f'{place}/{name}')
    if not found:  # a file that has moved must not drop out of a digest in silence
        raise FileNotFoundError(f'no source of this package: {folder}')
    return found


_imported_as = functools.cache(_now)  # of the packages; by their folders


def _below(folder: str, found: Callable[[str], Mapping[str, str]]) -> dict[str, str]:
    """The sources of a folder within a package."""
    whole = found(folder.partition('/')[0])
    return {name: text for name, text in whole.items() if name.startswith(f'{folder}/')}


class Sources:
    """The sources of a function: digest when it was imported, and now.

    package: folders of this package, relative to it; files: other people's, with their digests.
    """

    _known: dict[str, Sources] = {}  # by the file, of this package

    def __init__(self, label: str, package: tuple[str, ...], files: dict[Path, str]) -> None:
        self.label = label
        self.package = package
        self._files = files
        parts = [f'{p}\0{text}' for f in package for p, text in _below(f, _imported_as).items()]
        if files:
            folder = next(iter(files)).parent
            parts += (f'{_name(path, folder)}\0{text}' for path, text in files.items())
        self.digest = digest_of('\n'.join(parts).encode())

    @classmethod
    def of(cls, function: Callable[..., Any]) -> Sources | None:
        """Of one function; None if it was typed, not imported.

        Raises AlfError if its file belongs to this package and was edited since the process began.
        """
        name = function.__code__.co_filename
        if name in cls._known:
            return cls._known[name]
        file = Path(name).resolve()
        if not file.is_file():
            return None
        if not file.is_relative_to(PACKAGE):
            ours = 'kernel', 'effects/contract'
            return cls(file.stem, ours, _with_imported(file, function.__globals__))
        path = file.relative_to(PACKAGE)
        package, *folders = path.parts[:-1]
        if _imported_as(package).get(path.as_posix()) != digest_of(file.read_bytes()):
            raise AlfError(f'{file}: edited since this process began; end it and start it again')
        folder = package if package == 'kernel' else '/'.join((package, *folders))
        found = cls(folder.replace('/', '.'), tuple(dict.fromkeys(('kernel', folder))), {})
        cls._known[name] = found
        return found

    def changed(self) -> bool:
        """Whether the sources have changed since the import."""
        try:
            if any(_below(f, _now) != _below(f, _imported_as) for f in self.package):
                return True
            return any(digest_of(path.read_bytes()) != text for path, text in self._files.items())
        except OSError:
            return True


# ------------------------------------------------------------------------ files of somebody else


_texts: dict[Path, tuple[str, object, str]] = {}


def _as_imported(path: Path, module: dict[str, Any]) -> str:
    """Digest of a file, as it was when the module was imported: about when it is first seen."""
    name, spec = module['__name__'], module.get('__spec__')
    known = _texts.get(path)
    if known is None or known[0] != name or known[1] is not spec:  # not seen, or another import
        known = _texts[path] = name, spec, digest_of(path.read_bytes())
    return known[2]


def _name(path: Path, folder: Path) -> str:
    """The place of a file, relative to a folder if it lies there: a folder may be moved."""
    return str(path.relative_to(folder) if path.is_relative_to(folder) else path)


def _is_installed(path: Path) -> bool:
    """Whether a module belongs to Python, or to a package that was installed and is not edited."""
    return bool(_INSTALLED.intersection(path.parts)) or path.is_relative_to(_LIBRARY)


def _with_imported(file: Path, module: dict[str, Any]) -> dict[Path, str]:
    """Digests of a file, and of the modules that it imports, and those do: beside or below it, or
    elsewhere if they are not installed, as of the text of a log, which runs from a new folder."""
    own = _as_imported(file, module)
    found = {origin: text for _, origin, text in _modules(file, module)}
    return {file: own, **dict(sorted(found.items()))}


def module_digests(file: Path, module: dict[str, Any]) -> dict[str, str]:
    """Digests of the modules that the module of a file imports, and those do, by name, as they
    were imported. Installed packages, and ours, are left out."""
    found = _modules(file.resolve(), module)
    return dict(sorted((name, text) for name, at, text in found if not _is_installed(at)))


def _modules(file: Path, module: dict[str, Any]) -> Iterator[tuple[str, Path, str]]:
    """Name, file and digest of each."""
    seen, left = {file}, [(file, module)]
    while left:
        path, importing = left.pop()
        for name in sorted(_imported(path, importing.get('__package__') or '')):
            other = getattr(sys.modules.get(name), '__dict__', {})
            origin = Path(other.get('__file__') or '/').resolve()
            if origin.suffix != '.py' or origin in seen or origin.is_relative_to(PACKAGE):
                continue
            if origin.is_relative_to(file.parent) or not _is_installed(origin):
                seen.add(origin)
                left.append((origin, other))
                yield name, origin, _as_imported(origin, other)


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
