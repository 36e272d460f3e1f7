"""Imported robots in which a link almost without inertia turns freely between heavy ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved
from support.thorough import combined

ARM = (0.01, 0.02, 0.02, 0.0, 0.0, 0.0)  # kg m²
HEAD = (0.01, 0.01, 0.01, 0.0, 0.0, 0.0)


def robot(links: int, moment: float, collar: str = 'continuous') -> str:
    """Arms of 0.5 m, and a head on a neck of 1 g with this inertia: both turn about one axis."""
    parts, last = ['<link name="base"/>'], 'base'
    for k in range(links):
        axis = (0.0, 1.0, 0.0) if k % 2 else (0.0, 0.0, 1.0)
        parts.append(robots.link(f'arm{k}', (0.25, 0.0, 0.0), 1.0, ARM))
        parts.append(_pin(f'joint{k}', last, f'arm{k}', (0.5 if k else 0.0, 0.0, 0.0), axis))
        last = f'arm{k}'
    small = (moment,) * 3 + (0.0,) * 3
    up = (0.0, 0.0, 1.0)
    parts += [
        robots.link('neck', (0.0, 0.0, 0.0), 1e-3, small),
        _pin('collar', last, 'neck', (0.5, 0.0, 0.0), up, collar),
        robots.link('head', (0.1, 0.0, 0.0), 1.0, HEAD),
        _pin('yaw', 'neck', 'head', (0.0, 0.0, 0.05), up),
    ]
    return robots.robot(*parts)


def _pin(
    name: str,
    parent: str,
    child: str,
    at: tuple[float, ...],
    axis: tuple[float, ...],
    kind: str = 'continuous',
) -> str:
    x, y = (' '.join(map(str, each)) for each in (at, axis))
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x}"/><axis xyz="{y}"/></joint>'
    )


def turned(path: str, links: int, steps: int) -> tuple[Floats, int, float]:
    """rad of the joints of the arms and of the head beside the last arm; evaluations, and by how
    much the energy changed, J."""
    simulation = Simulation(scene_from_text(imported(path, scene=True)))
    before = simulation.sample().energy
    simulation.step(steps)
    sample = simulation.sample()
    joints = sample.joints
    head = joints['yaw'].position + (joints['collar'].position if 'collar' in joints else 0.0)
    angles = np.array([*(joints[f'joint{k}'].position for k in range(links)), head])
    return angles, simulation.evaluations, sample.energy - before


@pytest.mark.parametrize(('moment', 'links'), combined([1e-10, 1e-11, 1e-12], [2, 6]))
def test_a_light_neck_moves_as_if_it_were_fixed(links: int, moment: float, tmp_path: Path) -> None:
    """Nothing turns the neck, and nothing feels how it is turned. Its rows were counted as
    dependent, and the robot refused for lengths that contradict each other."""
    free = saved(tmp_path, 'free.urdf', robot(links, moment))
    fixed = saved(tmp_path, 'fixed.urdf', robot(links, moment, 'fixed'))
    found, evaluations, gained = turned(free, links, 300)
    wanted, fewest, _ = turned(fixed, links, 300)
    assert np.abs(found - wanted).max() < 1e-9
    assert abs(gained) < 1e-9
    assert evaluations <= 1.1 * fewest


@pytest.mark.parametrize('links', [2, 12])
@pytest.mark.parametrize('moment', [1e-13, 1e-15])
def test_a_neck_that_rounding_hides_is_named(links: int, moment: float, tmp_path: Path) -> None:
    """A run ended with loops that cannot be closed, or with lengths that contradict each other."""
    text = imported(saved(tmp_path, 'it.urdf', robot(links, moment)), scene=True)
    assert ': neck (joints collar, yaw)' in text
    with pytest.raises(AssemblyError, match='constraint: bodies neck, joints'):
        Simulation(scene_from_text(text))
