"""Equalities of an MJCF: loops that `connect` and `weld` close, and couplings of joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import mjcf_tendons
from alf_ros.exchange.robot import Connection, Coupled, FramePose, Robot

_TURNED = 1e-6  # rad: how far what a weld holds may be drawn from how it is held
_TORQUE_SCALE = 10  # place among the numbers of a weld; at 0 it holds places and no turn


def draw(mujoco: Any, data: Any, joints: Sequence[str], positions: Mapping[str, float]) -> None:
    """Draw joints where equalities have them. Raises InputError if --set says otherwise."""
    model = data.model
    for equality in _linear(mujoco, model):
        one, other, (constant, slope) = _coupled(model, equality)
        at = model.jnt_qposadr[one]
        wanted = float(model.qpos0[at] + constant)
        if other >= 0:
            there = model.jnt_qposadr[other]
            wanted += slope * float(data.qpos[there] - model.qpos0[there])
        given = positions.get(joints[one])
        if given is not None and abs(given - wanted) > _TURNED:
            message = f'an equality has it at {wanted:.9g}'
            raise InputError(message, key='--set', value=f'{joints[one]}={given:g}')
        data.qpos[at] = wanted


def add(
    robot: Robot,
    mujoco: Any,
    data: Any,
    joints: Sequence[str],
    held: Sequence[str],
    tendons: Sequence[str],
) -> None:
    """Add the equalities of a model to its robot; list those that hold nothing.

    joints, tendons: their names; held: the part of each body.
    """
    model, kinds = data.model, mujoco.mjtEq
    linear = _linear(mujoco, model)
    for n in range(model.neq):
        kind, name = model.eq_type[n], model.equality(n).name or f'loop{n}'
        if not model.eq_active0[n]:
            robot.leave('switched off in the file', name)
            continue
        if n in linear:
            joint, other, (_, slope) = _coupled(model, n)
            of = {joints[joint]: 1.0} | ({joints[other]: -slope} if slope else {})
            robot.couplings.append(Coupled(name, of))
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            connection, end = _loop(robot, mujoco, data, n, name, held)
            robot.connect(connection, end)
        elif kind != kinds.mjEQ_TENDON or not mjcf_tendons.couple(robot, model, n, name, tendons):
            robot.leave('equalities', name)
            continue
        robot.leave('softness', name)


def _linear(mujoco: Any, model: Any) -> list[int]:
    """The equalities that couple hinges and slides linearly."""
    kinds = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    found = []
    for n in range(model.neq):
        if model.eq_type[n] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[n]:
            continue
        one, other, _ = _coupled(model, n)
        single = all(model.jnt_type[each] in kinds for each in (one, other) if each >= 0)
        if single and (other < 0 or not np.any(model.eq_data[n, 2:5])):
            found.append(n)
    return found


def _coupled(model: Any, equality: int) -> tuple[int, int, tuple[float, float]]:
    """Two joints, the second -1 if there is none: x₁ = constant + slope x₂, less their
    positions in the file."""
    one, other = (int(ids[equality]) for ids in (model.eq_obj1id, model.eq_obj2id))
    constant, slope = map(float, model.eq_data[equality, :2])
    return one, other, (constant, slope if other >= 0 else 0.0)


def _loop(
    robot: Robot, mujoco: Any, data: Any, equality: int, name: str, held: Sequence[str]
) -> tuple[Connection, Floats]:
    """The joint that closes a loop, and where its child's end is drawn. Raises InputError."""
    model = data.model
    numbers = model.eq_data[equality]
    (one, first), (other, second) = _sides(mujoco, data, equality, held)
    is_weld = model.eq_type[equality] == mujoco.mjtEq.mjEQ_WELD
    turns = not is_weld or numbers[_TORQUE_SCALE] == 0.0
    if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
        start, end = first.origin, second.origin
        gap = first.turn.T @ second.turn
    elif is_weld:  # the anchor in both bodies, that of the second first
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, numbers[6:10])
        start, end = first.place(numbers[3:6]), second.place(numbers[:3])
        gap = (first.turn @ turn.reshape(3, 3)).T @ second.turn
    else:
        start, end = first.place(numbers[:3]), second.place(numbers[3:6])
        gap = np.eye(3)
    if not turns and np.linalg.norm(gap - np.eye(3)) > _TURNED:
        raise robot.error(name, 'its two sides are drawn turned against each other')
    return Connection(name, 'spherical' if turns else 'weld', one, other, start), end


def _sides(
    mujoco: Any, data: Any, equality: int, held: Sequence[str]
) -> Iterator[tuple[str, FramePose]]:
    """The two bodies of an equality, with the frames of bodies or of sites on them."""
    model = data.model
    by_site = model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE
    for n in (model.eq_obj1id[equality], model.eq_obj2id[equality]):
        places, turns = (data.site_xpos, data.site_xmat) if by_site else (data.xpos, data.xmat)
        part = held[model.site_bodyid[n] if by_site else n]
        yield part, FramePose(places[n].copy(), turns[n].reshape(3, 3).copy())
