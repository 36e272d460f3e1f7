"""The motion of a body from a sample: frame, velocities and accelerations, in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Point
from alf_ros.simulation.display_geometry import in_space, poses, turned
from alf_ros.simulation.kinematics import Kinematics
from alf_ros.simulation.placement import spin
from alf_ros.simulation.sample import Sample


@dataclass(frozen=True)
class BodyFrame:
    """The frame of a body in the world; of a planar mechanism, at z = 0.

    `place` (3,) m of its origin, `orientation` (4,) quaternion x y z w.
    """

    place: Floats
    orientation: Floats

    @property
    def pose(self) -> Floats:
        """(7,) place and orientation."""
        return np.concatenate([self.place, self.orientation])

    def to_body(self, vector: Floats) -> Floats:
        """(3,) in axes of the body."""
        return turned(self.orientation * (-1.0, -1.0, -1.0, 1.0), vector)

    def to_world(self, vector: Floats) -> Floats:
        """(3,) in axes of the world."""
        return turned(self.orientation, vector)


@dataclass(frozen=True)
class BodyMotion(BodyFrame):
    """How the frame of a body moves, world axes: `velocity` m/s and `acceleration` m/s² of the
    origin, `omega` rad/s, `alpha` rad/s², (3,) each.

    Undetermined components, as of a rod about itself, are zero.
    """

    velocity: Floats
    omega: Floats
    acceleration: Floats
    alpha: Floats

    def acceleration_at(self, arm: Floats) -> Floats:
        """(3,) m/s² of the material point that is `arm` (3,) m from the origin, world axes."""
        about = np.cross(self.omega, np.cross(self.omega, arm))
        return self.acceleration + np.cross(self.alpha, arm) + about


def body_frame(sample: Kinematics, name: str) -> BodyFrame:
    """The frame of a body of the mechanism."""
    pose = poses(sample)[sample.model.body_names.index(name)]
    return BodyFrame(pose[:3], pose[3:])


def body_motion(sample: Sample, name: str) -> BodyMotion:
    """The motion of a body of the mechanism.

    With d from the first point to the others, and the vectors of the body: ω satisfies ḋ = ω × d,
    and α satisfies d̈ = α × d + ω × (ω × d). Raises StepError if the accelerations of the sample
    cannot be computed.
    """
    origin, d, rates, changes = _moving(sample, name)
    omega = spin(d, rates)
    alpha = spin(d, changes - np.cross(omega, np.cross(omega, d)))
    if sample.model.layout.dimension == 2:
        omega[:2] = alpha[:2] = 0.0  # not even rounding
    frame = body_frame(sample, name)
    return BodyMotion(frame.place, frame.orientation, origin[1], omega, origin[2], alpha)


def _moving(sample: Sample, name: str) -> tuple[Floats, Floats, Floats, Floats]:
    """Place, velocity and acceleration of the first point (3, 3); d, ḋ, d̈ (k, 3) of the body."""
    mechanism = sample.model.mechanism
    body = next(body for body in mechanism.bodies if body.name == name)
    wanted = dict.fromkeys((*body.points, *body.vectors))
    known: dict[str, Floats] = {}
    D, at = mechanism.dimension, 0
    for item in mechanism.blocks:
        if item.name in wanted:
            if item.fixed:
                drawn = item.at if isinstance(item, Point) else item.along
                moves = np.vstack([drawn, np.zeros((2, D))])
            else:
                moves = np.array([x[at : at + D] for x in (sample.q, sample.qd, sample.qdd)])
            known[item.name] = in_space(moves)
        at += 0 if item.fixed else D
    first = known[body.points[0]]
    d = [known[point] - first for point in body.points[1:]] + [known[v] for v in body.vectors]
    stacked = np.array(d).reshape(-1, 3, 3)
    return first, stacked[:, 0], stacked[:, 1], stacked[:, 2]
