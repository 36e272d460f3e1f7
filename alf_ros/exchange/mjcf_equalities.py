"""Equalities of an MJCF: loops that `connect` and `weld` close, and couplings of joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from alf_ros.errors import InputError
from alf_ros.exchange import mjcf_posture, mjcf_tendons
from alf_ros.exchange.mjcf_posture import MjcfCoupling, MjcfLoop
from alf_ros.exchange.robot import Connection, Coupled, FramePose, Robot

_TURNED = 1e-6  # rad: how far --set may have a joint from where an equality has it
_TORQUE_SCALE = 10  # place among the numbers of a weld; at 0 it holds places and no turn


def draw(mujoco: Any, data: Any, joints: Sequence[str], positions: Mapping[str, float]) -> None:
    """Draw joints where equalities have them. Raises InputError if --set says otherwise."""
    model = data.model
    for each in _couplings(mujoco, model):
        wanted = each.constant
        if each.other >= 0:
            wanted += each.slope * float(data.qpos[model.jnt_qposadr[each.other]])
        given = positions.get(joints[each.one])
        if given is not None and abs(given - wanted) > _TURNED:
            message = f'an equality has it at {wanted:.9g}'
            raise InputError(message, key='--set', value=f'{joints[each.one]}={given:g}')
        data.qpos[model.jnt_qposadr[each.one]] = wanted


def close(
    robot: Robot, mujoco: Any, data: Any, joints: Sequence[str], positions: Mapping[str, float]
) -> None:
    """Move the joints of `data` that are not in `positions` to where the loops of its model close.

    Raises InputError if they cannot be closed.
    """
    loops = list(_loops(mujoco, data.model).values())
    stay = [n for n, name in enumerate(joints) if name in positions]
    couplings = _couplings(mujoco, data.model)
    mjcf_posture.close(robot, mujoco, data, loops, couplings, stay)


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
    linear, loops = _linear(mujoco, model), _loops(mujoco, model)
    for n in range(model.neq):
        kind, name = model.eq_type[n], _name(model, n)
        if not model.eq_active0[n]:
            robot.leave('switched off in the file', name)
            continue
        if n in linear:
            joint, other, (_, slope) = _coupled(model, n)
            of = {joints[joint]: 1.0} | ({joints[other]: -slope} if slope else {})
            robot.couplings.append(Coupled(name, of))
        elif n in loops:
            loop = loops[n]
            parts = [held[body] for body in loop.bodies]
            first, second = (
                FramePose(data.xpos[body], data.xmat[body].reshape(3, 3)).place(frame.origin)
                for body, frame in zip(loop.bodies, loop.frames, strict=True)
            )
            made = Connection(name, loop.kind, parts[0], parts[1], first)
            robot.connect(made, second)
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


def _couplings(mujoco: Any, model: Any) -> list[MjcfCoupling]:
    """Linear couplings, of positions as MuJoCo counts them."""
    found = []
    for n in _linear(mujoco, model):
        one, other, (constant, slope) = _coupled(model, n)
        constant += float(model.qpos0[model.jnt_qposadr[one]])
        if other >= 0:
            constant -= slope * float(model.qpos0[model.jnt_qposadr[other]])
        found.append(MjcfCoupling(one, other, constant, slope))
    return found


def _name(model: Any, equality: int) -> str:
    return str(model.equality(equality).name or f'loop{equality}')


def _loops(mujoco: Any, model: Any) -> dict[int, MjcfLoop]:
    """The active `connect` and `weld`, by their numbers."""
    kinds = mujoco.mjtEq
    return {
        n: _loop(mujoco, model, n)
        for n in range(model.neq)
        if model.eq_active0[n] and model.eq_type[n] in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD)
    }


def _loop(mujoco: Any, model: Any, equality: int) -> MjcfLoop:
    numbers = model.eq_data[equality]
    one, other = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    is_weld = model.eq_type[equality] == mujoco.mjtEq.mjEQ_WELD
    kind = 'weld' if is_weld and numbers[_TORQUE_SCALE] != 0.0 else 'spherical'
    if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
        first, second = (
            _frame(mujoco, model.site_pos[site], model.site_quat[site]) for site in (one, other)
        )
        one, other = (int(model.site_bodyid[site]) for site in (one, other))
    elif is_weld:  # the anchor in both bodies, that of the second first
        first = _frame(mujoco, numbers[3:6], numbers[6:10])
        second = FramePose(numbers[:3].copy(), np.eye(3))
    else:
        first, second = (FramePose(each.copy(), np.eye(3)) for each in (numbers[:3], numbers[3:6]))
    return MjcfLoop(_name(model, equality), kind, (one, other), (first, second))


def _frame(mujoco: Any, place: Any, quaternion: Any) -> FramePose:
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, quaternion)
    return FramePose(place.copy(), turn.reshape(3, 3))
