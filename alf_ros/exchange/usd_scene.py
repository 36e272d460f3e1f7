"""The physics scene of a USD stage: gravity, and what it turns off.

The first `PhysicsScene` counts. The switches `mjc:flag:*` turn off the same as in an MJCF
(`mjcf_switches`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from alf_ros.exchange.robot import Robot
from alf_ros.exchange.usd_stage import UsdStage

_EARTH = 9.81  # m/s^2, where the file sets none
# kind: any of the flags that turn it off
_OFF: dict[str, Sequence[str]] = {
    'gravity': ('gravity',),
    'springs': ('spring',),
    'damping': ('damper',),
    'dry friction': ('frictionloss', 'constraint'),
    'limits': ('limit', 'constraint'),
    'ranges of controls': ('clampctrl',),
    'actuators': ('actuation',),
    'equalities': ('equality', 'constraint'),
}


class UsdScene:
    """The attributes of the first scene that count for all joints and actuators.

    gravity: m/s^2. angle: rad, the unit of angles `mjc:*`.
    """

    def __init__(self, stage: UsdStage, robot: Robot) -> None:
        """Raises InputError."""
        self._stage, self._robot = stage, robot
        scenes = [each for each in stage.prims() if str(each.GetTypeName()) == 'PhysicsScene']
        for other in scenes[1:]:
            robot.leave('several scenes', other.GetName())
        self._prim: Any = scenes[0] if scenes else None
        self._off = {kind for kind, flags in _OFF.items() if any(map(self._is_disabled, flags))}
        groups = self._array('mjc:option:actuatorgroupdisable')
        self._groups = {int(each) for each in groups if math.isfinite(each)}
        degrees = self._word('mjc:compiler:angle', 'degree') != 'radian'
        self.angle = math.radians(1.0) if degrees else 1.0
        self.gravity = self._gravity()
        if self._array('mjc:option:density').any() or self._array('mjc:option:viscosity').any():
            robot.leave('fluid', 'density, viscosity, wind')

    def kept(self, kind: str, value: float) -> float:
        """A value of a kind; zero, and listed, where the scene turns the kind off."""
        if value and kind in self._off:
            self._robot.leave('switched off in the file', kind)
            return 0.0
        return value

    def is_off(self, kind: str) -> bool:
        """Whether the scene turns a kind off."""
        return kind in self._off

    def is_group_off(self, group: int) -> bool:
        """Whether actuators of a group, or all, are off."""
        return 'actuators' in self._off or group in self._groups

    def _gravity(self) -> tuple[float, ...]:
        stage = self._stage
        down = np.zeros(3)
        down[stage.up] = -1.0
        if self._prim is None:
            return tuple(map(float, _EARTH * down))
        along = stage.numbers(self._prim, 'physics:gravityDirection', (0.0, 0.0, 0.0))
        size = stage.number(self._prim, 'physics:gravityMagnitude', -np.inf, endless=True)
        if along.any():
            down = along / np.linalg.norm(along)
        if size == np.inf:
            raise stage.error(f'{self._prim.GetPath()} gravityMagnitude', 'not a usable number')
        strength = self.kept('gravity', _EARTH if size < 0.0 else size * stage.metre)
        return tuple(float(x) + 0.0 for x in strength * down)

    def _is_disabled(self, flag: str) -> bool:
        if self._prim is None:
            return False
        names = [f'mjc:flag:{flag}']
        names += ['newton:gravityEnabled'] if flag == 'gravity' else []
        return not all(self._stage.holds(self._prim, name, True) for name in names)

    def _word(self, name: str, default: str) -> str:
        return default if self._prim is None else self._stage.word(self._prim, name, default)

    def _array(self, name: str) -> np.ndarray[Any, Any]:
        if self._prim is None:
            return np.empty(0)
        return self._stage.array(self._prim, name, float)
