"""MJCF to a robot: bodies and joints; the other elements have modules of their own.

MuJoCo itself reads the file, so that defaults, includes, angles and inertias from geoms are its
own. Several joints of one body become a chain through bodies without mass.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.errors import InputError
from alf_ros.exchange import (
    mjcf_actuator_places,
    mjcf_actuators,
    mjcf_assets,
    mjcf_contacts,
    mjcf_equalities,
    mjcf_geoms,
    mjcf_nan,
    mjcf_switches,
    mjcf_tendons,
)
from alf_ros.exchange.robot import (
    GROUND,
    BodyVelocity,
    Connection,
    Lift,
    Robot,
    RobotPart,
    free_name,
    lumped,
)
from alf_ros.scene.text.yaml_document import LARGEST

_LEAST = 1e-3  # of forces of gravity: their sum, or else they are a torque without a place
# numbers of a model from which the robot is made; `size` and ranges may be infinite
_USED = (
    *('body_mass', 'body_inertia', 'body_pos', 'body_quat', 'body_ipos', 'body_iquat'),
    *('body_gravcomp', 'qpos0', 'qpos_spring', 'jnt_pos', 'jnt_axis', 'jnt_stiffness'),
    *('jnt_margin', 'dof_damping', 'dof_armature', 'dof_frictionloss', 'geom_pos', 'geom_quat'),
    *('site_pos', 'site_quat', 'eq_data', 'tendon_stiffness', 'tendon_damping'),
    *(
        'tendon_frictionloss',
        'tendon_lengthspring',
        'tendon_armature',
        'tendon_margin',
        'wrap_prm',
        'actuator_gear',
    ),
    *('actuator_gainprm', 'actuator_biasprm', 'actuator_damping', 'actuator_armature'),
)
_OF_DOFS = ('damping', 'frictionloss', 'armature')
_OF_TENDONS = ('stiffness', 'damping', 'frictionloss')
_PARTS = "'include'", "'model'"  # elements whose files no model is without
_KINDS = {
    'sensor': 'sensors',
    'key': 'keyframes',
    'cam': 'cameras',
    'light': 'lights',
}


def read(path: Path, positions: Mapping[str, float], key: str | None = None) -> Robot:
    """The robot of a file; `positions` of joints (rad, m), by default the positions in the file.

    key: a keyframe, by name or number, whose positions and controls count. Raises InputError.
    """
    import mujoco

    if not path.is_file():
        raise InputError('no such file', file=str(path))
    warned: list[str] = []
    mujoco.set_mju_user_warning(warned.append)  # or it would write them into a file
    try:
        try:
            model, lighter = _compiled(mujoco, path)
        finally:  # a refusal does not say which number it is
            if any(mjcf_nan.WARNING in each for each in warned):
                mjcf_nan.check(path)
        _hold(model)
        mjcf_actuators.reflect(mujoco, model)
        off = mjcf_switches.turn_off(mujoco, model)
        mjcf_switches.override(mujoco, model)
        if _has_negative(mujoco, model):
            mjcf_nan.check_signs(path)
        robot = _Reader(mujoco, model, str(path), positions, key).robot
    except UnicodeDecodeError as error:  # MuJoCo takes any bytes as names
        raise InputError(f'a name is not UTF-8: {error.object!r}', file=str(path)) from None
    finally:
        mujoco.set_mju_user_warning(None)
    for body in lighter:
        robot.leave('shapes without their file', body)
    for kind in off:
        robot.leave('switched off in the file', kind)
    for warning in warned:
        robot.leave('warnings of MuJoCo', ' '.join(warning.split()))
    return robot


def _compiled(mujoco: Any, path: Path) -> tuple[Any, list[str]]:
    """The model, and the bodies that lack the mass of meshes that are not there."""
    lighter: list[str] = []
    what = 'it'
    try:
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as error:
            is_part = any(part in str(error) for part in _PARTS)
            if 'opening file' not in str(error) or is_part:
                raise
            what = 'the model without missing meshes'
            model, lighter = mjcf_assets.compiled_without(mujoco, path)
    except (ValueError, RuntimeError) as error:  # the second one for an anchor without numbers
        raise InputError(f'MuJoCo refuses {what}: {error}', file=str(path)) from None
    for key in _USED:
        if not np.all(np.abs(getattr(model, key)) <= LARGEST):
            mjcf_nan.check_size(path)
            raise InputError('not usable numbers', file=str(path), key=key)
    if not np.all(np.abs(model.opt.gravity) <= LARGEST):
        mjcf_nan.check_size(path)
    return model, lighter


def _has_negative(mujoco: Any, model: Any) -> bool:
    """Whether a force on a hinge, a slide or a tendon has a sign that no motion has."""
    kinds = mujoco.mjtJoint
    single = np.isin(model.jnt_type, (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE))
    dofs = model.jnt_dofadr[single]
    of_joints = (getattr(model, f'dof_{key}')[dofs] for key in _OF_DOFS)
    of_tendons = (getattr(model, f'tendon_{key}') for key in _OF_TENDONS)
    each = (model.jnt_stiffness[single], *of_joints, *of_tendons)
    return any(bool(np.any(array < 0.0)) for array in each)


def _hold(model: Any) -> None:
    """Fix mocap bodies, which only a user moves, and the bodies fixed to them, to the world, as
    older versions of MuJoCo did; newer ones count them as bodies that move."""
    moved_by_hand = np.flatnonzero(model.body_mocapid >= 0)
    model.body_weldid[np.isin(model.body_weldid, moved_by_hand)] = 0


class _Reader:
    """The compiled model, placed as drawn."""

    def __init__(
        self,
        mujoco: Any,
        model: Any,
        file: str,
        positions: Mapping[str, float],
        key: str | None,
    ) -> None:
        self.mujoco, self.model, self.data = mujoco, model, mujoco.MjData(model)
        self.bodies = self._names('body', model.nbody)
        self.joints = self._names('joint', model.njnt)
        self.begins_at = None if key is None else self._begin_at(key)
        most = min(LARGEST, mujoco.mjMAXVAL)  # beyond, MuJoCo begins anew, or has no controls
        for kind in ('qpos', 'qvel', 'act', 'ctrl'):
            if not np.all(np.abs(getattr(self.data, kind)) <= most):
                mjcf_nan.check_size(Path(file))
                mjcf_nan.check_states(Path(file), most)
                raise InputError('not usable numbers', file=file, key=kind)
        self._set(positions)
        mjcf_equalities.draw(mujoco, self.data, self.joints, positions)
        called = model.names.split(b'\0')[0].decode()
        gravity = tuple(map(float, model.opt.gravity))
        self.robot = Robot(called or Path(file).stem, file, gravity, ': no body has a joint')
        mjcf_equalities.close(self.robot, mujoco, self.data, self.joints, positions)
        mujoco.mj_kinematics(model, self.data)
        self.held = [GROUND if w == 0 else self.bodies[w] for w in model.body_weldid]
        for body in range(1, model.nbody):
            if model.body_weldid[body] == body:
                self.robot.parts.append(self._part(body))
        for body in range(1, model.nbody):
            self._connect(body)
        self.tendons = self._names('tendon', model.ntendon)
        given = self.robot, mujoco, self.data
        tendons = mjcf_tendons.add(*given, self.tendons, self.joints, self.held)
        mjcf_equalities.add(*given, self.joints, self.held)
        names = self._names('actuator', mjcf_actuator_places.count(model))
        mjcf_actuators.add(*given, names, self.joints, tendons)
        mjcf_geoms.add(self.robot, mujoco, self.data, Path(file), self.held)
        mjcf_contacts.add(self.robot, mujoco, self.data, self.held)
        if any(not 0.0 <= each.friction < math.inf for each in self.robot.touches):
            mjcf_nan.check_friction(Path(file))
        self._move()
        self._lift()
        self._leave()

    def _names(self, kind: str, count: int) -> list[str]:
        """Of all things of a kind; unnamed ones are numbered, as MuJoCo counts them."""
        of = getattr(self.model, kind)
        given = [of(n).name for n in range(count)]
        return [name or free_name(f'{kind}{n}', given) for n, name in enumerate(given)]

    def _set(self, positions: Mapping[str, float]) -> None:
        hinge, slide = self.mujoco.mjtJoint.mjJNT_HINGE, self.mujoco.mjtJoint.mjJNT_SLIDE
        for name, value in positions.items():
            if name not in self.joints:
                raise InputError('no such joint', key='--set', value=name, choices=self.joints)
            joint = self.joints.index(name)
            if int(self.model.jnt_type[joint]) not in (hinge, slide):
                raise InputError('not a hinge or a slide', key='--set', value=name)
            self.data.qpos[self.model.jnt_qposadr[joint]] = value

    def _begin_at(self, key: str) -> str:
        """Positions, velocities and controls of a keyframe; returns its name."""
        names = self._names('key', self.model.nkey)
        numbers = [str(n) for n in range(self.model.nkey)]
        if key not in (*names, *numbers):
            raise InputError('no such keyframe', key='--key', value=key, choices=names or ['none'])
        n = names.index(key) if key in names else int(key)
        self.mujoco.mj_resetDataKeyframe(self.model, self.data, n)
        return names[n]

    # -------------------------------------------------------------------------------------- tree

    def _part(self, body: int) -> RobotPart:
        """A body and those that are fixed to it."""
        parts = []
        for each in np.flatnonzero(self.model.body_weldid == body):
            turn = self.data.ximat[each].reshape(3, 3)
            J = turn @ np.diag(self.model.body_inertia[each]) @ turn.T
            mass, com = float(self.model.body_mass[each]), self.data.xipos[each].copy()
            parts.append(RobotPart(self.bodies[each], com, mass, com, J))
        return lumped(self.bodies[body], self.data.xpos[body].copy(), parts)

    def _connect(self, body: int) -> None:
        model, kinds = self.model, self.mujoco.mjtJoint
        first = model.body_jntadr[body]
        joints = list(range(first, first + model.body_jntnum[body]))
        below = self.held[model.body_parentid[body]]
        for joint in joints:
            name, place = self.joints[joint], self.data.xanchor[joint].copy()
            if model.jnt_type[joint] == kinds.mjJNT_FREE:
                self._leave_dynamics(joint)
                continue
            child = self.bodies[body]
            if joint != joints[-1]:
                child = free_name(f'{child}_below_{name}', self.bodies)
                self.robot.parts.append(RobotPart(child, place, 0.0, place, np.zeros((3, 3))))
            if model.jnt_type[joint] == kinds.mjJNT_BALL:
                self._leave_dynamics(joint)
                damping = float(np.ravel(model.dof_damping[model.jnt_dofadr[joint]])[0])
                ball = Connection(name, 'spherical', below, child, place, damping=damping)
                self.robot.connect(ball)
            else:
                self.robot.connect(self._single(joint, below, child))
            below = child

    def _single(self, joint: int, parent: str, child: str) -> Connection:
        """A hinge or a slide."""
        model, name = self.model, self.joints[joint]
        turns = model.jnt_type[joint] == self.mujoco.mjtJoint.mjJNT_HINGE
        place, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        drawn = float(self.data.qpos[place])
        lower, upper = model.jnt_range[joint] + model.jnt_margin[joint] * np.array([1.0, -1.0])
        if drawn:
            self.robot.leave('zero of joints', f'{name} at {drawn:.12g}')
        for kind, orders in (
            ('damping', model.dof_dampingpoly[dof]),
            ('springs', model.jnt_stiffnesspoly[joint]),
        ):
            if np.any(orders):
                numbers = ' and '.join(f'{number:g}' for number in orders)
                self.robot.leave(f'higher orders of {kind}', f'{name} {numbers}')
        if model.jnt_stiffness[joint] and mjcf_switches.yields(model, 'jnt', joint):
            self.robot.leave('springs that yield', name)
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
            friction=float(model.dof_frictionloss[dof]),
            armature=float(model.dof_armature[dof]),
        )

    def _leave_dynamics(self, joint: int) -> None:
        """Note forces on a joint with several freedoms; a ball has its damping."""
        model, dof = self.model, self.model.jnt_dofadr[joint]
        free = model.jnt_type[joint] == self.mujoco.mjtJoint.mjJNT_FREE
        acting = (
            model.dof_armature[dof],
            model.dof_frictionloss[dof],
            model.dof_damping[dof] if free else 0.0,
            model.dof_dampingpoly[dof],
            model.jnt_stiffness[joint],
            model.jnt_stiffnesspoly[joint],
            model.jnt_limited[joint],
        )
        if any(np.any(value) for value in acting):
            self.robot.leave('limits, damping, friction, springs, armature', self.joints[joint])

    # ----------------------------------------------------------------------------------- the rest

    def _leave(self) -> None:
        """Note the other contents of the file."""
        model, leave = self.model, self.robot.leave
        for kind, count in (
            ('sensor', model.nsensor),
            ('key', model.nkey),
            ('cam', model.ncam),
            ('light', model.nlight),
        ):
            for name in self._names(kind, count):
                if kind != 'key' or name != self.begins_at:
                    leave(_KINDS[kind], name)
        for body in range(1, model.nbody):
            if model.body_mocapid[body] >= 0:
                leave('motion of mocap bodies', self.bodies[body])
            if model.body_plugin[body] >= 0:
                leave('plugins', self.bodies[body])
        for body in mjcf_switches.asleep(self.mujoco, model):
            leave('sleeping bodies', self.bodies[body])
        if model.nflex:
            leave('flex', f'{model.nflex} deformable')
        if model.opt.density or model.opt.viscosity:
            leave('fluid', 'density, viscosity, wind')

    def _move(self) -> None:
        """Velocities of the parts in a keyframe."""
        model, data, mujoco = self.model, self.data, self.mujoco
        if not np.any(data.qvel):
            return
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        both = np.zeros(6)
        for body in range(1, model.nbody):
            if model.body_weldid[body] == body:
                mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, both, 0)
                place, (angular, linear) = data.xpos[body].copy(), both.copy().reshape(2, 3)
                self.robot.velocities[self.bodies[body]] = BodyVelocity(place, linear, angular)

    def _lift(self) -> None:
        """Compensation of gravity: a force on each part, if no joint takes it from its actuators,
        which may be too weak or none."""
        model, data = self.model, self.data
        if not np.any(model.body_gravcomp > 0.0):  # then MuJoCo counts no negative ones either
            return
        whole = mjcf_switches.pushes(self.mujoco, model) and not model.jnt_actfrclimited.any()
        for part in self.robot.parts:
            own = [n for n in range(1, model.nbody) if self.held[n] == part.name]
            weights = model.body_mass[own] * model.body_gravcomp[own]
            if not weights.any():
                continue
            total = weights.sum()
            if abs(total) < _LEAST * np.abs(weights).sum() or (
                model.jnt_actgravcomp.any() and not whole
            ):
                self.robot.leave('compensation of gravity', part.name)
                continue
            is_even = np.ptp(model.body_gravcomp[own][model.body_mass[own] > 0.0]) == 0.0
            place = part.com if is_even else weights @ data.xipos[own] / total
            self.robot.lifts[part.name] = Lift(total * -model.opt.gravity + 0.0, place)
