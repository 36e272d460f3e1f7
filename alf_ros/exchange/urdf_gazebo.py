"""The extensions of Gazebo in a URDF, except its joints, which `urdf_loops` reads.

Gazebo knows some of them, and copies the others into its model as they are.
"""

from __future__ import annotations

from collections.abc import Collection
from xml.etree import ElementTree

from alf_ros.exchange.robot import Robot
from alf_ros.exchange.sdf_values import Refuse, is_true, numbers

# without an effect on the motion, besides contact
_HARMLESS = (
    *('material', 'visual', 'collision', 'sensor', 'light', 'projector', 'audio_sink', 'battery'),
    *('mu1', 'mu2', 'fdir1', 'kp', 'kd', 'maxVel', 'minDepth', 'maxContacts', 'laserRetro'),
    *('selfCollide', 'self_collide', 'provideFeedback', 'canonicalBody', 'preserveFixedJoint'),
    *('disableFixedJointLumping', 'cfmDamping', 'implicitSpringDamper', 'fudgeFactor'),
    *('must_be_base_link', 'allow_auto_disable'),
)
_UNLESS = ('static', 'kinematic', 'enable_wind')  # harmless unless it is so
_FRICTION = ('mu1', 'mu2')
_GRAVITY = ('gravity', 'turnGravityOff')
_SPRING = ('springStiffness', 'springReference')
_NO = ('false', 'no', '0')  # any other word turns gravity off
_YES = ('true', 'yes', '1')


def weightless(xml: ElementTree.Element, refuse: Refuse) -> set[str]:
    """The links without gravity. Raises the error for a <gravity> that SDF does not have."""
    found = set()
    for about, element in _of_extensions(xml):
        if element.tag == 'gravity':
            off = not is_true(element.text, refuse, about, element, default=True)
        else:
            off = element.tag == 'turnGravityOff' and _word(element) not in _NO
        if off:
            found.add(about)
    return found


def springs(xml: ElementTree.Element, refuse: Refuse) -> dict[str, tuple[float, float]]:
    """By joint the stiffness of its spring, N m/rad or N/m, and the coordinate at which it rests.
    Raises the error for a text that is no number."""
    found: dict[str, dict[str, float]] = {}
    for about, element in _of_extensions(xml):
        if element.tag in _SPRING:
            given = numbers(element.text or '', 1, refuse, about, element)
            found.setdefault(about, {})[element.tag] = float(given[0])
    stiffness, rest = _SPRING
    return {joint: (of.get(stiffness, 0.0), of.get(rest, 0.0)) for joint, of in found.items()}


def frictions(xml: ElementTree.Element) -> dict[str, dict[str, ElementTree.Element]]:
    """By link the elements of the coefficients of friction, `mu1` and `mu2`."""
    found: dict[str, dict[str, ElementTree.Element]] = {}
    for about, element in _of_extensions(xml):
        if element.tag in _FRICTION and (element.text or '').strip():
            found.setdefault(about, {})[element.tag] = element
    return found


def leave(
    robot: Robot, xml: ElementTree.Element, links: Collection[str], sprung: Collection[str]
) -> None:
    """Note the extensions that are not read. links: the names of all; sprung: of the joints whose
    springs are read."""
    for extension in xml.findall('gazebo'):
        about = extension.get('reference')
        for element in extension:
            if element.tag == 'plugin':
                robot.leave('plugins', element.get('name', ''))
            elif element.tag in _GRAVITY and about in links:
                continue
            elif element.tag in _SPRING and about in sprung:
                continue
            elif element.tag != 'joint' or about is not None:
                is_lost = element.tag in _FRICTION and about not in links
                harmless = _is_harmless(element) and not is_lost
                kind = 'gazebo' if harmless else 'physics of Gazebo'
                robot.leave(kind, f'{_called(element)} of {about or "the robot"}')


def _of_extensions(xml: ElementTree.Element) -> list[tuple[str, ElementTree.Element]]:
    """The elements of extensions, each after the name of the link or joint that has it."""
    extensions = xml.findall('gazebo')
    return [(about, each) for one in extensions for each in one if (about := one.get('reference'))]


def _is_harmless(element: ElementTree.Element) -> bool:
    """Whether the motion is the same without it."""
    tag = _called(element)
    if tag in _UNLESS:
        return _word(element) not in _YES
    if tag == 'collision':
        return element.find('surface') is None
    return tag in _HARMLESS or tag.startswith('sensor:')


def _word(element: ElementTree.Element) -> str:
    return (element.text or '').strip().lower()


def _called(element: ElementTree.Element) -> str:
    """Its tag, with the last word of the name space before it: `sensor:camera`."""
    space, _, tag = element.tag.rpartition('}')
    prefix = space.rpartition('#')[2].rpartition(':')[2]
    return f'{prefix}:{tag}' if space else tag
