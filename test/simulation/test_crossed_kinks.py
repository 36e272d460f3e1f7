"""Derivatives through kinks of forces that the motion crosses, against differences of runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Scene, Simulation, gradient, load_scene
from support.recordings import changed

DURATION = 1.2  # s
STENCIL = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))  # of sixth order
EXACT: dict[str, Any] = {'step': 1e-3, 'integrator': 'dop853_adaptive', 'tolerance': 1e-13}
EFFECTS: dict[str, dict[str, Any]] = {
    'table': {
        'torsion_spring': {
            'cord': {
                'joint': 'pin',
                'table': [[-2, -1000], [-0.8, 0], [1, 0]],
                'free_position': 0.0,
            }
        }
    },
    'stop': {'joint_stop': {'end': {'joint': 'pin', 'lower': -0.8, 'stiffness': 900}}},
    'ground': {
        'ground_contact': {
            'floor': {'on': 'A', 'through': [0, -0.7], 'stiffness': 3000, 'exponent': 1}
        }
    },
    'limit': {
        'motor': {'servo': {'joint': 'pin', 'position': 0.5, 'position_gain': 60, 'limit': 9}}
    },
}


def pendulum(kind: str) -> Scene:
    """It falls from the side, and meets the kink several times."""
    return load_scene(
        {
            'name': kind,
            'mechanism': {
                'alf': 1,
                'space': 'planar',
                'parameters': {'m': 1.0},
                'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
                'bodies': {'bar': {'points': ['O', 'A'], 'mass': 'm', 'inertia': 'rod'}},
                'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
            },
            'effects': {'gravity': {'acceleration': [0, -9.81]}, **EFFECTS[kind]},
        }
    )


def angle(scene: Scene, **settings: Any) -> float:
    simulation = Simulation(scene, **settings)
    simulation.step(round(DURATION / simulation.h))
    return simulation.sample().joints['pin'].position


@pytest.mark.parametrize('kind', EFFECTS)
def test_derivatives_are_those_of_runs(kind: str) -> None:
    """By tangents and by gradients, with errors near the errors of the motion; without pieces they
    were 1e-2 to 0.5."""
    scene, true = pendulum(kind), 0.0
    for k, weight in STENCIL:
        more, less = (
            angle(changed(scene, {'m': 1.0 + sign * k * 1e-3}), **EXACT) for sign in (1.0, -1.0)
        )
        true += weight * (more - less) / 1e-3
    for settings, error in ((EXACT, 1e-7), ({'step': 1e-3, 'integrator': 'rk4'}, 1e-4)):
        simulation = Simulation(scene, tangents=['m'], **settings)
        simulation.step(round(DURATION / simulation.h))
        tangent = simulation.sample().tangents['m'].joints['pin'].position
        assert tangent == pytest.approx(true, rel=error)
        found = gradient(Simulation(scene, **settings), 'final(pin.position)', ['m'], DURATION)
        assert found.by['m'] == pytest.approx(tangent, rel=1e-10)


def test_pieces_do_not_move_the_motion() -> None:
    """But for its own error at the kinks; without kinks on the way it has the same bits."""
    scene = pendulum('stop')
    for settings, off in ((EXACT, 1e-11), ({'step': 1e-3, 'integrator': 'rk4'}, 1e-5)):
        followed = Simulation(scene, tangents=['m'], **settings)
        plain = Simulation(scene, **settings)
        for simulation in (followed, plain):
            simulation.step(round(0.3 / simulation.h))
        assert followed.state.q.tobytes() == plain.state.q.tobytes()
        for simulation in (followed, plain):
            simulation.step(round(0.9 / simulation.h))
        assert np.abs(followed.state.q - plain.state.q).max() < off
