"""Display only: settings of ~/markers and tf, and the arithmetic of arrows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Body, Mechanism
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.simulation.kinematics import Kinematics
from alf_ros.simulation.sample import Sample

# An arrow is three segments: shaft and two barbs.
POINTS_PER_ARROW = 6
# Longest standard arrow, as a part of the mechanism's size, for a force like its weight.
_WEIGHT_LENGTH = 0.25
_BARB = 0.2
_SAME = 1e-9  # of the size: places that are one


@dataclass
class Display:
    """frame_prefix: precedes the names of bodies as frames. force_scale: length of an arrow per
    force, m/N; 0 makes the arrow of the mechanism's weight a quarter of its size."""

    frame_prefix: str = ''
    force_scale: float = 0.0


def size(mechanism: Mechanism) -> float:
    """Largest extent of the drawing along an axis, m; 1 for a single point."""
    places = np.array([point.at for point in mechanism.points])
    return float(np.ptp(places, axis=0).max()) or 1.0


def standard_scale(mechanism: Mechanism) -> float:
    """m/N: the weight of the whole mechanism is a quarter of its size."""
    weight = 9.81 * sum(body.mass for body in mechanism.bodies)
    return _WEIGHT_LENGTH * size(mechanism) / (weight or 1.0)


def segments(body: Body) -> Iterator[str]:
    """Ends of the lines that show a body: from point to point, and back to the first of three."""
    points = body.points
    for a, b in zip(points, points[1:], strict=False):
        yield from (a, b)
    if len(points) > 2:
        yield from (points[-1], points[0])


def reaction_points(mechanism: Mechanism) -> dict[str, str]:
    """The point at which the reaction of a joint acts, by joint; without joints that are not at a
    point of their child."""
    bodies, found = {body.name: body for body in mechanism.bodies}, {}
    for joint in mechanism.joints:
        if joint.point is not None:
            found[joint.name] = joint.point
            continue
        child = bodies[joint.child]
        away = [math.dist(local, joint.frames[1].origin) for local in child.local]
        if min(away) < _SAME * size(mechanism):
            found[joint.name] = child.points[away.index(min(away))]
    return found


def reaction_places(mechanism: Mechanism, layout: Layout) -> dict[str, Form]:
    """Where the reaction of a joint that is not in `reaction_points` acts, by joint: the place of
    the joint on its child."""
    at_points = reaction_points(mechanism)
    return {
        joint.name: layout.place(joint.child, joint.frames[1].origin)
        for joint in mechanism.joints
        if joint.name not in at_points
    }


def in_space(places: Floats) -> Floats:
    """(n, 2) or (n, 3) -> (n, 3): planar mechanisms lie at z = 0."""
    return np.pad(places, ((0, 0), (0, 3 - places.shape[1])))


def arrows(tails: Floats, vectors: Floats) -> Floats:
    """(n, 3) tails and vectors from them, m -> (6 n, 3) ends of segments."""
    tips = tails + vectors
    # The barbs lie in the x-y plane, unless the arrow stands on it.
    upright = np.abs(vectors[:, :2]).max(axis=1, initial=0.0) < 1e-3 * np.abs(vectors[:, 2])
    across = np.cross(np.where(upright[:, None], (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), vectors)
    back = tips - _BARB * vectors
    left, right = back + 0.5 * _BARB * across, back - 0.5 * _BARB * across
    return np.stack([tails, tips, tips, left, tips, right], axis=1).reshape(-1, 3)


def poses(sample: Kinematics) -> Floats:
    """(bodies, 7) frames of the bodies in the world: x y z (m), quaternion x y z w."""
    found = sample.body_poses
    if found.shape[1] == 7:
        return found
    half, none = 0.5 * found[:, 2], np.zeros((len(found), 1))
    columns = (found[:, :2], none, none, none, np.sin(half), np.cos(half))
    return np.column_stack(columns)


def turned(quaternion: Floats, vector: Floats) -> Floats:
    """(3,) turned by a unit quaternion x y z w: v + 2 u × (u × v + w v)."""
    u, w = quaternion[:3], quaternion[3]
    return vector + 2.0 * np.cross(u, np.cross(u, vector) + w * vector)


def held_forces(sample: Sample) -> tuple[Floats, Floats]:
    """Where the wrenches held act, (n, 3) m, and their forces, (n, 3) N, both in the world."""
    frames = dict(zip(sample.model.body_names, poses(sample), strict=True))
    bodies = {body.name: body for body in sample.model.mechanism.bodies}
    places, forces = np.zeros((0, 3)), np.zeros((0, 3))
    for name, wrench in sample.inputs.all_wrenches:
        (force,) = in_space(np.array([wrench.force]))
        if name in bodies:
            body, frame = bodies[name], frames[name]
            local = body.local[body.points.index(wrench.at)] if wrench.at else body.com
            place = frame[:3] + turned(frame[3:], in_space(np.array([local]))[0])
            force = turned(frame[3:], force) if wrench.frame == 'body' else force
        else:
            (place,) = in_space(np.array([sample.points[name]]))
        places, forces = np.vstack([places, place]), np.vstack([forces, force])
    return places, forces
