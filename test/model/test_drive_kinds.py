"""Every joint coordinate, driven: it follows, and its effort makes the same accelerations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.model import joints
from alf_ros.scene.scene import scene_from_text
from support.driven_mechanisms import GRAVITY, START, TWO
from support.joint_cases import scene_of

COORDINATES = [
    (2, 'revolute', 'joint', 'angle'),
    (2, 'slider', 'joint', 'length'),
    (2, 'prismatic', 'joint', 'length'),
    (3, 'revolute', 'joint', 'angle'),
    (3, 'universal', 'joint_first', 'angle'),
    (3, 'universal', 'joint_second', 'angle'),
    (3, 'cylindrical', 'joint_angle', 'angle'),
    (3, 'cylindrical', 'joint_length', 'length'),
    (3, 'prismatic', 'joint', 'length'),
    (3, 'screw', 'joint', 'angle'),
]


def test_no_kind_is_missing() -> None:
    cases = {(dimension, kind) for dimension, kind, _, _ in COORDINATES}
    for dimension, kind in cases:
        names = {name for D, of, name, _ in COORDINATES if (D, of) == (dimension, kind)}
        found = Simulation(scene_of(dimension, kind)).model.coordinate_names
        assert set(found) - {'pin'} == names
    with_freedoms = {
        (D, kind) for D in (2, 3) for kind, at in joints.types(D).items() if at.freedoms
    }
    assert cases == with_freedoms


def carried_over(driven: Simulation, free: Simulation) -> None:
    """Put the mechanism without drives where the driven one is."""
    state, (D, names) = free.state, (driven.model.layout.dimension, driven.model.layout)
    for theirs, ours in ((driven.state.q, state.q), (driven.state.qd, state.qd)):
        for of in ('of_point', 'of_vector'):
            there, here = getattr(names, of), getattr(free.model.layout, of)
            for name, block in here.items():
                ours.reshape(-1, D)[block] = theirs.reshape(-1, D)[there[name]]
    free.restore(replace(state, step=driven.state.step))


def of_points(sim: Simulation) -> Floats:
    """q̈ of the points."""
    model, sample = sim.model, sim.sample()
    movable = sum(not point.fixed for point in model.mechanism.points)
    return sample.qdd[: movable * model.layout.dimension]


@pytest.mark.parametrize(('dimension', 'kind', 'name', 'how'), COORDINATES)
def test_coordinate(dimension: int, kind: str, name: str, how: str) -> None:
    scene = scene_of(dimension, kind)
    free = Simulation(scene)
    start = free.sample().joints[name]
    x, v, a = start.position, start.velocity, 3.0  # half of it, rad/s^2 or m/s^2
    drive = f'{{joint: {name}, {how}: "{x!r} + {v!r}*t + {a}*t**2"}}'
    text = scene.text.replace('effects:', f'  drives: {{motor: {drive}}}\neffects:', 1)
    driven = Simulation(scene_from_text(text), integrator='dop853', step=5e-3)
    for sample in driven.run(1.0, every=50):
        t = sample.t
        assert sample.joints[name].position == pytest.approx(x + v * t + a * t**2, abs=1e-11)
        assert sample.joints[name].velocity == pytest.approx(v + 2.0 * a * t, abs=1e-10)
        carried_over(driven, free)
        (effort,) = sample.drive_efforts['motor']
        assert sample.joints[name].effort == effort and abs(effort) > 0.05
        without = of_points(free)
        free.apply_effort(name, float(effort))
        wanted = of_points(driven)
        assert np.abs(without - wanted).max() > 0.1
        assert of_points(free) == pytest.approx(wanted, abs=1e-8)
        free.clear_inputs()


@pytest.mark.parametrize('name', ['elbow_arm', 'elbow_down', 'motor_rotor', 'rotor'])
def test_names_that_blocks_of_joints_and_effects_might_have(name: str) -> None:
    """A drive is named as users like; what helps it has a block of its own."""
    drives = {name: {'joint': 'elbow', 'angle': f'{START} - 3*t'}}
    motor: dict[str, Any] = {'joint': 'shoulder', 'effort': 1, 'armature': 0.1}
    scene = {'mechanism': {**TWO, 'drives': drives}, 'effects': {**GRAVITY, 'motor': motor}}
    sim, other = Simulation(load_scene(scene)), Simulation(load_scene(renamed(scene, name)))
    for each in (sim, other):
        each.step(100)
    assert sim.sample().joints['elbow'].position == pytest.approx(START - 0.3, abs=1e-12)
    for point in ('A', 'B'):
        places = [each.sample().points[point] for each in (sim, other)]
        assert places[0] == pytest.approx(places[1], abs=1e-12)


def renamed(scene: dict[str, Any], name: str) -> dict[str, Any]:
    drives = {'plain': scene['mechanism']['drives'][name]}
    return {**scene, 'mechanism': {**scene['mechanism'], 'drives': drives}}
