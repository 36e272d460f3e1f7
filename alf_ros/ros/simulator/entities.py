"""A body as an entity of simulation_interfaces: pose, twist and acceleration of its frame, as they
are, and as somebody wants them."""

from __future__ import annotations

import math

import numpy as np
from simulation_interfaces.msg import EntityState

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.mechanism import Point
from alf_ros.ros.messages.templates import WORLD, to_time
from alf_ros.simulation.display_geometry import in_space, poses
from alf_ros.simulation.placement import TOLERANCE, spin, unit_quaternion
from alf_ros.simulation.sample import Sample


def entity_state(sample: Sample, name: str, ns: int) -> EntityState:
    """The frame of a body at stamp `ns`, in `world`: m, rad/s, m/s^2 ...

    With d from the first point to the others, and the vectors of the body: ω satisfies ḋ = ω × d,
    and α satisfies d̈ = α × d + ω × (ω × d). Undetermined components, as of a rod about itself,
    are zero.
    """
    n = sample.model.body_names.index(name)
    origin, d, rates, changes = _moving(sample, name)
    omega = spin(d, rates)
    alpha = spin(d, changes - np.cross(omega, np.cross(omega, d)))

    state = EntityState()
    state.header.frame_id, state.header.stamp = WORLD, to_time(ns)
    x, y, z, *quaternion = map(float, poses(sample)[n])
    position, turned = state.pose.position, state.pose.orientation
    position.x, position.y, position.z = x, y, z
    turned.x, turned.y, turned.z, turned.w = quaternion
    for vector, values in (
        (state.twist.linear, origin[1]),
        (state.twist.angular, omega),
        (state.acceleration.linear, origin[2]),
        (state.acceleration.angular, alpha),
    ):
        vector.x, vector.y, vector.z = map(float, values)
    return state


def wanted_pose(state: EntityState, dimension: int) -> Floats:
    """A pose as `Simulation.place` takes it. Raises InputError if it is none, or out of plane."""
    place, turned = state.pose.position, state.pose.orientation
    numbers = np.array([place.x, place.y, place.z, turned.x, turned.y, turned.z, turned.w])
    if not np.isfinite(numbers).all():
        raise InputError('not a pose', key='pose', expected='finite numbers')
    quaternion = unit_quaternion(numbers[3:])
    if dimension == 3:
        return np.array([*numbers[:3], *quaternion])
    if np.abs([place.z, *quaternion[:2]]).max() > TOLERANCE:
        raise InputError('out of the plane: the mechanism is planar', key='pose')
    return np.array([*numbers[:2], 2.0 * math.atan2(quaternion[2], quaternion[3])])


def wanted_twist(state: EntityState, dimension: int) -> Floats:
    """A twist as `Simulation.place` takes it. Raises InputError if it is out of plane."""
    v, omega = state.twist.linear, state.twist.angular
    if dimension == 3:
        return np.array([v.x, v.y, v.z, omega.x, omega.y, omega.z])
    if v.z or omega.x or omega.y:
        raise InputError('out of the plane: the mechanism is planar', key='twist')
    return np.array([v.x, v.y, omega.z])


def _moving(sample: Sample, name: str) -> tuple[Floats, Floats, Floats, Floats]:
    """Place, velocity and acceleration of the first point (3, 3); d, ḋ, d̈ (k, 3) of the body."""
    mechanism = sample.model.mechanism
    names = [item.name for item in mechanism.blocks if not item.fixed]
    moving = [in_space(x.reshape(len(names), -1)) for x in (sample.q, sample.qd, sample.qdd)]
    known = {each: np.array(x) for each, *x in zip(names, *moving, strict=True)}
    for item in mechanism.blocks:
        if item.fixed:
            at = item.at if isinstance(item, Point) else item.along
            known[item.name] = np.vstack([in_space(np.array([at])), np.zeros((2, 3))])
    body = next(body for body in mechanism.bodies if body.name == name)
    first = known[body.points[0]]
    d = [known[point] - first for point in body.points[1:]] + [known[v] for v in body.vectors]
    stacked = np.array(d).reshape(-1, 3, 3)
    return first, stacked[:, 0], stacked[:, 1], stacked[:, 2]
