"""The wrench of the parent on the child in every joint, on the cut mechanism."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import add_transposed, jacobian
from alf_ros.kernel.data import Cut, CutWork, Forms, Work
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import Block, block, cross, packed, put, times
from alf_ros.kernel.numba_ext.jit import ONE, THREE, compiled, inlined
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import vector


@compiled
def place_on_cut(unit: Unit, cut: Cut, there: CutWork, q: Floats, qd: Floats) -> None:
    """Position and velocity of the cut mechanism, from the assembled one."""
    q, qd = vector(q), vector(qd)
    for b in each(0, cut.source.size):
        put(there.q, b, block(unit, q, cut.source[b]))
        put(there.qd, b, block(unit, qd, cut.source[b]))


@compiled
def joint_wrenches(
    unit: Unit, cut: Cut, there: CutWork, work: Work, force: Floats, torque: Floats
) -> None:
    """Forces (joints D,), N, and torques about the joints (joints, in space times 3), N m, on the
    child, from q, q̈ and λ in `work`; Q on the cut blocks stands in `there`."""
    for b in each(0, cut.source.size):
        put(there.q, b, block(unit, work.q, cut.source[b]))
        put(there.qdd, b, block(unit, work.qdd, cut.source[b]))
        put(there.needed, b, -1.0 * block(unit, there.Q, b))
    for r in each(0, cut.source_row.size):
        there.y[r] = work.y[cut.source_row[r]]
    jacobian(unit, cut.rows, there.q, there.g, there.g2)
    add_mass_times(unit, cut.mass, 1.0, there.qdd, there.needed)
    add_transposed(unit, cut.rows, there.g, there.g2, there.y, there.needed)
    force, torque = vector(force), vector(torque)
    for n in each(0, cut.first.size - ONE):
        R = packed(unit, 0.0, 0.0, 0.0)
        T = packed(unit, 0.0, 0.0, 0.0)
        for m in each(cut.points.first[n], cut.points.first[n + ONE]):
            R = R + cut.points.sign[m] * block(unit, there.needed, cut.points.block[m])
        for m in each(cut.vectors.first[n], cut.vectors.first[n + ONE]):
            b = cut.vectors.block[m]
            arm, f = block(unit, there.q, b), block(unit, there.needed, b)
            T = T + cut.vectors.sign[m] * moment(unit, arm, f)
        origin = form(unit, cut.origins, n, there.q)
        for m in each(cut.first[n], cut.first[n + ONE]):
            h = -work.y[cut.row[m]] * block(unit, there.g2, cut.entry[m])
            R = R + cut.is_point[m] * h
            arm = block(unit, there.q, cut.block[m]) - cut.is_point[m] * origin
            T = T + moment(unit, arm, h)
        put(force, n, R)
        if np.uint64(len(unit)) == THREE:
            put(torque, n, T)
        else:
            torque[n] = T[0]


@inlined
def moment(unit: Unit, arm: Block, f: Block) -> Block:
    """arm × f; in the plane it is the first number of the block."""
    if np.uint64(len(unit)) == THREE:
        return cross(arm, f)
    return packed(unit, arm[0] * f[1] - arm[1] * f[0], 0.0, 0.0)


@inlined
def form(unit: Unit, forms: Forms, n: np.uint64, q: Floats) -> Block:
    """Value of form n at q."""
    value = block(unit, forms.c, n)
    for m in each(forms.first[n], forms.first[n + ONE]):
        value = value + times(unit, forms.C, m, block(unit, q, forms.block[m]))
    return value
