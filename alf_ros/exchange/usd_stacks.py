"""Joints of a USD stage that become chains, with bodies without mass in them, as in an MJCF.

A joint that leaves a combination of freedoms open for which there is no type is a chain of its
slides, along the axes of body 0, and of its rotations. One with a drive or a limit on one of
several coordinates is a chain too, as far as its rotations are swing and twist.

Several joints of the same two bodies may be one too. Joints constrain: two hinges of a door turn
as one. Files that come from MJCF mean a chain instead: each joint adds a freedom. So they do in an
articulation with `newton:jointsAddMobility`, and, where this is not stated, if all of them have
`MjcJointAPI`. The first joint of the stage is next to body 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.exchange.robot import GROUND, FramePose, RobotPart
from alf_ros.exchange.usd_joints import EQUALITIES, SLIDES, TURNS, UsdEnd, UsdJoint, kind_of
from alf_ros.exchange.usd_stage import UsdStage

_KINDS = ('revolute', 'prismatic', 'spherical')
_ROUNDED = 1e-5  # of places: how far single precision draws a slide from zero
_ADDS = 'newton:jointsAddMobility'


def chained(
    stage: UsdStage, joints: Sequence[UsdJoint], names: Mapping[str, str]
) -> tuple[list[UsdJoint], dict[str, RobotPart]]:
    """The joints, some of them as chains, and the bodies in these, by keys of their own.

    names: of the bodies, by path.
    """
    roots = {
        str(each.GetPath()): stage.holds(each, _ADDS, False)
        for each in stage.prims()
        if stage.is_authored(each, _ADDS)
    }
    groups: dict[tuple[str, str], list[UsdJoint]] = {}
    for joint in joints:
        if _can_stack(stage, joint):
            first, second = joint.ends
            groups.setdefault((first.body, second.body), []).append(joint)
    links: dict[str, RobotPart] = {}
    linked: dict[UsdJoint, list[UsdJoint]] = {}
    for group in groups.values():
        if len(group) > 1 and _adds(stage, group, roots):
            for joint, found in zip(group, _linked(group, names, links), strict=True):
                linked[joint] = [found]
    for joint in joints:
        if joint.kind == 'general':
            linked[joint] = _linked(list(_parts(joint)), names, links)
    return [each for joint in joints for each in linked.get(joint, [joint])], links


def _linked(
    group: Sequence[UsdJoint], names: Mapping[str, str], links: dict[str, RobotPart]
) -> list[UsdJoint]:
    """Joints as a chain, of which the bodies are added to `links`."""
    below, child = group[0].ends[0].body, group[0].ends[1].body
    found = []
    for joint in group:
        above = child
        if joint is not group[-1]:
            above = f'{child} {joint.name}'
            place, of = joint.ends[1].frame.origin, names.get(child, child)
            name = f'{of}_below_{joint.name}'
            links[above] = RobotPart(name, place, 0.0, place, np.zeros((3, 3)))
        ends = tuple(end.frame for end in joint.ends)
        found.append(replace(joint, ends=(UsdEnd(below, ends[0]), UsdEnd(above, ends[1]))))
        below = above
    return found


def _parts(joint: UsdJoint) -> Iterator[UsdJoint]:
    """The slides of a joint, and the joint with its rotations."""
    (first, second), frame = joint.ends, joint.ends[0].frame
    end = second.frame.origin
    slides = [each for each in joint.free if each in SLIDES]
    turns = tuple(each for each in joint.free if each not in SLIDES)
    numbers = [SLIDES.index(degree) for degree in slides]
    apart = frame.turn.T @ (end - frame.origin)
    size = np.abs([frame.origin, end]).max()
    tiny = [n for n in numbers if abs(apart[n]) <= _ROUNDED * size]
    frame = FramePose(frame.origin + frame.turn[:, tiny] @ apart[tiny], frame.turn)
    apart[tiny] = 0.0
    for k, (degree, n) in enumerate(zip(slides, numbers, strict=True)):
        left = sum((apart[m] * frame.turn[:, m] for m in numbers[k + 1 :]), np.zeros(3))
        moved = FramePose(end - left, joint.ends[0].frame.turn)
        ends = UsdEnd(first.body, frame), UsdEnd(second.body, moved)
        if degree == slides[-1] and not turns:
            ends = ends[0], second
        name = f'{joint.name}_{degree}'
        yield _part(joint, (degree,), name=name, kind='prismatic', axes=(n,), ends=ends)
        frame = moved
    if len(turns) == 2 and 'rotX' in turns:  # swing on body 0, then twist on body 1
        (swing,) = (each for each in turns if each != 'rotX')
        x, n = (frame.turn.T @ second.frame.turn)[:, 0], TURNS.index(swing)
        angle = math.atan2(x[1], x[0]) if swing == 'rotZ' else math.atan2(-x[2], x[0])
        turned = Rotation.from_rotvec(angle * np.eye(3)[n]).as_matrix()
        moved = FramePose(end, frame.turn @ turned)
        ends = UsdEnd(first.body, frame), UsdEnd(second.body, moved)
        name = f'{joint.name}_{swing}'
        yield _part(joint, (swing,), name=name, kind='revolute', axes=(n,), ends=ends)
        frame, turns = moved, ('rotX',)
    if turns:
        kind, axes = kind_of(turns) or ('', ())
        ends = UsdEnd(first.body, frame), second
        name = f'{joint.name}_{"_".join(turns)}'
        yield _part(joint, turns, name=name, kind=kind, axes=axes, ends=ends)


def _part(joint: UsdJoint, free: tuple[str, ...], **changes: Any) -> UsdJoint:
    """A part of a joint, with some of its freedoms."""
    degree = free[0] if len(free) == 1 else ''
    return replace(joint, free=free, degree=degree, **changes)


def _can_stack(stage: UsdStage, joint: UsdJoint) -> bool:
    schemas = stage.schemas(joint.prim)
    return (
        joint.kind in _KINDS
        and not stage.holds(joint.prim, 'physics:excludeFromArticulation', False)
        and not any(each in EQUALITIES for each in schemas)
    )


def _adds(stage: UsdStage, group: Sequence[UsdJoint], roots: Mapping[str, bool]) -> bool:
    paths = [str(joint.prim.GetPath()) for joint in group]
    paths += [end.body for end in group[0].ends if end.body != GROUND]
    stated = [says for root, says in roots.items() if any(_is_in(each, root) for each in paths)]
    if stated:
        return any(stated)
    return all('MjcJointAPI' in stage.schemas(joint.prim) for joint in group)


def _is_in(path: str, root: str) -> bool:
    return path == root or path.startswith(f'{root}/')
