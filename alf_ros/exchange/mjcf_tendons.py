"""Tendons of an MJCF, as compiled by MuJoCo: over joints, or through sites and pulleys.

The length is Σ coef · x, or the distances of successive sites, each divided by the divisor of the
last pulley. A tendon that wraps around a geom is listed: its length has another law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange import mjcf_switches
from alf_ros.exchange.mjcf_posture import MjcfCoupling
from alf_ros.exchange.robot import Robot, Tendon


def add(
    robot: Robot,
    mujoco: Any,
    data: Any,
    names: Sequence[str],
    joints: Sequence[str],
    held: Sequence[str],
) -> dict[int, str]:
    """Add the tendons of a model to its robot; list the others. Returns the names, by number.

    names: of the tendons; joints: of the joints; held: the part of each body.
    """
    model, found = data.model, {}
    for n, name in enumerate(names):
        if not _is_over_single(mujoco, model, n):
            robot.leave('tendons', f'{name} is over a ball or a free joint')
            continue
        shape = _shape(mujoco, data, n, name, joints, held)
        if shape is None:
            robot.leave('tendons', f'{name} wraps around a geom')
            continue
        found[n] = name
        for kind, value in (
            (
                'higher orders of tendons',
                (model.tendon_stiffnesspoly[n], model.tendon_dampingpoly[n]),
            ),
            ('armature of tendons', () if shape.joints else model.tendon_armature[n]),
            (
                'springs that yield',
                model.tendon_stiffness[n] and mjcf_switches.yields(model, 'tendon', n),
            ),
        ):
            if np.any(value):
                robot.leave(kind, name)
        if shape.joints and model.tendon_armature[n] and not _is_in_one_chain(mujoco, model, n):
            robot.leave('armature on branches', name)
        margin = float(model.tendon_margin[n])
        low, high = map(float, model.tendon_range[n])
        first, last = map(float, model.tendon_lengthspring[n])
        robot.tendons.append(
            replace(
                shape,
                stiffness=float(model.tendon_stiffness[n]),
                rest=(first, last),
                damping=float(model.tendon_damping[n]),
                friction=float(model.tendon_frictionloss[n]),
                limits=(low + margin, high - margin) if model.tendon_limited[n] else None,
                armature=float(model.tendon_armature[n]) if shape.joints else 0.0,
            )
        )
    return found


def _shape(
    mujoco: Any, data: Any, n: int, name: str, joints: Sequence[str], held: Sequence[str]
) -> Tendon | None:
    """A tendon without its forces; None for one that wraps around a geom."""
    model, kinds = data.model, mujoco.mjtWrap
    first = int(model.tendon_adr[n])
    whole = range(first, first + int(model.tendon_num[n]))
    if model.wrap_type[first] == kinds.mjWRAP_JOINT:
        own = _over_joints(mujoco, model, n)
        drawn = sum(a * float(data.qpos[model.jnt_qposadr[joint]]) for joint, a in own.items())
        of = {joints[joint]: factor for joint, factor in own.items()}
        return Tendon(name, of, drawn=drawn) if of else None
    path: list[tuple[str, Floats]] = []
    weights: list[float] = []
    share, is_cut = 1.0, True
    for w in whole:
        if model.wrap_type[w] == kinds.mjWRAP_PULLEY:
            share, is_cut = 1.0 / float(model.wrap_prm[w]), True
        elif model.wrap_type[w] == kinds.mjWRAP_SITE:
            site = int(model.wrap_objid[w])
            if path:
                weights.append(0.0 if is_cut else share)
            path.append((held[model.site_bodyid[site]], data.site_xpos[site].copy()))
            is_cut = False
        else:
            return None
    return Tendon(name, path=path, weights=weights) if any(weights) else None


def coupling(mujoco: Any, model: Any, equality: int, name: str) -> MjcfCoupling | None:
    """A linear equality of tendons over joints; None for others.

    It states L₁ - L₁⁰ = a + b (L₂ - L₂⁰), the lengths L⁰ at `qpos0`, the positions of the file.
    """
    numbers = list(map(float, model.eq_data[equality, :5]))
    ids = [int(each[equality]) for each in (model.eq_obj1id, model.eq_obj2id)]
    sides = [_over_joints(mujoco, model, n) for n in ids if n >= 0]
    single = all(_is_over_single(mujoco, model, n) for n in ids if n >= 0)
    if not all(sides) or not single or any(numbers[2:]):
        return None
    of: dict[int, float] = {}
    constant = numbers[0]
    for side, n, factor in zip(sides, ids, (1.0, -numbers[1]), strict=False):
        constant += factor * float(model.tendon_length0[n])
        for joint, value in side.items():
            of[joint] = of.get(joint, 0.0) + factor * value
    of = {joint: factor for joint, factor in of.items() if factor}
    return MjcfCoupling(name, of, constant) if of else None


def _over_joints(mujoco: Any, model: Any, n: int) -> dict[int, float]:
    """The joints of a tendon, by number, with their factors; none for one through places."""
    first, of = int(model.tendon_adr[n]), dict[int, float]()
    if model.wrap_type[first] == mujoco.mjtWrap.mjWRAP_JOINT:
        for w in range(first, first + int(model.tendon_num[n])):
            joint = int(model.wrap_objid[w])
            of[joint] = of.get(joint, 0.0) + float(model.wrap_prm[w])
    return {joint: factor for joint, factor in of.items() if factor}


def _is_over_single(mujoco: Any, model: Any, n: int) -> bool:
    """Whether all joints of a tendon are hinges and slides: of others MuJoCo adds the first number
    of a quaternion or of a place to the length, which is no coordinate."""
    kinds = mujoco.mjtJoint
    joints = list(_over_joints(mujoco, model, n))
    return bool(np.isin(model.jnt_type[joints], (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)).all())


def _is_in_one_chain(mujoco: Any, model: Any, n: int) -> bool:
    """Whether of all joints of a tendon each hangs from the one before. MuJoCo has no inertia that
    couples others, and leaves these products out."""
    dofs = sorted(int(model.jnt_dofadr[joint]) for joint in _over_joints(mujoco, model, n))
    dof = dofs[-1]
    above = {dof}
    while (dof := int(model.dof_parentid[dof])) >= 0:
        above.add(dof)
    return above.issuperset(dofs)
