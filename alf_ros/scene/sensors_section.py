"""The sensors of a scene: what each is mounted on, its rate and its errors.

    sensors:
      imu: {torso: {body: torso, rate: 200, angular_velocity_noise: 1.0e-3}}
      encoder: {crank: {joint: crank_pin, resolution: 2*pi/4096}}

The kinds are named after what they measure. `simulation.sensors` computes the measurements.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from alf_ros.mechanism import Mechanism
from alf_ros.mechanism.natural_coordinates import cut
from alf_ros.scene.parameter_reader import ParameterReader, instances
from alf_ros.scene.references import References
from alf_ros.scene.text.yaml_document import Entry

_WORLD_OR_BODY = ('world', 'body')
_LONGEST_DELAY = 60.0  # s of positions that an encoder remembers


def _number(doc: str, unit: str = '', default: float | None = 0.0) -> Any:
    """An optional number that is not negative."""
    about = {'kind': 'number', 'doc': doc} | ({'unit': unit} if unit else {})
    return field(default=default, metadata=about)


def _named(kind: str, doc: str) -> Any:
    return field(metadata={'kind': kind, 'doc': doc})


@dataclass(frozen=True, kw_only=True)
class _Timed:
    """Of all sensors. Raises ValueError for a number that no sensor can have."""

    rate: float | None = _number('messages per simulated second; one a tick if absent', 'Hz', None)

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.metadata['kind'] != 'number' or value is None:
                continue
            if each.name in ('rate', 'resolution', 'max_range') and not value > 0.0:
                raise ValueError(f'{each.name} must be positive')
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f'{each.name} must be zero or more')
            if each.name == 'delay' and value > _LONGEST_DELAY:
                raise ValueError(f'delay must be at most {_LONGEST_DELAY:g} s')
            if each.name == 'seed' and not (value == int(value) and value < 2**53):
                raise ValueError('seed must be a whole number')


@dataclass(frozen=True, kw_only=True)
class _Noisy(_Timed):
    seed: float = _number('whole number from which noise and biases are drawn')


@dataclass(frozen=True, kw_only=True)
class ForceTorqueSensor(_Noisy):
    """Force and torque of the parent on the child at a joint, in axes of the child with their
    origin at the joint, as the child carries it: the reaction, and the efforts on the free axes
    from commands, motors less the inertia of their rotors, springs, stops, friction, drives and
    couplings."""

    joint: str = _named('joint', 'joint')
    force_noise: float = _number('standard deviation of each message and axis', 'N')
    torque_noise: float = _number('standard deviation of each message and axis', 'N m')
    force_bias: float = _number('standard deviation of the constant error of an axis', 'N')
    torque_bias: float = _number('standard deviation of the constant error of an axis', 'N m')


@dataclass(frozen=True, kw_only=True)
class InertialSensor(_Noisy):
    """Rates of turn and specific force (acceleration less free fall) in axes of a body, with its
    orientation in the world."""

    body: str = _named('body', 'body that carries it')
    at: str | tuple[float, ...] | None = field(
        default=None,
        metadata={
            'kind': 'place',
            'doc': 'point of the body, or a place in its frame (m); its first point if absent',
        },
    )
    angular_velocity_noise: float = _number('standard deviation of each message and axis', 'rad/s')
    linear_acceleration_noise: float = _number(
        'standard deviation of each message and axis', 'm/s^2'
    )
    angular_velocity_bias: float = _number(
        'standard deviation of the constant error of an axis', 'rad/s'
    )
    linear_acceleration_bias: float = _number(
        'standard deviation of the constant error of an axis', 'm/s^2'
    )


@dataclass(frozen=True, kw_only=True)
class OdometrySensor(_Timed):
    """Pose of the frame of a body in the world, and its twist in axes of the body."""

    body: str = _named('body', 'body')


@dataclass(frozen=True, kw_only=True)
class PoseSensor(_Timed):
    """Pose of the frame of a body in the world."""

    body: str = _named('body', 'body')


@dataclass(frozen=True, kw_only=True)
class TwistSensor(_Timed):
    """Velocity of the origin of the frame of a body, and its angular velocity."""

    body: str = _named('body', 'body')
    axes: str = field(
        default='world',
        metadata={
            'kind': 'text',
            'doc': 'axes of the components',
            'choices': _WORLD_OR_BODY,
        },
    )


@dataclass(frozen=True, kw_only=True)
class AccelerationSensor(TwistSensor):
    """Acceleration of the origin of the frame of a body, and its angular acceleration."""


@dataclass(frozen=True, kw_only=True)
class EncoderSensor(_Timed):
    """Position of a joint coordinate in whole counts, some time later; as velocity, the change
    since the measurement before."""

    joint: str = _named('coordinate', 'joint coordinate')
    resolution: float | None = _number('one count; exact if absent', 'rad or m', None)
    delay: float = _number('age of the position when it is sent', 's')


@dataclass(frozen=True, kw_only=True)
class RangeSensor(_Noisy):
    """Distance between two points; infinite beyond `max_range`."""

    at: str = _named('point', 'point where it is mounted')
    to: str = _named('point', 'point whose distance it measures')
    noise: float = _number('standard deviation of each message', 'm')
    min_range: float = _number('least distance that it measures', 'm')
    max_range: float = _number('largest distance that it measures', 'm', 1e3)


KINDS: Mapping[str, type[_Timed]] = {
    'force_torque': ForceTorqueSensor,
    'imu': InertialSensor,
    'odometry': OdometrySensor,
    'pose': PoseSensor,
    'twist': TwistSensor,
    'acceleration': AccelerationSensor,
    'encoder': EncoderSensor,
    'range': RangeSensor,
}


@dataclass(frozen=True)
class Sensor:
    """A sensor as a scene names it; `parameters` is of the class that `KINDS` has for `kind`."""

    kind: str
    name: str
    parameters: Any

    @property
    def label(self) -> str:
        """Name that distinguishes it from all other sensors of a scene: `imu/torso`, or `imu` of
        one without a name of its own."""
        return self.kind if self.name == self.kind else f'{self.kind}/{self.name}'


def read_sensors(
    section: Entry, mechanism: Mechanism, numbers: Mapping[str, float], references: References
) -> tuple[Sensor, ...]:
    """The sensors in a section. Raises InputError."""
    reader = ParameterReader(mechanism, numbers, references)
    found = []
    for kind, entry in section.mapping(KINDS).items():
        for name, instance in instances(kind, entry, KINDS[kind], True):
            values: dict[str, Any] = reader.parameters(instance, KINDS[kind])
            fault = _misplaced(kind, values, mechanism)
            if fault:
                raise instance.error(fault)
            try:
                found.append(Sensor(kind, name, KINDS[kind](**values)))
            except ValueError as error:
                raise instance.error(str(error)) from None
    return tuple(found)


def _misplaced(kind: str, values: Mapping[str, Any], mechanism: Mechanism) -> str:
    """The reason why a sensor cannot be at its place; '' if it can."""
    if kind == 'imu':
        body, at = mechanism.body[values['body']], values.get('at')
        if not cut(mechanism).turns(body.name):
            shape = 'point' if len(body.points) < 2 else 'rod that may turn about itself'
            return f'{body.name} is a {shape} and has no orientation: an imu on it has no axes'
        if isinstance(at, str) and at not in body.points:
            return f'{at} is not a point of {body.name}'
    return ''
