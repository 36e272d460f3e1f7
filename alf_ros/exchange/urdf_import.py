"""The tree of a URDF to a robot; `urdf_loops` and `loop_file` close its loops.

urdf_parser_py, which ROS 2 brings, reads it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange.robot import STILL, Connection, Part, Pose, Robot, lumped
from alf_ros.mechanism import GROUND
from alf_ros.scene.text.yaml_document import LARGEST

_TREE = {'revolute': 'revolute', 'continuous': 'revolute', 'prismatic': 'prismatic'}
_TREE |= {'planar': 'planar'}  # and `fixed` and `floating`, which are no joints
_GRAVITY = (0.0, 0.0, -9.81)


class UrdfReader:
    """The tree of a URDF, its links placed; `robot` is what it becomes.

    positions: of joints, rad or m, zero where absent. The root stands still unless `floating`.
    Raises InputError.
    """

    def __init__(self, path: Path, positions: Mapping[str, float], floating: bool) -> None:
        self.file = str(path)
        self.xml, self.urdf = _parsed(path)
        self.robot = Robot(self.urdf.name, self.file, _GRAVITY)
        self.joints = {joint.name: joint for joint in self.urdf.joints}
        self.links = {link.name: link for link in self.urdf.links}
        self.positions = positions
        for name in positions:
            if name not in self.joints:
                raise InputError('no such joint', key='--set', value=name, choices=self.joints)
        for kind, things, count in (
            ('joint', self.joints, len(self.urdf.joints)),
            ('link', self.links, len(self.urdf.links)),
        ):
            if len(things) < count:
                raise self.error(kind, f'a name of two {kind}s')
        self.poses: dict[str, Pose] = {}
        self.part_of: dict[str, str] = {}
        self._place(floating)
        self._lump()
        for joint in self.urdf.joints:
            self._connect(joint)
        self._leave()

    def error(self, key: str, message: str, **details: Any) -> InputError:
        return InputError(message, file=self.file, key=key, **details)

    def unit(self, key: str, axis: Any) -> Floats:
        """A direction; x where none is given, as the format says."""
        u = np.array((1.0, 0.0, 0.0) if axis is None else axis, dtype=float)
        size = float(np.linalg.norm(u))
        if not size > 0.0:
            raise self.error(key, 'zero is no direction')
        return u / size

    # -------------------------------------------------------------------------------------- tree

    def _place(self, floating: bool) -> None:
        """Poses of all links, and which links move as one."""
        above: dict[str, Any] = {}
        for joint in self.urdf.joints:
            for link in (joint.parent, joint.child):
                if link not in self.links:
                    raise self.error(joint.name, 'no such link', value=link, choices=self.links)
            if joint.child in above:
                first = above[joint.child].name
                message = f'{joint.child!r} is a child of {first} already: close loops otherwise'
                raise self.error(joint.name, message)
            above[joint.child] = joint
        for name in self.links:
            chain = [name]
            while chain[-1] in above and chain[-1] not in self.poses:
                chain.append(above[chain[-1]].parent)
                if len(chain) > len(self.links) + 1:
                    raise self.error(name, 'this link hangs from itself')
            if chain[-1] not in self.poses:
                self.poses[chain[-1]] = STILL
                moves = floating and chain[-1] != 'world'
                self.part_of[chain[-1]] = chain[-1] if moves else GROUND
            for link in reversed(chain[:-1]):
                joint = above[link]
                self.poses[link] = self.poses[joint.parent] @ self._pose(joint)
                fixed = joint.type == 'fixed'
                self.part_of[link] = self.part_of[joint.parent] if fixed else link

    def _pose(self, joint: Any) -> Pose:
        """Of the child's frame in the parent's."""
        pose = _pose(joint.origin)
        x = self.positions.get(joint.name, 0.0)
        if joint.type == 'prismatic':
            return Pose(pose.place(x * self.unit(joint.name, joint.axis)), pose.turn)
        turned = Rotation.from_rotvec(x * self.unit(joint.name, joint.axis)).as_matrix()
        return Pose(pose.origin, pose.turn @ turned)

    def _lump(self) -> None:
        """A part for all links that are fixed to each other, named after the heaviest."""
        members: dict[str, list[Part]] = {}
        for name, link in self.links.items():
            members.setdefault(self.part_of[name], []).append(self._part(name, link))
        named = {GROUND: GROUND}
        for root, parts in members.items():
            named.setdefault(root, max(parts, key=lambda part: part.mass).name)
        self.part_of = {link: named[root] for link, root in self.part_of.items()}
        for root, parts in members.items():
            if root == GROUND:
                continue
            name = named[root]
            part = lumped(name, self.poses[root].origin, parts)
            if part.mass == 0.0:
                self.robot.leave('mass: there is none', name)
            self.robot.parts.append(part)

    def _part(self, name: str, link: Any) -> Part:
        pose = self.poses[name]
        J: Floats = np.zeros((3, 3))
        inertial = link.inertial
        if inertial is None or not inertial.mass:
            return Part(name, pose.origin, 0.0, pose.origin, J)
        frame = pose @ _pose(inertial.origin)
        if inertial.inertia is None:
            self.robot.leave('inertia: there is none', name)
        else:
            J = np.array(inertial.inertia.to_matrix(), dtype=float)
        turned = frame.turn @ J @ frame.turn.T
        return Part(name, pose.origin, float(inertial.mass), frame.origin, turned)

    def _connect(self, joint: Any) -> None:
        if joint.type in ('fixed', 'floating'):
            return
        pose = self.poses[joint.child]
        turns = joint.limit is not None and joint.type in ('revolute', 'prismatic')
        dynamics = joint.dynamics
        if dynamics is not None and dynamics.friction:
            self.robot.leave('dry friction', joint.name)
        drawn = self.positions.get(joint.name, 0.0)
        if drawn:
            self.robot.leave('zero of joints: here it is as drawn', f'{joint.name} at {drawn:g}')
        self.robot.connect(
            Connection(
                joint.name,
                _TREE[joint.type],
                self.part_of[joint.parent],
                self.part_of[joint.child],
                pose.origin,
                (pose.turn @ self.unit(joint.name, joint.axis),),
                drawn,
                (joint.limit.lower or 0.0, joint.limit.upper or 0.0) if turns else None,
                float(dynamics.damping or 0.0) if dynamics is not None else 0.0,
            )
        )

    def part(self, link: str, key: str) -> tuple[str, Pose]:
        """The part that a link of a loop belongs to, and the link's pose."""
        if link in (GROUND, 'world') and link not in self.links:
            return GROUND, STILL
        if link not in self.links:
            raise self.error(key, 'no such link', value=link, choices=self.links)
        return self.part_of[link], self.poses[link]

    # ----------------------------------------------------------------------------------- the rest

    def _leave(self) -> None:
        """What else the file has."""
        for link in self.xml.findall('link'):
            for kind in ('visual', 'collision'):
                if link.find(kind) is not None:
                    self.robot.leave(f'{kind} shapes', link.get('name', ''))
        for joint in self.urdf.joints:
            for kind in ('mimic', 'calibration', 'safety_controller'):
                if getattr(joint, kind, None) is not None:
                    self.robot.leave(kind, joint.name)
            limit = joint.limit
            if limit is not None and (limit.effort or limit.velocity):
                self.robot.leave('limits of effort and velocity', joint.name)
        known = ('link', 'joint', 'gazebo', 'constraint', 'material')
        for element in self.xml:
            if isinstance(element.tag, str) and element.tag not in known:
                self.robot.leave('elements', f'{element.tag} {element.get("name", "")}'.strip())


def _parsed(path: Path) -> tuple[ElementTree.Element, Any]:
    """The XML, and what urdf_parser_py makes of it."""
    from urdf_parser_py import urdf
    from urdf_parser_py.xml_reflection import core

    try:
        text = path.read_bytes()
        xml = ElementTree.fromstring(text)
    except OSError as error:
        raise InputError(f'cannot be read: {error.strerror}', file=str(path)) from None
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f'not XML: {error}', file=str(path)) from None
    if xml.tag != 'robot':
        raise InputError('not a URDF', file=str(path), value=xml.tag, expected='<robot>')
    if xml.find('.//{http://www.ros.org/wiki/xacro}*') is not None:
        raise InputError('a xacro: run `xacro FILE > OUT.urdf` first', file=str(path))
    plain = ElementTree.Element('robot', xml.attrib)  # what else there is may be as it likes
    for element in xml:
        if element.tag in ('link', 'joint'):
            kept = [each for each in element if each.tag not in ('visual', 'collision')]
            ElementTree.SubElement(plain, element.tag, element.attrib).extend(kept)
    for element in plain.iter():
        _check_sizes(element, path)
    told, core.on_error = core.on_error, lambda message: None  # what is unknown we list ourselves
    try:
        robot = urdf.URDF.from_xml_string(ElementTree.tostring(plain))
    except core.ParseError as error:
        where, _, what = str(error).partition(':')
        message = f'{what.strip()} in {re.sub("^ParseError in ", "", where)}'
        raise InputError(message, file=str(path)) from None
    except (TypeError, ValueError, KeyError, AttributeError, AssertionError) as error:  # unchecked
        raise InputError(f'urdf_parser_py cannot read it: {error}', file=str(path)) from None
    finally:
        core.on_error = told
    if not robot.links:
        raise InputError('a robot without links', file=str(path))
    return xml, robot


def _check_sizes(element: ElementTree.Element, path: Path) -> None:
    """Refuse what reads as a number, but cannot be computed with."""
    for key, value in element.attrib.items():
        for word in value.split() if key not in ('name', 'link', 'joint', 'type') else ():
            try:
                usable = abs(float(word)) <= LARGEST
            except ValueError:  # the parser says what should have been there
                usable = True
            if not usable:
                where = f'{element.tag} {key}'
                message = 'not a usable number'
                raise InputError(message, file=str(path), key=where, value=word)


def _pose(origin: Any) -> Pose:
    if origin is None:
        return STILL
    rpy = origin.rpy or (0.0, 0.0, 0.0)
    turn = Rotation.from_euler('xyz', rpy).as_matrix()
    return Pose(np.array(origin.xyz or (0.0, 0.0, 0.0), dtype=float), turn)
