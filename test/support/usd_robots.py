"""USD stages as text: rigid bodies, joints, and the robots of `imported_robots` made of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.usd_import import read
from support.imported_motions import saved
from support.imported_robots import COUPLER, CRANK, DENSITY, GROUND, ROCKER, four_bar_angles


def numbers(values: Iterable[float]) -> str:
    return f'({", ".join(repr(float(x)) for x in values)})'


def quaternion(turn: Rotation) -> str:
    x, y, z, w = turn.as_quat()
    return numbers((w, x, y, z))


def prim(kind: str, name: str, schemas: str, *lines: str) -> str:
    """One prim; schemas: names of applied API schemas, without `Physics` and `API`."""
    parts = (word.partition(':') for word in schemas.split())
    names = ', '.join(f'"Physics{kind}API{colon}{name}"' for kind, colon, name in parts)
    applied = f' (prepend apiSchemas = [{names}])' if names else ''
    return '\n'.join([f'def {kind} "{name}"{applied}', '{', *lines, '}'])


def stage(*prims: str, up: str = 'Z', metre: float = 1.0, kilogram: float = 1.0) -> str:
    head = f'metersPerUnit = {metre!r}\nkilogramsPerUnit = {kilogram!r}\nupAxis = "{up}"'
    return '\n'.join(['#usda 1.0', f'({head})', *prims, ''])


def placed(at: Sequence[float] | Floats, turn: Rotation | None = None) -> str:
    """The transformation of a prim; double precision, as most programs write it."""
    lines = [f'double3 xformOp:translate = {numbers(at)}']
    order = '"xformOp:translate"'
    if turn is not None:
        lines.append(f'quatd xformOp:orient = {quaternion(turn)}')
        order += ', "xformOp:orient"'
    return '\n'.join([*lines, f'uniform token[] xformOpOrder = [{order}]'])


def massive(mass: float, com: Sequence[float], moments: Sequence[float]) -> str:
    return (
        f'float physics:mass = {mass!r}\npoint3f physics:centerOfMass = {numbers(com)}\n'
        f'float3 physics:diagonalInertia = {numbers(moments)}'
    )


def joint(
    kind: str,
    name: str,
    ends: Sequence[tuple[str, Sequence[float] | Floats]],
    *lines: str,
    schemas: str = '',
) -> str:
    """ends: path of a body, '' for the world, and a place on it."""
    found = []
    for side, (body, place) in enumerate(ends):
        found += [f'rel physics:body{side} = <{body}>'] if body else []
        found += [f'point3f physics:localPos{side} = {numbers(place)}']
    return prim(f'Physics{kind}Joint', name, schemas, *found, *lines)


def axis(name: str) -> str:
    return f'uniform token physics:axis = "{name}"'


def body(name: str, *lines: str, at: Sequence[float] = (0.0, 0.0, 0.0)) -> str:
    return prim('Xform', name, 'RigidBody Mass', placed(at), *lines)


FULL = massive(2.0, (0.0, 0.0, 0.0), (0.3, 0.4, 0.5))


def robot_of(folder: Path, text: str) -> Robot:
    return read(Path(saved(folder, 'it.usda', text)), {})


def made(folder: Path, text: str, **wishes: object) -> str:
    return imported(saved(folder, 'it.usda', text), **wishes)


# a joint of the world and a body `b`, at the origin of both
PIN = ('', (0.0, 0.0, 0.0)), ('/b', (0.0, 0.0, 0.0))


def drive(instance: str, **values: float | str) -> list[str]:
    kinds = {key: 'uniform token' if key == 'type' else 'float' for key in values}
    return [f'{kinds[key]} drive:{instance}:physics:{key} = {x}' for key, x in values.items()]


@dataclass(frozen=True)
class Units:
    """How a stage writes the four-bar: its axes, as a turn of the x-z plane, and its units."""

    turn: Rotation
    up: str
    metre: float
    kilogram: float

    def four_bar(self) -> str:
        """config/mechanisms/four_bar.yaml; joints turn about the stage's image of -y."""
        one, two, three = four_bar_angles()
        corner = CRANK * np.array([np.cos(one), 0.0, np.sin(one)])
        links = (
            ('crank', np.zeros(3), one, CRANK),
            ('coupler', corner, two, COUPLER),
            ('rocker', np.array([GROUND, 0.0, 0.0]), three, ROCKER),
        )
        return stage(
            *(self._link(*each) for each in links),
            self._pin('crank_pin', '', 0.0, 'crank', 0.0),
            self._pin('knee', 'crank', CRANK, 'coupler', 0.0),
            self._pin('rocker_pin', '', GROUND, 'rocker', 0.0),
            self._pin('wrist', 'coupler', COUPLER, 'rocker', ROCKER),
            gravity(self.turn.apply([0.0, 0.0, -1.0]), 9.81 / self.metre),
            up=self.up,
            metre=self.metre,
            kilogram=self.kilogram,
        )

    def _link(self, name: str, at: Floats, angle: float, length: float) -> str:
        mass = DENSITY * length
        J = mass * length**2 / 12.0 / self.metre**2 / self.kilogram
        turn = self.turn * Rotation.from_euler('y', -angle)
        return prim(
            'Xform',
            name,
            'RigidBody Mass',
            placed(self.turn.apply(at) / self.metre, turn),
            massive(mass / self.kilogram, (length / 2 / self.metre, 0.0, 0.0), (0.0, J, J)),
        )

    def _pin(self, name: str, parent: str, x: float, child: str, end: float) -> str:
        """At x along the parent's bar and `end` along the child's, about -y."""
        along = Rotation.from_euler('z', -np.pi / 2)  # its x axis to -y
        first, place = along, np.array([x, 0.0, 0.0]) / self.metre
        if not parent:
            first, place = self.turn * along, self.turn.apply(place)
        return joint(
            'Revolute',
            name,
            ((f'/{parent}' if parent else '', place), (f'/{child}', (end / self.metre, 0.0, 0.0))),
            f'quatf physics:localRot0 = {quaternion(first)}',
            f'quatf physics:localRot1 = {quaternion(along)}',
        )


def gravity(direction: Sequence[float] | Floats, magnitude: float) -> str:
    return prim(
        'PhysicsScene',
        'scene',
        '',
        f'vector3f physics:gravityDirection = {numbers(direction)}',
        f'float physics:gravityMagnitude = {magnitude!r}',
    )


Z_UP = Units(Rotation.identity(), 'Z', 1.0, 1.0)
Y_UP = Units(Rotation.from_euler('x', -np.pi / 2), 'Y', 0.01, 0.001)
TILTED = Units(Rotation.from_rotvec([0.3, -0.9, 0.5]), 'Z', 0.0254, 0.4536)
