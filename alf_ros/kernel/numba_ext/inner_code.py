"""Code of functions that only compiled code calls: it is kept as LLVM's text, not as machine code.

numba optimises each function together with all that it calls, and makes machine code of it, even
if Python never calls it. Its caller then takes the text, optimises it again and makes machine code
again. Here both wait for the function that Python calls, which holds all that it needs.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult


class _NoEnvironment:
    """Takes the place of a `CPUCodegen` where numba stores the address of a Python object."""

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing: there is no machine code that could use it."""


class InnerLibrary(JITCodeLibrary):
    """The code of one function and of all that it calls."""

    @property
    def codegen(self) -> Any:
        """The object that numba gives the address of the environment of this function."""
        return _NoEnvironment()

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """0: there is none."""
        self._ensure_finalized()
        return 0

    def serialize_using_object_code(self) -> Any:
        """Name, kind and LLVM code, for `_unserialize`."""
        self._ensure_finalized()
        return self.name, 'inner', self._get_module_for_linking().as_bitcode()

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, kind, text = state
        library = cls(codegen, name)
        library._shared_module = library._final_module = llvm.parse_bitcode(text)
        library._finalize_final_module()
        return library


class InnerCompiler(Compiler):
    """numba's compiler, which writes into an `InnerLibrary`."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a Python function."""
        self.state.library = InnerLibrary(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)


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
