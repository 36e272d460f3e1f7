"""The softest modes of Φ_q at a position: σ, the distance to a singular one, and its error."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.kernel import Modes, Work
from alf_ros.kernel.softest import ALL_SOFT
from alf_ros.model import Model
from alf_ros.rank import effective_rank

ROUNDS, KNOWN = 30, 1e-6  # at most, and when σ is known well enough, where none are followed
NIL = 1e-8  # σ below which a mode has no sign: rounding may have turned its vectors
_NEAR = (
    2e-2  # part of the ordinary σ: at a tick of 2 ms, no pass of the library's scenes is missed
)
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
    random = np.random.default_rng(0)
    start = random.standard_normal((count + 1, m)) / np.sqrt(m)
    sizes = {
        's2': count,
        'sigma': count,
        'error': count,
        'v': count * whole,
        'w': count * m,
        'gram': count * count,
        'x': m,
        'g': rows.i.size * D,
        'g2': rows.block.size * D,
        'gb': rows.i.size * D,
        'g2b': rows.block.size * D,
    }
    return Modes(
        root=np.sqrt(rows.alpha),
        penalty=model.penalty,
        redundant=np.uint64(redundant),
        z=start[:count].ravel(),
        fresh=start[count],
        **{name: np.zeros(size) for name, size in sizes.items()},
    )


def found(model: Model, work: Work, redundant: int) -> Modes | None:
    """The softest modes where `work` has the factor and Φ_q; None without any rows that are
    independent. As many more as vanish together there, up to _MOST."""
    count, modes = _ALONE, begun(model, redundant)
    if modes is None:
        return None
    kernel.softest(model.unit, model.system, work, modes, ROUNDS, KNOWN)
    while modes.s2[-1] < ALL_SOFT and count < min(_MOST, modes.root.size - redundant):
        count *= 2
        modes = begun(model, redundant, count)
        assert modes is not None
        kernel.softest(model.unit, model.system, work, modes, ROUNDS, KNOWN)
    if redundant and modes.s2[0] > ALL_SOFT:
        # a mode below NIL is not told from what depends on others; but it is missing in the rank
        if len(model.row_names) - redundant - effective_rank(model, work) > 0.5:
            modes.sigma[0], modes.s2[0], modes.error[0] = 0.0, 0.0, NIL
    return modes
