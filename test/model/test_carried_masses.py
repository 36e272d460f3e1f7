"""Light links between heavy ones, against joints without a link; and light ends of chains."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.studies.ensemble.member import run_member
from alf_ros.studies.ensemble.members_together import run_members
from alf_ros.studies.ensemble.study_reading import study_of

STEPS = 100


def bodies(**more: Any) -> dict[str, Any]:
    """An arm about y at O, and a weight at A, both heavy."""
    arm = {
        'points': ['O', 'A'],
        'mass': 1.0,
        'com': [0.1, 0.01, 0.0],
        'inertia': {'about_com': [1e-2, 2e-2, 2e-2, 0.0, 0.0, 0.0]},
    }
    weight = {
        'points': ['A'],
        'mass': 2.0,
        'com': [0.02, 0.03, -0.15],
        'inertia': {'about_com': [3e-3, 2e-3, 1e-3, 0.0, 0.0, 0.0]},
    }
    return {'arm': arm, 'weight': weight, **more}


def scene(parts: dict[str, Any], joints: dict[str, Any]) -> dict[str, Any]:
    pin = {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O', 'axis': [0, 1, 0]}
    return {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {'O': {'at': [0, 0, 0], 'fixed': True}, 'A': {'at': [0.3, 0, 0]}},
            'bodies': parts,
            'joints': {'pin': pin, **joints},
        },
        'effects': {'gravity': {'acceleration': [3.0, 4.0, -9.81]}},
        'solver': {'step': 0.01, 'integrator': 'dop853_adaptive', 'tolerance': 1e-10},
    }


def between(mass: float, moment: float, com: float = 0.0) -> dict[str, Any]:
    """A link between arm and weight: about x of the arm, then about y of the weight."""
    link = {
        'points': ['A'],
        'mass': mass,
        'com': [0.0, 0.0, com],
        'inertia': {'about_com': [moment, moment, moment, 0.0, 0.0, 0.0]},
    }
    first = {'type': 'revolute', 'between': ['arm', 'link'], 'at': 'A', 'axis': [1, 0, 0]}
    second = {'type': 'revolute', 'between': ['link', 'weight'], 'at': 'A', 'axis': [0, 1, 0]}
    return scene(bodies(link=link), {'first': first, 'second': second})


def end(scene: dict[str, Any]) -> tuple[Floats, int]:
    """Joint positions and velocities after a second, rad and rad/s, and how many evaluations."""
    simulation = Simulation(load_scene(scene))
    for _ in range(STEPS):
        simulation.step()
    sample = simulation.sample()
    return np.array([*sample.joint_positions, *sample.joint_velocities]), simulation.evaluations


@pytest.mark.parametrize(
    ('mass', 'moment', 'com'),
    [
        (0.0, 0.0, 0.0),
        (0.0, 1e-9, 0.0),
        (0.0, 1e-14, 0.0),
        (1e-6, 1e-12, 0.0),
        (1e-9, 1e-13, 0.0),
        (1e-12, 1e-16, 0.0),
        (1e-3, 0.0, 1e-5),
        (1e-6, 0.0, 1e-6),
    ],
)
def test_a_light_link_between_heavy_ones(mass: float, moment: float, com: float) -> None:
    """As if it were a universal joint."""
    joint = {'type': 'universal', 'between': ['arm', 'weight'], 'at': 'A'}
    exact, least = end(scene(bodies(), {'joint': {**joint, 'axes': [[1, 0, 0], [0, 1, 0]]}}))
    found, evaluations = end(between(mass, moment, com))
    # what the link itself weighs changes the motion by 1.8e5 rad/s per kg m², and 69 per kg
    known = 1e-8 + 2e5 * moment + 80.0 * mass
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=known)
    assert evaluations <= 1.2 * least


@pytest.mark.parametrize('mass', [1e-6, 1e-9, 1e-12])
def test_a_light_end_of_a_chain(mass: float) -> None:
    """It holds only itself, and takes no more evaluations than a heavier one."""
    found, evaluations = end(hanging(mass))
    alone = end(scene({'arm': bodies()['arm']}, {}))
    np.testing.assert_allclose(found[0], alone[0][0], rtol=0.0, atol=1e-9 + 10.0 * mass)
    assert evaluations <= 1.2 * end(hanging(1e-3))[1]


def hanging(mass: float) -> dict[str, Any]:
    """A weight of this mass on the arm."""
    weight = bodies()['weight']
    moments = [2e-3 * mass, 2e-3 * mass, 1e-3 * mass, 0.0, 0.0, 0.0]
    light = {**weight, 'mass': mass, 'inertia': {'about_com': moments}}
    joint = {'type': 'revolute', 'between': ['arm', 'weight'], 'at': 'A', 'axis': [0, 0.6, 0.8]}
    return scene(bodies(weight=light), {'joint': joint})


def test_members_with_light_links() -> None:
    """Each has the bits of its single run."""
    vary = {'link.mass': [1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13] * 3}
    made = study_of(
        load_scene(between(1e-3, 1e-14)),
        vary,
        sampling='table',
        duration=0.1,
        outputs=['energy', 'joints.second.position'],
    )
    for k, member in enumerate(run_members(made, range(made.members))):
        assert not member.reason
        for array, own in zip(member.arrays, run_member(made, k).arrays, strict=True):
            assert array.tobytes() == own.tobytes()


@pytest.mark.parametrize('spin', [1e-6, 1e-9, 1e-11])
def test_a_rod_that_spins_between_heavy_ones(spin: float) -> None:
    """Its spin is a free motion of its own, of little mass: it keeps its rate."""
    moments = [1e-2, 2e-2, 2e-2, 0.0, 0.0, 0.0]
    arm = {'mass': 1.0, 'com': [0.1, 0.01, 0.0], 'inertia': {'about_com': moments}}
    rod = {'points': ['A', 'B'], 'mass': 0.1, 'com': [0.2, 0.0, 0.0]}
    pin = {'type': 'revolute', 'axis': [0, 1, 0]}
    data = {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {
                'O': {'at': [0, 0, 0], 'fixed': True},
                'A': {'at': [0.3, 0, 0]},
                'B': {'at': [0.5, 0.4, 0.3]},
                'C': {'at': [0.5, 0.4, 0], 'fixed': True},
            },
            'bodies': {
                'left': {'points': ['O', 'A'], **arm},
                'right': {'points': ['C', 'B'], **arm},
                'rod': {**rod, 'inertia': {'about_com': [spin, 1e-3, 1e-3, 0.0, 0.0, 0.0]}},
            },
            'joints': {
                'first': {**pin, 'between': ['ground', 'left'], 'at': 'O'},
                'second': {**pin, 'between': ['ground', 'right'], 'at': 'C'},
                'third': {'type': 'spherical', 'between': ['left', 'rod'], 'at': 'A'},
                'fourth': {'type': 'spherical', 'between': ['rod', 'right'], 'at': 'B'},
            },
        },
        'effects': {'gravity': {'acceleration': [1.0, 0.0, -9.81]}},
        'solver': {'step': 0.01, 'integrator': 'dop853_adaptive', 'tolerance': 1e-10},
    }
    simulation = Simulation(load_scene(data))
    energy = simulation.sample().energy
    simulation.step(STEPS)
    sample = simulation.sample()
    assert sample.energy == pytest.approx(energy, abs=1e-8)
