"""Friction under a load that rigid bodies leave open: either hinge carries the weight."""

from __future__ import annotations

import pytest

from alf_ros import Simulation
from alf_ros.inspection.answer import NOTE
from alf_ros.inspection.soundness import examine
from alf_ros.ros.simulator import diagnostics
from alf_ros.scene.scene import scene_from_text

DOOR = """
mechanism:
  alf: 1
  space: spatial
  points:
    Low: {at: [0, 0, 0], fixed: true}
    High: {at: [0, 0, 2], fixed: true}
    Edge: {at: [0.9, 0, 1]}
  bodies:
    door:
      {points: [Low, High, Edge], mass: 30, inertia: {about_com: [10, 2, 12]}, com: [1, 0.45, 0]}
  joints:
    low: {type: revolute, between: [ground, door], at: Low, axis: [0, 0, 1]}
    high: {type: revolute, between: [ground, door], at: High, axis: [0, 0, 1]}
effects:
  gravity: {acceleration: [0, 0, -9.81]}
  joint_friction: {joint: low, dynamic: 0.1, radius: 0.01LOAD}
"""


@pytest.mark.parametrize('load', ['', ', load: 20'], ids=['open', 'given'])
def test_a_motion_that_follows_one_of_many_loads_is_told(load: str) -> None:
    scene = scene_from_text(DOOR.replace('LOAD', load))
    simulation = Simulation(scene)
    simulation.step(5)
    sample = simulation.sample()
    report = diagnostics.constraints(sample)
    found = [each for each in examine(scene).answers if each.question == 'friction']
    if load:
        assert sample.open_loads == () and report.level == diagnostics.OK and not found
        return
    assert sample.open_loads == ('joint_friction',)
    assert report.level == diagnostics.WARN
    assert 'joint_friction: the load is one of many that balance' in report.message
    assert [each.verdict for each in found] == [NOTE]
    assert found[0].answer.startswith('joint_friction: loads that are not determined')
