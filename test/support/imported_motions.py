"""Shared parts of the tests of imported robots: the text as a simulation, and its motion."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.scene import scene_from_text

DURATION = 1.0  # s
XZ = np.eye(3)


def angles(simulation: Simulation, names: tuple[str, ...]) -> Floats:
    """(instants, joints) rad since the start."""
    found = [
        [sample.joints[name].position for name in names]
        for sample in simulation.run(DURATION, every=50)
    ]
    return np.array(found) - found[0]


def simulate(text: str) -> Simulation:
    return Simulation(scene_from_text(text), integrator='dop853', step=1e-3)


def saved(folder: Path, name: str, text: str) -> str:
    path = folder / name
    path.write_text(text, encoding='utf-8')
    return str(path)


def with_speed(text: str, point: str, along: tuple[float, float], turn: Floats = XZ) -> str:
    """A scene with the velocity of a point in the x-z plane, which `turn` (3, 3) turns: its
    largest component, because the others are rounded."""
    speed = turn @ (along[0], 0.0, along[1])
    largest = np.abs(speed) == np.abs(speed).max()
    given = ['~' if free else repr(float(x)) for x, free in zip(speed, ~largest, strict=True)]
    return f'{text}initial: {{velocities: {{{point}: [{", ".join(given)}]}}}}\n'


def check_four_bar(text: str, turn: Floats = XZ, within: float = 2e-8) -> None:
    """The motion of config/scenes/four_bar.yaml, 30 rad/s at the crank, in the x-z plane, which
    `turn` (3, 3) turns. within: rad."""
    ours = Simulation(load_scene('four_bar'), integrator='dop853', step=1e-3)
    names = ('crank_pin', 'knee', 'rocker_pin')
    speed = (-30 * 0.1 * math.sin(math.radians(60)), 30 * 0.1 * math.cos(math.radians(60)))
    theirs = simulate(with_speed(text, 'knee_at', speed, turn))
    expected = angles(ours, names)
    assert np.ptp(expected[:, 0]) > 20.0
    assert angles(theirs, names) == pytest.approx(expected, abs=within)
