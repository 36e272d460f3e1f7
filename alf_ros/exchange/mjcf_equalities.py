"""Equalities of an MJCF: loops that `connect` and `weld` close, and couplings of joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import mjcf_posture, mjcf_tendons
from alf_ros.exchange.mjcf_posture import MjcfCoupling, MjcfLoop
from alf_ros.exchange.robot import Connection, Coupled, FramePose, Robot

_TURNED = 1e-6  # rad: how far --set may have a joint from where an equality has it
_PHASE = 1e-9  # rad or m: how far a coupling may be drawn from what the file says
_TORQUE_SCALE = 10  # place among the numbers of a weld; at 0 it holds places and no turn


def draw(mujoco: Any, data: Any, joints: Sequence[str], positions: Mapping[str, float]) -> None:
    """Draw joints where equalities have them. Raises InputError if --set says otherwise."""
    model = data.model
    couplings = {n: _of_joints(model, n) for n in _linear(mujoco, model)}
    for _ in couplings:  # of joints that follow one another, whatever their order
        for n, each in couplings.items():
            one, off = int(model.eq_obj1id[n]), each.off(data)
            if joints[one] not in positions or abs(off) <= _TURNED:  # digits that --set lacks
                data.qpos[model.jnt_qposadr[one]] -= off
    for n, each in couplings.items():
        name = joints[int(model.eq_obj1id[n])]
        given = positions.get(name, 0.0)
        if name in positions and abs(off := each.off(data)) > _TURNED:
            message = f'an equality has it at {given - off:.9g}'
            raise InputError(message, key='--set', value=f'{name}={given:g}')


def close(
    robot: Robot, mujoco: Any, data: Any, joints: Sequence[str], positions: Mapping[str, float]
) -> None:
    """Move the joints of `data` that are not in `positions` to where the loops of its model close,
    and couplings hold.

    Raises InputError if they cannot be closed.
    """
    loops = [
        each for each in _loops(mujoco, data.model).values() if not _is_inside(data.model, each)
    ]
    stay = [n for n, name in enumerate(joints) if name in positions]
    couplings = list(_couplings(mujoco, data.model).values())
    before = data.qpos.copy()
    mjcf_posture.close(robot, mujoco, data, loops, couplings, stay)
    _tell_moved(robot, mujoco, data, joints, before)


def _tell_moved(
    robot: Robot, mujoco: Any, data: Any, joints: Sequence[str], before: Floats
) -> None:
    """Note where free bodies and balls are that are not where they were; of hinges and slides the
    report gives the positions of all."""
    model, kinds = data.model, mujoco.mjtJoint
    for n, name in enumerate(joints):
        first, is_free = int(model.jnt_qposadr[n]), model.jnt_type[n] == kinds.mjJNT_FREE
        if not (is_free or model.jnt_type[n] == kinds.mjJNT_BALL):
            continue
        now = data.qpos[first : first + (7 if is_free else 4)]
        if np.abs(now - before[first : first + now.size]).max() > _PHASE:
            numbers = ' '.join(f'{x:.12g}' for x in now.round(12) + 0.0)
            robot.leave('qpos of bodies', f'{name} at {numbers}')


def add(
    robot: Robot,
    mujoco: Any,
    data: Any,
    joints: Sequence[str],
    held: Sequence[str],
) -> None:
    """Add the equalities of a model to its robot; list those that hold nothing.

    joints: their names; held: the part of each body.
    """
    model = data.model
    couplings, loops = _couplings(mujoco, model), _loops(mujoco, model)
    for n in range(model.neq):
        name = _name(model, n)
        if not model.eq_active0[n]:
            robot.leave('switched off in the file', name)
            continue
        if n in couplings:
            if abs(couplings[n].off(data)) > _PHASE:
                robot.leave('phase of mimic', name)
            of = {joints[joint]: factor for joint, factor in couplings[n].of.items()}
            robot.couplings.append(Coupled(name, of))
        elif n in loops:
            loop = loops[n]
            parts = [held[body] for body in loop.bodies]
            if _is_inside(model, loop):
                robot.leave('elements', f'equality {name} inside one body, or the ground')
                continue
            first, second = (
                FramePose(data.xpos[body], data.xmat[body].reshape(3, 3)).place(frame.origin)
                for body, frame in zip(loop.bodies, loop.frames, strict=True)
            )
            made = Connection(name, loop.kind, parts[0], parts[1], first)
            robot.connect(made, second)
        else:
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
        one, other = int(model.eq_obj1id[n]), int(model.eq_obj2id[n])
        single = all(int(model.jnt_type[each]) in kinds for each in (one, other) if each >= 0)
        if single and (other < 0 or not np.any(model.eq_data[n, 2:5])):
            found.append(n)
    return found


def _of_joints(model: Any, equality: int) -> MjcfCoupling:
    """x₁ = constant + slope x₂, less their positions in the file, as a coupling of positions."""
    one, other = (int(ids[equality]) for ids in (model.eq_obj1id, model.eq_obj2id))
    constant, slope = map(float, model.eq_data[equality, :2])
    constant += float(model.qpos0[model.jnt_qposadr[one]])
    of = {one: 1.0}
    if other >= 0 and slope:
        constant -= slope * float(model.qpos0[model.jnt_qposadr[other]])
        of[other] = -slope
    return MjcfCoupling(_name(model, equality), of, constant)


def _couplings(mujoco: Any, model: Any) -> dict[int, MjcfCoupling]:
    """The active linear equalities, of joints and of tendons over joints, by their numbers."""
    found = {n: _of_joints(model, n) for n in _linear(mujoco, model)}
    for n in range(model.neq):
        if model.eq_type[n] == mujoco.mjtEq.mjEQ_TENDON and model.eq_active0[n]:
            coupling = mjcf_tendons.coupling(mujoco, model, n, _name(model, n))
            found |= {n: coupling} if coupling is not None else {}
    return found


def _name(model: Any, equality: int) -> str:
    return str(model.equality(equality).name or f'loop{equality}')


def _loops(mujoco: Any, model: Any) -> dict[int, MjcfLoop]:
    """The active `connect` and `weld`, by their numbers."""
    kinds = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
    return {
        n: _loop(mujoco, model, n)
        for n in range(model.neq)
        if model.eq_active0[n] and int(model.eq_type[n]) in kinds
    }


def _is_inside(model: Any, loop: MjcfLoop) -> bool:
    """Whether it is between bodies that are fixed to each other, where it holds nothing."""
    one, other = (int(model.body_weldid[body]) for body in loop.bodies)
    return one == other


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
