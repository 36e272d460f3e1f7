"""Positions and velocities of joints at the start, in a USD stage.

PhysX has them in the schema `PhysxJointStateAPI`, and Newton in attributes without one. The bodies
of a stage are drawn somewhere already, and have velocities of their own: these count.
"""

from __future__ import annotations

import math

from alf_ros.exchange.robot import Robot
from alf_ros.exchange.usd_joints import UsdJoint
from alf_ros.exchange.usd_stage import UsdStage

_OFF = 1e-5  # rad, or of the unit of length: seven digits are written


def leave(stage: UsdStage, robot: Robot, joint: UsdJoint, drawn: float) -> None:
    """List the state of a joint that is at `drawn` (rad, m), if it differs. Raises InputError."""
    turns = joint.kind == 'revolute'
    unit = math.radians(1.0) if turns else stage.metre
    short = 'angular' if turns else 'linear'
    for name in dict.fromkeys((joint.degree, short)):
        for prefix in (f'state:{name}:physics', f'newton:{name}'):
            if stage.is_authored(joint.prim, f'{prefix}:position'):
                at = unit * stage.number(joint.prim, f'{prefix}:position')
                if abs(at - drawn) > _OFF * max(1.0 if turns else stage.metre, abs(drawn)):
                    robot.leave('positions of joints', f'{joint.name} at {at:g}')
            if stage.number(joint.prim, f'{prefix}:velocity'):
                robot.leave('velocities of joints', joint.name)


def leave_several(stage: UsdStage, robot: Robot, joint: UsdJoint) -> None:
    """List the state of a joint with several coordinates, if it is not zero. Raises InputError."""
    for name in joint.free:
        for prefix in (f'state:{name}:physics', f'newton:{name}'):
            for key, kind in (('position', 'positions'), ('velocity', 'velocities')):
                if stage.number(joint.prim, f'{prefix}:{key}'):
                    robot.leave(f'{kind} of joints', joint.name)
