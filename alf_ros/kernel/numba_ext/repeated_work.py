"""Less work for numba: results that it computes again and again while it compiles are kept, and
passes over code in which they have nothing to do are left out.

The code that numba makes is the same, but for the numbers in names of functions, which no other
process gives (`inner_code`). This holds inside of `spared`, under the lock of numba's
compiler. Before and after, numba is as it was.

- The type of a call of a built-in function, an operator for example, depends on the types of its
  arguments only. numba tries the dozens of candidates of `+` at each `+`.
- The size of a type of LLVM: numba makes a module of LLVM for each variable to ask for it.
- Which variables live at the entry of each block, after each of nine changes of the intermediate
  code. Only generators and code with Python objects need it.
- The time in each call of LLVM, for each function that is being compiled, up to a dozen at once.
- Code of LLVM that a function needs by way of several others: it is added once (`inner_code`).
- Code in which there may be closures, lists and reductions to inline, or expressions of arrays to
  fuse, `with` statements or displays of dictionaries to simplify. numba prepares each function for
  that. The kernel has numbers, vectors and structs.
- The variables that a statement reads or writes. numba lists them a dozen times for each
  statement, and looks at its place in the source too.
- The options of a compilation, which are part of a key at each call of an operator.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import reduce
from typing import Any

from numba import stencil, types
from numba.core import event, interpreter, ir, postproc, transforms
from numba.core.base import BaseContext
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import CPUCodeLibrary
from numba.core.ir_utils import fixup_var_define_in_scope
from numba.core.targetconfig import TargetConfig
from numba.core.typed_passes import NopythonRewrites
from numba.core.types.functions import BaseFunction
from numba.core.untyped_passes import InlineClosureLikes

from alf_ros.kernel.numba_ext.inner_code import UniqueNumbers, add_parts

_signatures: dict[tuple[Any, ...], Any] = {}
_sizes: dict[tuple[Any, str], int] = {}
_depth = 0

_call_type = BaseFunction.get_call_type
_size = BaseContext.get_abi_sizeof
_run = postproc.PostProcessor.run
_inline, _rewrite = InlineClosureLikes.run_pass, NopythonRewrites.run_pass
_delete_exit = interpreter.peep_hole_delete_with_exit
_fuse_displays = interpreter.peep_hole_fuse_dict_add_updates
_start, _end, _trigger = event.start_event, event.end_event, event.trigger_event


def _remembered_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
    if kws:
        return _call_type(self, context, args, kws)
    key = self, context, tuple(args)
    known = _signatures.get(key)
    if known is None:
        found = _call_type(self, context, args, kws)
        # An `overload` is compiled with the options of its caller: numba decides each time.
        if found is not None and self._impl_keys[found.args] is self.typing_key:
            _signatures[key] = found
        return found
    self._impl_keys[known.args] = self.typing_key
    return known


def _remembered_size(self: Any, kind: Any) -> int:
    key = self.codegen(), str(kind)
    if key not in _sizes:
        _sizes[key] = _size(self, kind)
    return _sizes[key]


def _run_without_lives(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    code = self.func_ir
    if code.is_generator:
        _run(self, emit_dels, extend_lifetimes)
        return
    code.blocks = transforms.canonicalize_cfg(code.blocks)
    code.variable_lifetime = postproc.VariableLifetime(code.blocks)
    code.generator_info = None
    if emit_dels:
        self._insert_var_dels(extend_lifetimes=extend_lifetimes)


_UNFOLDED = 'reduce', 'stencil'  # functions of Python and numba, whose calls are inlined


def _may_be_inlined(value: Any) -> bool:
    """Whether a value in numba's intermediate code is one that `InlineClosureLikes` looks for."""
    if isinstance(value, ir.Expr):
        made = value.op in ('make_function', 'build_list')
        return made or (value.op == 'getattr' and value.attr in _UNFOLDED)
    if isinstance(value, (ir.Global, ir.FreeVar)):
        return value.name in _UNFOLDED or value.value is reduce or value.value is stencil
    return False


def _inline_if_any(self: Any, state: Any) -> Any:
    code = state.func_ir
    for block in code.blocks.values():
        if any(_may_be_inlined(each.value) for each in block.find_insts(ir.Assign)):
            return _inline(self, state)
    postproc.PostProcessor(code).run()
    fixup_var_define_in_scope(code.blocks)
    return True


def _rewrite_if_any(self: Any, state: Any) -> Any:
    fused = types.ArrayCompatible, types.StringLiteral
    if any(isinstance(kind, fused) for kind in state.typemap.values()):
        return _rewrite(self, state)
    return True


def _delete_exit_if_any(code: Any) -> Any:
    scopes = {id(block.scope): block.scope for block in code.blocks.values()}
    for scope in scopes.values():
        if any(name.startswith('$setup_with_exitfn') for name in scope.localvars._con):
            return _delete_exit(code)
    return code


def _fuse_displays_if_any(code: Any) -> Any:
    for block in code.blocks.values():
        for each in block.find_insts(ir.Assign):
            if isinstance(each.value, ir.Expr) and each.value.op == 'build_map':
                return _fuse_displays(code)
    return code


def _list_variables(self: Any, value: Any) -> list[Any]:
    found: list[Any] = []
    _add_variables(value, found)
    return found


def _add_variables(value: Any, found: list[Any]) -> None:
    """Add those that occur in a part of a statement, in their order."""
    kind = type(value)
    if kind is ir.Var:
        found.append(value)
    elif kind is ir.Loc or kind is str:
        return
    elif isinstance(value, ir.Inst):
        found += value.list_vars()
    elif isinstance(value, (list, tuple)):
        for each in value:
            _add_variables(each, found)
    elif isinstance(value, dict):
        for each in value.values():
            _add_variables(each, found)


def _values_of_options(self: Any) -> dict[str, Any]:
    given = self._values
    return {name: given.get(name, option.default) for name, option in self.options.items()}


def _no_timer(kind: str, callback: Any) -> AbstractContextManager[None]:
    return nullcontext()


# events that somebody listens to


def _start_heard(kind: str, data: Any = None) -> None:
    if event._registered.get(kind):
        _start(kind, data)


def _end_heard(kind: str, data: Any = None, exc_details: Any = None) -> None:
    if event._registered.get(kind):
        _end(kind, data, exc_details)


def _trigger_heard(kind: str, data: Any = None) -> AbstractContextManager[Any]:
    heard: AbstractContextManager[Any] = nullcontext()
    return _trigger(kind, data) if event._registered.get(kind) else heard


REPLACED: tuple[tuple[Any, str, Any], ...] = (
    (BaseFunction, 'get_call_type', _remembered_call_type),
    (BaseContext, 'get_abi_sizeof', _remembered_size),
    (postproc.PostProcessor, 'run', _run_without_lives),
    (CPUCodeLibrary, 'add_linking_library', add_parts),
    (FunctionIdentity, '_unique_ids', UniqueNumbers()),
    (InlineClosureLikes, 'run_pass', _inline_if_any),
    (NopythonRewrites, 'run_pass', _rewrite_if_any),
    (interpreter, 'peep_hole_delete_with_exit', _delete_exit_if_any),
    (interpreter, 'peep_hole_fuse_dict_add_updates', _fuse_displays_if_any),
    (ir.Inst, '_rec_list_vars', _list_variables),
    (TargetConfig, 'values', _values_of_options),
    (event, 'install_timer', _no_timer),
    (event, 'start_event', _start_heard),
    (event, 'end_event', _end_heard),
    (event, 'trigger_event', _trigger_heard),
)
_ORIGINAL = [getattr(owner, name) for owner, name, _ in REPLACED]


@contextmanager
def spared() -> Iterator[None]:
    """As a block, inside of which numba compiles. Blocks may be nested."""
    global _depth
    _depth += 1
    if _depth == 1:
        for owner, name, ours in REPLACED:
            setattr(owner, name, ours)
    try:
        yield
    finally:
        _depth -= 1
        if _depth == 0:
            for (owner, name, _), theirs in zip(REPLACED, _ORIGINAL, strict=True):
                setattr(owner, name, theirs)
