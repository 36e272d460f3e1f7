"""A body as an entity of simulation_interfaces: pose, twist and acceleration of its frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from simulation_interfaces.msg import EntityState

from alf_ros.arrays import Floats
from alf_ros.display import in_space, poses
from alf_ros.mechanism import Point
from alf_ros.messages import WORLD, to_time

if TYPE_CHECKING:
    from alf_ros.sample import Sample


def entity_state(sample: Sample, name: str, ns: int) -> EntityState:
    """The frame of a body at stamp `ns`, in `world`: m, rad/s, m/s^2 ...

    With d from the first point to the others, and the vectors of the body: ω is that of ḋ = ω × d,
    α that of d̈ = α × d + ω × (ω × d). What nothing turns about, as a rod about itself, is zero.
    """
    n = sample.model.body_names.index(name)
    origin, d, rates, changes = _moving(sample, name)
    cross = np.vstack([-np.cross(each, np.eye(3)).T for each in d]) if len(d) else np.zeros((0, 3))
    omega = np.linalg.lstsq(cross, rates.ravel(), rcond=None)[0]
    spun = changes - np.cross(omega, np.cross(omega, d))
    alpha = np.linalg.lstsq(cross, spun.ravel(), rcond=None)[0]

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
