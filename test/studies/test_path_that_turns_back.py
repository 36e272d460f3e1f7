"""optimise for a path that is nearest to a place where the point of the mechanism turns back.

There it stands still for an instant, and numbers of the scene change how far it comes."""

from __future__ import annotations

import math
from typing import Any

import pytest

from alf_ros import Scene, load_scene, optimise
from alf_ros.studies.optimisation.design_goal import design_goal
from alf_ros.studies.optimisation.design_numbers import design_numbers
from alf_ros.studies.optimisation.driven_design import DrivenDesign
from alf_ros.studies.optimisation.free_design import FreeDesign

ASIDE = 0.3  # m, of the place from the line of the motion


def slider() -> Scene:
    """The crank swings through 0, where the slider is at 2 L."""
    return load_scene(
        {
            'mechanism': 'slider_crank',
            'drives': {'motor': {'joint': 'crank_pin', 'angle': 'pi/4*cos(2*pi*t)'}},
            'solver': {'step': 0.01, 'integrator': 'rk4'},
        }
    )


def pendulum() -> Scene:
    """Released from the horizontal, it turns back at the other side, at L."""
    return load_scene(
        {
            'mechanism': 'pendulum',
            'effects': {'gravity': {'acceleration': [0, -9.81]}},
            'solver': {'step': 0.01, 'integrator': 'dop853'},
        }
    )


def distance(reach: float, at: float) -> float:
    """m, from the place to the point that turns back."""
    return math.hypot(reach - at, ASIDE)


def goal_at(x: float, point: str) -> dict[str, Any]:
    """The path should go through a place beside the line of the motion."""
    return {'path': point, 'through': [[x, ASIDE]]}


def test_the_gradient_where_a_driven_point_turns_back() -> None:
    """d = |(2 L, 0) - place|: dd/dL = 2 (2 L - x) / d."""
    scene = slider()
    numbers = design_numbers(scene, {'L': [0.8, 1.4]})
    motion = DrivenDesign(numbers, numbers.before, 0.5, 0.02)
    goal = design_goal(goal_at(2.5, 'B'), 'minimise', motion.samples[0], 0.5)
    found, away = goal.of(motion), distance(2.0, 2.5)
    assert found.value == pytest.approx(away, rel=1e-9)
    assert found.gradient[0] == pytest.approx(2.0 * (2.0 - 2.5) / away, rel=1e-6)


def test_the_gradient_where_a_falling_point_turns_back() -> None:
    """d = |(L, 0) - place|: dd/dL = (L - x) / d."""
    numbers = design_numbers(pendulum(), {'L': [0.5, 2.0]})
    motion = FreeDesign(numbers, numbers.before, 1.5, 0.01)
    goal = design_goal(goal_at(1.2, 'A'), 'minimise', motion.samples[0], 1.5)
    found, away = goal.of(motion), distance(1.0, 1.2)
    assert found.value == pytest.approx(away, rel=1e-6)
    assert found.gradient[0] == pytest.approx((1.0 - 1.2) / away, rel=1e-4)


def test_a_slider_that_should_come_further() -> None:
    """The optimum is L = 1.25: the slider comes beside the place."""
    goal = goal_at(2.5, 'B')
    found = optimise(slider(), {'L': [0.8, 1.4]}, goal, duration=0.5, period=0.02)
    assert found.settled
    assert found.values[0] == pytest.approx(1.25, rel=1e-6)
    assert found.objective_after == pytest.approx(ASIDE, rel=1e-9)
