"""Whether drives or belts are the reason why a step failed; the others are in `kernel.Status`."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model import assembly
from alf_ros.model.compile import Model
from alf_ros.model.constraints.meshing import integrals
from alf_ros.model.prescribed import prescribe, without_value

_PARTS, _HALVINGS = 64, 24  # of a step, for the search for the instant


def beyond_reach(model: Model, q: Floats, t: float, h: float) -> tuple[str, str] | None:
    """Whether a motion has no value, or drives go where the loops do not reach, in the step of
    h (s) from q (blocks D, m) at t (s): the reason and the remedy, or None.

    Loops are closed without forces: the result is the same for every method.
    """
    if not model.layout.of_prescribed:
        return None
    good, closed = 0.0, np.array(q)
    for part in range(1, _PARTS + 1):
        s = part * h / _PARTS
        without = without_value(model.layout, model.system, t + s)
        if without:
            return (
                f'the motion {without!r} has no value, rate or acceleration at t = {t + s:.6g} s',
                'take one that has them at every instant',
            )
        if not model.mechanism.drives:  # belts alone turn no joint
            continue
        found, said = _followed(model, closed, t + s)
        if found is not None:
            good, closed = s, found
            continue
        bad = s
        for _ in range(_HALVINGS):
            middle = 0.5 * (good + bad)
            found, _ = _followed(model, closed, t + middle)
            if found is None:
                bad = middle
            else:
                good, closed = middle, found
        return (
            f'drives go beyond the reach of the loops at t = {t + good:.6g} s: {said}',
            'take motions that the loops can follow',
        )
    return _against_mesh(model, closed, t + h)


def _against_mesh(model: Model, q: Floats, t: float) -> tuple[str, str] | None:
    """Whether drives would slip teeth or couplings at t (s) and q, where their positions fit."""
    if not integrals(model.layout):
        return None
    try:
        assembly.complete(model, q, {}, t)
    except AssemblyError as error:
        return f'at t = {t:.6g} s {error.message}', 'take motions that gears and couplings permit'
    return None


def _followed(model: Model, q: Floats, t: float) -> tuple[Floats | None, str]:
    """The position near q where drives are at t (s); without one None, and the gap."""
    start, unused = np.array(q), np.zeros_like(q)
    prescribe(model.system, t, start, unused, unused)
    try:
        return assembly.close(model, {}, start), ''
    except AssemblyError as error:
        return None, error.message.removeprefix('the mechanism cannot be closed: ')
