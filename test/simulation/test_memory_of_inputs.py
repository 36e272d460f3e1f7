"""Inputs with ever other numbers: no result of them is remembered."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.mechanism.memory import ResultMemory
from support.thorough import thinned


def remembered() -> int:
    """Results that the process remembers."""
    return sum(len(each._known) for each in gc.get_objects() if type(each) is ResultMemory)


@pytest.mark.parametrize(
    'scene',
    thinned(
        ['slider_crank', 'delta_robot_controlled', 'stewart_platform'],
        keep=['slider_crank', 'delta_robot_controlled'],
    ),
)
def test_no_command_is_remembered(scene: str) -> None:
    simulation = Simulation(load_scene(scene))
    model, random = simulation.model, np.random.default_rng(1)
    space = model.layout.dimension == 3

    def command() -> None:
        for body in model.body_names:
            force = tuple(random.normal(size=3 if space else 2))
            torque = tuple(random.normal(size=3)) if space else random.normal()
            if model.layout.turns(body):
                simulation.apply_wrench(body, force, torque, frame='body')
                simulation.step(0)
            else:
                torque = (0.0, 0.0, 0.0) if space else 0.0
            simulation.apply_wrench(body, force, torque)
            simulation.step(0)
        for coordinate in model.coordinates:
            simulation.apply_effort(coordinate.name, random.normal())
            simulation.step(0)

    command()
    before = remembered()
    for _ in range(3):
        command()
    assert remembered() == before
