"""A mechanism as URDF: its spanning tree, for viewers and robot_state_publisher. No ROS needed.

A link per body, with the body's frame, and for each joint of the tree a `continuous` or
`prismatic` one of the same name (of several freedoms: the names of its coordinates, with links
between), so that `joint_states` move it. A slider is a `prismatic` joint with a link of its own
(`<joint>_slide`), for what slides on it may turn as well. URDF knows no loops: the joints that
close them are left out, as are bodies that no joint known to URDF holds. A link has the shapes of
its body, or bars between its points if there are none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import urdf_visuals
from alf_ros.mechanism import GROUND, Body, Joint, Mechanism, Numbers
from alf_ros.mechanism.visual_shapes import roll_pitch_yaw
from alf_ros.model.joints import type_of
from alf_ros.model.joints.contract import X, Z
from alf_ros.simulation.display_geometry import in_space, size

WORLD = 'world'
# Radius of a bar as a part of the mechanism's size.
_RADIUS = 0.01


class _LinkJoint(NamedTuple):
    """One joint of the row of URDF joints that a joint is; `axis` (3,) in the frame of the joint
    as drawn. mimics: its position is `value` times the position of the joint of the same name."""

    name: str
    type: str
    axis: Numbers
    mimics: bool = False


def urdf(
    mechanism: Mechanism,
    prefix: str = '',
    free: Mapping[str, tuple[Floats, Floats]] | None = None,
    keep: AbstractSet[str] = frozenset(),
) -> str:
    """URDF of a mechanism; `prefix` precedes the names of its links.

    free: place (3,) m and axes (3, 3) in columns of bodies; if given, bodies that are not in the
    tree have a `floating` joint. keep: joint coordinates that the tree must have, such as those
    with motors, which a controller looks up in it. Raises InputError if they close a loop.
    """
    robot = ElementTree.Element('robot', name=mechanism.name)
    tree = list(_tree(mechanism, keep))
    left_out = outside(mechanism)
    if left_out and free is None:
        text = f' held by no joint that URDF knows: {", ".join(left_out)} '
        robot.append(ElementTree.Comment(text))
    world = ElementTree.SubElement(robot, 'link', name=WORLD)
    world.extend(urdf_visuals.elements(mechanism.shapes))
    bodies = {body.name: body for body in mechanism.bodies}
    radius = _RADIUS * size(mechanism)
    for joint, parent, child in tree:
        _add_link(robot, bodies[child], prefix, radius)
        above = WORLD if parent == GROUND else prefix + parent
        _add_joint_of_tree(robot, joint, above, child, prefix)
    for name, (place, axes) in (free or {}).items():
        if name in left_out:
            _add_link(robot, bodies[name], prefix, radius)
            _add_joint(robot, f'{name}_free', 'floating', WORLD, prefix + name, place, axes)
    for joint in mechanism.joints:
        if type_of(joint).urdf_rail:
            slide = f'{prefix}{joint.name}_slide'
            ElementTree.SubElement(robot, 'link', name=slide)
            axis, through = in_space(np.array([joint.frames[0].axes[0], joint.frames[0].origin]))
            _add_joint(robot, joint.name, 'prismatic', WORLD, slide, through, np.eye(3), axis)
    missing = keep - {joint.get('name') or '' for joint in robot.iter('joint')}
    if missing:
        raise InputError(
            f'no tree of {mechanism.name} has all the joints to be kept',
            key='keep',
            value=', '.join(sorted(missing)),
            expected='joints that URDF knows and that close no loop among themselves',
        )
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, 'unicode', xml_declaration=True) + '\n'


def closing(mechanism: Mechanism) -> tuple[Joint, ...]:
    """The joints that are not in the tree: they close its loops, or URDF does not know them."""
    used = {joint.name for joint, _, _ in _tree(mechanism)}
    return tuple(joint for joint in mechanism.joints if joint.name not in used)


def outside(mechanism: Mechanism) -> list[str]:
    """The bodies that are not in the tree."""
    held = {child for _, _, child in _tree(mechanism)}
    return [body.name for body in mechanism.bodies if body.name not in held]


def _tree(
    mechanism: Mechanism, keep: AbstractSet[str] = frozenset()
) -> Iterator[tuple[Joint, str, str]]:
    """(joint, known body, new body) of a spanning tree from the ground, nearest first."""
    joints = [joint for joint in mechanism.joints if _row(joint) is not None]
    if keep:
        joints = _without_loops(sorted(joints, key=lambda joint: keep.isdisjoint(_names(joint))))
    known, ring = {GROUND}, [GROUND]
    touching: dict[str, list[Joint]] = {}
    for joint in joints:
        touching.setdefault(joint.parent, []).append(joint)
        touching.setdefault(joint.child, []).append(joint)
    while ring:
        following = []
        for body in ring:
            for joint in touching.get(body, []):
                other = joint.child if joint.parent == body else joint.parent
                if other not in known:
                    known.add(other)
                    following.append(other)
                    yield joint, body, other
        ring = following


def _names(joint: Joint) -> list[str]:
    """Of its joints in a URDF."""
    return [each.name for each in _row(joint) or ()]


def _row(joint: Joint) -> list[_LinkJoint] | None:
    """Its joints in a URDF, from the parent on; None if URDF has no equivalent."""
    if joint.angles:
        axes = Z, X, (0.0, -math.sin(joint.value), math.cos(joint.value))
        pairs = zip(joint.angles, axes, strict=True)
        return [_LinkJoint(name, 'continuous', axis) for name, axis in pairs]
    found = type_of(joint).urdf
    if found is None:
        return None
    return [_LinkJoint(joint.name + each.suffix, *each[1:]) for each in found]


def _without_loops(joints: Iterable[Joint]) -> list[Joint]:
    """Those that close no loop with joints before them."""
    group: dict[str, set[str]] = {}
    found = []
    for joint in joints:
        one, other = (group.setdefault(body, {body}) for body in (joint.parent, joint.child))
        if one is not other:
            found.append(joint)
            one |= other
            group.update(dict.fromkeys(other, one))
    return found


def frame(joint: Joint, body: str) -> tuple[Floats, Floats]:
    """Where a joint sits on a body or the ground: place (3,) m, axes (3, 3) in columns.

    An angle in the plane is that between the frames of the bodies.
    """
    side = joint.frames[body == joint.child]
    (place,) = in_space(np.array([side.origin]))
    axes = np.eye(3)
    if len(side.origin) == 3:
        axes = np.array(side.axes).T
    elif not any(freedom.is_angle for freedom in joint.freedoms):
        axes[:2, :2] = np.array(side.axes).T
    return place, axes


def _motions(joint: Joint, forwards: bool) -> Iterator[tuple[_LinkJoint, Floats]]:
    """The joints in a row from one body to the other, each with its axis."""
    found = _row(joint) or []
    # joint_states tell the child's motion against the parent: the other way round, minus it
    for each in found if forwards else reversed(found):
        axis = np.array(each.axis)
        yield each, axis if forwards else -axis


def _add_joint_of_tree(
    robot: ElementTree.Element, joint: Joint, above: str, child: str, prefix: str
) -> None:
    """From the link above to the joint's frame there, along its freedoms, to the child's frame."""
    forwards = joint.child == child
    place, axes = frame(joint, joint.parent if forwards else joint.child)
    inner, turn = frame(joint, child)
    at_origin = not inner.any() and np.array_equal(turn, np.eye(3))
    motions = list(_motions(joint, forwards))
    for n, (each, axis) in enumerate(motions):
        last, name = n == len(motions) - 1, each.name
        below = f'{prefix}{child}' if last and at_origin else f'{prefix}{child}_at_{name}'
        if below != prefix + child:
            ElementTree.SubElement(robot, 'link', name=below)
        found = _add_joint(robot, name, each.type, above, below, place, axes, axis)
        if each.mimics:
            multiplier = repr(joint.value)
            ElementTree.SubElement(found, 'mimic', joint=joint.name, multiplier=multiplier)
        above, place, axes = below, np.zeros(3), np.eye(3)
    if not at_origin or not motions:  # a link begins at its joint, a body at its origin
        place, axes = place - axes @ turn.T @ inner, axes @ turn.T
        _add_joint(robot, f'{joint.name}_to_{child}', 'fixed', above, prefix + child, place, axes)


def _numbers(values: Iterable[float]) -> str:
    return ' '.join(repr(float(value) + 0.0) for value in values)


def _add_joint(
    robot: ElementTree.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    place: Floats,
    axes: Floats,
    axis: Floats | None = None,
) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    ElementTree.SubElement(
        joint, 'origin', xyz=_numbers(place), rpy=_numbers(roll_pitch_yaw(axes))
    )
    if axis is not None:
        ElementTree.SubElement(joint, 'axis', xyz=_numbers(axis))
    if kind == 'prismatic':  # required by the format; the simulation has no such limits
        limits = {'lower': '-1e9', 'upper': '1e9', 'effort': '1e9', 'velocity': '1e9'}
        ElementTree.SubElement(joint, 'limit', limits)
    return joint


def _add_link(robot: ElementTree.Element, body: Body, prefix: str, radius: float) -> None:
    link = ElementTree.SubElement(robot, 'link', name=prefix + body.name)
    if body.mass > 0.0:
        inertial = ElementTree.SubElement(link, 'inertial')
        (com,) = in_space(np.array([body.com]))
        ElementTree.SubElement(inertial, 'origin', xyz=_numbers(com))
        ElementTree.SubElement(inertial, 'mass', value=repr(body.mass))
        # Of a planar body only that about z is known, and only that matters.
        J = np.array(body.inertia)
        J = J if J.ndim == 2 else J * np.eye(3)
        moments = {
            f'i{a}{b}': repr(float(J['xyz'.index(a), 'xyz'.index(b)]))
            for a, b in map(tuple, _PAIRS)
        }
        ElementTree.SubElement(inertial, 'inertia', moments)
    if body.shapes:
        link.extend(urdf_visuals.elements(body.shapes))
        return
    places = in_space(np.array(body.local))
    closing = places[:1] if len(places) > 2 else places[:0]
    for one, other in zip(places, [*places[1:], *closing], strict=False):
        x, y, z = other - one
        visual = ElementTree.SubElement(link, 'visual')
        # A cylinder lies along its z axis: tilted, then turned.
        turn = _numbers((0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)))
        ElementTree.SubElement(visual, 'origin', xyz=_numbers(0.5 * (one + other)), rpy=turn)
        shape = ElementTree.SubElement(visual, 'geometry')
        length = repr(math.hypot(x, y, z))
        ElementTree.SubElement(shape, 'cylinder', length=length, radius=repr(radius))


_PAIRS = (*zip('xxx', 'xyz', strict=True), *zip('yyz', 'yzz', strict=True))
