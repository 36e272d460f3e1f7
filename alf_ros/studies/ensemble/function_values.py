"""A digest of all that a function uses: the values in its closure, its defaults, and the globals
that it names, with their functions in turn. It is the same in any process.

The text of a function alone does not tell `make(1.0)` from `make(2.0)`. Its pickled bytes do, but
they also depend on which objects the process happens to share.
"""

from __future__ import annotations

import builtins
import hashlib
import io
import pickle
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any


def digest(function: Callable[..., Any]) -> str:
    """SHA-256 of the values that a function uses."""
    found = hashlib.sha256()
    for part in _parts(function, ()):
        found.update(len(part).to_bytes(8, 'little') + part)
    return found.hexdigest()


def _parts(value: Any, within: tuple[int, ...]) -> Iterator[bytes]:
    """The value in bytes, without what it is a part of: `within` has the addresses of that."""
    yield type(value).__qualname__.encode()
    if isinstance(value, ModuleType):
        yield value.__name__.encode()
        return
    if id(value) in within:
        return
    within = (*within, id(value))
    if isinstance(value, (set, frozenset)):
        yield from sorted(b'\0'.join(_parts(each, within)) for each in value)
        return
    if isinstance(value, Mapping):
        for key, each in value.items():
            yield from _parts(key, within)
            yield from _parts(each, within)
        return
    if isinstance(value, (list, tuple)):
        for each in value:
            yield from _parts(each, within)
        return
    if isinstance(value, MethodType):
        yield from _parts((value.__func__, value.__self__), within)
        return
    if isinstance(value, partial):
        yield from _parts((value.func, value.args, value.keywords), within)
        return
    if not isinstance(value, FunctionType):
        # a function that is compiled, or remembers its results, is what it was made of
        inner = getattr(value, 'py_func', getattr(value, '__wrapped__', None))
        yield from [_pickled(value)] if inner is None else _parts(inner, within)
        return
    yield from _code(value.__code__)
    cells = []
    for cell in value.__closure__ or ():
        with suppress(ValueError):  # it has no content yet
            cells.append(cell.cell_contents)
    for each in (value.__defaults__, value.__kwdefaults__, cells, dict(_globals(value))):
        yield from _parts(each, within)


def _code(code: CodeType) -> Iterator[bytes]:
    """The instructions and constants of code, without the lines on which it stands."""
    yield code.co_code
    for constant in code.co_consts:
        yield from _code(constant) if isinstance(constant, CodeType) else _parts(constant, ())


def _globals(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """The globals that a function names, also in functions inside it, in order of their names."""
    for name in sorted(_names(function.__code__)):
        if name in function.__globals__ and not hasattr(builtins, name):
            yield name, function.__globals__[name]


def _names(code: CodeType) -> set[str]:
    found = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found |= _names(constant)
    return found


def _pickled(value: Any) -> bytes:
    """In bytes that do not depend on which equal objects are one; by name where that cannot be."""
    out = io.BytesIO()
    pickler = pickle.Pickler(out, protocol=4)
    pickler.fast = True
    try:
        pickler.dump(value)
    except Exception:  # whatever somebody's object raises
        return repr(type(value)).encode()
    return out.getvalue()
