"""Effects in files outside the package, named by path.

A scene calls one `my_effect.py`, relative to itself; in full it is `/path/my_effect.py#sha256=…`,
so that a log identifies the text that was run. Another text is refused.
"""

from __future__ import annotations

import atexit
import dataclasses
import dis
import hashlib
import re
import shutil
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numba.core.errors import NumbaError

from alf_ros import columns, paths
from alf_ros.effects import contract
from alf_ros.errors import InputError

_NAME = re.compile(r'(?P<path>.*\.py)(#sha256=(?P<digest>[0-9a-f]{64}))?')
TRUSTED = 'trust in the file: see doc/security.md'
LARGEST = 1 << 20  # bytes of a file
# By digest: texts that have run in this process, and copies of texts in logs.
_modules: dict[str, ModuleType] = {}
_texts: dict[str, str] = {}
_provided: dict[str, Path] = {}


def is_file_name(name: str) -> bool:
    """Whether an effect is meant that is a file of its own."""
    return _NAME.fullmatch(name) is not None


def stem(name: str) -> str:
    """The name of the file without folder and ending."""
    return Path(_split(name)[0]).stem


def digest(name: str) -> str:
    """The digest in a name, '' if there is none."""
    return _split(name)[1] or ''


def is_known(name: str) -> bool:
    """Whether the text of this digest has run in this process, or was provided: nothing has to be
    read, and no code runs that has not been allowed before."""
    return digest(name) in _modules or digest(name) in _provided


def _split(name: str) -> tuple[str, str | None]:
    found = _NAME.fullmatch(name)
    if found is None:
        raise KeyError(name)
    return found['path'], found['digest']


def full_name(name: str, folder: Path | None, code: bool = True) -> str:
    """Path and digest of a file named relative to `folder`.

    A digest that is known names its text, whatever lies at the path. `folder` None: no other is
    looked for. `code` False: a text that is not known is refused. Raises InputError then, if there
    is no such file, or if its digest is not the one in the name.
    """
    path, wanted = _split(name)
    if is_known(name):
        return name
    if folder is None:
        raise InputError('an effect in a file: files are not read here', value=path)
    try:
        file = (folder / paths.named(path)).resolve()
        text = paths.content(file, LARGEST)
    except (InputError, OSError, RuntimeError):  # links in a circle
        raise InputError('no such file of an effect', value=path) from None
    found = hashlib.sha256(text).hexdigest()
    if wanted not in (None, found):
        raise InputError('the file of this effect has changed', value=str(file))
    full = f'{file}#sha256={found}'
    if not code and not is_known(full):
        raise InputError(
            'an effect in a file: its code would run here', value=str(file), expected=TRUSTED
        )
    return full


def source(name: str) -> str:
    """The text of the file of a full name, as it was run."""
    return _texts[digest(name)]


def sources(kinds: Iterable[str]) -> dict[str, str]:
    """The texts of the effects among these kinds that are files, by full name, in their order."""
    return {kind: source(kind) for kind in dict.fromkeys(kinds) if is_file_name(kind)}


def provide(name: str, text: str) -> None:
    """From now on this text stands for the digest of a full name: for a log, which brings its own.

    It is code, and runs when a scene names it. Raises InputError if its digest is another.
    """
    path, wanted = _split(name)
    try:
        encoded = text.encode()
    except UnicodeEncodeError:
        encoded = b''
    if hashlib.sha256(encoded).hexdigest() != wanted:
        raise InputError('not the text of this effect', value=path)
    # numba caches only code from files, and the log must not choose the name of the file
    folder = tempfile.mkdtemp(prefix='alf_ros_effect_')
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    _provided[wanted] = Path(folder) / f'effect_{wanted[:12]}.py'
    _provided[wanted].write_bytes(encoded)


def load(name: str) -> ModuleType:
    """The module of a full name. Raises InputError, with the line, if it cannot be used."""
    full = full_name(name, Path())
    wanted = digest(full)
    if wanted not in _modules:
        file = _provided.get(wanted, Path(_split(full)[0]))
        text = paths.content(file, LARGEST)
        if hashlib.sha256(text).hexdigest() != wanted:  # changed since it was asked for
            raise InputError('the file of this effect has changed', value=str(file))
        _modules[wanted] = checked(_executed(text, str(file), wanted), str(file))
        _texts[wanted] = text.decode()
    return _modules[wanted]


def _executed(text: bytes, path: str, wanted: str) -> ModuleType:
    """The module that a text makes."""
    # Not through the import system: its cache knows the time of a file to the second only.
    module = ModuleType(f'alf_ros_effect_{wanted}')
    module.__file__ = path
    sys.modules[module.__name__] = module  # where dataclasses look up annotations
    try:
        text.decode()
        exec(compile(text, path, 'exec'), vars(module))
    except UnicodeDecodeError as error:
        line = text.count(b'\n', 0, error.start) + 1
        raise InputError('not a text file in UTF-8', file=path, line=line) from None
    except SyntaxError as error:
        raise InputError(f'not Python: {error.msg}', file=path, line=error.lineno) from None
    except NumbaError as error:
        (said, *_) = [line for line in str(error).splitlines() if line.strip()][1:] or ['']
        raise InputError(f'numba cannot compile it: {said}', file=path) from None
    except (Exception, SystemExit) as error:  # whatever somebody's file raises
        raise failure(error, path) from None
    return module


def failure(error: BaseException, path: str) -> InputError:
    """The error for an exception of somebody's file, with its line."""
    return InputError(f'{type(error).__name__}: {error}', file=path, line=_line(error, path))


def _line(error: BaseException, path: str) -> int | None:
    """Where in the file it happened."""
    line, trace = None, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == path:
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def check_packed(packed: object, path: str) -> None:
    """Raises InputError if compiled code cannot read what `pack` has returned."""
    wanted = 'pack returns no Packed with flat arrays, slots of whole numbers and params of floats'
    if not isinstance(packed, contract.Packed):
        raise InputError(wanted, file=path)
    for part, kind in ((packed.slots, 'i'), (packed.params, 'f')):
        if not isinstance(part, np.ndarray) or part.ndim != 1:
            raise InputError(wanted, file=path)
        # of members that are read at once
        together = kind == 'f' and any(isinstance(x, columns.Column) for x in part)
        if part.dtype.kind != kind and not together:
            raise InputError(wanted, file=path)


def _raising_line(function: Any, seen: set[Any]) -> tuple[str, int] | None:
    """File and line where a function, or compiled ones that it calls, raises an exception. Nobody
    would hear of it: the run would continue with part of the force."""
    code, line = function.__code__, 0
    if code in seen:
        return None
    seen.add(code)
    lines = dict(dis.findlinestarts(code))
    for instruction in dis.get_instructions(code):
        line = lines.get(instruction.offset) or line
        if instruction.opname == 'RAISE_VARARGS':
            return code.co_filename, line
    called = (getattr(function.__globals__.get(name), 'py_func', None) for name in code.co_names)
    found = (_raising_line(each, seen) for each in called if each is not None)
    return next((each for each in found if each is not None), None)


def checked(module: ModuleType, file: str) -> ModuleType:
    """The module, if it holds what `contract` asks for. Raises InputError otherwise."""
    for name in ('Parameters', 'MULTIPLE', 'pack', 'force'):
        if not hasattr(module, name):
            raise InputError(
                f'an effect without {name}: see alf_ros/effects/contract/__init__.py', file=file
            )
    if not dataclasses.is_dataclass(module.Parameters):
        raise InputError('Parameters is no dataclass', file=file)
    fields = dataclasses.fields(module.Parameters)
    named = set(getattr(module, 'ONE_OF', ()))
    for field in fields:
        if not {'kind', 'doc'} <= set(field.metadata):
            raise InputError(f"no 'kind' and 'doc' in the metadata of {field.name!r}", file=file)
        named.update(field.metadata.get('needs', ()))
    unknown = named.difference(field.name for field in fields)
    if unknown:
        raise InputError(f"ONE_OF or 'needs' name no parameter: {min(unknown)!r}", file=file)
    for name, wanted in (('force', contract.FORCE), ('potential', contract.POTENTIAL)):
        if hasattr(module, name) and getattr(getattr(module, name), '_sig', None) != wanted:
            raise InputError(f'{name} is not compiled by @contract.{name}', file=file)
    asked = ('tangent', contract.TANGENT), ('side', contract.SIDE), ('interval', contract.INTERVAL)
    for name, wanted in asked:
        if hasattr(module, name) and getattr(getattr(module, name), 'signature', None) != wanted:
            raise InputError(f'{name} is not compiled by @contract.{name}', file=file)
    for name in ('force', 'potential', 'friction', 'tangent', 'side', 'interval'):
        made = getattr(module, name, None)
        written = (getattr(made, key, None) for key in ('_pyfunc', '_function', 'function'))
        function = next((each for each in written if each is not None), None)
        raised = None if function is None else _raising_line(function, set())
        if raised is not None:
            said = f'{name} raises an exception, which compiled code cannot: give NaN instead'
            raise InputError(said, file=raised[0], line=raised[1])
    return module
