"""Blocks as values and loops as they are written, of the kernel, against numpy and `range`."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros.arrays import Floats, Integers, Unit
from alf_ros.kernel.numba_ext.block import (
    add,
    add_outer,
    block,
    cross,
    dot,
    packed,
    put,
    subtract,
    times,
)
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.kernel.numba_ext.plain_loops import each


@compiled
def _operations(
    unit: Unit, q: Floats, v: Floats, T: Floats, A: Floats, out: Floats
) -> tuple[float, float, float]:
    b, c = block(unit, q, 1), block(unit, v, 2)
    put(out, 0, b + c)
    put(out, 1, b - c)
    put(out, 2, 2.5 * b)
    add(out, 3, b)
    subtract(out, 4, c)
    put(out, 5, packed(unit, 1.0, 2.0, 3.0))
    put(out, 6, times(unit, T, 1, b))
    put(out, 7, cross(b, c))
    add_outer(unit, A, 1, b, c)
    last = 0.0
    for a in range(len(unit)):
        last = b[a]
    return dot(b, c), b[0], last


@pytest.mark.parametrize('D', (2, 3))
def test_blocks_are_vectors(D: int) -> None:
    rng = np.random.default_rng(7)
    q, v, out = rng.normal(size=(3, D)), rng.normal(size=(3, D)), rng.normal(size=(8, D))
    T, A = rng.normal(size=(2, D, D)), rng.normal(size=(2, D, D))
    before, matrices = out.copy(), A.copy()
    flat = [array.reshape(-1) for array in (q, v, T, A, out)]
    inner, first, last = _operations((0.0,) * D, *flat)
    b, c = q[1], v[2]
    expected = [b + c, b - c, 2.5 * b, before[3] + b, before[4] - c, np.arange(1.0, D + 1.0)]
    np.testing.assert_array_equal(out[:6], expected)
    np.testing.assert_allclose(out[6], T[1] @ b, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(A, matrices + np.array([np.zeros((D, D)), np.outer(b, c)]))
    assert inner == sum((b * c)[1:], (b * c)[0])
    assert (first, last) == (b[0], b[-1])
    if D == 3:
        np.testing.assert_allclose(out[7], np.cross(b, c), rtol=0, atol=1e-15)


@compiled
def _went(first: int, end: int, seen: Integers) -> int:
    count = 0
    for i in each(first, end):
        if i == 7:
            continue
        if i == 11:
            break
        for j in each(0, i):  # each time anew
            seen[i] += j
        count += 1
    return count


@pytest.mark.parametrize('first', (0, 3, 9))
@pytest.mark.parametrize('end', (0, 1, 4, 9, 14))
def test_each_goes_where_range_goes(first: int, end: int) -> None:
    seen, expected = np.zeros(14, dtype=np.int64), np.zeros(14, dtype=np.int64)
    went = [i for i in range(first, min(end, 11)) if i != 7]
    for i in went:
        expected[i] = sum(range(i))
    assert _went(first, end, seen) == len(went)
    np.testing.assert_array_equal(seen, expected)
