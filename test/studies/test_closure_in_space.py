"""Robots with several active joints through their dead points, against closed forms.

There values go along a singular curve rather than to it, so a line of values tells little of it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import yaml

from alf_ros import Closure
from alf_ros.arrays import Floats
from support.paths import ROOT

LEGS = [f'leg{n}' for n in range(6)]
BASE, PLATE, HIGH = 1.0, 0.6, 1.2  # m, of config/mechanisms/stewart_platform.yaml
DRAWN = ROOT / 'config' / 'mechanisms' / 'delta_robot.yaml'
MOTORS = ['motor0', 'motor1', 'motor2']
DELTA = {
    'rb': 0.2,
    'a': 0.41455943222835656,
    'l': 0.40320743450643326,
    'rp': 0.08609285477829187,
    'theta': 0.8969847132783821,
}


def turn(v: Floats) -> Floats:
    """The rotation about v (rad)."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = v / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K


def corners(radius: float, apart: float, begin: float) -> Floats:
    """(6, 3) of a plate, m."""
    n = np.arange(6)
    angle = np.radians(120.0 * (n // 2) + apart * (n % 2) + begin)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)


@pytest.mark.parametrize(
    ('rows', 'yaw', 'way', 'tilt'),
    [
        (596, -2.3, (-0.3373873, 0.0378576, -0.2207996), (0.2085098, -0.1340643)),
        (146, 2.2, (0.2607717, 0.0121788, -0.0620557), (-0.0658535, 0.2437261)),
    ],
)
@pytest.mark.parametrize('noise', [0.0, 1e-7, 1e-5])
def test_a_stewart_platform_passes_its_dead_point(
    rows: int,
    yaw: float,
    way: tuple[float, float, float],
    tilt: tuple[float, float],
    noise: float,
) -> None:
    """Lengths of legs of a path of the plate that loses rank once, as its Jacobian shows."""
    below, above = corners(BASE, 20.0, -10.0), corners(PLATE, 100.0, -50.0)
    drawn = np.linalg.norm(above + [0.0, 0.0, HIGH] - below, axis=1)
    random, passes, before = np.random.default_rng(0), 0, 0.0
    closure = Closure('stewart_platform', LEGS, noise=noise)
    for s in np.linspace(0.0, 1.0, rows):
        R = turn(np.array([0.0, 0.0, yaw * s])) @ turn(np.array([*tilt, 0.0]) * np.sin(2.0 * s))
        arms = above @ R.T
        places = arms + [0.0, 0.0, HIGH] + np.array(way) * s * s * (3.0 - 2.0 * s)
        legs = places - below
        lengths = np.linalg.norm(legs, axis=1)
        u = legs / lengths[:, None]
        det = np.linalg.det(np.hstack([u, np.cross(arms, u)]))
        passes += bool(det * before < 0.0)
        before = det
        values = lengths - drawn + noise * random.standard_normal(6)
        posture = closure.close(dict(zip(LEGS, values.tolist(), strict=True)))
    found = np.array([posture.points[f'P{n}'] for n in range(6)])
    assert passes == 1
    assert np.abs(found - places).max() <= 1e-9 + 300.0 * noise


def arm_angle(at: Floats, n: int, last: float) -> float:
    """Of arm n (rad, downwards) with the plate at `at` (m): the solution next to the last one."""
    p, about = DELTA, 2.0 * math.pi * n / 3.0
    out = at[0] * math.cos(about) + at[1] * math.sin(about) - (p['rb'] - p['rp'])
    aside, down = at[1] * math.cos(about) - at[0] * math.sin(about), -at[2]
    far = math.hypot(out, down)
    part = (p['a'] ** 2 + far**2 + aside**2 - p['l'] ** 2) / (2.0 * p['a'] * far)
    both = [math.atan2(down, out) + sign * math.acos(part) for sign in (-1.0, 1.0)]
    changes = [math.remainder(angle - last, 2.0 * math.pi) for angle in both]
    return last + min(changes, key=abs)


@pytest.mark.parametrize(('rows', 'noise'), [(168, 0.0), (84, 1e-9), (84, 1e-6), (168, 1e-6)])
def test_a_delta_robot_passes_a_dead_point_and_a_crossing(rows: int, noise: float) -> None:
    """Soon behind the dead point branches cross, on which the plate would begin to turn; two more
    dead points follow, close to each other."""
    mechanism: dict[str, Any] = yaml.safe_load(DRAWN.read_text())
    mechanism['parameters'].update(DELTA)
    p, s = DELTA, np.linspace(0.0, 1.0, rows)
    low = math.sqrt(p['l'] ** 2 - (p['rb'] + p['a'] * math.cos(p['theta']) - p['rp']) ** 2)
    begin = np.array([0.0, 0.0, -p['a'] * math.sin(p['theta']) - low])
    path = begin + np.outer(s, (-0.077586346553367, -0.29811933720410977, 0.48796086879458245))
    path += np.outer(
        np.sin(np.pi * s) ** 2, (0.1828344566524833, 0.04660350099607843, -0.11398939530944788)
    )
    random, angles = np.random.default_rng(0), [p['theta']] * 3
    closure = Closure(mechanism, MOTORS, noise=noise)
    for at in path:
        angles = [arm_angle(at, n, angles[n]) for n in range(3)]
        values = np.array(angles) - p['theta'] + noise * random.standard_normal(3)
        posture = closure.close(dict(zip(MOTORS, values.tolist(), strict=True)))
    assert np.abs(posture.points['C'] - path[-1]).max() <= 1e-9 + 300.0 * noise


COUPLED: dict[str, Any] = {
    'alf': 1,
    'space': 'spatial',
    'points': {
        'A': {'at': [0.35, -0.34, 0.36], 'fixed': True},
        'B': {'at': [-0.98, 0.96, 0.65]},
        'C': {'at': [0.7, -0.14, 0.25]},
        'D': {'at': [0.52, 0.08, -0.79]},
        'E': {'at': [0.17, -0.36, -0.16]},
    },
    'bodies': {
        name: {'points': points, 'mass': 1, 'inertia': {'about_com': [1, 1, 1]}, 'com': [0, 0, 0]}
        for name, points in (('a', ['A']), ('b', ['B']), ('c', ['C']), ('d', ['D', 'E']))
    },
    'joints': {
        'base': {
            'type': 'revolute',
            'between': ['ground', 'a'],
            'at': 'A',
            'axis': [0.92, 0.18, 0.34],
        },
        'knee': {'type': 'revolute', 'between': ['a', 'b'], 'at': 'B', 'axis': [0.26, -0.4, 0.88]},
        'hip': {
            'type': 'revolute',
            'between': ['b', 'c'],
            'at': 'C',
            'axis': [0.75, -0.49, -0.44],
        },
        'plane': {
            'type': 'planar',
            'between': ['c', 'd'],
            'at': 'D',
            'axis': [-0.88, 0.18, -0.44],
        },
        'cross': {
            'type': 'universal',
            'between': ['ground', 'd'],
            'at': 'E',
            'axes': [[0.97, -0.23, 0], [0, 0, -1]],
        },
    },
    'couplings': {'mimic': {'joints': {'knee': 0.83, 'hip': 1.8}}},
}
# rad: where the angle turns back, of a computation of its own (poses of rigid bodies as unknowns,
# followed by arc length; differences of both are 1e-12)
ENDS = -2.0958236952870, 0.7445649966249


def test_coupled_hinges_in_space_go_to_their_dead_points() -> None:
    """Where the first correction closes the other joints, it opens the coupling again."""
    closure = Closure(COUPLED, ['cross_first'])
    posture = closure.close(closure.start)
    assert posture.travel('cross_first') == pytest.approx(ENDS, abs=1e-9)
    for before in (1e-3, 1e-6):
        posture = closure.close({'cross_first': ENDS[1] - before})
        assert posture.missed_by < 1e-12
        assert posture.travel('cross_first') == pytest.approx(ENDS, abs=1e-9)
    beyond = closure.close({'cross_first': ENDS[1] + 0.1})
    assert beyond.missed_by == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize('bars', [(2.155, 2.208, 2.508), (2.22, 2.29, 2.60), (2.05, 2.45, 2.65)])
def test_a_redundant_four_bar_goes_to_its_dead_points(bars: tuple[float, float, float]) -> None:
    """Four parallel hinges hold more than they must. A crank of 1 m, and coupler, rocker and
    ground, m: the rocker turns between the places where crank and coupler are in line."""
    coupler, rocker, ground = bars
    B, D = np.array([math.cos(1.0), math.sin(1.0), 0.0]), np.array([ground, 0.0, 0.0])
    whole = float(np.linalg.norm(D - B))
    along = (coupler**2 - rocker**2 + whole**2) / (2.0 * whole)
    across = math.sqrt(coupler**2 - along**2) / whole * np.cross([0.0, 0.0, 1.0], D - B)
    C = B + along / whole * (D - B) + across
    R = turn(np.array([0.4, -1.1, 0.7]))
    places = {'A': 0.0 * D, 'B': B, 'C': C, 'D': D}
    part = {'mass': 1.0, 'inertia': {'about_com': [0.01, 0.01, 0.01]}, 'com': [0.1, 0, 0]}
    hinges = {'A': ('ground', 'AB'), 'B': ('AB', 'BC'), 'C': ('BC', 'DC'), 'D': ('ground', 'DC')}
    mechanism = {
        'alf': 1,
        'name': 'hinged',
        'space': 'spatial',
        'points': {n: {'at': (R @ p).tolist(), 'fixed': n in 'AD'} for n, p in places.items()},
        'bodies': {bar: {'points': list(bar), **part} for bar in ('AB', 'BC', 'DC')},
        'joints': {
            f'at_{n}': {
                'type': 'revolute',
                'between': list(two),
                'at': n,
                'axis': R[:, 2].tolist(),
            }
            for n, two in hinges.items()
        },
    }
    drawn = math.atan2(*(C - D)[1::-1])
    ends = [
        math.pi - math.acos((ground**2 + rocker**2 - reach**2) / (2.0 * ground * rocker)) - drawn
        for reach in (coupler + 1.0, coupler - 1.0)
    ]
    found = Closure(mechanism, ['at_D']).close({'at_D': 0.0}).travel('at_D')
    assert found == pytest.approx(ends, abs=1e-11)
