"""Actuators of a URDF: `<transmission>` of ROS 1, `<ros2_control>` of ROS 2.

Both name joints and interfaces, not gains: a motor on such a joint has the effort limit of the
joint, and applies no force until a scene or a topic commands one.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree

from alf_ros.exchange.robot import Actuator, Robot


def initial_positions(xml: ElementTree.Element) -> dict[str, str]:
    """The `initial_value` of the position of each joint in <ros2_control>, as it is written."""
    found = {}
    for joint in xml.findall('ros2_control/joint'):
        for state in joint.findall('state_interface'):
            for each in state.findall('param'):
                if state.get('name') == 'position' and each.get('name') == 'initial_value':
                    found[joint.get('name', '')] = (each.text or '').strip()
    return found


def add(robot: Robot, xml: ElementTree.Element, limits: dict[str, float | None]) -> None:
    """Add a motor for each joint that an actuator pushes.

    limits: of effort, N m or N, by joint; joints that do not move are not among them.
    """
    seen = set()
    for joint, effort in (*_transmissions(xml), *_controlled(xml)):
        if joint not in limits or joint in seen:
            if joint not in limits:
                robot.leave('actuators', joint)
            continue
        seen.add(joint)
        robot.actuators.append(Actuator(f'{joint}_motor', joint, limit=limits[joint]))
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
