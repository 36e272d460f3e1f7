"""The elements and attributes that SDF has in worlds, models, links and joints: a report names
the others, and text where SDF has none.

Specification: sdformat.org, versions 1.4 to 1.12, and elements that `sdf_import` adds.
"""

from __future__ import annotations

from xml.etree import ElementTree

from alf_ros.exchange import unknown_elements
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.sdf_values import number, says
from alf_ros.exchange.sdf_versions import OF_MODEL

# by element the elements in it that SDF has
_ELEMENTS = {
    'sdf': ('world', 'model', 'actor', 'light', 'include'),
    'world': ('gravity', 'model', 'include', 'frame', 'joint', 'light', 'plugin', 'state', 'actor')
    + ('road', 'population', 'wind', 'physics', 'scene', 'gui', 'magnetic_field', 'atmosphere')
    + ('spherical_coordinates', 'audio'),
    'include': ('uri', 'name', 'pose', 'static', 'placement_frame', 'plugin', 'model_state'),
    'frame': ('pose',),
    'model': ('static', 'self_collide', 'allow_auto_disable', 'enable_wind', 'pose', 'frame')
    + ('include', 'model', 'link', 'joint', 'plugin', 'gripper', 'model_state', 'placement_frame'),
    'link': ('pose', 'inertial', 'gravity', 'enable_wind', 'self_collide', 'kinematic', 'light')
    + ('velocity_decay', 'must_be_base_link', 'collision', 'visual', 'sensor', 'projector')
    + ('audio_sink', 'audio_source', 'battery', 'particle_emitter'),
    'joint': ('pose', 'parent', 'child', 'axis', 'axis2', 'physics', 'sensor', 'gearbox_ratio')
    + ('gearbox_reference_body', 'thread_pitch', 'screw_thread_pitch'),
    'inertial': ('pose', 'mass', 'inertia', 'density', 'auto_inertia_params', 'fluid_added_mass'),
    'inertia': ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'),
    'axis': ('xyz', 'dynamics', 'limit', 'mimic', 'initial_position', OF_MODEL),
    'dynamics': ('damping', 'friction', 'spring_stiffness', 'spring_reference'),
    'limit': ('lower', 'upper', 'effort', 'velocity', 'stiffness', 'dissipation'),
    'mimic': ('multiplier', 'offset', 'reference'),
    'collision': ('pose', 'geometry', 'surface', 'density', 'auto_inertia_params', 'max_contacts')
    + ('laser_retro',),
    'geometry': ('empty', 'box', 'capsule', 'cone', 'cylinder', 'ellipsoid', 'heightmap', 'image')
    + ('mesh', 'plane', 'polyline', 'sphere'),
    'surface': ('bounce', 'friction', 'contact', 'soft_contact'),
    'friction': ('ode', 'bullet', 'torsional'),
    'ode': ('mu', 'mu2', 'fdir1', 'slip1', 'slip2'),
    'bullet': ('friction', 'friction2', 'fdir1', 'rolling_friction'),
}
_ELEMENTS['axis2'] = _ELEMENTS['axis']
# by element the attributes that it has
_ATTRIBUTES: dict[str, tuple[str, ...]] = dict.fromkeys(_ELEMENTS, ()) | {
    'sdf': ('version',),
    'world': ('name',),
    'include': ('merge', 'placement_frame'),
    'frame': ('name', 'attached_to'),
    'model': ('name', 'canonical_link', 'placement_frame'),
    'link': ('name',),
    'collision': ('name',),
    'joint': ('name', 'type'),
    'pose': ('relative_to', 'rotation_format', 'degrees'),
    'inertial': ('auto',),
    'mimic': ('joint', 'axis'),
    'xyz': ('expressed_in',),
}
_BELOW = frozenset(
    ('frame', 'include', 'pose', 'inertial', 'inertia', 'axis', 'axis2', 'xyz', 'dynamics')
    + ('limit', 'mimic', 'collision', 'geometry', 'surface', 'friction', 'ode', 'bullet')
)
# elements whose values are in elements, and the elements of numbers in them and elsewhere
_HOLDERS = frozenset(('inertial', 'inertia', 'axis', 'axis2', 'dynamics', 'limit', 'mimic'))
_VALUES = frozenset(
    tag
    for holder in ('inertia', 'dynamics', 'limit', 'mimic')
    for tag in (*_ELEMENTS[holder], 'mass', 'initial_position', OF_MODEL)
)
_SEVERAL = frozenset(
    ('frame', 'include', 'model', 'link', 'joint', 'plugin', 'gripper', 'model_state', 'sensor')
    + ('collision', 'visual', 'light', 'battery', 'particle_emitter', 'audio_source', 'world')
    + ('actor', 'state', 'road', 'population')
)
# elements that no reader here needs, for settings of solvers and of contact between bodies
_TRUTHS, _NUMBERS = ('self_collide', 'allow_auto_disable', 'must_be_base_link'), ('max_contacts',)


def leave_unknown(robot: Robot, element: ElementTree.Element, name: str) -> None:
    """Note what SDF does not have within an element of the file that has a name. Raises
    InputError for values that its format does not have."""
    for tag in _TRUTHS:
        says(element, tag, robot.error, name)
    for tag in _NUMBERS:
        number(element, tag, 0.0, robot.error, name)
    for tag, _ in unknown_elements.of(element, _ELEMENTS.get(element.tag, ()), _SEVERAL):
        if (element.tag, tag) != ('include', 'params'):  # which `sdf_import` lists
            robot.leave('unknown elements', f'{tag} of {name}')
    for attribute in unknown_elements.attributes(element, _ATTRIBUTES):
        robot.leave('unknown attributes', f'{attribute} of {name}')
    if element.tag in _HOLDERS and (text := unknown_elements.text(element)):
        robot.leave('unknown text', f'{text} of {name}')
    for each in element:
        if each.tag in _BELOW:
            leave_unknown(robot, each, name)
        if element.tag in _HOLDERS and each.tag in _VALUES:
            _leave_of_value(robot, each, name)


def _leave_of_value(robot: Robot, element: ElementTree.Element, name: str) -> None:
    """Note what an element has besides its value, which is its text."""
    for tag, _ in unknown_elements.of(element, (), ()):
        robot.leave('unknown elements', f'{tag} of {name}')
    for attribute in unknown_elements.attributes(element, {element.tag: ()}):
        robot.leave('unknown attributes', f'{attribute} of {name}')
