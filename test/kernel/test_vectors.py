"""Loops over vectors of the kernel, four numbers at a time, against numpy and in lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.kernel.numba_ext.lane_structs import LaneStruct
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.kernel.numba_ext.structs import Struct
from alf_ros.kernel.numba_ext.vectors import (
    add_first,
    add_times,
    furthest,
    largest,
    put_difference,
    put_sum,
)


@dataclass(frozen=True, eq=False)
class Vectors(Struct):
    n: np.uint64
    u: Floats
    v: Floats
    sum: Floats
    difference: Floats
    added: Floats
    scaled: Floats
    found: Floats  # (2,)


@compiled
def each_loop(of: Vectors) -> None:
    n, u, v = of.n, of.u, of.v
    put_sum(u, v, of.sum, n)
    put_difference(u, v, of.difference, n)
    add_first(u, of.added, n)
    add_times(0.3, u, of.scaled, n)
    of.found[0], of.found[1] = largest(u, n), furthest(u, v, n)


def vectors(n: int, seed: int) -> Vectors:
    rng = np.random.default_rng(seed)
    u, v, total, difference, added, scaled = rng.normal(size=(6, n + 2))
    return Vectors(np.uint64(n), u, v, total, difference, added, scaled, np.zeros(2))


@pytest.mark.parametrize('n', [0, 1, 3, 4, 5, 6, 8, 11])
def test_loops_are_those_of_numpy(n: int) -> None:
    of, before = vectors(n, n), vectors(n, n)
    each_loop(of)
    u, v = of.u[:n], of.v[:n]
    expected = {
        'sum': u + v,
        'difference': u - v,
        'added': before.added[:n] + u,
        'scaled': before.scaled[:n] + 0.3 * u,
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(getattr(of, name)[:n], values, err_msg=name)
        np.testing.assert_array_equal(getattr(of, name)[n:], getattr(before, name)[n:])
    assert of.found[0] == np.abs(u).max(initial=0.0)
    assert of.found[1] == np.abs(u - v).max(initial=0.0)


@pytest.mark.parametrize('at', range(7))
def test_the_largest_may_stand_anywhere_and_no_number_is_not_larger(at: int) -> None:
    of = vectors(7, 1)
    of.u[at] = -9.0
    of.u[(at + 3) % 7] = np.nan
    each_loop(of)
    assert of.found[0] == 9.0
    assert of.found[1] == np.nanmax(np.abs(of.u[:7] - of.v[:7]))


@pytest.mark.skipif(PLAIN, reason='code that is not compiled has no lanes')
@pytest.mark.parametrize('n', [3, 4, 7])
def test_lanes_have_the_bits_of_single_vectors(n: int) -> None:
    single = [vectors(n, seed) for seed in range(8)]
    together = LaneStruct(single)
    each_loop(together)
    for m, each in enumerate(single):
        each_loop(each)
        for name in ('sum', 'difference', 'added', 'scaled', 'found'):
            assert getattr(together, name)[:, m].tobytes() == getattr(each, name).tobytes(), name
