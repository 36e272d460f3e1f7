"""Less work of numba makes the same code; and numba is as it was when nothing is compiled."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros.kernel.numba_ext.repeated_work import REPLACED, spared
from support.forked import ended
from support.reader import START_LIMIT, environment

# numbers of all kinds, loops, functions of numba that are compiled themselves; and, where no pass
# of numba is left out, a closure, lists, a reduction, expressions of arrays and a large dictionary
SOURCE = """
import contextlib, math, sys
from functools import reduce
from itertools import count

import numpy as np
from numba.core.bytecode import FunctionIdentity

from alf_ros.kernel.numba_ext import cache, inner_code
from alf_ros.kernel.numba_ext.jit import compiled, expanded, inner

if sys.argv[1] == 'all':
    cache.spared = contextlib.nullcontext

numbers_of_functions = FunctionIdentity._unique_ids = count(1)
inner_code.UniqueNumbers.__next__ = lambda self: next(numbers_of_functions)


@expanded
def middle(a, b):
    return a if a > b else 0.5 * (a + b)


@inner
def law(x, n, rising):
    total = 0.0
    for i in range(n):
        step = x * i + (i + 1) * (n - i) // 3
        total += math.sin(step) + max(step, 2.0) + middle(abs(step), 1.0) + np.sign(x)
        if rising and total > 40.0:
            break
        while total < -1.0:
            total = total**2 - n % 3
    return total


@compiled
def whole(x, n, numbers):
    total = law(x, n, True) - law(x, 2, False) + law(float(n), n, x < 1.0)
    for i in range(numbers.size):
        numbers[i] += total * i
    return total


@inner
def plus(a, b):
    return a + b


@compiled
def arrays(numbers):
    def twice(x):
        return 2.0 * x

    some = np.array([twice(x) for x in range(4)])
    x = numbers[1]
    table = {
        'a': x, 'b': 2, 'c': x, 'd': 4, 'e': x, 'f': 6, 'g': x, 'h': 8, 'i': x, 'j': 10,
        'k': x, 'l': 12, 'm': x, 'n': 14, 'o': x, 'p': 16, 'q': x, 'r': 18, 's': x, 't': 20,
    }
    return reduce(plus, numbers) + (numbers * some + 1.0).sum() + table['a'] * table['t']


numbers = np.arange(4.0)
print([whole(0.7, 5, numbers), *numbers.tolist()])
if sys.argv[1] == 'less':
    print(arrays(numbers))
"""


def libraries(folder: Path, how: str) -> dict[str, Any]:
    """The code of each function, by the name of its file in the cache; and what they compute."""
    (folder / 'laws.py').write_text(SOURCE)
    variables = {**environment(), 'NUMBA_CACHE_DIR': str(folder / how)}
    done = ended(['laws.py', how], folder, variables, START_LIMIT, new=True)
    assert done.returncode == 0, done.stderr
    found = {}
    for path in (folder / how).glob('alf_ros/*/*-*'):
        whole = path.read_bytes()
        found[path.name], *_ = pickle.loads(whole[2 * 65 :])
    return {**found, 'printed': [json.loads(line) for line in done.stdout.splitlines()]}


@pytest.mark.thorough
def test_the_code_is_the_same(tmp_path: Path) -> None:
    less, all_of_it = (libraries(tmp_path, how) for how in ('less', 'all'))
    assert len(less) == 5
    # numba numbers closures as they come: what these compute is the same, not always their code
    for name in ('laws.arrays', 'laws.plus'):
        del less[next(each for each in less if each.startswith(name))]
    total, *numbers = less['printed'][0]
    n, found = np.array(numbers), less['printed'].pop()
    assert less == all_of_it
    assert found == pytest.approx((n + n * [0.0, 2.0, 4.0, 6.0] + 1.0).sum() + 20.0 * n[1])
    assert n - np.arange(4.0) == pytest.approx(total * np.arange(4.0))


def test_numba_is_left_as_it_was() -> None:
    def now() -> list[Any]:
        return [getattr(owner, name) for owner, name, _ in REPLACED]

    before = now()
    with pytest.raises(ZeroDivisionError), spared():
        with spared():
            pass
        assert all(one is not other for one, other in zip(before, now(), strict=True))
        raise ZeroDivisionError
    assert now() == before
