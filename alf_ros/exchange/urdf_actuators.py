"""Actuators of a URDF: `<transmission>` of ROS 1, `<ros2_control>` of ROS 2.

Both name joints and interfaces, not gains: a motor on such a joint has the effort limit of the
joint, and applies no force until a scene or a topic commands one. As in ros_control and
ros2_control, commands and limits belong to the joint. A reduction n gives the joint n times the
effort of the motor before it; it changes no command here, and is listed. In files of Drake the
joint feels the inertia of a rotor times the square of the reduction.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Iterator
from xml.etree import ElementTree

from alf_ros.exchange import urdf_numbers
from alf_ros.exchange.robot import Actuator, Robot
from alf_ros.scene.text.decimal_numbers import decimal

_REDUCTIONS = ('mechanicalReduction', 'mechanical_reduction', 'gear_ratio')
_ROTORS = ('motorInertia', 'rotor_inertia')
_DRAKE = ('http://drake.mit.edu', 'undeclared:drake')
_CONSTANTS = ('motorTorqueConstant', 'motor_torque_constant')  # N m per ampere
_ENDS = ('min', 'max')  # of commands
_YES = ('true', 'True', '1')
_STARTS = (
    ('initial_position', 'positions of joints'),
    ('initial_velocity', 'velocities of joints'),
)


def initial_positions(xml: ElementTree.Element) -> dict[str, list[ElementTree.Element]]:
    """The `initial_value` of the position of each joint in <ros2_control>: its elements, several
    if the file names the joint several times."""
    found: dict[str, list[ElementTree.Element]] = {}
    for joint in xml.findall('ros2_control/joint'):
        for state in joint.findall('state_interface'):
            for each in state.findall('param'):
                if state.get('name') == 'position' and each.get('name') == 'initial_value':
                    found.setdefault(joint.get('name', ''), []).append(each)
    return found


def armatures(robot: Robot, xml: ElementTree.Element) -> dict[str, float]:
    """The inertia of rotors as their joints feel it, kg m^2 or kg, where the file states it as
    Drake does. Raises InputError for a value that is no such number."""
    found: dict[str, float] = {}
    for transmission in xml.findall('transmission'):
        joints = [joint.get('name', '') for joint in transmission.findall('joint')]
        for actuator in transmission.findall('actuator'):
            inertia = _of_drake(robot, actuator, 'rotor_inertia')
            if inertia is not None and len(joints) == 1:
                ratio = _of_drake(robot, actuator, 'gear_ratio')
                felt = inertia * (1.0 if ratio is None else ratio**2)
                found[joints[0]] = found.get(joints[0], 0.0) + felt
    return found


def _of_drake(robot: Robot, actuator: ElementTree.Element, name: str) -> float | None:
    """The value of an element of Drake in an actuator, or None. Raises InputError."""
    tags = [f'{{{of}}}{name}' for of in _DRAKE]
    at = next((each for each in actuator if each.tag in tags), None)
    value = None if at is None else at.get('value')
    if value is None:
        return None
    fault, expected = urdf_numbers.fault(value, 1), 'a number'
    if fault is None and name == 'rotor_inertia' and decimal(value) < 0.0:
        fault, expected = 'negative', '0 or more'
    if fault is not None:
        key = f'actuator {actuator.get("name", "")}: drake:{name}'
        raise robot.error(key, fault, at, value=value, expected=expected)
    return decimal(value)


def leave(
    robot: Robot,
    xml: ElementTree.Element,
    mimics: Container[str],
    with_rotors: Collection[str],
) -> None:
    """Note their other contents; `mimics`: joints that mimic others already; with_rotors: joints
    that have their `armatures`."""
    placed = initial_positions(xml)
    for joint in xml.findall('ros2_control/joint'):
        name = joint.get('name', '')
        given = {each.get('name', ''): each.text or '' for each in joint.findall('param')}
        if name not in mimics and ('mimic' in given or joint.get('mimic') in _YES):
            robot.leave('mimic', name)
        for key, kind in _STARTS:  # of early versions, and of drivers
            if name not in placed and not _is(given.get(key, ''), 0.0):
                robot.leave(kind, name)
        for state in joint.findall('state_interface'):
            begins = any(each.get('name') == 'initial_value' for each in state.findall('param'))
            if begins and state.get('name') == 'velocity':
                robot.leave('velocities of joints', name)
        _leave_of_motors(robot, name, given)
        for command in joint.findall('command_interface'):
            if any(each.get('name') in _ENDS for each in command.findall('param')):
                robot.leave('limits of commands', f'{name} ({command.get("name")})')
    for transmission in (*xml.findall('transmission'), *xml.findall('ros2_control/transmission')):
        names = [joint.get('name', '') for joint in transmission.findall('joint')]
        counted = len(names) == 1 and names[0] in with_rotors
        told = [each for each in transmission.iter() if not (counted and _is_of_drake(each))]
        tags = {each.tag.rpartition('}')[2] for each in told}
        for name in names:
            _leave_of_motors(robot, name, tags)
        reduced = [text for text in _reductions(told) if not _is(text, 1.0)]
        if reduced:
            by = f'{", ".join(names)} by {", ".join(reduced)}'
            robot.leave('reductions of transmissions', by)


def _leave_of_motors(robot: Robot, joint: str, told: Container[str]) -> None:
    """Note numbers of the motor of a joint; `told`: names of all that the file says of it."""
    for kind, names in (
        ('rotors of transmissions', _ROTORS),
        ('constants of motors', _CONSTANTS),
    ):
        if any(name in told for name in names):
            robot.leave(kind, joint)


def _is_of_drake(element: ElementTree.Element) -> bool:
    return element.tag.rpartition('}')[0].removeprefix('{') in _DRAKE


def _reductions(elements: Iterable[ElementTree.Element]) -> Iterator[str]:
    """The reductions among the elements of a transmission, as they are written."""
    for each in elements:
        tag = each.tag.rpartition('}')[2]
        if tag in _REDUCTIONS:
            yield (each.text or each.get('value') or '').strip()


def _is(text: str, value: float) -> bool:
    """Whether a text is this number, or empty."""
    try:
        return decimal(text.strip() or repr(value)) == value
    except ValueError:
        return False


def add(robot: Robot, xml: ElementTree.Element, limits: dict[str, float | None]) -> None:
    """Add a motor for each joint that an actuator pushes.

    limits: of effort, N m or N, by joint; joints that do not move are not among them. Raises
    InputError for a negative one.
    """
    seen = set()
    for joint, effort in (*_transmissions(xml), *_controlled(xml)):
        if joint not in limits or joint in seen:
            if joint not in limits:
                robot.leave('actuators', joint)
            continue
        seen.add(joint)
        limit = limits[joint]
        if limit is not None and limit < 0.0:
            at = next((each for each in xml.findall('joint') if each.get('name') == joint), None)
            at = at if at is None else at.find('limit')
            raise robot.error(joint, 'negative effort', at, value=limit, expected='0 or more')
        robot.actuators.append(Actuator(f'{joint}_motor', joint, limit=limit))
        if not effort:
            robot.leave('gains of actuators', joint)


def _transmissions(xml: ElementTree.Element) -> Iterator[tuple[str, bool]]:
    """Joint, and whether its commands are efforts."""
    for transmission in xml.findall('transmission'):
        for joint in transmission.findall('joint'):
            told = [each.text or '' for each in transmission.iter('hardwareInterface')]
            yield joint.get('name', ''), any('effort' in each.lower() for each in told)


def _controlled(xml: ElementTree.Element) -> Iterator[tuple[str, bool]]:
    for joint in xml.findall('ros2_control/joint'):
        told = [each.get('name', '') for each in joint.findall('command_interface')]
        if told:
            yield joint.get('name', ''), 'effort' in told
