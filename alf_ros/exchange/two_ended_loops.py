"""A loop with two ends: a frame on each of two links, which a joint holds together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import Connection, FramePose
from alf_ros.exchange.urdf_import import UrdfReader

CLOSES = ('spherical', 'weld', 'revolute')  # kinds of loops that are closed from open positions
_APART = 1e-6  # sine between directions of both ends as drawn


@dataclass(frozen=True)
class LoopEnd:
    """A link, and the pose of the frame of the loop in the frame of the link."""

    link: str
    frame: FramePose


@dataclass(frozen=True)
class TwoEndedLoop:
    """A joint of a `kind` between two frames. The origins of the frames coincide; of a `weld` all
    axes coincide too, of a `revolute` the z axes do, in this or the opposite direction."""

    name: str
    kind: str
    ends: tuple[LoopEnd, LoopEnd]


def rotation_to(z: Floats) -> Floats:
    """(3, 3) a rotation of the z axis to a direction of length 1."""
    return np.asarray(Rotation.align_vectors([z], [[0.0, 0.0, 1.0]])[0].as_matrix())


def add(reader: UrdfReader, loop: TwoEndedLoop) -> None:
    """Add a loop to the robot. Raises InputError if its ends are drawn apart."""
    parts, frames = [], []
    for end in loop.ends:
        part, pose = reader.part(end.link, loop.name)
        parts.append(part)
        frames.append(pose @ end.frame)
    first, second = (frame.turn for frame in frames)
    if loop.kind == 'weld':
        off = float(np.abs(first - second).max())
    elif loop.kind == 'revolute':
        off = float(np.linalg.norm(np.cross(first[:, 2], second[:, 2])))
    else:
        off = 0.0
    if off > _APART:
        raise reader.error(loop.name, 'its two ends are drawn at an angle to each other')
    axes = (first[:, 2],) if loop.kind == 'revolute' else ()
    place = frames[0].origin
    made = Connection(loop.name, loop.kind, parts[0], parts[1], place, axes)
    reader.robot.connect(made, frames[1].origin)
