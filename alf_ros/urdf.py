"""A mechanism as URDF: its spanning tree, for viewers and robot_state_publisher. No ROS needed.

A link per body, with the body's frame, and a `continuous` joint for each revolute one of the tree,
named alike, so that `joint_states` move it. A slider is a `prismatic` joint with a link of its own
(`<joint>_slide`), for what slides on it may turn as well. URDF knows no loops: the joints that
close them are left out, as are bodies that only a slider, or nothing, holds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree

from alf_ros.display import size
from alf_ros.mechanism import GROUND, Body, Joint, Mechanism

WORLD = 'world'
# Radius of a bar as a part of the mechanism's size.
_RADIUS = 0.01

Place = tuple[float, float]


def urdf(mechanism: Mechanism, prefix: str = '') -> str:
    """URDF of a planar mechanism; `prefix` stands before the names of its links.

    Raises ValueError for a spatial one.
    """
    if mechanism.dimension != 2:
        raise ValueError('only planar mechanisms have a URDF so far')
    robot = ElementTree.Element('robot', name=mechanism.name)
    left_out = [body.name for body in mechanism.bodies if body.name not in _reached(mechanism)]
    if left_out:
        text = f' not held by revolute joints alone: {", ".join(left_out)} '
        robot.append(ElementTree.Comment(text))
    ElementTree.SubElement(robot, 'link', name=WORLD)
    bodies = {body.name: body for body in mechanism.bodies}
    radius = _RADIUS * size(mechanism)
    for joint, parent, child in _tree(mechanism):
        _add_link(robot, bodies[child], prefix, radius)
        outer, inner = _place(joint, parent), _place(joint, child)
        above = WORLD if parent == GROUND else prefix + parent
        below = prefix + child
        if inner != (0.0, 0.0):  # the link of a joint begins at the joint, a body at its origin
            hub = f'{prefix}{child}_at_{joint.name}'
            ElementTree.SubElement(robot, 'link', name=hub)
            _add_joint(robot, f'{joint.name}_to_{child}', 'fixed', hub, below, _minus(inner))
            below = hub
        # joint_states tell the child's angle against the parent's: the other way round, minus it
        sign = 1.0 if joint.child == child else -1.0
        _add_joint(robot, joint.name, 'continuous', above, below, outer, (0.0, 0.0, sign))
    for joint in mechanism.joints:
        if joint.kind == 'slider' and joint.parent == GROUND:
            slide = f'{prefix}{joint.name}_slide'
            ElementTree.SubElement(robot, 'link', name=slide)
            x, y = joint.frames[0].axes[0]
            through = _place(joint, GROUND)
            _add_joint(robot, joint.name, 'prismatic', WORLD, slide, through, (x, y, 0.0))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, 'unicode', xml_declaration=True) + '\n'


def _tree(mechanism: Mechanism) -> Iterator[tuple[Joint, str, str]]:
    """(joint, known body, new body) of a spanning tree from the ground, nearest first."""
    revolute = [joint for joint in mechanism.joints if joint.kind == 'revolute']
    known, ring = {GROUND}, [GROUND]
    touching: dict[str, list[Joint]] = {}
    for joint in revolute:
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


def _reached(mechanism: Mechanism) -> set[str]:
    return {child for _, _, child in _tree(mechanism)}


def _place(joint: Joint, body: str) -> Place:
    """Where the joint sits on a body or the ground."""
    x, y = joint.frames[body == joint.child].origin
    return x, y


def _minus(place: Place) -> Place:
    return -place[0], -place[1]


def _numbers(*values: float) -> str:
    return ' '.join(repr(value + 0.0) for value in values)


def _add_joint(
    robot: ElementTree.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    origin: Place,
    axis: tuple[float, float, float] | None = None,
) -> None:
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    ElementTree.SubElement(joint, 'origin', xyz=_numbers(*origin, 0.0), rpy='0 0 0')
    if axis is not None:
        ElementTree.SubElement(joint, 'axis', xyz=_numbers(*axis))
    if kind == 'prismatic':  # required by the format; the simulation has no such limits
        limits = {'lower': '-1e9', 'upper': '1e9', 'effort': '1e9', 'velocity': '1e9'}
        ElementTree.SubElement(joint, 'limit', limits)


def _add_link(robot: ElementTree.Element, body: Body, prefix: str, radius: float) -> None:
    link = ElementTree.SubElement(robot, 'link', name=prefix + body.name)
    if body.mass > 0.0:
        inertial = ElementTree.SubElement(link, 'inertial')
        ElementTree.SubElement(inertial, 'origin', xyz=_numbers(body.com[0], body.com[1], 0.0))
        ElementTree.SubElement(inertial, 'mass', value=repr(body.mass))
        # Only that about z is known, and only that matters in the plane.
        moment = repr(body.inertia)
        moments = {'ixx': moment, 'iyy': moment, 'izz': moment}
        ElementTree.SubElement(
            inertial, 'inertia', {**moments, 'ixy': '0', 'ixz': '0', 'iyz': '0'}
        )
    places = [(x, y) for x, y in body.local]
    closing = places[:1] if len(places) > 2 else []
    for (x, y), (u, v) in zip(places, [*places[1:], *closing], strict=False):
        visual = ElementTree.SubElement(link, 'visual')
        # A cylinder lies along its z axis: tilted onto x, then turned in the plane.
        turn = _numbers(0.0, 0.5 * math.pi, math.atan2(v - y, u - x))
        middle = _numbers(0.5 * (x + u), 0.5 * (y + v), 0.0)
        ElementTree.SubElement(visual, 'origin', xyz=middle, rpy=turn)
        shape = ElementTree.SubElement(visual, 'geometry')
        length = repr(math.hypot(u - x, v - y))
        ElementTree.SubElement(shape, 'cylinder', length=length, radius=repr(radius))
