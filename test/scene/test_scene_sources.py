"""A scene is given as a Scene, by name, as a file or as a mapping, to all that take one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from alf_ros import (
    Closure,
    Ensemble,
    InputError,
    Simulation,
    branches,
    equilibria,
    equilibrium,
    equilibrium_path,
    fastest,
    floquet,
    linearise,
    load_scene,
    loads,
    modes,
    recorded,
)
from alf_ros.simulation.sensors import Sensors
from support.thorough import thinned

FREE: dict[str, Any] = {
    'mechanism': 'four_bar',
    'effects': {'gravity': {'acceleration': [0, -9.81]}},
    'sensors': {'encoder': {'joint': 'knee'}},
    'solver': {'step': 0.01, 'integrator': 'rk4'},
}
DRIVEN = {**FREE, 'drives': {'turn': {'joint': 'crank_pin', 'angle': 'pi/3 + 0.1*t'}}}
SINGULAR = {'mechanism': 'slider_crank', 'initial': {'positions': {'A': [0, 1], 'B': [0, 0]}}}
USES: dict[str, tuple[dict[str, Any], Callable[[Any], Any]]] = {
    'Simulation': (DRIVEN, lambda scene: Simulation(scene).state.q),
    'Sensors': (FREE, lambda scene: len(Sensors(scene).sensors)),
    'Ensemble': (FREE, lambda scene: Ensemble(scene, 2).observe()),
    'equilibrium': (FREE, lambda scene: equilibrium(scene).q),
    'equilibria': (FREE, lambda scene: equilibria(scene, starts=1)[0].q),
    'equilibrium_path': (
        FREE,
        lambda scene: equilibrium_path(scene, over='crank_pin.effort', end=0.01).values,
    ),
    'linearise': (FREE, lambda scene: linearise(scene).A),
    'modes': (FREE, lambda scene: modes(scene).frequencies),
    'loads': (DRIVEN, lambda scene: loads(scene, times=[0.0, 0.5])['crank_pin']),
    'fastest': (
        DRIVEN,
        lambda scene: fastest(scene, {'crank_pin': 20.0}, length=1.0, pieces=10).t,
    ),
    'branches': (SINGULAR, lambda scene: str(branches(scene).as_data())),
}


@pytest.mark.parametrize(
    'name', thinned(USES, lambda name: name not in ('equilibria', 'equilibrium_path'))
)
def test_a_scene_a_file_and_a_mapping_are_one(name: str, tmp_path: Path) -> None:
    text, use = USES[name]
    path = tmp_path / 'scene.yaml'
    path.write_text(yaml.safe_dump(text), 'utf-8')
    expected = use(load_scene(path))
    for source in (path, str(path), text):
        assert np.array_equal(use(source), expected)


def test_names() -> None:
    assert Simulation('four_bar').scene == load_scene('four_bar')
    with pytest.raises(InputError, match="got 'four_bra'; did you mean 'four_bar'"):
        Simulation('four_bra')
    with pytest.raises(InputError, match='period: not usable'):
        floquet('four_bar', period=0.0)


def test_a_loaded_scene_is_itself() -> None:
    scene = load_scene(FREE)
    assert load_scene(scene) is scene
    with pytest.raises(InputError, match="parameters: it is loaded, got 'a'"):
        load_scene(scene, {'a': 1.0})


def test_a_terminal_shows_each_in_a_line() -> None:
    simulation = Simulation(FREE)
    simulation.step(3)
    told = {
        '<Scene scene: 3 bodies, 4 joints, 1 effects>': simulation.scene,
        '<Simulation of scene, t = 0.03 s, rk4 at 0.01 s>': simulation,
        '<Sample at t = 0.03 s, 4 joint coordinates>': simulation.sample(),
        '<State at step 3, 8 coordinates>': simulation.state,
        '<Ensemble of 2 members of scene>': Ensemble(FREE, 2),
        '<Closure of four_bar by crank_pin>': Closure('four_bar', ['crank_pin']),
        '<Recording recording: knee; 0 inputs>': recorded([0, 1, 2, 3], {'knee': [0, 0, 0, 0]}),
        f'<VibrationModes: 1, at {modes(FREE).frequencies[0]:.4g} Hz>': modes(FREE),
    }
    assert [repr(each) for each in told.values()] == list(told)
