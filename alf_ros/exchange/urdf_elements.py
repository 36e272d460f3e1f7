"""The elements and attributes that URDF has in robots, links and joints: a report names the
others, and text where URDF has none.

Specification: wiki.ros.org/urdf/XML, and extensions that other modules here read.
"""

from __future__ import annotations

from xml.etree import ElementTree

from alf_ros.exchange import unknown_elements
from alf_ros.exchange.robot import Robot

# by element the elements in it that are read, or named one by one
_READ = {
    'robot': ('link', 'joint', 'gazebo', 'constraint', 'material', 'transmission', 'ros2_control'),
    'link': ('inertial', 'visual', 'collision'),
    'joint': ('parent', 'child', 'origin', 'axis', 'limit', 'dynamics', 'mimic')
    + ('calibration', 'safety_controller'),
    'inertial': ('origin', 'mass', 'inertia'),
    'collision': ('origin', 'geometry', 'material'),
    'geometry': ('box', 'cylinder', 'sphere', 'mesh', 'capsule'),
}
# by element of a link or a joint the attributes that it has
_ATTRIBUTES = {
    'link': ('name',),
    # Isaac keeps the link of a fixed joint with `dont_collapse`, which moves nothing
    'joint': ('name', 'type', 'dont_collapse'),
    'inertial': (),
    'mass': ('value',),
    'inertia': ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'),
    'origin': ('xyz', 'rpy'),
    'axis': ('xyz',),
    'parent': ('link',),
    'child': ('link',),
    'limit': ('lower', 'upper', 'effort', 'velocity'),
    'dynamics': ('damping', 'friction'),
    'mimic': ('joint', 'multiplier', 'offset'),
    'collision': ('name',),
    'geometry': (),
    'box': ('size',),
    'sphere': ('radius',),
    'cylinder': ('radius', 'length'),
    'capsule': ('radius', 'length'),
    'mesh': ('filename', 'scale'),
}
# elements whose values are attributes: they have nothing inside
_PLAIN = {'mass', 'inertia', 'origin', 'axis', 'parent', 'child', 'limit', 'dynamics', 'mimic'}
_SEVERAL_OF = (*_READ['robot'], 'visual', 'collision')
_HARMLESS = ('sensor', 'self_filter', 'collision_checking', 'self_collision_checking', 'verbose')
# of `<compiler>` in the extension `<mujoco>`: where meshes are, and what is shown
_OF_MESHES = {'meshdir', 'strippath', 'discardvisual', 'fusestatic'}


def leave_unknown(robot: Robot, xml: ElementTree.Element) -> None:
    """Note what URDF does not have within the root element of a file."""
    for element in (xml, *xml):
        if element.tag not in _READ:
            continue
        for tag, each in unknown_elements.of(element, _READ[element.tag], _SEVERAL_OF):
            called = each.get('name', '') if element is xml else f'of {element.get("name", "")}'
            _leave(robot, each, f'{tag} {called}'.strip())
        if element is not xml:
            _leave_inside(robot, element)


def _leave_inside(robot: Robot, element: ElementTree.Element) -> None:
    """Note what URDF does not have further inside a link or a joint."""
    name = element.get('name', '')
    inner = [each for each in element if each.tag in ('inertial', 'collision')]
    inner += element.findall('collision/geometry')
    parts = [*element, *(part for one in inner for part in one)]
    plain = [each for each in parts if each.tag in _PLAIN]
    for each in (*inner, *plain):
        for tag, unknown in unknown_elements.of(each, _READ.get(each.tag, ()), ()):
            _leave(robot, unknown, f'{tag} of {name}')
    for each in plain:
        if text := unknown_elements.text(each):
            robot.leave('unknown text', f'{text} of {name}')
    for each in (element, *parts):
        for attribute in unknown_elements.attributes(each, _ATTRIBUTES):
            robot.leave('unknown attributes', f'{attribute} of {name}')


def _leave(robot: Robot, element: ElementTree.Element, called: str) -> None:
    robot.leave('elements' if _is_harmless(element) else 'unknown elements', called)


def _is_harmless(element: ElementTree.Element) -> bool:
    """Whether an element that URDF does not have moves nothing."""
    inside = [*element.iter()][1:]
    only_shows = all(
        each.tag == 'compiler' and _OF_MESHES.issuperset(each.keys()) for each in inside
    )
    return element.tag in _HARMLESS or (element.tag == 'mujoco' and only_shows)
