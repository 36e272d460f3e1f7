"""Links that an extension of Gazebo adds to a URDF: `<gazebo><link>`, as SDF has links.

Gazebo copies them into its model, where joints of extensions hold them, as in the grippers of the
PR2. Here each becomes a link of the URDF on a `floating` joint, so it is placed, and closes loops,
as all others do. What it has besides its pose and its inertia becomes an extension about it.
"""

from __future__ import annotations

from xml.etree import ElementTree

from scipy.spatial.transform import Rotation

from alf_ros.exchange.robot import FramePose, free_name
from alf_ros.exchange.sdf_frames import pose_of
from alf_ros.exchange.sdf_values import Refuse, name_of, number
from alf_ros.exchange.xml_file import PlacedElement

_MOMENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
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
    below = {child.get('link') for child in xml.iterfind('joint/child')}
    names = [link.get('name', '') for link in xml.findall('link')]
    root = next((name for name in names if name not in below), '')
    joints = [joint.get('name', '') for joint in xml.findall('joint')]
    default = []
    for extension, link in found:
        extension.remove(link)
        name = name_of(link, refuse)
        pose = link.find('pose')
        if pose is not None and pose.get('relative_to'):
            to = pose.get('relative_to')
            raise refuse(name, 'no frame for relative_to here', pose, value=to, expected='none')
        inertial = link.find('inertial')
        if inertial is None or inertial.find('mass') is None:
            default.append(name)
        own = _below(xml, 'link', link, name=name)
        own.append(_inertial(own, inertial, refuse, name))
        joints.append(free_name(f'{name}_free', joints))
        joint = _below(xml, 'joint', link, name=joints[-1], type='floating')
        _below(joint, 'parent', link, link=root)
        _below(joint, 'child', link, link=name)
        joint.append(_origin(link, pose_of(pose, refuse, name)))
        about = _below(xml, 'gazebo', link, reference=name)
        about.extend(each for each in link if each.tag not in _READ)
    return default


def _inertial(
    link: ElementTree.Element, given: ElementTree.Element | None, refuse: Refuse, name: str
) -> ElementTree.Element:
    """The `<inertial>` of a URDF for one of SDF, or for none."""
    at = link if given is None else given
    made = _made('inertial', at)
    pose, inertia = (None if given is None else given.find(tag) for tag in ('pose', 'inertia'))
    made.append(_origin(at, pose_of(pose, refuse, name)))
    _below(made, 'mass', at, value=repr(number(given, 'mass', 1.0, refuse, name)))
    moments = {
        key: repr(number(inertia, key, float(key[1] == key[2]), refuse, name)) for key in _MOMENTS
    }
    _below(made, 'inertia', at, **moments)
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
