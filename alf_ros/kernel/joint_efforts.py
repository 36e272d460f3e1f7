"""Efforts of effects on the free axes of joints: the power of the child alone, moved along one.

An effect on a joint coordinate x exerts F ∂x/∂q; on blocks that the child does not share, F is the
product with any velocity of the child that makes ẋ = 1. Compiled only where such effects are.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import add_one, add_one_friction
from alf_ros.kernel.data import Axes, CutWork, Effects
from alf_ros.kernel.joint_wrenches import form, moment
from alf_ros.kernel.numba_ext.block import block, dot, packed, put
from alf_ros.kernel.numba_ext.jit import ONE, THREE, compiled
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import vector
from alf_ros.kernel.numba_ext.vectors import zero


@compiled
def add_joint_efforts(
    unit: Unit,
    axes: Axes,
    effects: Effects,
    there: CutWork,
    t: float,
    near: Floats,
    loads: Floats,
    efforts: Floats,
) -> None:
    """efforts (joint coordinates,), N m or N, += what `effects` exert at q and q̇ in `there`."""
    near, loads = vector(near), vector(loads)
    zero(there.Q)
    for n in each(0, axes.coordinate.size):
        # other blocks keep what they have: nobody reads it
        for m in each(axes.first[n], axes.first[n + ONE]):
            put(there.Q, axes.block[m], packed(unit, 0.0, 0.0, 0.0))
        for e in each(axes.first_effect[n], axes.first_effect[n + ONE]):
            add_one(effects, e, t, there.q, there.qd, near, there.Q)
            if effects.friction[e] != 0:
                add_one_friction(effects, e, t, there.q, there.qd, near, loads, there.Q)
        along = form(unit, axes.directions, n, there.q)
        origin = form(unit, axes.origins, n, there.q)
        effort = 0.0
        for m in each(axes.first[n], axes.first[n + ONE]):
            f = block(unit, there.Q, axes.block[m])
            if axes.is_angle[n] == 0:
                effort += axes.is_point[m] * dot(along, f)
            else:
                arm = block(unit, there.q, axes.block[m]) - axes.is_point[m] * origin
                turning = moment(unit, arm, f)
                if np.uint64(len(unit)) == THREE:
                    effort += dot(along, turning)
                else:
                    effort += turning[0]
        efforts[axes.coordinate[n]] += effort
