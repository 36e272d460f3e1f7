"""The softest modes of Φ_q at a position: σ, the distance to a singular one, and its error."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Modes, Work
from alf_ros.kernel.softest_modes import ALL_SOFT
from alf_ros.model.compile import Model
from alf_ros.model.rank import effective_rank

ROUNDS, KNOWN = 30, 1e-6  # at most, and when σ is known well enough, where none are followed
NIL = 1e-8  # σ below which a mode has no sign: rounding may have turned its vectors
_NEAR = (
    2e-2  # part of the ordinary σ: at a tick of 2 ms, no pass of the library's scenes is missed
)
MISSING = 0.01  # of the rank: there s is less than 10
_ALONE, _MOST = 3, 24  # modes at a position of which nothing else is known


def near(model: Model) -> float:
    """σ below which a position is called near to a singular one."""
    return _NEAR * model.system.ordinary


def begun(model: Model, redundant: int, count: int = _ALONE) -> Modes | None:
    """So many modes to begin the iteration with, at no position yet; None without any rows that
    are independent. `redundant`: rows that depend on the others at ordinary positions."""
    rows, D = model.system.rows, model.layout.dimension
    m, whole = rows.alpha.size, model.q.size
    count = min(count, m - redundant)
    if count < 1:
        return None
    sizes = {
        's2': count,
        'sigma': count,
        'error': count,
        'z': count * m,
        'v': count * whole,
        'w': count * m,
        'fresh': m,
        'gram': count * count,
        'x': m,
        'g': rows.i.size * D,
        'g2': rows.block.size * D,
        'gb': rows.i.size * D,
        'g2b': rows.block.size * D,
    }
    modes = Modes(
        root=np.sqrt(rows.alpha),
        penalty=model.penalty,
        redundant=np.uint64(redundant),
        **{name: np.zeros(size) for name, size in sizes.items()},
    )
    restart(modes)
    return modes


def restart(modes: Modes) -> None:
    """Begin the iteration again."""
    m, count = modes.root.size, modes.s2.size
    start = _start(count + 1, m)
    modes.z[:], modes.fresh[:], modes.s2[:] = start[:count].ravel(), start[count], 0.0


@lru_cache(maxsize=8)
def _start(count: int, m: int) -> Floats:
    return np.random.default_rng(0).standard_normal((count, m)) / np.sqrt(m)


def found(model: Model, work: Work, redundant: int, memory: Modes | None = None) -> Modes | None:
    """The softest modes where `work` has the factor and Φ_q; None without any rows that are
    independent. As many more as vanish together there, up to _MOST.

    `memory`: what `begun` has given, to be written in.
    """
    count, modes = _ALONE, memory or begun(model, redundant)
    if modes is None:
        return None
    if memory is not None:
        restart(memory)
    kernel.softest(model.unit, model.system, work, modes, ROUNDS, KNOWN)
    while modes.s2[-1] < ALL_SOFT and count < min(_MOST, modes.root.size - redundant):
        count *= 2
        modes = begun(model, redundant, count)
        assert modes is not None
        kernel.softest(model.unit, model.system, work, modes, ROUNDS, KNOWN)
    if redundant:
        missing = len(model.row_names) - redundant - effective_rank(model, work)
        if missing > MISSING:
            return _among_dependent(model, work, redundant, round(missing))
    return modes


def _among_dependent(model: Model, work: Work, redundant: int, soft: int) -> Modes:
    """The modes where some are so soft that K removes them together with dependent rows.

    Dependent rows are therefore followed too, and omitted as the softest results.
    """
    rows, spare = model.system.rows.alpha.size, 2
    while True:
        all_of_them = begun(model, 0, redundant + soft + spare)
        assert all_of_them is not None
        sigma, error, s2 = all_of_them.sigma, all_of_them.error, all_of_them.s2
        for _ in range(ROUNDS):
            kernel.softest(model.unit, model.system, work, all_of_them, 1, 0.0)
            if error[redundant] <= KNOWN * sigma[redundant]:
                break
        if s2[-1] > ALL_SOFT or s2.size == rows:
            break
        spare *= 2
    modes = begun(model, redundant, s2.size - redundant)
    assert modes is not None
    for name in ('s2', 'sigma', 'error', 'z', 'v', 'w'):
        of, to = getattr(all_of_them, name), getattr(modes, name)
        to[:] = of[of.size - to.size :]
    modes.g[:], modes.g2[:] = all_of_them.g, all_of_them.g2
    return modes
