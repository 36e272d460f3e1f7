"""Links without mass at the ends of a robot: frames of tools and cameras on joints that move.

Nothing hangs from them and nothing holds them, so that how they move is not determined and moves
nothing else. They are left out with their joints, and so is what hung from them alone. The parts
that they hang from get their shapes. A joint of them that is coupled to one that moves mass, or
that has a rotor, moves with that, and stays. Fingers of which none has mass are left out with
their couplings.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

from alf_ros.exchange.robot import Robot


def left_out(robot: Robot) -> None:
    """Take such parts and their joints out of a robot."""
    held = _held(robot)
    robot.couplings = [each for each in robot.couplings if held.issuperset(each.of)]
    while True:
        ends = _ends(robot, held)
        if not ends:
            return
        parts = {part for part, _ in ends}
        joints = {joint for _, joint in ends}
        sides = {each.name: (each.parent, each.child) for each in robot.connections}
        above = {part: next(x for x in sides[joint] if x != part) for part, joint in ends}
        robot.shapes = [(above.get(part, part), shape) for part, shape in robot.shapes]
        robot.touches = [
            replace(each, part=above.get(each.part, each.part)) for each in robot.touches
        ]
        for name in sorted(joints):
            robot.leave('joints of massless ends', name)
        for name in parts:
            robot.left_out.remove('mass: there is none', name)
        robot.parts = [part for part in robot.parts if part.name not in parts]
        robot.connections = [each for each in robot.connections if each.name not in joints]
        robot.actuators = [
            each for each in robot.actuators if each.on_tendon or each.joint not in joints
        ]


def _held(robot: Robot) -> set[str]:
    """Joints that couplings connect with one that is not of such an end."""
    at_ends, parts = set[str](), set[str]()
    while more := {end for end in _ends(robot, set(), parts) if end[0] not in parts}:
        parts |= {part for part, _ in more}
        at_ends |= {joint for _, joint in more}
    held = set[str]()
    while (
        more_held := {
            name
            for each in robot.couplings
            if not held.isdisjoint(each.of) or not at_ends.issuperset(each.of)
            for name in each.of
        }
        - held
    ):
        held |= more_held
    return held


def _ends(robot: Robot, held: set[str], without: Container[str] = ()) -> list[tuple[str, str]]:
    """Parts without mass that one connection alone holds, each with the connection; without the
    connections of some parts."""
    at: dict[str, list[str]] = {}
    for each in robot.connections:
        if each.parent not in without and each.child not in without:
            for side in (each.parent, each.child):
                at.setdefault(side, []).append(each.name)
    rotors = {each.name for each in robot.connections if each.armature}
    found = []
    for part in robot.parts:
        joints = at.get(part.name, [])
        if part.mass == 0.0 and len(joints) == 1 and joints[0] not in held | rotors:
            found.append((part.name, joints[0]))
    return found
