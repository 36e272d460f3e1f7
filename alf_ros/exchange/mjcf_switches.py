"""Switches of an MJCF (`<option>` with its `<flag>`), worked into the compiled model.

What a switch turns off is taken out of the model, so that no reader of the model knows switches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

# kind: any of the flags that turn it off, and the arrays of the model that have it
_OFF: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    'gravity': (['GRAVITY'], ['opt.gravity']),
    'springs': (
        ['SPRING'],
        ['jnt_stiffness', 'jnt_stiffnesspoly', 'tendon_stiffness', 'tendon_stiffnesspoly'],
    ),
    'damping': (
        ['DAMPER'],
        ['dof_damping', 'dof_dampingpoly', 'tendon_damping', 'tendon_dampingpoly'],
    ),
    'dry friction': (['FRICTIONLOSS', 'CONSTRAINT'], ['dof_frictionloss', 'tendon_frictionloss']),
    'limits': (['LIMIT', 'CONSTRAINT'], ['jnt_limited', 'tendon_limited']),
    'ranges of controls': (['CLAMPCTRL'], ['actuator_ctrllimited']),
}
_GROUPS = 31  # of actuators that can be turned off


def turn_off(mujoco: Any, model: Any) -> list[str]:
    """Take out of a model the things that its flags turn off, but for contact and actuators.

    Returns their kinds. Equalities that are off are not active any more, and not among them.
    """
    found = []
    for kind, (flags, arrays) in _OFF.items():
        if any(_is_set(mujoco, model, flag) for flag in flags):
            found += [kind] if _cleared(model, arrays) else []
    if _is_set(mujoco, model, 'SPRING') and _is_set(mujoco, model, 'DAMPER'):
        # then MuJoCo has no passive forces at all
        found += ['compensation of gravity'] if _cleared(model, ['body_gravcomp']) else []
        if model.opt.density or model.opt.viscosity:
            model.opt.density = model.opt.viscosity = 0.0
            found.append('fluid')
    if any(_is_set(mujoco, model, flag) for flag in ('EQUALITY', 'CONSTRAINT')):
        model.eq_active0[:] = 0
    if not model.opt.gravity.any():
        model.body_gravcomp[:] = 0.0
    return found


def override(mujoco: Any, model: Any) -> None:
    """Give all geoms and pairs the friction and the margin that `<option>` has instead of theirs,
    if its flag says so. Of two coefficients of sliding a geom gets the smaller one."""
    if _is_overridden(mujoco, model):
        along, across, spin, roll, _ = friction = model.opt.o_friction
        model.geom_friction[:] = min(along, across), spin, roll
        model.pair_friction[:] = friction
        model.geom_margin[:] = 0.5 * model.opt.o_margin  # those of two geoms add up
        model.pair_margin[:] = model.opt.o_margin


def is_directed(mujoco: Any, model: Any) -> bool:
    """Whether `<option>` gives all geoms another friction in a second direction."""
    along, across = model.opt.o_friction[:2]
    return _is_overridden(mujoco, model) and bool(along != across)


def _is_overridden(mujoco: Any, model: Any) -> bool:
    return bool(model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE)


def asleep(mujoco: Any, model: Any) -> list[int]:
    """The bodies that rest at the start until something touches them."""
    if not model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        return []
    resting = model.tree_sleep_policy == mujoco.mjtSleepPolicy.mjSLEEP_INIT
    return [body for body, tree in enumerate(model.body_treeid) if tree >= 0 and resting[tree]]


def is_off(mujoco: Any, model: Any, actuator: int) -> bool:
    """Whether an actuator is turned off, alone or with all."""
    group = int(model.actuator_group[actuator])
    own = 0 <= group < _GROUPS and bool(model.opt.disableactuator >> group & 1)
    return own or _is_set(mujoco, model, 'ACTUATION')


def pushes(mujoco: Any, model: Any) -> bool:
    """Whether MuJoCo computes forces of actuators, and with them the compensation of gravity of
    joints with `actuatorgravcomp`."""
    return bool(model.nu) and not _is_set(mujoco, model, 'ACTUATION')


def yields(model: Any, kind: str, n: int) -> bool:
    """Whether the spring of joint (`jnt`) or `tendon` n yields, as from MuJoCo 4.0 on it can."""
    limits = getattr(model, f'{kind}_springyield', None)
    return limits is not None and bool(limits[n])


def _is_set(mujoco: Any, model: Any, flag: str) -> bool:
    return bool(model.opt.disableflags & getattr(mujoco.mjtDisableBit, f'mjDSBL_{flag}'))


def _cleared(model: Any, arrays: Sequence[str]) -> bool:
    """Whether one of them held anything; now they do not."""
    found = False
    for name in arrays:
        array = model.opt.gravity if name == 'opt.gravity' else getattr(model, name)
        found = found or bool(array.any())
        array[:] = 0
    return found
