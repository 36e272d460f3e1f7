"""One compiled read against the sample that reads each quantity by itself: the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.observables import READINGS
from alf_ros.simulation.sample_reader import KEYS, SampleReader, fits, mask
from support.ball_scene import BALLS, NAMES
from support.some_scenes import SOME_SCENES

Into = dict[str, tuple[Floats, ...]]


def made(simulation: Simulation) -> tuple[SampleReader, Into]:
    """A reader of all that the simulation has, and where it writes."""
    sample = simulation.sample()
    keys = [key for key in KEYS if key != 'work' or simulation.ledger]
    into: Into = {}
    for key in keys:
        into[key] = tuple(np.full(np.size(x), np.nan) for x in READINGS[key].values(sample))
    return SampleReader(simulation, into), into


def check(simulation: Simulation, reader: SampleReader, into: Into) -> bool:
    """Whether the reader has read the present; what it has read is what the sample says."""
    if not reader.read(mask(tuple(into), distance=True)):
        return False
    sample = simulation.sample()
    for key, arrays in into.items():
        for array, expected in zip(arrays, READINGS[key].values(sample), strict=True):
            assert array.tobytes() == np.ascontiguousarray(expected).tobytes(), key
    assert reader.distance == sample.diagnostics.distance
    return True


@pytest.mark.parametrize('name', SOME_SCENES)
def test_every_scene_is_read_as_samples_read_it(name):
    simulation = Simulation(load_scene(name))
    if simulation.model.mechanism.drives:
        assert not fits(simulation)
        return
    reader, into = made(simulation)
    assert not check(simulation, reader, into)  # before the first step a sample decides
    read = 0
    for _ in range(4):
        simulation.step()
        read += check(simulation, reader, into)
    assert read >= 3


def test_angles_of_balls_are_read():
    simulation = Simulation(scene_from_text(BALLS))
    reader, into = made(simulation)
    simulation.step(10)
    assert check(simulation, reader, into)
    positions, velocities, efforts = into['joint_states']
    assert positions.size == len(NAMES) and np.abs(velocities).min() > 0.0
    assert efforts[0] != 0.0 and not efforts[1:].any()


def test_held_inputs_and_a_ledger_are_read():
    simulation = Simulation(load_scene('slider_crank'), ledger=True)
    reader, into = made(simulation)
    curve = Curve(((0.0, 0.1, 2.0, 0.0, 0.0, 0.0, 0.0), (1.0, 2.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
    for act in (
        lambda: simulation.apply_wrench('crank', force=[1.0, -2.0], torque=0.3),
        lambda: simulation.apply_effort('knee', 0.25),
        lambda: simulation.apply_effort('knee', curve),
        simulation.clear_inputs,
    ):
        act()
        simulation.step(3)
        assert check(simulation, reader, into)


def test_only_what_is_wanted_is_written():
    simulation = Simulation(load_scene('delta_robot'))
    reader, into = made(simulation)
    simulation.step()
    for arrays in into.values():
        for array in arrays:
            array[:] = 7.0
    assert reader.read(mask(('joint_states',)))
    assert not any((array == 7.0).all() for array in into['joint_states'])
    for key in into.keys() - {'joint_states'}:
        assert all((array == 7.0).all() for array in into[key]), key


def test_limits_are_left_to_the_sample():
    """A step ends in a change point, where reactions are limits along the motion."""
    watched = Simulation(load_scene('change_point'), watch=True)
    while not watched.passes:
        watched.step()
    steps = 200
    simulation = Simulation(load_scene('change_point'), step=watched.passes[0].t / steps)
    reader, into = made(simulation)
    wanted, left = mask(('reactions',)), []
    for _ in range(2 * steps - 10):
        simulation.step()
        if reader.read(wanted):
            expected = READINGS['reactions'].values(simulation.sample())[0]
            assert into['reactions'][0].tobytes() == expected.tobytes()
        else:
            left.append(simulation.step_index)
    assert steps in left and len(left) < 5


def test_other_formulations_are_left_to_samples():
    simulation = Simulation(load_scene('slider_crank'), formulation='penalty')
    assert not fits(simulation)


def test_arrays_that_do_not_fit_are_refused():
    simulation = Simulation(load_scene('slider_crank'))
    count = len(simulation.model.coordinates)
    cases: list[tuple[str, Any, str]] = [
        ('joint', (np.zeros(1),), 'no such reading'),
        ('energy', (np.zeros(2),), 'do not fit'),
        ('joint_states', (np.zeros(count),), 'do not fit'),
        ('joint_states', (np.zeros(count, dtype=np.float32),) * 3, 'do not fit'),
        ('joint_states', (np.zeros(2 * count)[::2],) * 3, 'do not fit'),
    ]
    for key, arrays, word in cases:
        with pytest.raises(InputError, match=word):
            SampleReader(simulation, {key: arrays})
    reader = SampleReader(simulation, {'energy': (np.zeros(1),)})
    with pytest.raises(InputError, match='no arrays'):
        reader.read(mask(('state',)))
