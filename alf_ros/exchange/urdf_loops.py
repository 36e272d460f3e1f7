"""Loops in a URDF, by the two idioms there are.

`<gazebo><joint>` is an SDF joint inside the extension: its pose is in the frame of the child, its
axis in that pose. Gazebo creates it with all joints of the tree at zero, so its place on the
parent is the one that it has there. `<constraint>` is proposed for urdfdom (pull request 264): an
origin and an axis on each side.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange import two_ended_loops, urdf_gazebo
from alf_ros.exchange.robot import AXES, STILL, TYPES, FramePose
from alf_ros.exchange.sdf_frames import MODEL, pose_of
from alf_ros.exchange.sdf_joints import SCREW, pitch_of
from alf_ros.exchange.sdf_values import says
from alf_ros.exchange.sdf_versions import OF_MODEL
from alf_ros.exchange.two_ended_loops import LoopEnd, TwoEndedLoop, rotation_to
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.scene.text.decimal_numbers import decimal

_NONE = (0.0, 0.0, 0.0)
GEARBOX = 'gearbox'  # a type of SDF that closes no loop, see `urdf_gearboxes`


def loops(reader: UrdfReader) -> Iterator[TwoEndedLoop]:
    """The loops of a URDF, which may be open as drawn. Raises InputError."""
    zero = reader.poses_at({})
    for element in gazebo_joints(reader):
        if element.get('type') != GEARBOX:
            yield _gazebo(reader, element, zero)
    for element in reader.xml.findall('constraint'):
        yield _constraint(reader, element, zero)


def leave(reader: UrdfReader) -> None:
    """Note the extensions of Gazebo that are no loops, and what loops do not have here."""
    urdf_gazebo.leave(reader.robot, reader.xml, reader.links, reader.sprung)
    for element in gazebo_joints(reader):
        axes = (*element.findall('axis'), *element.findall('axis2'))
        if any(axis.find(tag) is not None for axis in axes for tag in ('limit', 'dynamics')):
            name = element.get('name', 'gazebo_joint')
            reader.robot.leave('limits, damping, friction, springs, armature', name)


def gazebo_joints(reader: UrdfReader) -> list[ElementTree.Element]:
    """The joints in extensions of Gazebo that are about the whole robot."""
    extensions = reader.xml.findall('gazebo')
    return [
        element
        for extension in extensions
        for element in (extension.findall('joint') if extension.get('reference') is None else ())
    ]


def _gazebo(
    reader: UrdfReader, element: ElementTree.Element, zero: dict[str, FramePose]
) -> TwoEndedLoop:
    name = element.get('name', 'gazebo_joint')
    kind = SCREW if element.get('type') == SCREW else _kind(reader, name, element)
    sides = ends(reader, name, element, ('parent', 'child'))
    place, axes = placed(reader, name, element, zero, AXES.get(kind, 1))
    made = two_ended_loops.drawn(name, kind, sides, place, axes, zero, reader.file)
    pitch = pitch_of(reader.robot, element, name) if kind == SCREW else 0.0
    return replace(made, pitch=pitch)


def ends(
    reader: UrdfReader, name: str, element: ElementTree.Element, tags: Sequence[str]
) -> list[str]:
    """The links that a joint of Gazebo names. Raises InputError."""
    links = [(element.findtext(tag) or '').strip() for tag in tags]
    for link in links:
        reader.part(link, name, element)
    return links


def placed(
    reader: UrdfReader,
    name: str,
    element: ElementTree.Element,
    zero: dict[str, FramePose],
    count: int,
) -> tuple[Floats, list[Floats]]:
    """Place and axes of a joint of Gazebo in the frame of the root, with all joints at `zero`.
    Raises InputError."""
    child = (element.findtext('child') or '').strip()
    pose = element.find('pose')
    _only(reader, name, pose, 'relative_to', (child,))
    frame = zero.get(child, STILL) @ pose_of(pose, reader.error, name)
    axes = []
    for tag in ('axis', 'axis2')[:count]:
        axis = element.find(tag)
        xyz = None if axis is None else axis.find('xyz')
        if axis is None or xyz is None:
            raise reader.error(name, f'no <xyz> in <{tag}>', element)
        _only(reader, name, xyz, 'expressed_in', (MODEL, name))
        u = reader.unit(name, _floats(reader, name, xyz, xyz.text, (0.0, 0.0, 1.0)), xyz)
        of_model = says(axis, OF_MODEL, reader.error, name) or xyz.get('expressed_in') == MODEL
        axes.append(u if of_model else frame.turn @ u)
    return frame.origin, axes


def _constraint(
    reader: UrdfReader, element: ElementTree.Element, zero: dict[str, FramePose]
) -> TwoEndedLoop:
    """An axis has no direction, and a `prismatic` turns about its axis as little as it can from
    how both sides are with all joints at zero."""
    name = element.get('name', 'constraint')
    kind = _kind(reader, name, element)
    first, second = (_end(reader, element, side, kind) for side in ('parent', 'child'))
    if kind == 'prismatic':
        one, other = (zero.get(end.link, STILL) @ end.frame for end in (first, second))
        z = one.turn[:, 2] if one.turn[:, 2] @ other.turn[:, 2] >= 0.0 else -one.turn[:, 2]
        across = np.asarray(Rotation.align_vectors([z], [other.turn[:, 2]])[0].as_matrix())
        turn = other.turn.T @ across.T @ one.turn
        second = LoopEnd(second.link, second.frame @ FramePose(np.zeros(3), turn))
    return TwoEndedLoop(name, kind, (first, second))


def _end(reader: UrdfReader, element: ElementTree.Element, side: str, kind: str) -> LoopEnd:
    name = element.get('name', 'constraint')
    link = element.find(side)
    body = '' if link is None else link.get('link', '')
    reader.part(body, name, element if link is None else link)
    origin, axis = element.find(f'{side}_origin'), element.find(f'{side}_axis')
    at = {} if origin is None else origin.attrib
    xyz, rpy = (_floats(reader, name, origin, at.get(key), _NONE) for key in ('xyz', 'rpy'))
    frame = _frame(xyz, rpy)
    if AXES[kind]:
        given = None if axis is None else axis.get('xyz')
        u = reader.unit(name, _floats(reader, name, axis, given, (1.0, 0.0, 0.0)), axis)
        frame = FramePose(frame.origin, frame.turn @ rotation_to(u))
    return LoopEnd(body, frame)


def _kind(reader: UrdfReader, name: str, element: ElementTree.Element) -> str:
    given = element.get('type', '')
    if given not in TYPES:
        raise reader.error(name, 'unknown type of joint', element, value=given, choices=TYPES)
    return TYPES[given]


def _only(
    reader: UrdfReader,
    name: str,
    element: ElementTree.Element | None,
    attribute: str,
    frames: tuple[str, ...],
) -> None:
    """Refuse an attribute with another frame than these."""
    given = '' if element is None else element.get(attribute, '')
    if given and given not in frames:
        expected = ' or '.join(frames)
        raise reader.error(
            name, f'no frame for {attribute} here', element, value=given, expected=expected
        )


def _frame(xyz: Floats, rpy: Floats) -> FramePose:
    return FramePose(xyz, Rotation.from_euler('xyz', rpy).as_matrix())


def _floats(
    reader: UrdfReader,
    name: str,
    at: ElementTree.Element | None,
    text: str | None,
    default: tuple[float, ...],
) -> Floats:
    if text is None:
        return np.array(default)
    try:
        values = np.array([decimal(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.size != len(default) or not np.all(np.isfinite(values)):
        expected = f'{len(default)} numbers'
        raise reader.error(name, 'not numbers', at, value=text, expected=expected)
    return values
