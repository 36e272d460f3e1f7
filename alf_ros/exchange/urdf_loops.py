"""Loops in a URDF, by the two idioms there are.

`<gazebo><joint>` is an SDF joint inside the extension: its pose is in the frame of the child, its
axis in that pose. `<constraint>` is proposed for urdfdom (pull request 264): an origin and an axis
on each side.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import AXES, TYPES, Connection, FramePose
from alf_ros.exchange.two_ended_loops import CLOSES, LoopEnd, TwoEndedLoop, rotation_to
from alf_ros.exchange.urdf_import import UrdfReader

_PARALLEL = 1e-9  # 1 - cosine: how far the axes of both sides may be drawn apart
_NONE = (0.0, 0.0, 0.0)


def close(reader: UrdfReader) -> None:
    """Add the loops of a URDF to its robot. Raises InputError."""
    for extension in reader.xml.findall('gazebo'):
        about = extension.get('reference')
        for element in extension:
            if element.tag == 'joint' and about is None:
                _gazebo(reader, element)
            else:
                reader.robot.leave('gazebo', f'{element.tag} of {about or "the robot"}')
    for element in reader.xml.findall('constraint'):
        if _kind_of(reader, element) not in CLOSES:
            _constraint(reader, element)


def two_ended(reader: UrdfReader) -> list[TwoEndedLoop]:
    """The loops of <constraint> that may be open as drawn. Raises InputError."""
    found = []
    for element in reader.xml.findall('constraint'):
        kind = _kind_of(reader, element)
        if kind in CLOSES:
            first, second = (_end(reader, element, side, kind) for side in ('parent', 'child'))
            name = element.get('name', 'constraint')
            found.append(TwoEndedLoop(name, kind, (first, second)))
    return found


def _end(reader: UrdfReader, element: ElementTree.Element, side: str, kind: str) -> LoopEnd:
    name = element.get('name', 'constraint')
    link = element.find(side)
    body = '' if link is None else link.get('link', '')
    reader.part(body, name)
    origin, axis = element.find(f'{side}_origin'), element.find(f'{side}_axis')
    at = {} if origin is None else origin.attrib
    xyz, rpy = (_floats(reader, name, at.get(key), _NONE) for key in ('xyz', 'rpy'))
    frame = _frame(xyz, rpy)
    if kind == 'revolute':
        given = None if axis is None else axis.get('xyz')
        u = reader.unit(name, _floats(reader, name, given, (1.0, 0.0, 0.0)))
        frame = FramePose(frame.origin, frame.turn @ rotation_to(u))
    return LoopEnd(body, frame)


def _kind_of(reader: UrdfReader, element: ElementTree.Element) -> str:
    return _kind(reader, element.get('name', 'constraint'), element.get('type', ''))


def _gazebo(reader: UrdfReader, element: ElementTree.Element) -> None:
    name = element.get('name', 'gazebo_joint')
    kind = _kind(reader, name, element.get('type', ''))
    sides = [(element.findtext(side) or '').strip() for side in ('parent', 'child')]
    (parent, _), (child, frame) = (reader.part(side, name) for side in sides)
    x = _floats(reader, name, element.findtext('pose'), (*_NONE, *_NONE))
    frame = frame @ _frame(x[:3], x[3:])
    axes = []
    for tag in ('axis', 'axis2')[: AXES[kind]]:
        axis = element.find(tag)
        xyz = None if axis is None else axis.find('xyz')
        if axis is None or xyz is None:
            raise reader.error(name, f'no <xyz> in <{tag}>')
        u = reader.unit(name, _floats(reader, name, xyz.text, (0.0, 0.0, 1.0)))
        of_model = (axis.findtext('use_parent_model_frame') or '').strip() in ('1', 'true')
        of_model |= xyz.get('expressed_in') == '__model__'
        axes.append(u if of_model else frame.turn @ u)
        if axis.find('limit') is not None or axis.find('dynamics') is not None:
            reader.robot.leave('limits, damping, friction, springs, armature', name)
    reader.robot.connect(Connection(name, kind, parent, child, frame.origin, tuple(axes)))


def _constraint(reader: UrdfReader, element: ElementTree.Element) -> None:
    name = element.get('name', 'constraint')
    kind = _kind(reader, name, element.get('type', ''))
    parts, places, axes = [], [], []
    for side in ('parent', 'child'):
        link = element.find(side)
        part, pose = reader.part('' if link is None else link.get('link', ''), name)
        origin, axis = element.find(f'{side}_origin'), element.find(f'{side}_axis')
        at = {} if origin is None else origin.attrib
        xyz, rpy = (_floats(reader, name, at.get(key), _NONE) for key in ('xyz', 'rpy'))
        frame = pose @ _frame(xyz, rpy)
        u = None if axis is None else axis.get('xyz')
        parts.append(part)
        places.append(frame.origin)
        axes.append(frame.turn @ reader.unit(name, _floats(reader, name, u, (1.0, 0.0, 0.0))))
    if AXES[kind] == 1 and 1.0 - abs(axes[0] @ axes[1]) > _PARALLEL:
        raise reader.error(name, 'its two axes are drawn apart', expected='joints placed by --set')
    along = tuple(axes[: AXES[kind]])
    made = Connection(name, kind, parts[0], parts[1], places[0], along)
    reader.robot.connect(made, places[1])


def _kind(reader: UrdfReader, name: str, given: str) -> str:
    if given not in TYPES:
        raise reader.error(name, 'unknown type of joint', value=given, choices=TYPES)
    return TYPES[given]


def _frame(xyz: Floats, rpy: Floats) -> FramePose:
    return FramePose(xyz, Rotation.from_euler('xyz', rpy).as_matrix())


def _floats(reader: UrdfReader, name: str, text: str | None, default: tuple[float, ...]) -> Floats:
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.size != len(default) or not np.all(np.isfinite(values)):
        raise reader.error(name, 'not numbers', value=text, expected=f'{len(default)} numbers')
    return values
