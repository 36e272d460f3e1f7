"""Rigid bodies of a USD stage: which prims they carry, what moves, and their mass.

Where a file leaves mass, centre of mass or inertia open, they follow from the shapes that collide,
as `UsdPhysics.RigidBodyAPI.ComputeMassProperties` defines it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import GROUND, Robot, RobotPart, lumped
from alf_ros.exchange.usd_solids import solid_of
from alf_ros.exchange.usd_stage import UsdStage

_WATER = 1000.0  # kg/m^3, the density where a file has none
_BALL = 0.1  # m, the radius of the sphere that stands for a body with mass and without shapes
_MASS_LEFT = 'inertia: default of USD'


class UsdBodies:
    """Bodies by their paths, and the body, or the ground, of each prim.

    prims: of the bodies that move. shapes: the prims of each body that collide. any_body: whether
    the file has a body at all.
    """

    def __init__(self, stage: UsdStage, robot: Robot) -> None:
        """Raises InputError."""
        self._stage, self._robot = stage, robot
        self._owner: dict[str, str] = {'/': GROUND}
        self.prims: dict[str, Any] = {}
        self.any_body = False
        self.shapes: dict[str, list[Any]] = {}
        self._with_disabled: set[str] = set()  # bodies with shapes whose collision is disabled
        for prim in stage.prims():
            path, schemas = str(prim.GetPath()), stage.schemas(prim)
            owner = self._owner[str(prim.GetPath().GetParentPath())]
            self.any_body |= 'PhysicsRigidBodyAPI' in schemas
            if 'PhysicsRigidBodyAPI' in schemas and self._enabled(prim):
                owner = GROUND if self._is_kinematic(prim) else path
                if owner == path:
                    self.prims[path] = prim
            self._owner[path] = owner
            if 'PhysicsCollisionAPI' in schemas and _has_shape(prim, schemas):
                if stage.holds(prim, 'physics:collisionEnabled', True):
                    self.shapes.setdefault(owner, []).append(prim)
                else:
                    self._with_disabled.add(owner)
        self.names = unique_names(self.prims)

    def owner(self, path: str) -> str:
        """The path of the body that carries a prim, or the ground."""
        return self._owner[path]

    def knows(self, path: str) -> bool:
        """Whether a prim of this path exists and is active."""
        return path in self._owner

    def part(self, path: str) -> RobotPart:
        """A body in the world, as drawn. Raises InputError."""
        stage, prim, name = self._stage, self.prims[path], self.names[path]
        origin = stage.frame(prim).origin
        mass, com, inertia = self._mass(prim), self._centre(prim), self._inertia(prim)
        shapes: Sequence[RobotPart] = ()
        if not mass or com is None or inertia is None:
            density = self._given(prim, 'physics:density')
            shapes = [self._shape(each, density) for each in self.shapes.get(path, ())]
            if path in self._with_disabled:
                self._robot.leave('mass of disabled shapes', name)
        if shapes:
            whole = lumped(name, origin, shapes)
            if com is not None:  # as USD has it: the same mass about another place
                whole = RobotPart(name, origin, whole.mass, com, _about(whole, com))
            factor = mass / whole.mass if mass else 1.0
            J = factor * whole.inertia if inertia is None else inertia
            return RobotPart(name, origin, mass or whole.mass, whole.com, J)
        if mass and inertia is None:
            inertia = 0.4 * mass * _BALL**2 * np.eye(3)
            self._robot.leave(_MASS_LEFT, name)
        if not mass or inertia is None:
            inertia = np.zeros((3, 3))
        return RobotPart(name, origin, mass, origin if com is None else com, inertia)

    # ---------------------------------------------------------------------------- one prim

    def _enabled(self, prim: Any) -> bool:
        return self._stage.holds(prim, 'physics:rigidBodyEnabled', True)

    def _is_kinematic(self, prim: Any) -> bool:
        """Whether its file moves it; what it moves is listed."""
        if not self._stage.holds(prim, 'physics:kinematicEnabled', False):
            return False
        from pxr import UsdGeom

        if UsdGeom.Xformable(prim).TransformMightBeTimeVarying() or any(
            self._stage.numbers(prim, f'physics:{name}', (0.0, 0.0, 0.0)).any()
            for name in ('velocity', 'angularVelocity')
        ):
            self._robot.leave('motion of kinematic bodies', prim.GetName())
        return True

    def _mass(self, prim: Any) -> float:
        """kg; zero where it is left open."""
        return self._given(prim, 'physics:mass') * self._stage.kilogram

    def _given(self, prim: Any, name: str) -> float:
        """A mass or a density in units of the file; zero where it is left open. Raises
        InputError."""
        found = self._stage.number(prim, name)
        if found < 0.0:
            key, expected = f'{prim.GetPath()} {name}', 'more than 0, or 0 where it is left open'
            raise self._stage.error(key, 'below zero', value=found, expected=expected)
        return found

    def _centre(self, prim: Any) -> Floats | None:
        """(3,) m in the world; None where it is left open."""
        stage = self._stage
        open_ = (-np.inf,) * 3
        found = stage.numbers(prim, 'physics:centerOfMass', open_, endless=True)
        if not np.isfinite(found).all():
            return None
        matrix, origin = stage.affine(prim)
        return np.asarray(matrix @ found + origin, dtype=float)

    def _inertia(self, prim: Any) -> Floats | None:
        """(3, 3) kg m^2 in the world; None where it is left open."""
        stage = self._stage
        if stage.array(prim, 'newton:inertia', float).size:
            xx, yy, zz, xy, xz, yz = stage.numbers(prim, 'newton:inertia', (0.0,) * 6)
            turn = stage.frame(prim).turn
            J = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
            return np.asarray(stage.kilogram * stage.metre**2 * J, dtype=float)
        moments = stage.numbers(prim, 'physics:diagonalInertia', (0.0, 0.0, 0.0))
        if not moments.any():
            return None
        axes = stage.frame(prim).turn @ stage.quaternion(prim, 'physics:principalAxes')
        J = axes @ np.diag(moments) @ axes.T
        return np.asarray(stage.kilogram * stage.metre**2 * J, dtype=float)

    def _shape(self, prim: Any, density: float) -> RobotPart:
        """A shape that collides; density: of its body, in units of the file."""
        stage, solid = self._stage, solid_of(self._stage, prim)
        name = str(prim.GetPath())
        if (
            stage.word(prim, 'newton:massModel') == 'shell'
            or stage.word(prim, 'mjc:inertia') == 'shell'
            or stage.holds(prim, 'mjc:shellinertia', False)
        ):
            self._robot.leave('shells', prim.GetName())
        own = self._given(prim, 'physics:density')
        unit = stage.kilogram / stage.metre**3
        given = [d for d in (own, density, self._of_material(prim)) if d > 0.0]
        per_volume = given[0] * unit if given else _WATER
        mass = self._mass(prim) or per_volume * solid.volume
        J = mass / solid.volume * solid.inertia
        found = RobotPart(name, solid.centroid, mass, solid.centroid, J)
        com = self._centre(prim)
        if com is not None:
            found = RobotPart(name, com, mass, com, _about(found, com))
        inertia = self._inertia(prim)
        return found if inertia is None else replace(found, inertia=inertia)

    def _of_material(self, prim: Any) -> float:
        """The density of the material that a shape is bound to; zero without one."""
        from pxr import UsdShade

        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial('physics')
        if not material:
            return 0.0
        return self._given(material.GetPrim(), 'physics:density')


def unique_names(paths: Iterable[str]) -> dict[str, str]:
    """A name for each path: its last word, or as many words as no other path ends with."""
    names: dict[str, str] = {}
    taken: set[str] = set()
    for path in paths:
        words = path.strip('/').split('/')
        found = words[-1]
        for n in range(2, len(words) + 1):
            if found not in taken:
                break
            found = '_'.join(words[-n:])
        taken.add(found)
        names[path] = found
    return names


def _has_shape(prim: Any, schemas: Sequence[str]) -> bool:
    """Whether a prim that collides has a shape of its own: a group has none, unless its meshes
    count as one."""
    from pxr import UsdGeom

    is_group = str(prim.GetTypeName()) in ('', 'Xform', 'Scope')
    merges = any(each.startswith('PhysxMeshMergeCollisionAPI') for each in schemas)
    return merges or bool(UsdGeom.Gprim(prim)) or not is_group


def _about(part: RobotPart, place: Floats) -> Floats:
    """(3, 3) the inertia of a part about another place than its centre of mass."""
    r = part.com - place
    J = part.inertia + part.mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    return np.asarray(J, dtype=float)
