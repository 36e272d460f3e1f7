"""Calls of code by its address, and of single instructions of the processor."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from alf_ros.kernel.numba_ext.lane_numbers import lanes_among
from alf_ros.kernel.numba_ext.plain import PlainVector, at, found_at, lowered
from alf_ros.kernel.numba_ext.structs import VectorType


def _passed(kind: Any) -> Any:
    """The type in which an argument of a type is passed: whole numbers and truth in 64 bit."""
    kind = types.unliteral(kind)
    if isinstance(kind, types.Boolean):
        return types.int64
    if isinstance(kind, types.Integer):
        return types.int64 if kind.signed else types.uint64
    return types.float64 if isinstance(kind, types.Float) else kind


def _values(context: Any, builder: Any, kinds: Any, arguments: Any) -> list[Any]:
    values: list[Any] = []
    offset = False
    for kind, value in zip(kinds, arguments, strict=True):
        is_vector = isinstance(kind, (types.Array, VectorType))
        if is_vector:
            data = cgutils.create_struct_proxy(kind)(context, builder, value=value).data
            values.append(data)
        elif offset and isinstance(kind, types.Integer):
            values[-1] = builder.gep(values[-1], [value])
        else:
            values.append(value)
        offset = is_vector
    return values


def _call(returns: Any, kind: Any, arguments: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        given = cgutils.unpack_tuple(builder, args[1], len(sig.args[1]))
        values = _values(context, builder, sig.args[1].types, given)
        function = ir.FunctionType(returns, [value.type for value in values])

        def call(address: Any) -> Any:
            return builder.call(builder.inttoptr(address, function.as_pointer()), values)

        if isinstance(sig.args[0], VectorType):
            some = cgutils.create_struct_proxy(sig.args[0])(context, builder, value=args[0])
            with builder.if_then(builder.icmp_unsigned('!=', some.size, some.size.type(0))):
                call(builder.load(some.data))
            return context.get_dummy_value()
        value = call(args[0])
        return context.get_dummy_value() if sig.return_type == types.void else value

    address, *rest = arguments
    passed = types.StarArgTuple.from_types(tuple(map(_passed, rest)))
    return kind(address, passed), code


def _call_plainly(address: Any, *arguments: Any) -> Any:
    if isinstance(address, PlainVector):
        if address.size == 0:
            return None
        address = address[0]
    values: list[Any] = []
    offset = False
    for value in arguments:
        if offset and isinstance(value, (int, np.integer)):
            values[-1] = values[-1].behind(value)
            offset = False
            continue
        offset = isinstance(value, (PlainVector, np.ndarray))
        values.append(PlainVector(value) if isinstance(value, np.ndarray) else value)
    return at(address)(*values)


@lowered(_call_plainly)
def call(typing: Any, address: Any, *arguments: Any) -> Any:
    """Call the C function at an address, or at the address in a vector of none or one.

    Vectors are passed as pointers to their first numbers; a whole number behind one says at which
    number the pointer begins instead. Testing here for an address, instead of in separate code,
    saves a second of compiling.
    """
    return _call(ir.VoidType(), types.void, (address, *arguments))


@lowered(_call_plainly)
def call_for_number(typing: Any, address: Any, *arguments: Any) -> Any:
    """The same of a function that returns a float, at an address."""
    return _call(ir.DoubleType(), types.float64, (address, *arguments))


@lowered(_call_plainly)
def call_for_whole(typing: Any, address: Any, *arguments: Any) -> Any:
    """The same of a function that returns a whole number."""
    return _call(ir.IntType(64), types.int64, (address, *arguments))


@lowered(found_at)
def struct_at_address(typing: Any, address: Any) -> Any:
    """The struct at an `address_of`, for a function that is called by its address: it knows the
    type."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.uint64), code


_COUNTS = types.UniTuple(types.int64, 3)


def entry(function: Any, *kinds: Any) -> int:
    """Where the machine code of a compiled function for arguments of these types begins. It
    returns three whole numbers.

    `call_for_counts` calls it. Code that calls the function itself would contain it, compiled
    again.
    """
    _, _, given, _ = function.get_call_template(kinds, {})
    made = function.overloads[tuple(given)]
    if made.signature.return_type != _COUNTS:
        raise TypeError(f'{function.__name__} returns {made.signature.return_type}')
    return int(made.library.get_pointer_to_function(made.fndesc.llvm_func_name))


@intrinsic
def call_for_counts(typing: Any, address: Any, *arguments: Any) -> Any:
    """Call compiled code at its `entry`."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kinds, convention = tuple(sig.args[1]), context.call_conv
        given = cgutils.unpack_tuple(builder, args[1], len(kinds))
        kind = convention.get_function_type(_COUNTS, kinds)
        function = builder.inttoptr(args[0], kind.as_pointer())
        status, value = convention.call_function(builder, function, _COUNTS, kinds, given)
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return value

    return _COUNTS(types.uint64, types.StarArgTuple.from_types(arguments)), code


def _ask_plainly(words: Any) -> int:
    return 0  # Python hears signals by itself


@lowered(_ask_plainly)
def ask(typing: Any, words: Any) -> Any:
    """Call the Python object whose address is the first of four words, if there is one.

    It is called without arguments, with the interpreter's lock, which compiled code does not have.
    Returns 1 if it raised, or if the handler of a signal did: the exception (type, value,
    traceback) is then in the other words, and belongs to the code that reads it. Else 0.
    """

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        some = cgutils.create_struct_proxy(sig.args[0])(context, builder, value=args[0]).data
        pointer = ir.IntType(8).as_pointer()
        python, raised = context.get_python_api(builder), ir.IntType(64)
        result = cgutils.alloca_once_value(builder, raised(0))

        def function(name: str, returns: Any, count: int, kind: Any = pointer) -> Any:
            signature = ir.FunctionType(returns, [kind] * count)
            return cgutils.get_or_insert_function(builder.module, signature, name)

        caller = builder.load(some)
        with builder.if_then(builder.icmp_unsigned('!=', caller, caller.type(0))):
            lock = python.gil_ensure()
            call = function('PyObject_CallNoArgs', pointer, 1)
            answer = builder.call(call, [builder.inttoptr(caller, pointer)])
            with builder.if_else(cgutils.is_null(builder, answer)) as (failed, answered):
                with failed:
                    places = [builder.gep(some, [ir.IntType(64)(n)]) for n in (1, 2, 3)]
                    fetch = function('PyErr_Fetch', ir.VoidType(), 3, some.type)
                    builder.call(fetch, places)
                    builder.store(raised(1), result)
                with answered:
                    python.decref(answer)
            python.gil_release(lock)
        return builder.load(result)

    return types.int64(words), code


def _fused(a: float, b: float, c: float) -> Any:
    if not np.isfinite(a + b + c):
        return a * b + c
    return np.float64(float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))))


@lowered(_fused)
def fused(typing: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once; of numbers or lanes."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = args[0].type
        suffix = f'v{kind.count}f64' if isinstance(kind, ir.VectorType) else 'f64'
        declared = ir.FunctionType(kind, [kind] * 3)
        fma = cgutils.get_or_insert_function(builder.module, declared, f'llvm.fma.{suffix}')
        return builder.call(fma, args)

    kind = lanes_among((a, b, c)) or types.float64
    return kind(kind, kind, kind), code
