"""Links that an extension of Gazebo adds to a URDF: `<gazebo><link>`, as SDF has links.

Gazebo copies them into its model, where joints of extensions hold them, as in the grippers of the
PR2. Here each becomes a link of the URDF on a `floating` joint, so it is placed, and closes loops,
as all others do. What it has besides its pose and its inertia becomes an extension about it.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.exchange.robot import FramePose, free_name
from alf_ros.exchange.sdf_frames import pose_of
from alf_ros.exchange.sdf_inertial import MOMENTS, inertial_of, states_mass
from alf_ros.exchange.sdf_values import Refuse, name_of
from alf_ros.exchange.xml_file import PlacedElement

_READ = ('pose', 'inertial')


def added(xml: ElementTree.Element, refuse: Refuse) -> list[str]:
    """Put such links in place of their extensions; returns those with the mass that is the default
    of SDF. Poses are in the frame of the root link. Raises the error."""
    found = [
        (extension, link)
        for extension in xml.findall('gazebo')
        if extension.get('reference') is None
        for link in extension.findall('link')
    ]
    if not found:
        return []
    root, default = _root_of(xml), list[str]()
    joints = [joint.get('name', '') for joint in xml.findall('joint')]
    for extension, link in found:
        extension.remove(link)
        name = name_of(link, refuse)
        pose = link.find('pose')
        if pose is not None and pose.get('relative_to'):
            to = pose.get('relative_to')
            raise refuse(name, 'no frame for relative_to here', pose, value=to, expected='none')
        inertial = link.find('inertial')
        if not states_mass(inertial):
            default.append(name)
        own = _below(xml, 'link', link, name=name)
        own.append(_inertial(own, inertial, refuse, name))
        if root is None:  # it is the first link of the robot
            root = name
        else:
            joints.append(free_name(f'{name}_free', joints))
            joint = _below(xml, 'joint', link, name=joints[-1], type='floating')
            _below(joint, 'parent', link, link=root)
            _below(joint, 'child', link, link=name)
            joint.append(_origin(link, pose_of(pose, refuse, name)))
        about = _below(xml, 'gazebo', link, reference=name)
        about.extend(each for each in link if each.tag not in _READ)
    return default


def _root_of(xml: ElementTree.Element) -> str | None:
    """The link that hangs from no other one, `world` also where the file does not have it."""
    parents, children = (
        [each.get('link', '') for each in xml.iterfind(f'joint/{side}')]
        for side in ('parent', 'child')
    )
    links = [*(link.get('name', '') for link in xml.findall('link')), *parents]
    return next((name for name in links if name not in children), None)


def _inertial(
    link: ElementTree.Element, given: ElementTree.Element | None, refuse: Refuse, name: str
) -> ElementTree.Element:
    """The `<inertial>` of a URDF for one of SDF, or for none."""
    at = link if given is None else given
    mass, frame, J = inertial_of(given, refuse, name)
    made = _made('inertial', at)
    made.append(_origin(at, frame))
    _below(made, 'mass', at, value=repr(mass))
    upper = J[np.triu_indices(3)].tolist()
    _below(made, 'inertia', at, **dict(zip(MOMENTS, map(repr, upper), strict=True)))
    return made


def _origin(at: ElementTree.Element, pose: FramePose) -> ElementTree.Element:
    rpy = Rotation.from_matrix(pose.turn).as_euler('xyz')
    texts = (' '.join(repr(float(x)) for x in part) for part in (pose.origin, rpy))
    return _made('origin', at, **dict(zip(('xyz', 'rpy'), texts, strict=True)))


def _below(
    parent: ElementTree.Element, tag: str, at: ElementTree.Element, **attributes: str
) -> ElementTree.Element:
    made = _made(tag, at, **attributes)
    parent.append(made)
    return made


def _made(tag: str, at: ElementTree.Element, **attributes: str) -> ElementTree.Element:
    """An element that stands where another one is in the file."""
    made = PlacedElement(tag, attributes)
    if isinstance(at, PlacedElement):
        made.file, made.line = at.file, at.line
    return made
