"""A loop with two ends: a frame on each of two links, which a joint holds together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import loop_gaps
from alf_ros.exchange.robot import AXES, STILL, Connection, FramePose
from alf_ros.exchange.urdf_import import UrdfReader

_OBLIQUE = 1e-6  # cosine between the axes of a `universal`


@dataclass(frozen=True)
class LoopEnd:
    """A link, and the pose of the frame of the loop in the frame of the link."""

    link: str
    frame: FramePose


@dataclass(frozen=True)
class TwoEndedLoop:
    """A joint of a `kind` between two frames, of which z is its axis (`loop_gaps`). The first z is
    the first axis of a `universal`, the second z its second axis. pitch: of a screw, m per turn.
    """

    name: str
    kind: str
    ends: tuple[LoopEnd, LoopEnd]
    pitch: float = 0.0


def rotation_to(z: Floats) -> Floats:
    """(3, 3) a rotation of the z axis to a direction of length 1."""
    return np.asarray(Rotation.align_vectors([z], [[0.0, 0.0, 1.0]])[0].as_matrix())


def drawn(
    name: str,
    kind: str,
    links: Sequence[str],
    place: Floats,
    axes: Sequence[Floats],
    poses: Mapping[str, FramePose],
    file: str,
) -> TwoEndedLoop:
    """The loop that a joint at one place, with axes in the same frame as `poses`, closes.

    links: the two, a link without pose is the ground. place (3,) m; axes: unit directions (3,).
    Raises InputError for two axes that are not perpendicular.
    """
    if len(axes) == 2 and abs(float(axes[0] @ axes[1])) > _OBLIQUE:
        raise InputError('its two axes are not perpendicular', file=file, key=name)
    turns = [rotation_to(axis) for axis in axes] or [np.eye(3)]
    first, second = (
        LoopEnd(link, poses.get(link, STILL).inverse @ FramePose(place, turn))
        for link, turn in zip(links, (turns[0], turns[-1]), strict=True)
    )
    return TwoEndedLoop(name, kind, (first, second))


def add(reader: UrdfReader, loop: TwoEndedLoop) -> None:
    """Add a loop to the robot. Raises InputError if its ends are drawn apart."""
    parts, frames = [], []
    for end in loop.ends:
        part, pose = reader.part(end.link, loop.name)
        parts.append(part)
        frames.append(pose @ end.frame)
    axes = tuple(frame.turn[:, 2] for frame in frames)[: AXES.get(loop.kind, 1)]
    slides = loop_gaps.slides(loop.kind)
    place = frames[1 if slides else 0].origin  # where something slides it belongs to the child
    first, second = parts
    made = Connection(loop.name, loop.kind, first, second, place, axes, pitch=loop.pitch)
    reader.robot.connect(made, None if slides else frames[1].origin)
