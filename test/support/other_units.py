"""Scenes in other units, by powers of two: exponents of numbers change, so nothing is rounded.

A run in other units then has the same bits, unless something in the method has a size of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.effects import Effect
from alf_ros.mechanism import Body, Frame, Joint, Mechanism
from alf_ros.mechanism.parts import Bearing, Coupling, Rotor
from alf_ros.scene.scene import Scene
from alf_ros.simulation.sample import Sample


@dataclass(frozen=True)
class Units:
    """A metre, a kilogram and a second of a scene in its other units."""

    m: float
    kg: float
    s: float

    @property
    def N(self) -> float:
        """A newton."""
        return self.m * self.kg / self.s**2

    def factor(self, unit: str, is_angle: bool, power: float = 1.0) -> float:
        """Of a number in a unit of an effect. is_angle: which of two units counts."""
        first, _, second = unit.partition(' or ')
        m, kg, s, N = self.m, self.kg, self.s, self.N
        return {
            '1': 1.0,
            'N m': N * m,
            'N': N,
            'N m s/rad': N * m * s,
            'N s/m': N * s / m,
            'N m/rad': N * m,
            'N/m': N / m,
            'N s^2/m^2': N * s**2 / m**2,
            'm': m,
            'm/s': m / s,
            'm/s^2': m / s**2,
            'kg m²': kg * m**2,
            'kg': kg,
            'rad': 1.0,
            'rad/s': 1.0 / s,
            's': s,
            's/m': s / m,
            's/rad': s,
            'N m/rad^p': N * m,
            'N/m^p': N / m**power,
            'N/m^1.5': N / m**1.5,
        }[first if is_angle or not second else second]


def in_units(scene: Scene, units: Units) -> Scene:
    """The scene in other units. Drives, and motions of joints, are functions of the time in s:
    with them seconds and metres stay."""
    mechanism = scene.mechanism
    moved = mechanism.drives or any(joint.motion for joint in mechanism.joints)
    assert not moved or units.m == units.s == 1.0
    vectors = {vector.name for vector in mechanism.vectors}

    def of_blocks(given: Mapping[str, Any], of_points: float, of_vectors: float) -> dict[str, Any]:
        return {
            name: times(numbers, of_vectors if name in vectors else of_points)
            for name, numbers in given.items()
        }

    return replace(
        scene,
        mechanism=_mechanism(mechanism, units),
        effects=tuple(_effect(effect, mechanism, units) for effect in scene.effects),
        positions=of_blocks(scene.positions, units.m, 1.0),
        velocities=of_blocks(scene.velocities, units.m / units.s, 1.0 / units.s),
        solver=replace(scene.solver, step=scene.solver.step * units.s),
    )


def times(numbers: Any, factor: float) -> Any:
    """Numbers, nested, times a factor; names and missing ones stay."""
    if numbers is None or isinstance(numbers, str):
        return numbers
    if isinstance(numbers, tuple):
        return tuple(times(each, factor) for each in numbers)
    return numbers * factor


def _mechanism(mechanism: Mechanism, units: Units) -> Mechanism:
    is_angle = {each.name: each.is_angle for each in mechanism.coordinates}

    def rotor(each: Rotor) -> Rotor:
        turns = all(is_angle[name] for name, _ in each.of)
        return replace(each, inertia=each.inertia * units.factor('kg m² or kg', turns))

    def coupling(each: Coupling) -> Coupling:
        mixed = len({is_angle[name] for name, _ in each.of}) > 1
        of = [(name, a / units.m if mixed and not is_angle[name] else a) for name, a in each.of]
        return replace(each, of=tuple(of))

    return replace(
        mechanism,
        points=tuple(replace(each, at=times(each.at, units.m)) for each in mechanism.points),
        bodies=tuple(_body(each, units) for each in mechanism.bodies),
        joints=tuple(_joint(each, units) for each in mechanism.joints),
        rotors=tuple(map(rotor, mechanism.rotors)),
        couplings=tuple(map(coupling, mechanism.couplings)),
    )


def _body(body: Body, units: Units) -> Body:
    return replace(
        body,
        local=times(body.local, units.m),
        mass=body.mass * units.kg,
        com=times(body.com, units.m),
        inertia=times(body.inertia, units.kg * units.m**2),
    )


def _joint(joint: Joint, units: Units) -> Joint:
    def moved(frame: Frame) -> Frame:
        return replace(frame, origin=times(frame.origin, units.m))

    parent, child = joint.frames
    return replace(
        joint,
        frames=(moved(parent), moved(child)),
        value=joint.value * (1.0 if joint.angles else units.m),
        of_parent=joint.of_parent * units.m,
        bearing=_bearing(joint.bearing, units),
    )


def _bearing(bearing: Bearing | None, units: Units) -> Bearing | None:
    if bearing is None:
        return None
    return Bearing(
        bearing.translation * units.factor('N/m', is_angle=False),
        bearing.rotation * units.factor('N m/rad', is_angle=True),
    )


def _effect(effect: Effect, mechanism: Mechanism, units: Units) -> Effect:
    """The effect in other units, by the units that its fields have."""
    numbers = effect.parameters
    name = getattr(numbers, 'joint', None)
    is_angle = name not in mechanism.coordinate or mechanism.coordinate[name].is_angle
    power = getattr(numbers, 'exponent', 1.0)

    def changed(kind: str, unit: str, value: Any) -> Any:
        if kind == 'factors':  # of angles in m/rad
            turns = {each.name: each.is_angle for each in mechanism.coordinates}
            return tuple((of, c * (units.m if turns[of] else 1.0)) for of, c in value)
        if kind == 'table':
            chosen = unit.split(' or ')[0 if is_angle else -1].split(', ')
            if effect.kind == 'user_table' and name is not None:
                chosen[1:] = ['N m' if is_angle else 'N']
            elif effect.kind == 'user_table':
                chosen[1:] = ['N'] * mechanism.dimension + ['N m'] * 3
            columns = [units.factor(each, is_angle, power) for each in chosen]
            return tuple(tuple(x * f for x, f in zip(row, columns, strict=False)) for row in value)
        factor = units.factor(unit, is_angle, power)
        if kind == 'signal' and isinstance(value, tuple):
            return tuple((t * units.s, x * factor) for t, x in value)
        return times(value, factor)

    known = ((each.name, each.metadata, getattr(numbers, each.name)) for each in fields(numbers))
    found = {
        field: changed(said['kind'], said['unit'], value)
        for field, said, value in known
        if 'unit' in said and value is not None and (field != 'radius' or is_angle)
    }
    return replace(effect, parameters=replace(numbers, **found))


def differences(sample: Sample, other: Sample, units: Units) -> dict[str, float]:
    """By name the largest difference, if any, of quantities of a sample from the ones of the same
    instant in other units, as a part of the largest of them."""
    m, s, N = units.m, units.s, units.N
    found: dict[str, float] = {}

    def compare(name: str, own: Any, there: Any, factor: float) -> None:
        a = np.atleast_1d(np.asarray(own, dtype=float)) * factor
        b = np.atleast_1d(np.asarray(there, dtype=float))
        if not np.array_equal(a, b, equal_nan=True):
            size: Floats = np.nanmax(np.abs(a))
            found[name] = float(np.max(np.abs(a - b)) / size)

    for name in sample.points:
        compare(f'{name}, position', sample.points[name], other.points[name], m)
        compare(f'{name}, velocity', sample.velocities[name], other.velocities[name], m / s)
    for name, reaction in sample.reactions.items():
        compare(f'{name}, force', reaction.force, other.reactions[name].force, N)
        compare(f'{name}, torque', reaction.torque, other.reactions[name].torque, N * m)
    for each in sample.model.mechanism.coordinates:
        unit = 1.0 if each.is_angle else m
        own, there = sample.joints[each.name], other.joints[each.name]
        compare(f'{each.name}, joint', own.position, there.position, unit)
        compare(f'{each.name}, rate', own.velocity, there.velocity, unit / s)
        compare(f'{each.name}, effort', own.effort, there.effort, N * m / unit)
    compare('energy', sample.energy, other.energy, N * m)
    for name in ('rank', 'redundant', 'singular', 'iterations', 'distance'):
        compare(name, getattr(sample.diagnostics, name), getattr(other.diagnostics, name), 1.0)
    return found
