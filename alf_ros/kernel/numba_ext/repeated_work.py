"""Less work for numba: results that it computes again and again while it compiles are kept.

The code that numba makes is the same. This holds inside of `spared`, under the lock of numba's
compiler. Before and after, numba is as it was.

- The type of a call of a built-in function, an operator for example, depends on the types of its
  arguments only. numba tries the dozens of candidates of `+` at each `+`.
- The size of a type of LLVM: numba makes a module of LLVM for each variable to ask for it.
- Which variables live at the entry of each block, after each of nine changes of the intermediate
  code. Only generators and code with Python objects need it.
- The time in each call of LLVM, for each function that is being compiled, up to a dozen at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from numba.core import event, postproc, transforms
from numba.core.base import BaseContext
from numba.core.types.functions import BaseFunction

_signatures: dict[tuple[Any, ...], Any] = {}
_sizes: dict[tuple[Any, str], int] = {}
_depth = 0

_call_type = BaseFunction.get_call_type
_size = BaseContext.get_abi_sizeof
_run = postproc.PostProcessor.run
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
