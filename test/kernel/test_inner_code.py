"""Code that only compiled code calls has no machine code of its own, in memory and on disk."""

import json

import pytest

from support.forked import ended
from support.reader import START_LIMIT, environment


def printed(folder, cache, *arguments):
    """The output of Python in a process of its own, with a cache of compiled code."""
    variables = {**environment(), 'NUMBA_CACHE_DIR': str(folder / cache)}
    done = ended([*arguments], folder, variables, START_LIMIT, new=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


SOURCE = """
from alf_ros.kernel.numba_ext.jit import compiled, inlined, inner

@inlined
def third(x):
    return x / 3.0

@inner
def cubic(x):
    return third(x) * x * x

@compiled
def once(x):
    return cubic(x)

@compiled
def twice(x):
    return cubic(cubic(x))
"""
SCRIPT = """
import json, sys
import cubics
from numba.core import event

with event.install_recorder('numba:compile') as recorder:
    value = getattr(cubics, sys.argv[1])(0.7)
names = [e.data['dispatcher'].py_func.__name__ for _, e in recorder.buffer if e.is_start]
(code,) = cubics.cubic.overloads.values() if cubics.cubic.overloads else (None,)
address = code and code.library.get_pointer_to_function(code.fndesc.llvm_func_name)
print(json.dumps([value, names, address]))
"""


def run(folder, name):
    return json.loads(printed(folder, 'cache', '-c', SCRIPT, name))


def test_it_is_compiled_once_and_serves_two_callers_in_two_processes(tmp_path):
    (tmp_path / 'cubics.py').write_text(SOURCE)

    def cubic(x):
        return x / 3.0 * x * x

    assert run(tmp_path, 'once') == [cubic(0.7), ['once', 'cubic', 'third'], 0]
    # the text of `cubic` comes from the disk, with what it calls
    assert run(tmp_path, 'twice') == [cubic(cubic(0.7)), ['twice'], 0]
    # nothing but the caller is read
    assert run(tmp_path, 'once') == [cubic(0.7), [], None]
    assert run(tmp_path, 'twice') == [cubic(cubic(0.7)), [], None]


SHARED = """
import numpy as np
from numba import njit
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.structs import vector

@inner
def least(a, b):
    return min(a, b)

@inner
def taken(v, i, doubled):
    return least(2.0 * v[i], 9.0) if doubled else least(v[i], 9.0)

@compiled
def total(v, at):
    return taken(v, 0, True) + taken(v, at[0], False) + taken(vector(v), np.uint32(2), v[0] > 0.0)

@njit
def somebody_elses(v):
    return taken(v, np.uint8(1), True)

v, at = np.array([1.0, 2.0, 4.0]), np.array([1], dtype=np.uint16)
print(total(v, at), somebody_elses(v))
for kinds in taken.overloads:
    print(*kinds, sep=', ')
print(len(least.overloads))
"""


def test_one_variant_serves_constants_arrays_and_short_whole_numbers(tmp_path):
    """Also where numba compiles code that is not of this package."""
    (tmp_path / 'shared.py').write_text(SHARED)
    assert printed(tmp_path, 'cache', 'shared.py').splitlines() == [
        '12.0 4.0',
        'float64*, int64, bool',
        'float64*, uint64, bool',
        '1',
    ]


OF_EFFECTS = """
from numba.core.registry import CPUDispatcher
from alf_ros import effects
from alf_ros.effects.contract import gap_vectors
from alf_ros.effects.contract.dual_force import dual_force
from alf_ros.kernel.numba_ext.dual_numbers import RULES_OF_TWO

dual_force(effects.load('spring').force._pyfunc)
parts = [each for each in vars(gap_vectors).values() if isinstance(each, CPUDispatcher)]
for some in (parts, [rule for rule, _ in RULES_OF_TWO]):
    found = [code for each in some for code in each.overloads.values()]
    addresses = {c.library.get_pointer_to_function(c.fndesc.llvm_func_name) for c in found}
    print(len(found) > 1, *addresses)
"""


@pytest.mark.thorough
def test_parts_of_effects_and_rules_of_dual_numbers_are_such_code(tmp_path):
    assert printed(tmp_path, 'cache', '-c', OF_EFFECTS).splitlines() == ['True 0', 'True 0']


INLINED = """
import sys
from numba import types
from alf_ros.kernel.numba_ext.jit import by_address, compiled, inner

@inner
def square(x):
    return x * x

@compiled
def called(x):
    return square(x)

def forced(x):
    return square(x)

if sys.argv[1] == 'called':
    called(0.5)
else:
    by_address(types.float64(types.float64))(forced)
(code,) = square.overloads.values()
text = str(code.library.parts[0]._get_module_for_linking())
print('square' in text, 'alwaysinline' in text)
"""


@pytest.mark.thorough
def test_it_is_the_same_whoever_calls_it_first(tmp_path):
    """A function called by its address is put into its C function, but not all that it calls."""
    (tmp_path / 'squares.py').write_text(INLINED)
    for first in ('called', 'forced'):
        assert printed(tmp_path, first, 'squares.py', first).split() == ['True', 'False'], first


LIKE_NAMES = """
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.number_types import called

def adding(number):
    return called(lambda x: x + number)

more, less = adding(10.0), adding(-10.0)

@inner
def up(x):
    return more(x)

@inner
def down(x):
    return less(x)

@compiled
def only_up(x):
    return up(x)

@compiled
def only_down(x):
    return down(x)

@compiled
def both(x):
    return 1000.0 * up(x) + down(x)
"""


@pytest.mark.thorough
def test_functions_of_one_name_stay_apart(tmp_path):
    """Two processes compile two functions of one name, each as its first: a third process has the
    code of both. LLVM took one for the other."""
    (tmp_path / 'like_names.py').write_text(LIKE_NAMES)
    found = [
        float(
            printed(tmp_path, 'cache', '-c', f'import like_names; print(like_names.{name}(1.0))')
        )
        for name in ('only_up', 'only_down', 'both')
    ]
    assert found == [11.0, -9.0, 10991.0]
