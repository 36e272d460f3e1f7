"""A coordinate over which positions are mapped: of a joint, or a component of a point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND, Drive, Mechanism
from alf_ros.mechanism.time_function import signal
from alf_ros.model.compile import Model
from alf_ros.simulation.input_checks import text
from alf_ros.studies.atlas.coordinate_reader import CoordinateReader

_AXES = 'xyz'


@dataclass(frozen=True)
class MapCoordinate:
    """A coordinate by name; `point` and `axis` if it is a component of a point."""

    name: str
    is_angle: bool
    point: str = ''
    axis: int = 0

    @property
    def unit(self) -> str:
        """The unit of its values."""
        return 'rad' if self.is_angle else 'm'

    def read(self, reader: CoordinateReader, q: Floats, v: Floats) -> tuple[float, float]:
        """Value at q (blocks D, m), of an angle from -π to π, and rate where q changes by v."""
        model = reader.model
        if self.point:
            place = model.layout.of_point[self.point] * model.layout.dimension + self.axis
            return float(q[place]), float(v[place])
        values, rates = reader.read(q, v)
        n = model.coordinate_names.index(self.name)
        return float(values[n]), float(rates[n])

    def held(self, mechanism: Mechanism, value: float) -> Drive:
        """A drive that holds it at a value."""
        name = f'{self.name} held'  # no name of a file has a space
        if self.point:
            motion = [
                signal(value) if axis == self.axis else None for axis in range(mechanism.dimension)
            ]
            return Drive(name, 'point', (self.point,), tuple(motion))
        coordinate = mechanism.coordinate[self.name]
        from_ground = (
            coordinate.joint.parent == GROUND
            and coordinate.name != f'{coordinate.joint.name}_second'
        )
        kind = 'angle' if self.is_angle else 'length'
        return Drive(name, kind, (self.name,), (signal(value),), from_ground and self.is_angle)

    def hold_at(self, model: Model, q: Floats, value: float) -> None:
        """Move the block of the drive that holds it, in q (blocks D, m), to a value."""
        layout = model.layout
        block = q.reshape(-1, layout.dimension)[layout.of_prescribed[f'{self.name} held']]
        if self.point:
            block[self.axis] = value
        elif self.is_angle:
            block[:2] = layout.length * np.cos(value), layout.length * np.sin(value)
        else:
            block[0] = value


def coordinate_named(mechanism: Mechanism, name: str, key: str) -> MapCoordinate:
    """The coordinate of a name: of a joint, or 'B.x' of a point. Raises InputError."""
    text(name, key)
    if name in mechanism.coordinate:
        return MapCoordinate(name, mechanism.coordinate[name].is_angle)
    point, dot, axis = name.removeprefix('points.').rpartition('.')
    points = {each.name: each for each in mechanism.points}
    axes = _AXES[: mechanism.dimension]
    if dot and point in points and axis in axes and axis:
        if points[point].fixed:
            raise InputError('this point is fixed', key=key, value=name)
        return MapCoordinate(f'{point}.{axis}', False, point, axes.index(axis))
    moving = [f'{each}.{axis}' for each in points if not points[each].fixed for axis in axes]
    joint = name.removeprefix('joints.').rpartition('.')[0]
    if joint in mechanism.coordinate:
        raise InputError('no such coordinate', key=key, value=name, expected=joint)
    if name.startswith('points.'):
        moving = [f'points.{each}' for each in moving]
    choices = [*mechanism.coordinate, *moving]
    raise InputError('no such coordinate', key=key, value=name, choices=choices)
