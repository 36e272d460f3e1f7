"""The digest of a Python function by value: what decides what it returns, and nothing else.

It covers the code, defaults and closure of the function, and the globals, attributes and items
that these lead to. Code of installed packages counts by its name: a store keeps their versions.
Pickled bytes are no such digest: they depend on line numbers, on the identity of objects, and on
the order of sets, which is another one in each process.
"""

from __future__ import annotations

import copyreg
import hashlib
import pickle
import sys
import sysconfig
from collections.abc import Callable, Iterator
from pathlib import Path
from types import (
    BuiltinFunctionType,
    CellType,
    CodeType,
    FunctionType,
    MappingProxyType,
    ModuleType,
)
from typing import Any

import numpy as np

_INSTALLED = ('site-packages', 'dist-packages')
_LIBRARY = Path(sysconfig.get_path('stdlib'))
_PACKAGE = __name__.partition('.')[0]
_NO_CONTENT = frozenset(  # attributes of a class that do not change what it does
    (
        '__dict__',
        '__weakref__',
        '__module__',
        '__doc__',
        '__annotations__',
        '__annotate_func__',
        '__annotations_cache__',
        '__firstlineno__',
        '__slotnames__',
        '__static_attributes__',
        '_abc_impl',
    )
)
_CODE = (
    'co_code',
    'co_consts',
    'co_names',
    'co_varnames',
    'co_freevars',
    'co_cellvars',
    'co_argcount',
    'co_posonlyargcount',
    'co_kwonlyargcount',
    'co_flags',
    'co_exceptiontable',
)


def function_digest(function: Any) -> str:
    """SHA-256 of all that a function does, the same in each process. Raises pickle.PicklingError
    or TypeError for a value that has no content."""
    own = function.__module__ if isinstance(function, FunctionType) else None
    return _Walk(own).of(function)


class _Walk:
    """Digests of values, for a function of the module `own`. An object that is met again, within
    itself as well, counts by the number of its first meeting."""

    def __init__(self, own: str | None) -> None:
        self._own = own
        self._met: dict[int, tuple[int, Any]] = {}  # the objects too: an id is given again

    def of(self, value: Any) -> str:
        """The digest of a value."""
        made = hashlib.sha256()
        for part in self._said(value):
            made.update(len(part).to_bytes(8, 'little') + part)
        return made.hexdigest()

    def _said(self, value: Any) -> Iterator[bytes]:
        kind = type(value)
        yield f'{kind.__module__}.{kind.__qualname__}'.encode()
        if value is None or kind in (bool, int, float, complex, str, type(Ellipsis)):
            yield repr(value).encode()
        elif kind in (bytes, bytearray):
            yield bytes(value)
        elif kind in (set, frozenset):  # no numbers of what is in it: the order is any
            yield from sorted(_Walk(self._own).of(item).encode() for item in value)
        elif kind is tuple:  # equal ones may be one object, or several
            yield from (self.of(item).encode() for item in value)
        elif id(value) in self._met:
            yield str(self._met[id(value)][0]).encode()
        else:
            self._met[id(value)] = len(self._met), value
            yield from (self.of(part).encode() for part in self._parts(value))

    def _parts(self, value: Any) -> Iterator[Any]:
        name = self._named(value) if isinstance(value, (FunctionType, type)) else None
        if name is not None:
            yield name
        elif isinstance(value, ModuleType):
            yield value.__name__
            if not installed(value.__name__):
                yield _source(value)
        elif type(value) is list:
            yield from value
        elif type(value) in (dict, MappingProxyType):
            yield from (part for pair in value.items() for part in pair)
        elif type(value) is np.ndarray and not value.dtype.hasobject:
            yield from (value.dtype.str, value.shape, value.tobytes())
        elif isinstance(value, CodeType):
            yield from (getattr(value, name, None) for name in _CODE)
        elif isinstance(value, FunctionType):
            yield from _function(value)
        elif isinstance(value, type):
            yield from _class(value)
        elif isinstance(value, CellType):
            yield from _content(value)
        elif isinstance(value, (staticmethod, classmethod)):
            yield value.__func__
        elif isinstance(value, property):
            yield from (value.fget, value.fset, value.fdel)
        elif str(type(value).__module__).startswith('numba.') and hasattr(value, 'py_func'):
            # its pickle has a random number too
            yield value.py_func
        else:
            yield from self._reduced(value)

    def _named(self, value: Any) -> str | None:
        """The name of a function or class of an installed module."""
        module, name = getattr(value, '__module__', None), getattr(value, '__qualname__', None)
        if not isinstance(module, str) or module == self._own or not installed(module):
            return None
        found: Any = sys.modules[module]
        for part in str(name).split('.'):
            found = getattr(found, part, None)
        return f'{module}.{name}' if found is value else None

    def _reduced(self, value: Any) -> Iterator[Any]:
        """The parts of which pickle makes an object."""
        if isinstance(value, BuiltinFunctionType) and not isinstance(value.__self__, ModuleType):
            yield from (value.__name__, value.__self__)
            return
        reduce: Callable[[Any], Any] | None = copyreg.dispatch_table.get(type(value))
        made = reduce(value) if reduce is not None else value.__reduce_ex__(4)
        if isinstance(made, str):  # a name in its module
            yield self._named(value) or made
            return
        for part in made:
            yield list(part) if hasattr(part, '__next__') else part


def installed(module: str) -> bool:
    """Whether an imported module is of Python, of an installed package, or of this one."""
    found = sys.modules.get(module)
    if found is None or module == '__main__':
        return False
    file = getattr(found, '__file__', None)
    if file is None or module.partition('.')[0] == _PACKAGE:
        return True
    path = Path(file)
    return any(part in path.parts for part in _INSTALLED) or path.is_relative_to(_LIBRARY)


def _function(function: FunctionType) -> Iterator[Any]:
    yield from (function.__code__, function.__defaults__, function.__kwdefaults__)
    yield from function.__closure__ or ()
    for name in sorted(_global_names(function.__code__)):
        if name in function.__globals__:
            yield from (name, function.__globals__[name])


def _global_names(code: CodeType) -> set[str]:
    """The names that a code and the codes within it may look up."""
    found = set(code.co_names)
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            found |= _global_names(inner)
    return found


def _content(cell: CellType) -> Iterator[Any]:
    try:
        yield cell.cell_contents
    except ValueError:  # an empty one
        return


def _class(kind: type) -> Iterator[Any]:
    yield from (kind.__qualname__, kind.__bases__)
    for name in sorted(set(vars(kind)) - _NO_CONTENT):
        value = vars(kind)[name]
        if type(value).__name__ not in ('member_descriptor', 'getset_descriptor'):
            yield from (name, value)


def _source(module: ModuleType) -> bytes:
    file = getattr(module, '__file__', None)
    if file is None:
        raise pickle.PicklingError(f'{module.__name__} has no file')
    try:
        return Path(file).read_bytes()
    except OSError:
        raise pickle.PicklingError(f'{file} cannot be read') from None
