"""Files for viewers state no masses: with `--mass` their loops close as with real masses."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import support.imported_robots as robots
from alf_ros import Closure, InputError
from alf_ros.commands.import_ import main
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import Scene, scene_from_text
from support.imported_motions import saved

FOUR_BAR = robots.four_bar(robots.BY_GAZEBO)


def bare(urdf: str) -> str:
    return re.sub('<inertial>.*?</inertial>', '', urdf, flags=re.DOTALL)


def scene(text: str) -> Scene:
    return scene_from_text('mechanism:\n' + ''.join(f'  {line}\n' for line in text.split('\n')))


def test_a_loop_without_masses_closes_as_with_them(tmp_path: Path) -> None:
    found = []
    for urdf, mass in ((FOUR_BAR, None), (bare(FOUR_BAR), 0.7)):
        text = imported(saved(tmp_path, 'it.urdf', urdf), mass=mass)
        assert ('masses, given' in text) == (mass is not None)
        closed = Closure(scene(text), ['crank_pin']).close({'crank_pin': 0.2})
        found.append([closed.joints[name] for name in ('knee', 'wrist', 'rocker_pin')])
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)


@pytest.mark.parametrize(
    ('urdf', 'message'),
    [
        (FOUR_BAR, 'no part that can move has mass'),
        (robots.double_pendulum(), 'joints elbow, shoulder move no mass'),
    ],
)
def test_without_a_mass_it_is_refused_with_the_cure(
    urdf: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=f'{message}; expected mass .*or --mass KG'):
        imported(saved(tmp_path, 'it.urdf', bare(urdf)))


def test_masses_of_the_file_count(tmp_path: Path) -> None:
    urdf = saved(tmp_path, 'it.urdf', FOUR_BAR)
    plain, given = imported(urdf), imported(urdf, mass=0.7)
    told = '#   masses of the file: they count, and none is given: 0.7 kg'
    more = set(given.splitlines()) - set(plain.splitlines())
    assert more == {'# Changes of readings only:', told}


@pytest.mark.parametrize('mass', ['0', '-1'])
def test_no_mass(mass: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f'--mass: not a mass, got {float(mass)}'):
        main([saved(tmp_path, 'it.urdf', bare(FOUR_BAR)), f'--mass={mass}'])
