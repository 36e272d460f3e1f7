"""Columns of the derivatives of forces: directions in which the force of an effect is
differentiated at once."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.kernel.numba_ext.structs import Lanes, Struct


@dataclass(frozen=True, eq=False)
class ForceColumns(Struct):
    """A direction in each lane: the first ones are along numbers of q and q̇, and then, for each
    effect, along its own numbers."""

    addresses = ('force',)

    force: Addresses  # (effects,) for dual numbers in lanes; (0,): forces are traced instead
    number: Integers  # (columns of the state,) the number of q, or of q̇ behind it, of each
    dq: Lanes  # (all blocks D,) m
    dqd: Lanes  # (all blocks D,) m/s
    dparams: Lanes  # (params,)
    Q: Floats  # (all blocks D,) forces beside their derivatives
    dQ: Lanes  # (all blocks D,) of one effect
    own: Lanes  # (effects,) ∂J/∂ the numbers of each effect, summed up over all stages
    sum: Lanes  # (1,) ∂J/∂ the numbers of the state, in a stage
