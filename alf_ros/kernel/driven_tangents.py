"""Derivatives of prescribed blocks by the numbers of their motions, and the same transposed.

A prescribed block is a function s(t, θ). Its δs, δṡ and δs̈ do not follow from earlier stages: the
program of the motions gives them at the time of a stage, for dual numbers.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Adjoint, Tangents
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inner
from alf_ros.kernel.numba_ext.lane_structs import lane, lanes_of
from alf_ros.kernel.numba_ext.plain_loops import each


@inner
def drive_tangents(tangents: Tangents, t: float, k: np.uint64) -> None:
    """δs, δṡ and δs̈ at t (s) into `q`, `qd` and `drive_qdd` of group k."""
    at = k * tangents.Q.size
    call(
        tangents.drive,
        t,
        tangents.drive_slots,
        tangents.drive_params,
        tangents.drive_changes,
        k * tangents.drive_params.size,
        tangents.drive_registers,
        tangents.drive_slopes,
        tangents.Q,
        tangents.q,
        at,
        tangents.Q,
        tangents.qd,
        at,
        tangents.Q,
        tangents.drive_qdd,
        at,
    )


@inner
def drive_all_tangents(tangents: Tangents, t: float) -> None:
    """The same of all groups."""
    for k in range(tangents.groups):
        drive_tangents(tangents, t, k)


@inner
def take_drives_back(adjoint: Adjoint, t: float) -> None:
    """∂J/∂(δs, δṡ, δs̈) at t (s), in `q`, `qd` and `qdd`, into ∂J/∂ the numbers of the motions."""
    tangents, bars = adjoint.tangents, adjoint.drive
    if tangents.drive.size == 0:
        return
    slots, W = tangents.drive_slots, lanes_of(adjoint.drive_q)
    first = TWO + THREE * np.uint64(slots[0])
    numbers, outputs = tangents.drive_params.size, np.uint64(slots[1])
    for k in each(0, (numbers + W - ONE) // W):
        call(
            tangents.drive,
            t,
            slots,
            tangents.drive_params,
            adjoint.drive_seeds,
            k * numbers,
            tangents.drive_registers,
            tangents.drive_slopes,
            tangents.Q,
            adjoint.drive_q,
            tangents.Q,
            adjoint.drive_qd,
            tangents.Q,
            adjoint.drive_qdd,
        )
        for m in each(0, min(W, numbers - k * W)):
            for n in each(0, outputs):
                a = np.uint64(slots[first + TWO * n])
                bars[k * W + m] += (
                    lane(adjoint.drive_q, a, m) * adjoint.q[a]
                    + lane(adjoint.drive_qd, a, m) * adjoint.qd[a]
                    + lane(adjoint.drive_qdd, a, m) * adjoint.qdd[a]
                )
    for n in each(0, outputs):
        a = np.uint64(slots[first + TWO * n])
        adjoint.q[a], adjoint.qd[a], adjoint.qdd[a] = 0.0, 0.0, 0.0
