"""The elements that SDF has in models, links and joints: a report names the others.

Specification: sdformat.org, versions 1.4 to 1.12, and elements that `sdf_import` adds.
"""

from __future__ import annotations

from xml.etree import ElementTree

from alf_ros.exchange import unknown_elements
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.sdf_versions import OF_MODEL

# by element the elements in it that SDF has
_ELEMENTS = {
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
}
_ELEMENTS['axis2'] = _ELEMENTS['axis']
_BELOW = ('inertial', 'inertia', 'axis', 'axis2', 'dynamics', 'limit', 'mimic')
_SEVERAL = frozenset(
    ('frame', 'include', 'model', 'link', 'joint', 'plugin', 'gripper', 'model_state', 'sensor')
    + ('collision', 'visual', 'light', 'battery', 'particle_emitter', 'audio_source')
)


def leave_unknown(robot: Robot, element: ElementTree.Element, name: str) -> None:
    """Note elements that SDF does not have within a model, a link or a joint that has a name."""
    known = _ELEMENTS[element.tag]
    for tag, _ in unknown_elements.of(element, known, _SEVERAL):
        robot.leave('unknown elements', f'{tag} of {name}')
    for each in element:
        if each.tag in known and each.tag in _BELOW:
            leave_unknown(robot, each, name)
