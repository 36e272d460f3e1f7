"""MJCF to a robot: bodies, joints, and the loops that `equality` closes by `connect` and `weld`.

MuJoCo itself reads the file, so that defaults, includes, angles and inertias from geoms are its
own. Several joints of one body become a chain through bodies without mass.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.errors import InputError
from alf_ros.exchange.robot import Connection, Part, Pose, Robot, lumped
from alf_ros.mechanism import GROUND
from alf_ros.scene.text.yaml_document import LARGEST

_TURNED = 1e-6  # rad: how far what a weld holds may be drawn from how it is held


def read(path: Path, positions: Mapping[str, float]) -> Robot:
    """The robot of a file; `positions` of joints (rad, m), those of the file where absent.

    Raises InputError.
    """
    import mujoco

    if not path.is_file():
        raise InputError('no such file', file=str(path))
    warned: list[str] = []
    mujoco.set_mju_user_warning(warned.append)  # or it would write them into a file
    try:
        model = _compiled(mujoco, path)
        robot = _Reader(mujoco, model, str(path), positions).robot
    finally:
        mujoco.set_mju_user_warning(None)
    for warning in warned:
        robot.leave('warnings of MuJoCo', ' '.join(warning.split()))
    return robot


def _compiled(mujoco: Any, path: Path) -> Any:
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise InputError(f'MuJoCo refuses it: {error}', file=str(path)) from None
    for key in ('mass', 'inertia', 'pos', 'ipos'):
        if not np.all(np.abs(getattr(model, f'body_{key}')) <= LARGEST):
            raise InputError('not usable numbers', file=str(path), key=f'{key} of a body')
    return model


class _Reader:
    """What is compiled, placed as drawn."""

    def __init__(self, mujoco: Any, model: Any, file: str, positions: Mapping[str, float]) -> None:
        self.mujoco, self.model, self.data = mujoco, model, mujoco.MjData(model)
        self.bodies = self._names('body', model.nbody)
        self.joints = self._names('joint', model.njnt)
        self._set(positions)
        mujoco.mj_kinematics(model, self.data)
        called = model.names.split(b'\0')[0].decode()
        gravity = tuple(map(float, model.opt.gravity))
        self.robot = Robot(called or Path(file).stem, file, gravity)
        self.held = [GROUND if w == 0 else self.bodies[w] for w in model.body_weldid]
        for body in range(1, model.nbody):
            if model.body_weldid[body] == body:
                self.robot.parts.append(self._part(body))
        for body in range(1, model.nbody):
            self._connect(body)
        for equality in range(model.neq):
            self._close(equality)
        self._leave()

    def _names(self, kind: str, count: int) -> list[str]:
        """Of all things of a kind; unnamed ones are numbered, as MuJoCo counts them."""
        of = getattr(self.model, kind)
        return [of(n).name or f'{kind}{n}' for n in range(count)]

    def _set(self, positions: Mapping[str, float]) -> None:
        hinge, slide = self.mujoco.mjtJoint.mjJNT_HINGE, self.mujoco.mjtJoint.mjJNT_SLIDE
        for name, value in positions.items():
            if name not in self.joints:
                raise InputError('no such joint', key='--set', value=name, choices=self.joints)
            joint = self.joints.index(name)
            if self.model.jnt_type[joint] not in (hinge, slide):
                raise InputError('not a hinge or a slide', key='--set', value=name)
            self.data.qpos[self.model.jnt_qposadr[joint]] = value

    def _frame(self, body: int) -> Pose:
        return Pose(self.data.xpos[body].copy(), self.data.xmat[body].reshape(3, 3).copy())

    # -------------------------------------------------------------------------------------- tree

    def _part(self, body: int) -> Part:
        """A body and those that are fixed to it."""
        parts = []
        for each in np.flatnonzero(self.model.body_weldid == body):
            turn = self.data.ximat[each].reshape(3, 3)
            J = turn @ np.diag(self.model.body_inertia[each]) @ turn.T
            mass, com = float(self.model.body_mass[each]), self.data.xipos[each].copy()
            parts.append(Part(self.bodies[each], com, mass, com, J))
        return lumped(self.bodies[body], self.data.xpos[body].copy(), parts)

    def _connect(self, body: int) -> None:
        model, kinds = self.model, self.mujoco.mjtJoint
        first = model.body_jntadr[body]
        joints = list(range(first, first + model.body_jntnum[body]))
        below = self.held[model.body_parentid[body]]
        for joint in joints:
            name, place = self.joints[joint], self.data.xanchor[joint].copy()
            if model.jnt_type[joint] == kinds.mjJNT_FREE:
                self._leave_dynamics(joint, True)
                continue
            child = self.bodies[body]
            if joint != joints[-1]:
                child = f'{child}_below_{name}'
                self.robot.parts.append(Part(child, place, 0.0, place, np.zeros((3, 3))))
            if model.jnt_type[joint] == kinds.mjJNT_BALL:
                self._leave_dynamics(joint, True)
                self.robot.connect(Connection(name, 'spherical', below, child, place))
            else:
                self.robot.connect(self._single(joint, below, child))
            below = child

    def _single(self, joint: int, parent: str, child: str) -> Connection:
        """A hinge or a slide."""
        model, name = self.model, self.joints[joint]
        turns = model.jnt_type[joint] == self.mujoco.mjtJoint.mjJNT_HINGE
        place, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        drawn = float(self.data.qpos[place])
        lower, upper = model.jnt_range[joint]
        if drawn:
            self.robot.leave('zero of joints: here it is as drawn', f'{name} at {drawn:g}')
        self._leave_dynamics(joint, False)
        return Connection(
            name,
            'revolute' if turns else 'prismatic',
            parent,
            child,
            self.data.xanchor[joint].copy(),
            (self.data.xaxis[joint].copy(),),
            drawn,
            (float(lower), float(upper)) if model.jnt_limited[joint] else None,
            float(np.ravel(model.dof_damping[dof])[0]),
            float(np.ravel(model.jnt_stiffness[joint])[0]),
            float(model.qpos_spring[place]),
        )

    def _leave_dynamics(self, joint: int, several: bool) -> None:
        """What acts on a joint and has no place here; of one with several freedoms, all of it."""
        model, name, dof = self.model, self.joints[joint], self.model.jnt_dofadr[joint]
        found = {
            'armature': model.dof_armature[dof],
            'dry friction': model.dof_frictionloss[dof],
            'damping of free and ball joints': several and model.dof_damping[dof],
            'springs of free and ball joints': several and model.jnt_stiffness[joint],
            'limits of ball joints': several and model.jnt_limited[joint],
        }
        for kind, value in found.items():
            if np.any(value):
                self.robot.leave(kind, name)

    # ------------------------------------------------------------------------------------- loops

    def _close(self, equality: int) -> None:
        model, kinds = self.model, self.mujoco.mjtEq
        kind, name = model.eq_type[equality], model.equality(equality).name or f'loop{equality}'
        if kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD) or not model.eq_active0[equality]:
            self.robot.leave('equality, not connect or weld, or not active', name)
            return
        numbers = model.eq_data[equality]
        (one, first), (other, second) = self._sides(equality)
        welded = kind == kinds.mjEQ_WELD
        if model.eq_objtype[equality] == self.mujoco.mjtObj.mjOBJ_SITE:
            start, end = first.origin, second.origin
            gap = first.turn.T @ second.turn
        elif welded:
            held = np.zeros(9)
            self.mujoco.mju_quat2Mat(held, numbers[6:10])
            start, end = first.place(numbers[3:6]), second.origin
            gap = (first.turn @ held.reshape(3, 3)).T @ second.turn
        else:
            start, end = first.place(numbers[:3]), second.place(numbers[3:6])
            gap = np.eye(3)
        if welded and np.linalg.norm(gap - np.eye(3)) > _TURNED:
            raise self.robot.error(name, 'its two sides are drawn turned against each other')
        if other == GROUND:
            one, other, start, end = other, one, end, start
        kind_of = 'weld' if welded else 'spherical'
        self.robot.connect(Connection(name, kind_of, one, other, start), end)
        self.robot.leave('softness: here constraints hold exactly', name)

    def _sides(self, equality: int) -> Iterator[tuple[str, Pose]]:
        """The two bodies of an equality, with the frames of bodies or of sites on them."""
        model, data = self.model, self.data
        by_site = model.eq_objtype[equality] == self.mujoco.mjtObj.mjOBJ_SITE
        for n in (model.eq_obj1id[equality], model.eq_obj2id[equality]):
            if by_site:
                frame = Pose(data.site_xpos[n].copy(), data.site_xmat[n].reshape(3, 3).copy())
                yield self.held[model.site_bodyid[n]], frame
            else:
                yield self.held[n], self._frame(n)

    # ----------------------------------------------------------------------------------- the rest

    def _leave(self) -> None:
        """What else the file has."""
        model, leave = self.model, self.robot.leave
        for geom in range(model.ngeom):
            body = self.bodies[model.geom_bodyid[geom]]
            leave('shapes', body)
            if model.geom_contype[geom] or model.geom_conaffinity[geom]:
                leave('contact', body)
        for kind, count in (
            ('actuator', model.nu),
            ('tendon', model.ntendon),
            ('sensor', model.nsensor),
            ('key', model.nkey),
            ('cam', model.ncam),
            ('light', model.nlight),
            ('pair', model.npair),
        ):
            for name in self._names(kind, count):
                leave(kind, name)
        for body in range(1, model.nbody):
            if model.body_mocapid[body] >= 0:
                leave('motion of mocap bodies, which stand still', self.bodies[body])
            if model.body_gravcomp[body]:
                leave('compensation of gravity', self.bodies[body])
        if model.nflex:
            leave('flex', f'{model.nflex} deformable')
        if model.opt.density or model.opt.viscosity:
            leave('fluid', 'density, viscosity, wind')
