"""Slopes of a scene by its numbers, where scenes around it agree with each other and not with it,
and where the equations look as if they had a kink: tangents against differences of runs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from alf_ros import Simulation, gradient, load_scene
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene, scene_from_text
from support.thorough import thinned

# two bodies in space; the joint between them is of any kind
SPATIAL = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [0.4, 0.1, 0.05]}
    P: {at: [0.45, 0.5, 0.1]}
    Q: {at: [0.5, 0.15, 0.6]}
    R: {at: [0.2, 0.4, 0.3]}
    H: {at: [0.4, 0.3, 0.2]}
  bodies:
    one: {points: [O, A, H], mass: 1, inertia: {about_com: [0.02, 0.03, 0.025]},
          com: [0.2, 0.02, 0.01]}
    two: {points: [P, Q, R], mass: 0.6, inertia: {about_com: [0.02, 0.01, 0.015]},
          com: [0.1, 0.02, 0.03]}
  joints:
    ball: {type: spherical, between: [ground, one], at: O}
    joint: {type: TYPE, between: [one, two], at: H, axis: AXIS}
effects:
  gravity: {acceleration: [0.3, 0.5, -9.81]}
initial: {velocities: {A: [~, 0.3, ~]}}
solver: {step: 1.0e-3, integrator: dop853}
"""
# three parallel cranks: one row is redundant, for these lengths alone
CRANKS = """
mechanism:
  alf: 1
  space: planar
  points:
    O1: {at: [0, 0], fixed: true}
    O2: {at: [1, 0], fixed: true}
    O3: {at: [2, 0], fixed: true}
    A1: {at: [0.3, 0.4]}
    A2: {at: [1.3, 0.4]}
    A3: {at: [2.3, 0.4]}
  bodies:
    c1: {points: [O1, A1], mass: 1, inertia: rod}
    c2: {points: [O2, A2], mass: 1, inertia: rod}
    c3: {points: [O3, A3], mass: 1, inertia: rod}
    bar: {points: [A1, A2, A3], mass: 1, inertia: {about_com: 0.1}, com: [1, 0]}
  joints:
    p1: {type: revolute, between: [ground, c1], at: O1}
    p2: {type: revolute, between: [ground, c2], at: O2}
    p3: {type: revolute, between: [ground, c3], at: O3}
    q1: {type: revolute, between: [c1, bar], at: A1}
    q2: {type: revolute, between: [c2, bar], at: A2}
    q3: {type: revolute, between: [c3, bar], at: A3}
effects: {gravity: {acceleration: [0, -9.81]}}
solver: {step: 1.0e-3}
"""
FINE = {'solver.step': '1e-3', 'solver.integrator': 'dop853'}
AT_ZERO = {  # a number at which a term of the effect is left out
    'constant_wrench': ('{w: {on: coupler, force: [0, 1], torque: 0}}', 'w.torque'),
    'drag': ('{w: {on: coupler, at: [0, 0], linear: 2}}', 'effects.drag.w.at.0'),
    'spring': (
        '{w: {between: [coupler, O], at: [[0, 0], ~], stiffness: 9, free_length: 0.1}}',
        'effects.spring.w.at.0.1',
    ),
    'tendon': (
        '{w: {joints: [[crank_pin, 1], [knee, 0]], stiffness: 9}}',
        'effects.tendon.w.joints.1.1',
    ),
}


def read(source: str) -> Scene:
    return scene_from_text(source) if '\n' in source else load_scene(source)


def derivative(f: Callable[[float], Floats], step: float) -> Floats:
    """At 0, by central differences of sixth order."""
    weights = {1: 0.75, 2: -0.15, 3: 1 / 60}
    each = (w * (f(k * step) - f(-k * step)) for k, w in weights.items())
    return sum(each, np.zeros(1)) / step


def difference(scene: Scene, name: str, duration: float, step: float) -> tuple[Floats, Floats]:
    """The derivatives of the places and the velocities of the points by differences of runs."""

    def ends(value: float) -> Floats:
        sim = Simulation(overrides.with_changes(scene, {name: repr(value)}))
        sim.step(round(duration / sim.h))
        sample = sim.sample()
        return np.array([*sample.points.values(), *sample.velocities.values()])

    here = overrides.number(scene, name)
    q, qd = np.split(derivative(lambda x: ends(here + x), step), 2)
    return q, qd


def assert_exact(
    scene: Scene, name: str, duration: float = 0.05, step: float = 1e-3, most: float = 1e-7
) -> None:
    sim = Simulation(scene, tangents=[name])
    sim.step(round(duration / sim.h))
    tangent = sim.sample().tangents[name]
    for exact, found in zip(
        difference(scene, name, duration, step),
        (tangent.points, tangent.velocities),
        strict=True,
    ):
        size = np.abs(exact).max()
        assert size > 1e-4
        assert np.abs(exact - np.array([*found.values()])).max() <= most * size


@pytest.mark.parametrize('kind', AT_ZERO)
def test_a_number_at_which_the_effect_has_another_form_is_refused(kind: str) -> None:
    """The scenes on both sides have a term more, and agree with each other."""
    effect, name = AT_ZERO[kind]
    scene = overrides.with_changes(load_scene('slider_crank'), {f'effects.{kind}': effect})
    for names in ([name], [name, 'coupler.mass']):
        with pytest.raises(InputError) as caught:
            Simulation(scene, tangents=names)
        told = str(caught.value)
        assert told.startswith(f'{name}: no tangent: beside this value the effects have another')
        assert told.endswith('got 0.0; expected 1e-06, say')
    with pytest.raises(InputError, match='another form'):
        gradient(scene, 'final(points.B.x)', [name], duration=0.01)
    aside = overrides.with_changes(scene, {name: '1e-6'})  # what it proposes
    assert_exact(aside, name)


@pytest.mark.parametrize(
    'kind, axis, k',
    [('revolute', '[0, 0, 1]', 0), ('prismatic', '[0, 1, 0]', 0), ('cylindrical', '[1, 0, 0]', 1)],
)
def test_directions_along_the_axes(kind: str, axis: str, k: int) -> None:
    """The other axes of a joint, which are free to choose, are chosen alike beside them."""
    scene = read(SPATIAL.replace('TYPE', kind).replace('AXIS', axis))
    assert_exact(scene, f'mechanism.joints.joint.axis.{k}')


def test_the_direction_of_a_plane_that_a_disk_rolls_on() -> None:
    scene = load_scene('rolling_disk')
    assert_exact(scene, 'mechanism.joints.rim.on.normal.0', most=1e-6)


@pytest.mark.parametrize(
    'source, name',
    [
        (CRANKS, 'mechanism.points.O1.at.0'),
        (CRANKS, 'mechanism.points.A3.at.1'),
        ('differential_drive_cart', 'mechanism.points.L.at.0'),  # rows of velocities
    ],
)
def test_a_number_that_ends_a_redundancy_is_refused(source: str, name: str) -> None:
    """Beside it the mechanism is locked, or loses a freedom."""
    with pytest.raises(InputError, match='another number of constraints is redundant'):
        Simulation(read(source), tangents=[name])


def test_lengths_beside_stiffnesses() -> None:
    """Data of an effect of 1e8 N/m and of 0.1 m: each has its own rounding."""
    scene = overrides.with_changes(load_scene('excavator'), FINE)
    assert_exact(scene, 'mechanism.points.T1.at.1', 0.01, most=1e-6)


@pytest.mark.parametrize(
    'name, number',
    [('spatial_slider_crank', 'r'), ('double_wishbone', 'mechanism.points.DF.at.1')],
)
def test_sides_of_a_drawing_that_are_equally_long(name: str, number: str) -> None:
    """The length of unit vectors is the extent of the drawing, which has a kink there; the motion
    has none."""
    scene = overrides.with_changes(load_scene(name), FINE)
    assert_exact(scene, number, 0.02, step=1e-4)


def test_reactions_where_sides_are_equally_long() -> None:
    """Quantities are read in scenes beside it, in the same coordinates."""
    scene = overrides.with_changes(load_scene('spatial_slider_crank'), FINE)
    sim = Simulation(scene, tangents=['r'])
    sim.step(20)
    joint = next(iter(sim.sample().reactions))
    found = sim.sample().tangents['r'].of(f'reactions.{joint}.force')

    def force(r: float) -> Floats:
        other = Simulation(overrides.with_changes(scene, {'r': repr(r)}))
        other.step(20)
        return np.asarray(other.sample().reactions[joint].force)

    here = overrides.number(scene, 'r')
    exact = derivative(lambda x: force(here + x), 1e-4)
    assert np.abs(found - exact).max() <= 1e-6 * np.abs(exact).max()


def test_another_solver_is_refused_as_the_first_one_is() -> None:
    scene = load_scene('slider_crank')
    sim = Simulation(scene, tangents=['L'])
    with pytest.raises(InputError, match='tangents follow alf2 alone'):
        Simulation(scene, tangents=['L'], formulation='alf1')
    for integrator in ('dop853', 'esdirk43', 'esdirk43_adaptive'):
        assert sim.with_solver(integrator).sample().tangents['L'].points


def test_a_frame_that_turns_over_is_named() -> None:
    """A third point that leaves the line of the others to either side decides where y points."""
    with pytest.raises(InputError, match='the frame of lid turns over'):
        Simulation(load_scene('screw_jack'), tangents=['cx'])


ROBOTS = [
    ('delta_robot', 'a'),
    ('delta_robot', 'mechanism.points.E<k>.at.2'),
    ('four_axis_delta', 'rb'),
    ('actuator_leg', 'mechanism.points.K.at.0'),
]


@pytest.mark.parametrize('name, number', thinned(ROBOTS, keep=[ROBOTS[0], ROBOTS[2]]))
def test_lengths_of_robots_in_space(name: str, number: str) -> None:
    """Scenes beside them have other entries, and bodies that other points carry, by rounding."""
    scene = overrides.with_changes(load_scene(name), FINE)
    assert_exact(scene, number, 0.03, step=1e-4)


@pytest.mark.parametrize('name, number', thinned(ROBOTS[:3], keep=ROBOTS[:1]))
def test_reactions_and_gradients_of_robots_in_space(name: str, number: str) -> None:
    scene = overrides.with_changes(load_scene(name), FINE)
    sim = Simulation(scene, tangents=[number])
    sim.step(20)
    sample, joint = sim.sample(), next(iter(sim.sample().reactions))
    found = np.asarray(sample.tangents[number].of(f'reactions.{joint}.force'))
    plain = Simulation(scene)
    plain.step(20)
    np.testing.assert_allclose(sample.q, plain.sample().q, rtol=0.0, atol=1e-12)

    def force(value: float) -> Floats:
        other = Simulation(overrides.with_changes(scene, {number: repr(value)}))
        other.step(20)
        return np.asarray(other.sample().reactions[joint].force)

    here = overrides.number(scene, number)
    exact = derivative(lambda x: force(here + x), 1e-4)
    assert np.abs(found - exact).max() <= 1e-6 * np.abs(exact).max()
    back = gradient(scene, of=f'final(reactions.{joint}.force.x)', by=[number], duration=20e-3)
    rounding = 1e-9 * np.abs(found).max()
    assert back.by[number] == pytest.approx(found[0], rel=0.0, abs=rounding)
