"""A mass for the links of a robot file that states none, as files for viewers and planners do.

Where joints can be, how loops close, and how speeds depend on each other need no masses. Forces
and the time that a motion needs do, and the report says that they are not the robot's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros.exchange.robot import Robot

_RADIUS = 0.1  # of the robot's size: of the ball that each link is


def given(robot: Robot, mass: float) -> None:
    """Make each part a ball of so much mass (kg) in the middle of its joints, if none has any."""
    if any(part.mass or part.inertia.any() for part in robot.parts):
        robot.leave('masses of the file', f'{mass:g} kg')
        return
    inertia = 0.4 * mass * (_RADIUS * (robot.size or 1.0)) ** 2 * np.eye(3)
    for n, part in enumerate(robot.parts):
        places = [c.place for c in robot.connections if part.name in (c.parent, c.child)]
        com = np.mean(places or [part.origin], axis=0)
        robot.parts[n] = replace(part, mass=mass, com=com, inertia=inertia)
        robot.leave('masses, given', part.name)
        robot.left_out.remove('mass: there is none', part.name)
