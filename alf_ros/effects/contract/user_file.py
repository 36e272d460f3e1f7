"""Effects in files outside the package, named by path.

A scene calls one `my_effect.py`, relative to itself; in full it is `/path/my_effect.py#sha256=…`,
so that what is logged says which text was run, and another is refused.
"""

from __future__ import annotations

import atexit
import dataclasses
import hashlib
import re
import shutil
import sys
import tempfile
from pathlib import Path
from types import ModuleType

from numba.core.errors import NumbaError

from alf_ros.effects import contract
from alf_ros.errors import InputError

_NAME = re.compile(r'(?P<path>.*\.py)(#sha256=(?P<digest>[0-9a-f]{64}))?')
_loaded: dict[str, ModuleType] = {}
_provided: dict[str, Path] = {}  # digest -> copy of a file that need not be there any more


def is_file_name(name: str) -> bool:
    """Whether an effect is meant that is a file of its own."""
    return _NAME.fullmatch(name) is not None


def stem(name: str) -> str:
    """The name of the file without folder and ending."""
    return Path(_split(name)[0]).stem


def _split(name: str) -> tuple[str, str | None]:
    found = _NAME.fullmatch(name)
    if found is None:
        raise KeyError(name)
    return found['path'], found['digest']


def full_name(name: str, folder: Path) -> str:
    """Path and digest of a file named relative to `folder`.

    Raises InputError if there is none, or if its digest is not the one in the name.
    """
    path, wanted = _split(name)
    if wanted in _provided:
        return name
    file = (folder / Path(path).expanduser()).resolve()
    if not file.is_file():
        raise InputError('no such file of an effect', value=str(file))
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    if wanted not in (None, digest):
        raise InputError('the file of this effect is no longer what it was', value=str(file))
    return f'{file}#sha256={digest}'


def is_there(name: str) -> bool:
    """Whether the file of a full name is still there, and still the same."""
    try:
        return bool(full_name(name, Path()))
    except InputError:
        return False


def source(name: str) -> str:
    """The text of the file of a full name, as it was run."""
    path, digest = _split(name)
    return _provided.get(digest or '', Path(path)).read_bytes().decode()


def provide(name: str, text: str) -> None:
    """From now on this text stands for the file of a full name: for a log, which brings its own.

    It is code, and runs when a scene names it. Raises InputError if its digest is another.
    """
    path, digest = _split(name)
    if hashlib.sha256(text.encode()).hexdigest() != digest:
        raise InputError('not the text of this effect', value=path)
    # numba compiles for its cache only what is in a file
    folder = tempfile.mkdtemp(prefix='alf_ros_effect_')
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    _provided[digest] = Path(folder) / Path(path).name
    _provided[digest].write_bytes(text.encode())


def load(name: str) -> ModuleType:
    """The module of a full name. Raises InputError, with the line, if it cannot be used."""
    if name not in _loaded:
        path, digest = _split(full_name(name, Path()))
        path = str(_provided.get(digest or '', path))
        text = Path(path).read_bytes()
        # Not through the import system: its cache knows the time of a file to the second only.
        module = ModuleType(f'alf_ros_effect_{digest}')
        module.__file__ = path
        sys.modules[module.__name__] = module  # where dataclasses look up annotations
        try:
            exec(compile(text, path, 'exec'), vars(module))
        except SyntaxError as error:
            raise InputError(f'not Python: {error.msg}', file=path, line=error.lineno) from None
        except NumbaError as error:
            (said, *_) = [line for line in str(error).splitlines() if line.strip()][1:] or ['']
            raise InputError(f'numba cannot compile it: {said}', file=path) from None
        except Exception as error:  # whatever somebody's file raises
            raise InputError(
                f'{type(error).__name__}: {error}', file=path, line=_line(error, path)
            ) from None
        _loaded[name] = checked(module, path)
    return _loaded[name]


def _line(error: Exception, path: str) -> int | None:
    """Where in the file it happened."""
    line, trace = None, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == path:
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def checked(module: ModuleType, file: str) -> ModuleType:
    """The module, if it holds what `contract` asks for. Raises InputError otherwise."""
    for name in ('Parameters', 'MULTIPLE', 'pack', 'force'):
        if not hasattr(module, name):
            raise InputError(
                f'an effect without {name}: see alf_ros/effects/contract/__init__.py', file=file
            )
    if not dataclasses.is_dataclass(module.Parameters):
        raise InputError('Parameters is no dataclass', file=file)
    for field in dataclasses.fields(module.Parameters):
        if not {'kind', 'doc'} <= set(field.metadata):
            raise InputError(f"no 'kind' and 'doc' in the metadata of {field.name!r}", file=file)
    for name, wanted in (('force', contract.FORCE), ('potential', contract.POTENTIAL)):
        if hasattr(module, name) and getattr(getattr(module, name), '_sig', None) != wanted:
            raise InputError(f'{name} is not compiled by @contract.{name}', file=file)
    if not isinstance(getattr(module, 'tangent', None), (contract.Tangent, type(None))):
        raise InputError('tangent is not compiled by @contract.tangent', file=file)
    return module
