"""Units do not matter: a run with its lengths, masses and times in other units has the same bits.

The other units are powers of two, so that nothing is rounded on the way. A number with a size of
its own in the method, such as a least length, changes bits here, and results elsewhere.
"""

from __future__ import annotations

import re
from itertools import cycle

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.inspection.soundness import Soundness, examine
from alf_ros.scene.scene import Scene
from support import effect_examples, joint_cases
from support.other_units import Units, differences, in_units
from support.some_scenes import SOME_SCENES
from support.thorough import thinned

SMALL = Units(m=2.0**10, kg=2.0**-20, s=2.0**6)  # a metre is 1024 units of length
LARGE = Units(m=2.0**-10, kg=2.0**20, s=2.0**-6)
HEAVY = Units(m=1.0, kg=2.0**34, s=1.0)
INTEGRATORS = ('rk4', 'dop853', 'dop853_adaptive', 'esdirk43')


def check(scene: Scene, integrator: str, steps: int = 40) -> None:
    """A run has the same bits in each of the other units."""
    mechanism = scene.mechanism
    moved = mechanism.drives or any(joint.motion for joint in mechanism.joints)
    step = scene.solver.step
    own = Simulation(scene, integrator=integrator, step=step)
    own.step(steps)
    for units in (HEAVY,) if moved else (SMALL, LARGE):
        other = Simulation(in_units(scene, units), integrator=integrator, step=step * units.s)
        other.step(steps)
        assert other.evaluations == own.evaluations
        assert differences(own.sample(), other.sample(), units) == {}


@pytest.mark.parametrize(('name', 'integrator'), zip(SOME_SCENES, cycle(INTEGRATORS)))
def test_scenes_of_the_library(name: str, integrator: str) -> None:
    check(load_scene(name), integrator)


def test_slow_modes_of_a_large_mechanism() -> None:
    """Directions of axes, bound by linear rows, had more weight the larger a mechanism is."""
    check(load_scene('spatial_four_bar'), 'rk4')


@pytest.mark.parametrize(
    'name', thinned(SOME_SCENES + ['double_wishbone'], ['double_wishbone', 'change_point'])
)
def test_answers_of_check(name: str) -> None:
    """Numbers apart. Rows between fixed points had a weight of their own: in a heavy double
    wishbone the pins that share a load seemed to have reactions of their own."""
    scene = load_scene(name)
    mechanism = scene.mechanism
    moved = mechanism.drives or any(joint.motion for joint in mechanism.joints)
    own = examine(scene)
    for units in (HEAVY,) if moved else (SMALL, LARGE):
        other = examine(in_units(scene, units))
        assert words(other) == words(own)
        for there, here in zip(other.walk.positions, own.walk.positions, strict=True):
            assert np.array_equal(there, here * units.m)


def words(found: Soundness) -> list[tuple[str, str, str]]:
    """The answers, with a mark for each number."""
    number = re.compile(r'-?\d+\.?\d*(e[-+]?\d+)?')
    return [(each.verdict, each.question, number.sub('#', each.answer)) for each in found.answers]


@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_a_wheel_alone(integrator: str) -> None:
    """The only length of a mechanism with one point is the radius of its wheel."""
    check(load_scene('coin'), integrator)


@pytest.mark.parametrize(
    ('dimension', 'kind'),
    thinned(joint_cases.CASES, lambda dimension, kind: kind in ('no_slip', 'universal', 'gear')),
)
def test_joints(dimension: int, kind: str) -> None:
    check(joint_cases.scene_of(dimension, kind), 'dop853')


@pytest.mark.parametrize(
    ('kind', 'which'), thinned(effect_examples.CASES, effect_examples.in_plane_or_space)
)
def test_effects(kind: str, which: str) -> None:
    check(effect_examples.simulation(kind, which).scene, 'esdirk43')
