"""The σ of ordinary positions, found from a start beside a singular one."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.studies.exact import one_freedom

CHANGE = one_freedom.change_point_alone()
MIRRORED = 2.0 * math.pi  # rad: here φ stands for the other branch of the same crank
LANDING = 0.1  # s


@pytest.mark.parametrize('aside', [0.3, 0.1, 0.03, 0.01, 0.003, -0.001, 1e-4])
def test_a_start_beside_a_position(aside: float) -> None:
    at = dict(zip('AB', CHANGE.position(math.pi + aside).reshape(-1, 2).tolist(), strict=True))
    scene = load_scene({'mechanism': 'change_point', 'initial': {'positions': at}})
    assert 0.08 < Simulation(scene).model.system.ordinary < 0.6  # 0.42 as drawn


@pytest.mark.parametrize('aside', [0.1, 0.01, 1e-3])
def test_a_driven_start_beside_a_position(aside: float) -> None:
    """A piston has no other position with its drive as it is."""
    x, y = math.cos(math.pi + aside), math.sin(math.pi + aside)
    scene = load_scene(
        {
            'mechanism': 'slider_crank',
            'drives': {'piston': {'point': 'B', 'at': [f'{2.0 * x!r} + 0*t', None]}},
            'initial': {'positions': {'A': [x, y], 'B': [2.0 * x, 0.0]}},
        }
    )
    assert 0.05 < Simulation(scene).model.system.ordinary


def place(phi: float, loops: tuple[float, ...]) -> Floats:
    """A, and B of each loop, (2 + 2 loops,)."""
    return np.concatenate(
        [CHANGE.position(phi)[:2], *(CHANGE.position(phi + m)[2:] for m in loops)]
    )


def tangent(phi: float, loops: tuple[float, ...]) -> Floats:
    return np.concatenate([CHANGE.tangent(phi)[:2], *(CHANGE.tangent(phi + m)[2:] for m in loops)])


def inertia(phi: float, loops: tuple[float, ...]) -> float:
    """Of crank, couplers and rockers, 1, 1 and 2 kg, kg m²."""
    a, *bs = tangent(phi, loops).reshape(-1, 2)
    return float((a @ a + sum(a @ a + a @ b + 3.0 * (b @ b) for b in bs)) / 3.0)


def rates(loops: tuple[float, ...], t: float, y: Floats) -> tuple[float, float]:
    e = 1e-3  # differences of order 6
    slope = sum(
        w * (inertia(y[0] + k * e, loops) - inertia(y[0] - k * e, loops))
        for k, w in ((1, 45.0), (2, -9.0), (3, 1.0))
    ) / (60.0 * e)
    return y[1], -0.5 * slope * y[1] * y[1] / inertia(y[0], loops)


@pytest.mark.parametrize('loops', [(0.0, 0.0, 0.0), (0.0, MIRRORED, MIRRORED), (0.0, MIRRORED)])
def test_steps_of_many_equal_loops_end_in_the_position(loops: tuple[float, ...]) -> None:
    """Loops on one crank, on their branches, slow enough to start beside the position."""
    whole: dict[float, Any] = {
        end: solve_ivp(
            partial(rates, loops),
            (0.0, end),
            (math.pi, 0.5),
            'DOP853',
            rtol=1e-12,
            atol=1e-13,
            dense_output=True,
        ).sol
        for end in (-1.5 * LANDING, 3.0 * LANDING)
    }

    def state(t: float) -> Floats:
        return np.asarray(whole[-1.5 * LANDING if t < 0.0 else 3.0 * LANDING](t))

    names = ['A', *(f'B{k}' for k in range(len(loops)))]
    ends = {'crank': 'O A'} | {
        f'{kind}{k}': f'{at} B{k}'
        for k in range(len(loops))
        for kind, at in (('coupler', 'A'), ('rocker', 'C'))
    }
    joints = {'o': ('ground crank', 'O')}
    for k in range(len(loops)):
        joints |= {
            f'knee{k}': (f'crank coupler{k}', 'A'),
            f'wrist{k}': (f'coupler{k} rocker{k}', f'B{k}'),
            f'pin{k}': (f'ground rocker{k}', 'C'),
        }
    for aside in (0.0, 1e-8, -1e-5):
        theta, rate = state(-LANDING - aside)
        at = place(theta, loops).reshape(-1, 2).tolist()
        speeds = (rate * tangent(theta, loops)).reshape(-1, 2).tolist()
        scene = load_scene(
            {
                'mechanism': {
                    'alf': 1,
                    'points': {
                        'O': {'at': [0, 0], 'fixed': True},
                        'C': {'at': [4, 0], 'fixed': True},
                        **{name: {'at': p} for name, p in zip(names, at, strict=True)},
                    },
                    'bodies': {
                        name: {
                            'points': both.split(),
                            'mass': 2 if 'rocker' in name else 1,
                            'inertia': 'rod',
                        }
                        for name, both in ends.items()
                    },
                    'joints': {
                        name: {'type': 'revolute', 'between': between.split(), 'at': at}
                        for name, (between, at) in joints.items()
                    },
                },
                'initial': {'velocities': dict(zip(names, speeds, strict=True))},
            }
        )
        for integrator, step, tolerance, bound in (
            ('rk4', 1e-2, None, 1e-6),
            ('esdirk43', 1e-2, None, 1e-6),
            ('dop853', 2e-2, None, 1e-8),
            ('esdirk43_adaptive', 0.1, 1e-3, 1e-3),
            ('dop853_adaptive', 0.1, 1e-6, 1e-6),
        ):
            sim = Simulation(scene, integrator=integrator, step=step, tolerance=tolerance)
            for _ in range(3):
                sim.step(round(LANDING / step))
                exact = place(state(sim.t - LANDING - aside)[0], loops)
                assert sim.sample().q == pytest.approx(exact, abs=bound)
