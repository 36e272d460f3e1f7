"""Positions of the joints of an MJCF at which its loops (`connect` and `weld`) close, and at which
linear couplings hold.

MuJoCo itself gives poses and their derivatives. The unknowns are its degrees of freedom: positions
of hinges and slides, and where a free joint is from its place as drawn. Of a ball, and of the turn
of a free joint, they are the rotation vector r from the orientation drawn. With it the angular
velocity in the body is J(r) dr/dt, where

    J(r) = 1 - (1 - cos φ) / φ² K + (φ - sin φ) / φ³ K²,    φ = |r|, K v = r × v.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange import loop_gaps, open_loops
from alf_ros.exchange.robot import FramePose, Robot

_SMALL = 1e-4  # rad, below which a series stands for the formula of J


@dataclass(frozen=True, eq=False)
class MjcfLoop:
    """A `spherical` or `weld` between frames of two bodies, each in the frame of its body."""

    name: str
    kind: str
    bodies: tuple[int, int]
    frames: tuple[FramePose, FramePose]


@dataclass(frozen=True, eq=False)
class MjcfCoupling:
    """Σ factor · x = constant over hinges and slides, by number; positions count as in MuJoCo."""

    name: str
    of: Mapping[int, float]
    constant: float

    def off(self, data: Any) -> float:
        """By how much the left side is larger, in its own unit."""
        places = data.model.jnt_qposadr
        return sum(a * float(data.qpos[places[n]]) for n, a in self.of.items()) - self.constant


Held = MjcfLoop | MjcfCoupling


def close(
    robot: Robot,
    mujoco: Any,
    data: Any,
    loops: Sequence[MjcfLoop],
    couplings: Sequence[MjcfCoupling],
    stay: Sequence[int],
) -> None:
    """Move the joints of `data` to where the loops close and the couplings hold, except the joints
    whose numbers `stay` has. Raises InputError if no start closes them.
    """
    model = data.model
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    size = float(np.abs(data.xpos).max()) or 1.0
    free = {dof for dof in range(model.nv) if model.dof_jntid[dof] not in stay}
    held: list[tuple[Held, set[int]]] = [(loop, _dofs(model, loop) & free) for loop in loops]
    for coupling in couplings:
        dofs = {int(model.jnt_dofadr[joint]) for joint in coupling.of}
        held.append((coupling, dofs & free))
    found = data.qpos.copy()
    for own, unknowns in open_loops.groups(held):
        posture = _MjcfPosture(mujoco, data, own, sorted(unknowns), size)
        x = open_loops.closed(posture, robot)
        data.qpos[:] = posture.begin
        if x is not None:
            for joint in {model.dof_jntid[dof] for dof in unknowns}:
                first = model.jnt_qposadr[joint]
                last = model.jnt_qposadr[joint + 1] if joint + 1 < model.njnt else model.nq
                found[first:last] = posture.positions(x)[first:last]
    data.qpos[:] = found


def _dofs(model: Any, loop: MjcfLoop) -> set[int]:
    """The degrees of freedom below where both sides of a loop meet."""
    sides = []
    for body in loop.bodies:
        dofs = set()
        while body > 0:
            first = int(model.body_dofadr[body])
            dofs |= (
                set(range(first, first + int(model.body_dofnum[body]))) if first >= 0 else set()
            )
            body = int(model.body_parentid[body])
        sides.append(dofs)
    return sides[0] ^ sides[1]


class _MjcfPosture:
    """Loops and couplings that share joints; see `open_loops.OpenLoops`."""

    def __init__(
        self, mujoco: Any, data: Any, held: Sequence[Held], dofs: Sequence[int], size: float
    ) -> None:
        self._mujoco, self._data, self._model = mujoco, data, data.model
        self._held, self._dofs, self.size = held, np.array(dofs, dtype=int), size
        named = [each.name for each in held if isinstance(each, MjcfLoop)]
        self.loops = ', '.join(named or [each.name for each in held])
        self.begin = data.qpos.copy()
        kinds, single = self._model.jnt_type, mujoco.mjtJoint
        self._joints = self._model.dof_jntid[self._dofs]
        self._single = np.isin(kinds[self._joints], (single.mjJNT_HINGE, single.mjJNT_SLIDE))
        self._slides = kinds[self._joints] == single.mjJNT_SLIDE
        within = self._dofs - self._model.jnt_dofadr[self._joints]
        self._slides |= (kinds[self._joints] == single.mjJNT_FREE) & (within < 3)
        at = self._model.jnt_qposadr[self._joints]
        self.drawn = np.where(self._single, self.begin[at], 0.0)

    def limits(self) -> tuple[Floats, Floats]:
        """Limits of hinges and slides."""
        limited = self._single & self._model.jnt_limited[self._joints].astype(bool)
        low, high = self._model.jnt_range[self._joints].T
        limited &= low < high
        return np.where(limited, low, -np.inf), np.where(limited, high, np.inf)

    def scales(self) -> Floats:
        """1 rad, or the size."""
        return np.where(self._slides, self.size, 1.0)

    def positions(self, x: Floats) -> Floats:
        """The positions of all joints, as MuJoCo has them."""
        q, change = self.begin.copy(), np.zeros(self._model.nv)
        change[self._dofs] = x - self.drawn
        self._mujoco.mj_integratePos(self._model, q, change, 1.0)
        return q

    def gaps(self, x: Floats) -> tuple[Floats, Floats]:
        """Values (rows,) m, and the derivative (rows, n)."""
        model, data, mujoco = self._model, self._data, self._mujoco
        data.qpos[:] = self.positions(x)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        by_unknowns = self._by_unknowns(x)
        values, rows = [], []
        for each in self._held:
            if isinstance(each, MjcfCoupling):
                value, slope = self._coupled(each)
            else:
                ends = [
                    FramePose(data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()) @ frame
                    for body, frame in zip(each.bodies, each.frames, strict=True)
                ]
                slopes = []
                for body, end in zip(each.bodies, ends, strict=True):
                    slide, turn = np.zeros((2, 3, model.nv))
                    mujoco.mj_jac(model, data, slide, turn, end.origin, body)
                    slopes.append((turn, slide))
                value, slope = loop_gaps.gap(each.kind, ends, slopes, self.size)
            values.append(value)
            rows.append(slope @ by_unknowns)
        return np.concatenate(values), np.concatenate(rows)

    def _coupled(self, each: MjcfCoupling) -> tuple[Floats, Floats]:
        model, row = self._model, np.zeros((1, self._model.nv))
        first = max(each.of, key=lambda joint: abs(each.of[joint]))
        is_slide = model.jnt_type[first] == self._mujoco.mjtJoint.mjJNT_SLIDE
        unit = (1.0 if is_slide else self.size) / abs(each.of[first])  # so that it is in m
        for joint, factor in each.of.items():
            row[0, model.jnt_dofadr[joint]] = unit * factor
        return np.array([unit * each.off(self._data)]), row

    def _by_unknowns(self, x: Floats) -> Floats:
        """(degrees of freedom, n): the velocities of MuJoCo by the velocities of the unknowns."""
        found = np.zeros((self._model.nv, x.size))
        found[self._dofs, np.arange(x.size)] = 1.0
        turns = ~self._single & ~self._slides
        for joint in dict.fromkeys(self._joints[turns].tolist()):
            own = np.flatnonzero(turns & (self._joints == joint))
            found[np.ix_(self._dofs[own], own)] = _of_rotation_vector(x[own])
        return found


def _of_rotation_vector(r: Floats) -> Floats:
    """(3, 3) J(r)."""
    phi = float(np.linalg.norm(r))
    K = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    if phi < _SMALL:
        a, b = 0.5 - phi**2 / 24.0, 1.0 / 6.0 - phi**2 / 120.0
    else:
        a, b = (1.0 - np.cos(phi)) / phi**2, (phi - np.sin(phi)) / phi**3
    return np.asarray(np.eye(3) - a * K + b * (K @ K))
