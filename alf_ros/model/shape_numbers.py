"""The numbers of shapes: of bodies, of joints and of the ground.

Each can be changed by an amount (m), and each row depends on the numbers of a few items.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from alf_ros.mechanism import GROUND, Body, Frame, Joint, Mechanism, Numbers
from alf_ros.model.compile import Model
from alf_ros.model.constraints.rows import joint_rows, rigidity
from alf_ros.model.joints import type_of

# An item with a shape: ('body' | 'joint' | 'ground', name); 'ground': a fixed point or vector.
Item = tuple[str, str]
# The mechanism in which one number of the shape is larger by an amount (m), of each item given.
Change = Callable[[Mechanism, Mapping[str, float]], Mechanism]


def touched(model: Model) -> list[set[Item]]:
    """The items on which each row of the model depends: it may lack rows that bind velocities."""
    layout, mechanism = model.layout, model.mechanism
    fixed = {item.name for item in mechanism.blocks if item.fixed}
    parts: dict[str, set[Item]] = {GROUND: set()}
    for body in mechanism.bodies:
        held = fixed.intersection((*body.points, *body.vectors))
        parts[body.name] = {('body', body.name), *(('ground', name) for name in held)}
    found = {name: set[Item]() for name in model.row_names}
    for body in mechanism.bodies:
        for each in rigidity(body, layout):
            found[each.name] |= parts[body.name]
    for joint in mechanism.joints:
        own = {('joint', joint.name)} | parts[joint.parent] | parts[joint.child]
        for row in joint_rows(joint, layout):
            if row.name in found:
                found[row.name] |= own
    return list(found.values())


def apart(items: list[Item], made_of: list[set[Item]]) -> list[list[Item]]:
    """The items on which rows depend, in groups such that no row depends on two items of a
    group."""
    rows: dict[Item, set[int]] = {item: set() for item in items}
    for r, each in enumerate(made_of):
        for item in each & rows.keys():
            rows[item].add(r)
    groups: list[tuple[list[Item], set[int]]] = []
    for item, own in rows.items():
        if not own:
            continue
        fitting = next((group for group in groups if own.isdisjoint(group[1])), None)
        if fitting is None:
            groups.append(([item], set(own)))
        else:
            fitting[0].append(item)
            fitting[1].update(own)
    return [group for group, _ in groups]


def numbers(mechanism: Mechanism, size: float) -> Iterator[tuple[str, list[str], Change]]:
    """The numbers of shapes: the kind and the names of the items that have one, and its change.

    A direction is turned, by an angle times the size (m).
    """
    D = mechanism.dimension
    turns = range(3) if D == 3 else range(2, 3)
    for n in range(1, max((len(body.local) for body in mechanism.bodies), default=0)):
        names = [body.name for body in mechanism.bodies if len(body.local) > n]
        for axis in range(1 if n == 1 else D):  # the x axis goes through the second point
            yield 'body', names, partial(_of_bodies, partial(_moved_point, n, axis))
    for n in range(max((len(body.axes) for body in mechanism.bodies), default=0)):
        names = [body.name for body in mechanism.bodies if len(body.axes) > n]
        for axis in turns:
            yield 'body', names, partial(_of_bodies, partial(_turned_vector, n, axis, size))
    names = [joint.name for joint in mechanism.joints]
    for side in (0, 1):
        for axis in range(D):
            yield 'joint', names, partial(_of_joints, partial(_moved_frame, side, axis))
        for axis in turns:
            yield 'joint', names, partial(_of_joints, partial(_turned_frame, side, axis, size))
    names = [joint.name for joint in mechanism.joints if type_of(joint).drawn_length]
    yield 'joint', names, partial(_of_joints, _lengthened)
    names = [point.name for point in mechanism.points if point.fixed]
    for axis in range(D):
        yield 'ground', names, partial(_of_points, axis)
    names = [vector.name for vector in mechanism.vectors if vector.fixed]
    for axis in turns if names else ():
        yield 'ground', names, partial(_of_vectors, axis, size)


def _of_bodies(
    change: Callable[[Body, float], Body], mechanism: Mechanism, by: Mapping[str, float]
) -> Mechanism:
    bodies = (change(b, by[b.name]) if b.name in by else b for b in mechanism.bodies)
    return replace(mechanism, bodies=tuple(bodies))


def _of_joints(
    change: Callable[[Joint, float], Joint], mechanism: Mechanism, by: Mapping[str, float]
) -> Mechanism:
    joints = (change(j, by[j.name]) if j.name in by else j for j in mechanism.joints)
    return replace(mechanism, joints=tuple(joints))


def _of_points(axis: int, mechanism: Mechanism, by: Mapping[str, float]) -> Mechanism:
    points = (
        replace(p, at=_plus(p.at, axis, by[p.name])) if p.name in by else p
        for p in mechanism.points
    )
    return replace(mechanism, points=tuple(points))


def _of_vectors(
    axis: int, size: float, mechanism: Mechanism, by: Mapping[str, float]
) -> Mechanism:
    vectors = (
        replace(v, along=_turned(v.along, axis, by[v.name] / size)) if v.name in by else v
        for v in mechanism.vectors
    )
    return replace(mechanism, vectors=tuple(vectors))


def _moved_point(n: int, axis: int, body: Body, amount: float) -> Body:
    local = _plus(body.local[n], axis, amount)
    return replace(body, local=(*body.local[:n], local, *body.local[n + 1 :]))


def _turned_vector(n: int, axis: int, size: float, body: Body, amount: float) -> Body:
    along = _turned(body.axes[n], axis, amount / size)
    return replace(body, axes=(*body.axes[:n], along, *body.axes[n + 1 :]))


def _moved_frame(side: int, axis: int, joint: Joint, amount: float) -> Joint:
    frame = joint.frames[side]
    return _framed(joint, side, replace(frame, origin=_plus(frame.origin, axis, amount)))


def _turned_frame(side: int, axis: int, size: float, joint: Joint, amount: float) -> Joint:
    frame = joint.frames[side]
    axes = tuple(_turned(along, axis, amount / size) for along in frame.axes)
    return _framed(joint, side, replace(frame, axes=axes))


def _framed(joint: Joint, side: int, frame: Frame) -> Joint:
    other = joint.frames[1 - side]
    return replace(joint, frames=(frame, other) if side == 0 else (other, frame))


def _lengthened(joint: Joint, amount: float) -> Joint:
    return replace(joint, value=joint.value + amount)


def _plus(numbers: Numbers, axis: int, amount: float) -> Numbers:
    return (*numbers[:axis], numbers[axis] + amount, *numbers[axis + 1 :])


def _turned(along: Numbers, axis: int, angle: float) -> Numbers:
    """A direction (D,) turned about an axis of space by a small angle (rad)."""
    v = np.pad(np.array(along, dtype=float), (0, 3 - len(along)))
    w = v + angle * np.cross(np.eye(3)[axis], v)
    return tuple((w * (np.linalg.norm(v) / np.linalg.norm(w)))[: len(along)].tolist())


def changes(one: Mechanism, two: Mechanism, size: float) -> Iterator[tuple[str, float]]:
    """The items whose shapes differ, and the largest difference of a number of it, m."""
    for a, b in zip(one.bodies, two.bodies, strict=True):
        yield a.name, max(_off(a.local, b.local), size * _off(a.axes, b.axes))
    for c, d in zip(one.joints, two.joints, strict=True):
        pairs = list(zip(c.frames, d.frames, strict=True))
        moved = max(_off((f.origin,), (g.origin,)) for f, g in pairs)
        turned = size * max(_off(f.axes, g.axes) for f, g in pairs)
        yield c.name, max(moved, turned, abs(c.value - d.value))
    for p, q in zip(one.points, two.points, strict=True):
        yield p.name, _off((p.at,), (q.at,))
    for v, w in zip(one.vectors, two.vectors, strict=True):
        yield v.name, size * _off((v.along,), (w.along,))


def _off(one: tuple[Numbers, ...], two: tuple[Numbers, ...]) -> float:
    return max(
        (abs(x - y) for a, b in zip(one, two, strict=True) for x, y in zip(a, b, strict=True)),
        default=0.0,
    )
