"""How the kernel is compiled: 64-bit, no fast-math, without the interpreter's lock, cached."""

from __future__ import annotations

from typing import Any

from numba import njit

_options: dict[str, Any] = {'cache': True, 'nogil': True, 'error_model': 'numpy'}

compiled = njit(**_options)
# called from compiled code only: without the code that takes arguments from Python objects
inner = njit(**_options, no_cpython_wrapper=True, no_cfunc_wrapper=True)
inlined = njit(**_options, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)
# stands in the code that calls it: a compilation less, for what is called from one or two places
expanded = njit(nogil=True, error_model='numpy', inline='always')
