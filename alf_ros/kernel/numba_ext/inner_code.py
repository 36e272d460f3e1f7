"""Code of functions that only compiled code calls: it is kept as LLVM's text, not as machine code.

numba optimises each function together with all that it calls, and makes machine code of it, even
if Python never calls it. Its caller then takes the text, optimises it again and makes machine code
again. Here both wait for the function that Python calls, which holds all that it needs. A function
does not hold the text of the functions that it calls: a text that many functions need would be
copied into each, and read again from the file of each.

Texts that several processes wrote come together, and of two functions of one name LLVM takes one.
numba tells closures of one name apart by a number, which counts from 1 in each process. So here
the numbers begin elsewhere in each.
"""

from __future__ import annotations

import os
import pickle
import zlib
from collections.abc import Iterator, Sequence
from typing import Any
from weakref import WeakKeyDictionary, WeakValueDictionary

import llvmlite.binding as llvm
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult

_QUICKLY = 1  # a third of the length; a higher level takes longer, for little


class _NoEnvironment:
    """Takes the place of a `CPUCodegen` where numba stores the address of a Python object."""

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing: there is no machine code that could use it."""


class CodePart:
    """The LLVM code of one function, without the code of the functions that it calls."""

    _read: WeakValueDictionary[bytes, CodePart] = WeakValueDictionary()  # by their texts
    _others: WeakKeyDictionary[CPUCodeLibrary, CodePart] = WeakKeyDictionary()

    def __init__(self, module: Any, text: bytes | None = None) -> None:
        self._module, self._text = module, text
        self._reload_init: set[Any] = set()  # numba looks here; only parallel code has some

    @classmethod
    def read(cls, text: bytes) -> CodePart:
        """The part with a text: one for all functions that need it."""
        part = cls._read.get(text)
        if part is None:
            part = cls._read[text] = cls(None, text)
        return part

    @classmethod
    def of(cls, library: CPUCodeLibrary) -> list[CodePart]:
        """The parts of a library; a function that Python may call too is one part."""
        if isinstance(library, InnerLibrary):
            return library.parts
        if library not in cls._others:
            cls._others[library] = cls(library._get_module_for_linking())
        return [cls._others[library]]

    @property
    def text(self) -> bytes:
        """The bytes that a file keeps."""
        if self._text is None:
            self._text = self._module.as_bitcode()
        return self._text

    def _get_module_for_linking(self) -> Any:
        """As numba names it."""
        if self._module is None:
            self._module = llvm.parse_bitcode(self._text)
        return self._module


class InnerLibrary(JITCodeLibrary):
    """The code of one function and of all that it calls, in parts: in the function that Python
    calls in the end they come together, each once."""

    def __init__(self, codegen: Any, name: str, parts: Sequence[CodePart] = ()) -> None:
        super().__init__(codegen, name)
        self.parts = list(parts)
        self._whole: Any = None
        self._finalized = len(self.parts) > 0

    @property
    def codegen(self) -> Any:
        """The object that numba gives the address of the environment of this function."""
        return _NoEnvironment()

    def finalize(self) -> None:
        """The parts are known; nothing can be added any more."""
        self._raise_if_finalized()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = 'linkonce_odr'
        self._finalize_dynamic_globals()
        found = [CodePart(self._final_module)]
        for each in self._linking_libraries:
            found += [each] if isinstance(each, CodePart) else CodePart.of(each)
            self._dynamic_globals += getattr(each, '_dynamic_globals', ())
        self.parts = _callers_first(found)
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """All parts in one module, for code that is compiled without `add_parts`."""
        self._ensure_finalized()
        if self._whole is None:
            own, *others = (part._get_module_for_linking() for part in self.parts)
            self._whole = own.clone()
            for each in others:
                self._whole.link_in(each, preserve=True)
        return self._whole

    def get_pointer_to_function(self, name: str) -> int:
        """0: there is none."""
        self._ensure_finalized()
        return 0

    def serialize_using_object_code(self) -> Any:
        """Name, kind and the texts of the parts, for `_unserialize`."""
        self._ensure_finalized()
        texts = [part.text for part in self.parts]
        return self.name, 'inner', zlib.compress(pickle.dumps(texts), _QUICKLY)

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, _, packed = state
        texts = pickle.loads(zlib.decompress(packed))
        return cls(codegen, name, [CodePart.read(text) for text in texts])


def add_parts(self: CPUCodeLibrary, library: CPUCodeLibrary) -> None:
    """`CPUCodeLibrary.add_linking_library` for the time in which numba compiles our code."""
    library._ensure_finalized()
    inner = isinstance(library, InnerLibrary)
    more = library.parts if inner else [library]
    self._linking_libraries = _callers_first([*self._linking_libraries, *more])
    self._dynamic_globals += library._dynamic_globals if inner else []


def _callers_first(parts: Sequence[Any]) -> list[Any]:
    """Each part once, at its last place: a function stands before the functions that it calls.
    LLVM links only code that the code before it asks for."""
    return list(dict.fromkeys(reversed(parts)))[::-1]


class InnerCompiler(Compiler):
    """numba's compiler, which writes into an `InnerLibrary`."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a Python function."""
        self.state.library = InnerLibrary(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)


class UniqueNumbers(Iterator[int]):
    """Numbers that no other process has, also if it is forked from this one."""

    def __init__(self) -> None:
        self._process, self._last = 0, 0

    def __next__(self) -> int:
        if self._process != os.getpid():
            self._process, self._last = os.getpid(), int.from_bytes(os.urandom(8), 'little')
        self._last += 1
        return self._last


class _Reader:
    """A target context that reads an `InnerLibrary` where numba reads a library of its own."""

    def __init__(self, target_context: Any) -> None:
        self._target_context = target_context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target_context, name)

    def codegen(self) -> Any:
        return self

    def unserialize_library(self, state: Any) -> Any:
        return InnerLibrary._unserialize(self._target_context.codegen(), state)


def rebuilt(target_context: Any, data: Any) -> Any:
    """The result of a compilation that was saved."""
    is_inner = data[0][1] == 'inner'
    if is_inner:
        target_context = _Reader(target_context)
    return CompileResult._rebuild(target_context, *data)
