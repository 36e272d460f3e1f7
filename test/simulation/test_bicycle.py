"""The benchmark bicycle: two wheels that roll and lean, a frame, and a fork that steers.

J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab: Linearized dynamics equations for the
balance and steer of a bicycle: a benchmark and review. Proc. R. Soc. A 463 (2007), 1955-1982. Its
axes point forwards, to the right and down. Here y points to the left and z upwards, so that
products of inertia with z change their sign. Lean and steer are positive to the right in both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from alf_ros import Simulation, linearise, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.scene import Scene

BASE, TRAIL, TILT, REAR, FRONT = 1.02, 0.08, np.pi / 10.0, 0.3, 0.35  # m, m, rad, m, m
GRAVITY = 9.81
SINE, COSINE = float(np.sin(TILT)), float(np.cos(TILT))

# M q̈ + v C₁ q̇ + (g K₀ + v² K₂) q = 0 of q = (lean, steer), table 2
M = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
K0 = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
K2 = np.array([[0.0, 76.59734589573222], [0.0, 2.65431523794604]])
C1 = np.array([[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])


def published(speed: float) -> Floats:
    """(4, 4) A of the states lean, steer and their rates."""
    stiffness = np.linalg.solve(M, GRAVITY * K0 + speed**2 * K2)
    damping = np.linalg.solve(M, speed * C1)
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])


def wheel(mass: float, inertias: list[float], name: str) -> dict[str, Any]:
    return {
        'points': [name],
        'vectors': [f'{name}_spoke', f'{name}_axle'],
        'mass': mass,
        'inertia': {'about_com': inertias},
    }


def tyre(radius: float, name: str) -> dict[str, Any]:
    ground = {'through': [0, 0, 0], 'normal': [0, 0, 1]}
    return {
        'type': 'disk',
        'between': ['ground', f'{name}_wheel'],
        'at': name,
        'axle': f'{name}_axle',
        'radius': radius,
        'on': ground,
    }


def bicycle(speed: float, lean_rate: float = 0.0, steer_rate: float = 0.0) -> Scene:
    """Upright and straight, with rates to the right."""
    left = {'along': [0, 1, 0]}
    ahead = {'along': [1, 0, 0]}
    high = 0.9  # m, of a point of the steering axis, which meets the ground behind the front wheel
    return load_scene(
        {
            'mechanism': {
                'alf': 1,
                'space': 'spatial',
                'points': {
                    'rear': {'at': [0, 0, REAR]},
                    'ahead': {'at': [1, 0, REAR]},
                    'head': {'at': [BASE + TRAIL - high * SINE / COSINE, 0, high]},
                    'front': {'at': [BASE, 0, FRONT]},
                },
                'vectors': {
                    'steering': {'along': [SINE, 0, -COSINE]},
                    'fork_ahead': ahead,
                    'rear_axle': left,
                    'rear_spoke': ahead,
                    'front_axle': left,
                    'front_spoke': ahead,
                },
                'bodies': {
                    'frame': {
                        'points': ['rear', 'ahead', 'head'],
                        'vectors': ['rear_axle', 'steering'],
                        'mass': 85,
                        'com': [0.3, 0, 0.9 - REAR],
                        'inertia': {'about_com': [9.2, 11, 2.8, 0, -2.4, 0]},
                    },
                    'fork': {
                        'points': ['front'],
                        'vectors': ['fork_ahead', 'front_axle', 'steering'],
                        'mass': 4,
                        'com': [0.9 - BASE, 0, 0.7 - FRONT],
                        'inertia': {'about_com': [0.05892, 0.06, 0.00708, 0, 0.00756, 0]},
                    },
                    'rear_wheel': wheel(2, [0.0603, 0.12, 0.0603], 'rear'),
                    'front_wheel': wheel(3, [0.1405, 0.28, 0.1405], 'front'),
                },
                'joints': {
                    'rear_hub': {
                        'type': 'revolute',
                        'between': ['frame', 'rear_wheel'],
                        'at': 'rear',
                        'axis': 'rear_axle',
                    },
                    'front_hub': {
                        'type': 'revolute',
                        'between': ['fork', 'front_wheel'],
                        'at': 'front',
                        'axis': 'front_axle',
                    },
                    'steer': {
                        'type': 'revolute',
                        'between': ['frame', 'fork'],
                        'at': 'head',
                        'axis': 'steering',
                    },
                    'rear_tyre': tyre(REAR, 'rear'),
                    'front_tyre': tyre(FRONT, 'front'),
                },
            },
            'effects': {'gravity': {'acceleration': [0, 0, -GRAVITY]}},
            'initial': {
                'velocities': {
                    'rear': [speed, None, None],
                    'rear_axle': [None, None, lean_rate],
                    'front_axle': [None, None, lean_rate + SINE * steer_rate],
                }
            },
            'solver': {'step': 1e-2, 'integrator': 'dop853'},
        }
    )


@pytest.mark.parametrize('speed', [3.0, 5.0, 7.0])
def test_small_motions_are_the_published_ones(speed: float) -> None:
    """Unstable by weaving, stable, and unstable by capsizing: the derivatives of lean and steer
    after a second by the rates of both axles at the start."""
    names = [f'initial.velocities.{each}_axle.2' for each in ('rear', 'front')]
    simulation = Simulation(bicycle(speed), tangents=names)
    simulation.step(100)
    found = np.array(
        [
            [
                2.0 * tangent.of('body_poses.frame.qx'),
                tangent.joints['steer'].position,
                tangent.joints['steer'].velocity,
            ]
            for tangent in (simulation.sample().tangents[name] for name in names)
        ]
    ).T
    rates = np.array([[1.0, 0.0], [-1.0 / SINE, 1.0 / SINE]])
    expected = expm(published(speed))[:, 2:] @ rates
    np.testing.assert_allclose(found, expected[[0, 1, 3]], atol=1e-10)


def test_at_rest_it_falls_as_published() -> None:
    """Rolling, heading and the place do not matter: their eigenvalues are zero."""
    model = linearise(Simulation(bicycle(0.0)))
    expected = np.concatenate([np.zeros(6), np.linalg.eigvals(published(0.0)).real])
    np.testing.assert_allclose(model.eigenvalues.imag, 0.0, atol=1e-10)
    np.testing.assert_allclose(np.sort(model.eigenvalues.real), np.sort(expected), atol=1e-10)


def test_a_large_motion_keeps_its_energy() -> None:
    """It falls over, and the fork turns far to the side."""
    simulation = Simulation(bicycle(0.0, 0.3, 0.1), step=2e-3)
    samples = list(simulation.run(1.2, every=20))
    energies = [sample.energy for sample in samples]
    assert np.ptp(energies) < 1e-8 * energies[0]
    assert max(np.abs(sample.phi).max() for sample in samples) < 1e-12
    forces = [reaction.force for sample in samples for reaction in sample.reactions.values()]
    assert np.isfinite(forces).all()
    assert abs(samples[-1].body_poses[0, 3]) > 0.9
    assert abs(samples[-1].joints['steer'].position) > 0.9
