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


BARS = ('ELR', 'LQ', 'RT', 'GQT')
HINGES = (  # of a parallelogram: between two bars, at
    ('ground', 'ELR', 'E'),
    ('ELR', 'LQ', 'L'),
    ('ELR', 'RT', 'R'),
    ('LQ', 'GQT', 'Q'),
    ('RT', 'GQT', 'T'),
    ('GQT', 'plate', 'G'),
)


def plate_on_parallelograms(half: float) -> dict[str, Any]:
    """Two hinged parallelograms keep a plate from turning, and on a curve. half: of their short
    bars, m."""
    part = {'mass': 0.1, 'inertia': {'about_com': [0.01, 0.01, 0.01]}, 'com': [0, 0, 0]}
    points: dict[str, Any] = {'C': {'at': [0.02, 0.01, -0.4]}}
    bodies: dict[str, Any] = {'plate': {'points': ['C', 'G0', 'G1'], **part}}
    joints: dict[str, Any] = {}
    for k, (x, y) in enumerate(((1.0, 0.0), (-0.5, 0.9))):
        out, along = np.array([x, y, 0.0]), half * np.array([-y, x, 0.0])
        above, below = 0.3 * out, 0.06 * out + points['C']['at']
        for row, middle in (('LER', above), ('QGT', below)):
            for name, side in zip(row, (1.0, 0.0, -1.0), strict=True):
                place = (middle + side * along).tolist()
                points[f'{name}{k}'] = {'at': place, 'fixed': name == 'E'}
        bodies |= {f'{bar}{k}': {'points': [f'{p}{k}' for p in bar], **part} for bar in BARS}
        across = np.cross(below - above, along)
        for one, other, at in HINGES:
            axis = along if at in 'EG' else across
            names = [
                each if each in ('ground', 'plate') else f'{each}{k}' for each in (one, other)
            ]
            joints[f'at_{at}{k}'] = {
                'type': 'revolute',
                'between': names,
                'at': f'{at}{k}',
                'axis': axis.tolist(),
            }
    parts = {'points': points, 'bodies': bodies, 'joints': joints}
    return {'alf': 1, 'name': 'plate', 'space': 'spatial', **parts}


@pytest.mark.parametrize('half', [0.05, 0.01])
def test_rows_of_crossed_parallelograms_do_not_count(half: float) -> None:
    """A small displacement of a narrow one closes as a crossed one, of which fewer rows depend on
    others. The plate has one freedom."""
    simulation = Simulation(load_scene({'mechanism': plate_on_parallelograms(half)}))
    model = simulation.model
    assert len(model.row_names) - simulation.dependent_rows == model.n - 1
    assert simulation.sample().diagnostics.distance > 1e-3
