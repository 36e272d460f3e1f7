"""A body as an entity of simulation_interfaces: pose, twist and acceleration of its frame, as they
are, and as somebody wants them."""

from __future__ import annotations

import math

import numpy as np
from simulation_interfaces.msg import EntityState

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.ros.messages.templates import WORLD, to_time
from alf_ros.simulation.placement import TOLERANCE, unit_quaternion
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.sensors.body_motion import body_motion


def entity_state(sample: Sample, name: str, ns: int) -> EntityState:
    """The frame of a body at stamp `ns`, in `world`: m, rad/s, m/s^2 ...

    Undetermined components, as of a rod about itself, are zero.
    """
    motion = body_motion(sample, name)
    state = EntityState()
    state.header.frame_id, state.header.stamp = WORLD, to_time(ns)
    x, y, z, *quaternion = map(float, motion.pose)
    position, turned = state.pose.position, state.pose.orientation
    position.x, position.y, position.z = x, y, z
    turned.x, turned.y, turned.z, turned.w = quaternion
    for vector, values in (
        (state.twist.linear, motion.velocity),
        (state.twist.angular, motion.omega),
        (state.acceleration.linear, motion.acceleration),
        (state.acceleration.angular, motion.alpha),
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
