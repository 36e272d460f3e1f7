"""Code that is called at its address is one function."""

import pytest
from numba import types
from numba.core import sigutils
from numba.core.ccallback import CFunc

from alf_ros.kernel.numba_ext.c_functions import CCompiler
from alf_ros.kernel.numba_ext.plain import PLAIN

pytestmark = pytest.mark.skipif(PLAIN, reason='nothing is compiled')


def area(width, height):
    return width * height


def test_it_contains_what_numba_wraps():
    given = sigutils.normalize_signature(types.float64(types.float64, types.float64))
    made = CFunc(area, given, {}, {'error_model': 'numpy'}, pipeline_class=CCompiler)
    made.compile()
    (only,) = (line for line in made.inspect_llvm().splitlines() if line.startswith('define'))
    assert made.native_name in only
    assert made.ctypes(3.0, 0.5) == 1.5
