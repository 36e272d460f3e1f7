"""Numbers in lanes have the bits of single numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.block import add, block, cross, dot, packed, put, subtract
from alf_ros.kernel.numba_ext.calls import fused
from alf_ros.kernel.numba_ext.jit import ONE, TWO, compiled
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, everywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.lane_structs import LaneStruct
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.kernel.numba_ext.structs import Struct

ODD = [0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 5e-324, 1e308, -2.5e-308, 0.1, np.pi]

pytestmark = pytest.mark.skipif(PLAIN, reason='code that is not compiled has no lanes')


@dataclass(frozen=True, eq=False)
class Two(Struct):
    a: Floats  # (1,)
    b: Floats  # (1,)
    factor: float
    out: Floats  # (26,)


@dataclass(frozen=True, eq=False)
class Blocks(Struct):
    unit: tuple[float, float, float]
    u: Floats  # (6,)
    out: Floats  # (15,)


@dataclass(frozen=True, eq=False)
class Counted(Struct):
    counted = ('turns',)

    turns: Integers  # (2,)
    shared: Integers  # (3,)


@compiled
def each_operation(of: Two) -> None:
    a, b, out = of.a[0], of.b[0], of.out
    out[0], out[1], out[2], out[3] = a + b, a - b, a * b, a / b
    out[4], out[5], out[6], out[7] = -a, abs(a), np.sqrt(a), max(a, b)
    out[8], out[9], out[10], out[11] = min(a, b), np.sin(a), np.cos(a), np.log(abs(a))
    out[12] = pick(a < b, 1.0, 0.0) + pick(a <= b, 2.0, 0.0) + pick(a == b, 4.0, 0.0)
    out[13] = pick(a > b, 1.0, 0.0) + pick(a >= b, 2.0, 0.0) + pick(a != b, 4.0, 0.0)
    out[14] = pick((a < b) & (a < 1.0), a, b)
    out[15] = pick((a < b) | (b < 1.0), a, b)
    out[16] = pick((a < b) ^ (b < 1.0), a, pick(unless(a < b) & (a > 0.0), 1.0, 0.0))
    out[17] = 2.0 * a + 3
    out[18] = of.factor * a
    out[19] = max(0.0, a)
    out[20], out[21], out[22] = np.rint(a), np.arctan2(a, b), fused(a, b, of.factor)
    out[23], out[24], out[25] = np.ceil(a), a**b, abs(a) ** -0.125


@compiled
def each_block(of: Blocks) -> None:
    unit, u, out = of.unit, of.u, of.out
    a, b = block(unit, u, np.uint64(0)), block(unit, u, ONE)
    put(out, np.uint64(0), a + b)
    put(out, ONE, cross(a, b) - 2.0 * a)
    put(out, TWO, packed(unit, dot(a, b), 0.0, a[2]))
    add(out, ONE, dot(a, a) * b)
    subtract(out, TWO, packed(unit, 0.0, 0.0, 0.0) + b)
    c = pick(a[0] < b[0], a, b)
    for n in range(3):
        out[9 + n] = c[n]
        out[12 + n] = u[n] * b[2 - n]


@compiled
def masks(of: Two) -> int:
    smaller = of.a[0] < of.b[0]
    return 100 * everywhere(smaller) + 10 * anywhere(smaller) + nowhere(smaller)


def twos(a: Floats, b: Floats) -> list[Two]:
    with np.errstate(invalid='ignore'):
        factors = (a - b).tolist()
    return [
        Two(np.array([x]), np.array([y]), factor, np.zeros(26))
        for x, y, factor in zip(a, b, factors, strict=True)
    ]


@pytest.mark.parametrize('lanes', [2, 4, 16])
def test_every_operation_has_the_bits_of_single_numbers(lanes):
    rng = np.random.default_rng(lanes)
    a, b = (x.ravel() for x in np.meshgrid(ODD, ODD))
    a = np.concatenate([a, rng.normal(size=96), 10.0 ** rng.uniform(-300, 300, 96)])
    b = np.concatenate([b, rng.normal(size=96), 10.0 ** rng.uniform(-300, 300, 96)])
    for at in range(0, a.size, lanes):
        single = twos(a[at : at + lanes], b[at : at + lanes])
        together = LaneStruct(single)
        for each in single:
            each_operation(each)
        each_operation(together)
        alone = np.array([each.out for each in single]).T
        # the sign of a NaN is nobody's
        alone[np.isnan(alone)] = together.out[np.isnan(alone) & np.isnan(together.out)] = np.nan
        assert together.out.tobytes() == np.ascontiguousarray(alone).tobytes()


@pytest.mark.parametrize('lanes', [2, 8])
def test_blocks_have_the_bits_of_single_blocks(lanes):
    rng = np.random.default_rng(lanes)
    single = [Blocks((0.0, 0.0, 0.0), rng.normal(size=6), np.zeros(15)) for _ in range(lanes)]
    together = LaneStruct(single)
    each_block(together)
    for m, each in enumerate(single):
        each_block(each)
        assert together.out[:, m].tobytes() == each.out.tobytes()


def test_what_holds_for_a_group():
    assert masks(LaneStruct(twos(np.zeros(4), np.ones(4)))) == 110
    assert masks(LaneStruct(twos(np.ones(4), np.zeros(4)))) == 1
    assert masks(LaneStruct(twos(np.zeros(4), np.array([0.0, 1.0, 0.0, np.nan])))) == 10
    (single,) = twos(np.zeros(1), np.ones(1))
    assert masks(single) == 110


def test_a_group_has_numbers_of_each_and_one_pattern():
    members = [Counted(np.array([k, 2 * k]), np.array([7, 8, 9])) for k in range(4)]
    group = LaneStruct(members)
    assert group.turns.tolist() == [[0.0, 1.0, 2.0, 3.0], [0.0, 2.0, 4.0, 6.0]]
    assert group.shared.tolist() == [7, 8, 9]
    assert group.turns.ctypes.data % 64 == 0
