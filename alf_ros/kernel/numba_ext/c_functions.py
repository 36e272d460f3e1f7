"""Code of C functions: each is one function, where numba makes two.

numba compiles a function with its own way of passing arguments, and a C function that only calls
it. Both stay apart, so that each call passes its arguments twice. If some of them are passed in
memory, as after the sixth pointer, the second one reads what the first one has just written in
smaller parts: the processor waits for that. Here LLVM puts the first function into the second,
which is the only one that is called.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _CLibrary(JITCodeLibrary):
    """The code of a C function."""

    def add_ir_module(self, module: Any) -> None:
        """Add a module, in which calls may be replaced by what they call."""
        for function in module.functions:
            for block in function.blocks:
                for instruction in block.instructions:
                    if isinstance(instruction, ir.CallInstr):
                        instruction.attributes.discard('noinline')
        super().add_ir_module(module)

    def finalize(self) -> None:
        """Nobody else calls the function that numba wraps."""
        for function in self._final_module.functions:
            if not function.is_declaration and not function.name.startswith('cfunc.'):
                function.linkage = 'internal'
        super().finalize()


class CCompiler(Compiler):
    """numba's compiler, for a C function."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a Python function."""
        self.state.library = _CLibrary(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)
