"""Numbers of assemblies, each against a count made independently, with some seeds of the search.

Two; twenty with make thorough ARGS=test/studies/test_assemblies.py.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from alf_ros import AssemblyError, InputError, assemblies, load_scene
from alf_ros.arrays import Floats
from alf_ros.model.compile import compile_model
from alf_ros.studies.atlas.assembly_search import Assemblies
from alf_ros.studies.atlas.random_places import RandomPlaces
from support.thorough import LONG

SEEDS = range(20 if LONG else 1)
ROD = {'mass': 1.0, 'inertia': 'rod'}


def places(found: Assemblies, name: str) -> Floats:
    rows = np.array([each.points[name] for each in found.positions])
    return rows[np.lexsort(np.round(rows, 9).T[::-1])]


# ------------------------------------------------------------------------------- three legs, plane

ANCHORS = [
    (Fraction(0), Fraction(0)),
    (Fraction(19, 10), Fraction(0)),
    (Fraction(17, 10), Fraction(4, 5)),
]
PLATE = [
    (Fraction(0), Fraction(0)),
    (Fraction(8, 5), Fraction(0)),
    (Fraction(-3, 5), Fraction(19, 10)),
]
LEGS = [Fraction(23, 10), Fraction(9, 5), Fraction(21, 10)]


def sextic(t: Fraction) -> tuple[Fraction, tuple[Fraction, Fraction, Fraction]]:
    """The miss of the third circle at t = tan(φ/2) of the plate; x det, y det, det of its corner.

    (1 + t²)⁴ times the miss is (1 + t²) times a polynomial of degree six.
    """
    c, s = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
    rows = []
    for n in (1, 2):
        u = c * PLATE[n][0] - s * PLATE[n][1] - ANCHORS[n][0]
        v = s * PLATE[n][0] + c * PLATE[n][1] - ANCHORS[n][1]
        rows.append((2 * u, 2 * v, LEGS[n] ** 2 - LEGS[0] ** 2 - u * u - v * v))
    (a, b, p), (d, e, q) = rows
    x, y, det = p * e - q * b, a * q - d * p, a * e - d * b
    return x * x + y * y - det * det * LEGS[0] ** 2, (x, y, det)


def roots() -> list[Floats]:
    """The first corner and the direction of the plate at each root, by exact signs and bisection.

    Six changes of sign prove that there are six: a polynomial of degree six has no more.
    """
    angles = [math.pi * (k / 90 - 1) + 1e-3 for k in range(180)]
    grid = [Fraction(math.tan(a / 2)).limit_denominator(10**6) for a in angles]
    found = []
    for low, high in zip(grid, grid[1:], strict=False):
        if sextic(low)[0] * sextic(high)[0] >= 0:
            continue
        for _ in range(60):
            middle = ((low + high) / 2).limit_denominator(10**24)
            low, high = (
                (low, middle) if sextic(low)[0] * sextic(middle)[0] <= 0 else (middle, high)
            )
        x, y, det = sextic(low)[1]
        t = float(low)
        found.append(np.array([float(x / det), float(y / det), (1 - t * t) / (1 + t * t)]))
    return found


def three_legs() -> dict[str, Any]:
    x, y, c = roots()[0]
    s = math.sqrt(1 - c * c)
    corners = [
        [x + c * float(u) - s * float(v), y + s * float(u) + c * float(v)] for u, v in PLATE
    ]
    points: dict[str, Any] = {f'B{n}': {'at': corner} for n, corner in enumerate(corners)}
    points |= {
        f'A{n}': {'at': [float(u), float(v)], 'fixed': True} for n, (u, v) in enumerate(ANCHORS)
    }
    local = [[float(u), float(v)] for u, v in PLATE]
    drawn = np.linalg.norm(np.array(local[1]))
    assert drawn == pytest.approx(1.6)
    bodies: dict[str, Any] = {'plate': {'points': ['B0', 'B1', 'B2'], **ROD}}
    joints: dict[str, Any] = {}
    for n in range(3):
        bodies[f'leg{n}'] = {'points': [f'A{n}', f'B{n}'], 'length': float(LEGS[n]), **ROD}
        joints[f'foot{n}'] = {'type': 'revolute', 'between': ['ground', f'leg{n}'], 'at': f'A{n}'}
        joints[f'head{n}'] = {'type': 'revolute', 'between': [f'leg{n}', 'plate'], 'at': f'B{n}'}
    return {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}


def test_a_plate_on_three_legs_has_six_assemblies() -> None:
    wanted = roots()
    assert len(wanted) == 6
    rows = np.array([w[:2] for w in wanted])
    rows = rows[np.lexsort(np.round(rows, 9).T[::-1])]
    mechanism = three_legs()
    for seed in SEEDS:
        found = assemblies(mechanism, starts=100, seed=seed)
        assert len(found) == 6, (seed, found.statement)
        assert places(found, 'B0') == pytest.approx(rows, abs=1e-10)


def pistons(feet: list[complex], corners: list[complex]) -> dict[str, Any]:
    """A plate on three legs, each a cylinder and a piston."""
    points: dict[str, Any] = {}
    bodies: dict[str, Any] = {'plate': {'points': ['B0', 'B1', 'B2'], **ROD}}
    joints: dict[str, Any] = {}
    for n, (foot, corner) in enumerate(zip(feet, corners, strict=True)):
        span = corner - foot
        for name, part in zip('ACDB', (0.0, 0.3, 0.7, 1.0), strict=True):
            place = foot + part * span
            points[f'{name}{n}'] = {'at': [place.real, place.imag], 'fixed': name == 'A'}
        bodies[f'cylinder{n}'] = {'points': [f'A{n}', f'C{n}'], **ROD}
        bodies[f'piston{n}'] = {'points': [f'D{n}', f'B{n}'], **ROD}
        ends = {'foot': ('ground', 'cylinder', 'A'), 'head': ('plate', 'piston', 'B')}
        for name, (parent, child, point) in ends.items():
            pair = [parent, f'{child}{n}']
            joints[f'{name}{n}'] = {'type': 'revolute', 'between': pair, 'at': f'{point}{n}'}
        joints[f'stroke{n}'] = {
            'type': 'prismatic',
            'between': [f'cylinder{n}', f'piston{n}'],
            'at': f'C{n}',
            'axis': [span.real, span.imag],
        }
    return {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}


def signs(feet: list[complex], corners: list[complex]) -> int:
    """How often the miss of the third circle changes its sign while the plate turns."""
    squares = [abs(b - a) ** 2 for a, b in zip(feet, corners, strict=True)]
    turned = np.exp(1j * (np.linspace(0.0, 2.0 * math.pi, 20001) + 1e-5))  # as drawn: between two
    u, v = (feet[n] - feet[0] - turned * (corners[n] - corners[0]) for n in (1, 2))
    p, q = (
        (squares[0] - squares[n] + abs(w) ** 2) / 2 for n, w in ((1, u), (2, v))
    )  # w · (B0 - A0) of both
    det = u.real * v.imag - u.imag * v.real
    x, y = p * v.imag - q * u.imag, q * u.real - p * v.real
    miss = x * x + y * y - det * det * squares[0]
    return int(np.count_nonzero(miss[:-1] * miss[1:] < 0.0))


def test_a_cylinder_and_its_piston_turn_as_one() -> None:
    for feet, plate, at, angle in (
        (
            [-0.5 - 0.4j, 0.3 + 0.1j, 0.6 + 0.8j],
            [0.8 - 1.0j, -0.7 + 0.5j, 0.9 + 0.6j],
            -0.7 - 0.2j,
            1.9,
        ),
        (
            [1.4 - 0.7j, 0.2 + 0.9j, 0.9 + 0.6j],
            [0.3 - 0.2j, 0.9 + 0.4j, -0.1 + 0.7j],
            -0.3 + 0.3j,
            -1.7,
        ),
    ):
        corners = [at + complex(math.cos(angle), math.sin(angle)) * each for each in plate]
        wanted, strokes = signs(feet, corners), {f'stroke{n}': 0.0 for n in range(3)}
        for seed in range(4):
            found = assemblies(pistons(feet, corners), strokes, seed=seed)
            assert len(found) == wanted, (seed, found.statement)


# ---------------------------------------------------------------------------- three arms, in space


def arms() -> dict[str, Any]:
    """A delta robot: each pair of rods is one rod, to a point that stands for the plate."""
    points: dict[str, Any] = {'C': {'at': [0, 0, -0.4]}}
    bodies: dict[str, Any] = {'tool': {'points': ['C'], 'mass': 1.0, 'inertia': 'point'}}
    joints: dict[str, Any] = {}
    for k in range(3):
        angle = 2 * math.pi * k / 3
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        points[f'A{k}'] = {'at': (0.14 * out).tolist(), 'fixed': True}
        points[f'E{k}'] = {'at': ((0.14 + 0.25 * 0.8) * out + [0, 0, -0.15]).tolist()}
        bodies[f'arm{k}'] = {'points': [f'A{k}', f'E{k}'], 'length': 0.25, **ROD}
        joints[f'motor{k}'] = {
            'type': 'revolute',
            'between': ['ground', f'arm{k}'],
            'at': f'A{k}',
            'axis': [-math.sin(angle), math.cos(angle), 0.0],
        }
        joints[f'rod{k}'] = {
            'type': 'distance',
            'between': [f'arm{k}', 'tool'],
            'points': [f'E{k}', 'C'],
            'length': 0.45,
        }
    return {'alf': 1, 'space': 'spatial', 'points': points, 'bodies': bodies, 'joints': joints}


def test_a_delta_robot_reaches_a_place_in_eight_ways() -> None:
    """Of each arm two ways: where the circle of its elbow meets the sphere around the tool."""
    at = np.array([0.05, -0.03, -0.4])
    for seed in SEEDS:
        found = assemblies(arms(), {'C.x': 0.05, 'C.y': -0.03, 'C.z': -0.4}, starts=400, seed=seed)
        assert len(found) == 8, (seed, found.statement)
    ways = []
    for k in range(3):
        angle = 2 * math.pi * k / 3
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        # |A + a (cos θ out - sin θ z) - C|² = l² is P cos θ - Q sin θ = R
        gap = 0.14 * out - at
        P, Q = 2 * 0.25 * gap @ out, 2 * 0.25 * gap[2]
        R = 0.45**2 - 0.25**2 - gap @ gap
        middle, half = math.atan2(-Q, P), math.acos(R / math.hypot(P, Q))
        ways.append(
            [
                0.14 * out + 0.25 * (math.cos(x) * out - [0, 0, math.sin(x)])
                for x in (middle + half, middle - half)
            ]
        )
    for each in found.positions:
        for k in range(3):
            assert min(np.abs(each.points[f'E{k}'] - way).max() for way in ways[k]) < 1e-10


def test_a_delta_robot_has_its_tool_at_two_places() -> None:
    """Three spheres around the elbows meet in two points."""
    values = {'motor0': 0.1, 'motor1': -0.2, 'motor2': 0.3}
    for seed in SEEDS:
        found = assemblies(arms(), values, starts=100, seed=seed)
        assert len(found) == 2, (seed, found.statement)
    E = [found[0].points[f'E{k}'] for k in range(3)]
    M = 2.0 * np.array([E[1] - E[0], E[2] - E[0]])
    v = np.array([E[1] @ E[1] - E[0] @ E[0], E[2] @ E[2] - E[0] @ E[0]])
    base, along = np.linalg.lstsq(M, v, rcond=None)[0], np.cross(E[1] - E[0], E[2] - E[0])
    a, b, c = along @ along, 2 * along @ (base - E[0]), (base - E[0]) @ (base - E[0]) - 0.45**2
    wanted = np.array([base + x * along for x in np.roots([a, b, c])])
    wanted = wanted[np.lexsort(np.round(wanted, 9).T[::-1])]
    assert places(found, 'C') == pytest.approx(wanted, abs=1e-10)


# --------------------------------------------------------------- six legs, in space, feet in pairs

BASE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.9, 1.8, 0.0]])
PAIRS = ((1.64, 1.68), (1.68, 1.74), (1.87, 1.82))  # legs from corner i and i + 1 of the base
SIDES = (1.03, 1.16, 1.08)  # of the plate, from corner i to i + 1


def circles() -> list[tuple[Floats, Floats, float]]:
    """Centre, direction in the plane of the base, and radius: each corner of the plate turns about
    a side of the base."""
    found = []
    for i, (a, b) in enumerate(PAIRS):
        side = BASE[(i + 1) % 3] - BASE[i]
        length = float(np.linalg.norm(side))
        along = (a * a - b * b + length**2) / (2 * length)
        across = np.cross([0.0, 0.0, 1.0], side / length)
        found.append((BASE[i] + along * side / length, across, math.sqrt(a * a - along**2)))
    return found


def corner(i: int, angle: float) -> Floats:
    centre, across, radius = circles()[i]
    up = np.array([0.0, 0.0, math.sin(angle)])
    return np.asarray(centre + radius * (math.cos(angle) * across + up))


def turned(i: int, p: Floats, side: float, sign: int) -> float:
    """The angle of corner i at a distance from p, one of two; NaN if there is none."""
    centre, across, radius = circles()[i]
    gap = centre - p
    reach = (side**2 - gap @ gap - radius**2) / (2 * radius)
    most = math.hypot(gap @ across, gap[2])
    if abs(reach) > most:
        return math.nan
    return math.atan2(gap[2], gap @ across) + sign * math.acos(reach / most)


def plates() -> Floats:
    """(16, 9) all plates: along a turn of the first corner, where the third side fits. The closing
    equation is a polynomial of degree 16 (Nanua, Waldron & Murthy, IEEE Trans. Robotics and
    Automation 6 (1990) 438-444), so that 16 changes of sign are all."""
    found = []
    for second in (1, -1):
        for third in (1, -1):

            def plate(angle: float, signs: tuple[int, int] = (second, third)) -> Floats:
                first = corner(0, angle)
                others = turned(1, first, SIDES[0], signs[0]), turned(2, first, SIDES[2], signs[1])
                return np.array([first, corner(1, others[0]), corner(2, others[1])])

            def miss(angle: float, plate: Callable[[float], Floats] = plate) -> float:
                _, q, r = plate(angle)
                return float((q - r) @ (q - r) - SIDES[1] ** 2)

            grid = np.linspace(-math.pi, math.pi, 721) + 1e-3
            values = np.array([miss(angle) for angle in grid])
            for k in np.flatnonzero(values[:-1] * values[1:] < 0):
                root = brentq(miss, grid[k], grid[k + 1], xtol=1e-15)
                found.append(plate(root).ravel())
    return np.array(found)


def six_legs(plate: Floats) -> dict[str, Any]:
    points: dict[str, Any] = {
        f'A{n}': {'at': at.tolist(), 'fixed': True} for n, at in enumerate(BASE)
    }
    points |= {f'T{n}': {'at': at.tolist()} for n, at in enumerate(plate.reshape(3, 3))}
    joints: dict[str, Any] = {}
    for n, pair in enumerate(PAIRS):
        for foot, length in zip((n, (n + 1) % 3), pair, strict=True):
            joints[f'leg{n}{foot}'] = {
                'type': 'distance',
                'between': ['ground', 'plate'],
                'points': [f'A{foot}', f'T{n}'],
                'length': length,
            }
    body = {
        'points': ['T0', 'T1', 'T2'],
        'mass': 1.0,
        'inertia': {'about_com': [1, 1, 1]},
        'com': [0.3, 0.3, 0],
    }
    return {
        'alf': 1,
        'space': 'spatial',
        'points': points,
        'bodies': {'plate': body},
        'joints': joints,
    }


def test_a_stewart_platform_with_feet_in_pairs_has_sixteen_assemblies() -> None:
    wanted = plates()
    assert len(wanted) == 16
    mechanism = six_legs(wanted[0])
    for seed in SEEDS:
        found = assemblies(mechanism, starts=500, seed=seed)
        assert len(found) == 16, (seed, found.statement)
        rows = np.array([[each.points[f'T{n}'] for n in range(3)] for each in found.positions])
        for plate in wanted:
            assert np.abs(rows.reshape(16, 9) - plate).max(axis=1).min() < 1e-10


# ------------------------------------------------------------------------------------- the library


@pytest.mark.parametrize(
    'name, values, count',
    [
        ('slider_crank', {'crank_pin': 0.7}, 2),  # also folded
        ('four_bar', {'crank_pin': 0.7}, 2),
        ('four_bar', {'rocker_pin': 2.0}, 2),
        ('change_point', {'crank_pin': 0.7}, 2),
        ('wiper', {'motor_shaft': 0.7}, 4),
        ('spatial_four_bar', {'crank_pin': 0.7}, 2),
        ('spatial_slider_crank', {'crank_pin': 0.7}, 2),
        ('double_pendulum', {'B.x': 1.1, 'B.y': 0.2}, 2),
    ],
)
def test_counts_of_the_library(name: str, values: dict[str, float], count: int) -> None:
    starts = 300 if name.startswith('spatial') else 60
    for seed in SEEDS:
        found = assemblies(name, values, starts=starts, seed=seed)
        assert len(found) == count, (seed, found.statement)


def test_what_a_search_says() -> None:
    found = assemblies('four_bar', {'crank_pin': 0.7}, starts=50)
    assert found.closed >= sum(each.hits for each in found.positions)
    assert 0.01 < found.missing < 0.12 and found.statement.startswith('2 found by a search: ')
    assert found[0].joints['crank_pin'] == pytest.approx(0.7, abs=1e-12)
    assert all(each.sigma > 0.01 for each in found.positions)


@pytest.mark.parametrize(
    'values, said',
    [
        ({}, 'positions are not isolated: 1 freedom left'),
        ({'crank': 0.0}, "did you mean 'crank_pin'"),
        ({'crank_pin': 'far'}, 'finite number'),
    ],
)
def test_what_is_refused(values: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        assemblies('four_bar', values)
    with pytest.raises(AssemblyError, match='no assembly: '):
        assemblies('four_bar', {'rocker_pin': 0.0}, starts=20)


def test_positions_beyond_a_stop_are_marked() -> None:
    """The slider-crank with equal rods: over the crank at 0.7 rad the slider is ahead, or folded
    over the pin of the crank."""
    for stop, wanted in (
        ({'joint': 'guide', 'lower': 0.5}, {True: 1, False: 1}),
        ({'joint': 'guide', 'lower': -1.0, 'upper': 3.0}, {True: 2}),
        ({'joint': 'guide', 'upper': -0.5}, {False: 2}),
        # whole turns further on: the angle is the same
        ({'joint': 'crank_pin', 'lower': 0.6 + 2 * math.pi, 'upper': 7.5}, {True: 2}),
        ({'joint': 'crank_pin', 'upper': 0.75 - 4 * math.pi}, {True: 2}),
        ({'joint': 'crank_pin', 'lower': 0.75, 'upper': 3.0}, {False: 2}),
    ):
        scene = {
            'mechanism': 'slider_crank',
            'effects': {'joint_stop': {**stop, 'stiffness': 1e4}},
        }
        found = assemblies(scene, {'crank_pin': 0.7}, starts=60)
        assert Counter(each.within_stops for each in found.positions) == wanted
        within = wanted.get(True, 0)
        assert f'; {within} of them within the stops of joints' in found.statement
        for each in found.positions:
            ahead = each.joints['guide'] > 1.0
            assert each.within_stops == ahead or len(wanted) == 1
    free = assemblies('slider_crank', {'crank_pin': 0.7}, starts=60)
    assert 'stops' not in free.statement and all(each.within_stops for each in free.positions)


def test_an_input_beyond_its_travel_is_out_of_reach(crank_and_rocker: dict[str, Any]) -> None:
    """Half a turn away the loop closes: that is no reason why it does not close here."""
    found = assemblies(crank_and_rocker, {'pin': 3.0 - math.pi})
    assert len(found) == 2
    with pytest.raises(AssemblyError, match=r'no assembly: .* cannot be closed: ') as error:
        assemblies(crank_and_rocker, {'pin': 3.0}, starts=20)
    assert 'right angle' not in str(error.value)


@pytest.fixture
def crank_and_rocker() -> dict[str, Any]:
    """A crank about z and a rocker about x, with a rod between balls."""
    inertia = {'about_com': [0.01, 0.01, 0.01]}
    return {
        'alf': 1,
        'space': 'spatial',
        'points': {
            'O': {'at': [0, 0, 0], 'fixed': True},
            'Q': {'at': [0.8, 0.5, 0.1], 'fixed': True},
            'A': {'at': [0.4, 0, 0]},
            'B': {'at': [0.8, 0.5, 0.8]},
        },
        'bodies': {
            'crank': {'points': ['O', 'A'], 'mass': 1, 'com': [0.2, 0, 0], 'inertia': inertia},
            'rod': {'points': ['A', 'B'], 'mass': 1, 'inertia': 'rod'},
            'rocker': {'points': ['Q', 'B'], 'mass': 1, 'com': [0.3, 0, 0], 'inertia': inertia},
        },
        'joints': {
            'pin': {
                'type': 'revolute',
                'between': ['ground', 'crank'],
                'at': 'O',
                'axis': [0, 0, 1],
            },
            's1': {'type': 'spherical', 'between': ['crank', 'rod'], 'at': 'A'},
            's2': {'type': 'spherical', 'between': ['rod', 'rocker'], 'at': 'B'},
            'rock': {
                'type': 'revolute',
                'between': ['ground', 'rocker'],
                'at': 'Q',
                'axis': [1, 0, 0],
            },
        },
    }


# ----------------------------------------------------------------------- a leg with a cross


@pytest.mark.thorough
def test_the_cross_of_a_leg_may_be_turned_round() -> None:
    """Five bars and a leg on a universal joint hold the plate. Of each of the 16 plates there are
    two assemblies: the cross as drawn, and turned round by half a turn about the leg."""
    plate = plates()[0]
    mechanism = six_legs(plate)
    corner, foot = plate[:3], BASE[0]
    along = (corner - foot) / np.linalg.norm(corner - foot)
    first = np.cross([0.0, 0.0, 1.0], along)
    first /= np.linalg.norm(first)
    mechanism['vectors'] = {'u': {'along': along.tolist()}}
    half = {'vectors': ['u'], 'mass': 1.0, 'inertia': {'about_com': [0.1, 0.1, 0.1]}}
    mechanism['bodies'] |= {
        'lower': {'points': ['A0'], **half, 'com': [0.1, 0, 0]},
        'upper': {'points': ['T0'], **half, 'com': [-0.1, 0, 0]},
    }
    del mechanism['joints']['leg00']
    mechanism['joints'] |= {
        'base': {
            'type': 'universal',
            'between': ['ground', 'lower'],
            'at': 'A0',
            'axes': [first.tolist(), np.cross(along, first).tolist()],
        },
        'leg': {'type': 'prismatic', 'between': ['lower', 'upper'], 'at': 'T0', 'axis': 'u'},
        'ball': {'type': 'spherical', 'between': ['upper', 'plate'], 'at': 'T0'},
    }
    wanted = plates()
    for seed in SEEDS:
        found = assemblies(mechanism, {'leg': 0.0}, starts=1000, seed=seed)
        assert len(found) == 32, (seed, found.statement)
        rows = np.array([[each.points[f'T{n}'] for n in range(3)] for each in found.positions])
        for each in wanted:
            near = np.abs(rows.reshape(32, 9) - each).max(axis=1) < 1e-10
            crosses = [found[int(n)].joints['base_first'] for n in np.flatnonzero(near)]
            assert len(crosses) == 2
            assert math.cos(crosses[0] - crosses[1]) == pytest.approx(-1.0, abs=1e-9)


def test_places_of_a_mechanism_with_a_slider_are_numbers() -> None:
    """A rod between balls has one direction only: no axis of a joint across it."""
    inertia = {'about_com': [0.1, 0.1, 0.1]}
    mechanism: dict[str, Any] = {
        'alf': 1,
        'space': 'spatial',
        'points': {
            'O': {'at': [0, 0, 0], 'fixed': True},
            'A': {'at': [math.cos(0.7), math.sin(0.7), 0]},
            'B': {'at': [2 * math.cos(0.7), 0, 0]},
        },
        'bodies': {
            'crank': {'points': ['O', 'A'], 'mass': 1, 'com': [0.5, 0, 0], 'inertia': inertia},
            'rod': {'points': ['A', 'B'], 'mass': 1, 'inertia': 'rod'},
            'block': {'points': ['B'], 'mass': 1, 'com': [0, 0, 0], 'inertia': inertia},
        },
        'joints': {
            'pin': {
                'type': 'revolute',
                'between': ['ground', 'crank'],
                'at': 'O',
                'axis': [0, 0, 1],
            },
            's1': {'type': 'spherical', 'between': ['crank', 'rod'], 'at': 'A'},
            's2': {'type': 'spherical', 'between': ['rod', 'block'], 'at': 'B'},
            'guide': {
                'type': 'prismatic',
                'between': ['ground', 'block'],
                'at': 'B',
                'axis': [1, 0, 0],
            },
        },
    }
    model = compile_model(load_scene({'mechanism': mechanism}).mechanism, 1e8)
    places = RandomPlaces(model, model.q, 0)
    with np.errstate(all='raise'):
        for n in range(400):
            assert np.isfinite(places.place(n, [model.q])).all()


# ----------------------------------------------------------------------- spherical four-bars


def spherical(arcs: tuple[float, float, float, float], turn: float) -> dict[str, Any]:
    """Arcs of crank, coupler, rocker and ground on a sphere of 1 m, drawn closed with the crank
    turned about z from the plane of the ground."""
    a, b, c, d = arcs
    u0, u3 = np.array([0.0, 0.0, 1.0]), np.array([math.sin(d), 0.0, math.cos(d)])
    u1 = [math.sin(a) * math.cos(turn), math.sin(a) * math.sin(turn), math.cos(a)]
    # u2 = x u1 + y u3 + z u1 × u3 with its cosines to u1 and u3
    far = float(np.dot(u1, u3))
    x, y = np.linalg.solve([[1.0, far], [far, 1.0]], [math.cos(b), math.cos(c)])
    flat, normal = x * np.array(u1) + y * u3, np.cross(u1, u3)
    u2 = flat + math.sqrt((1.0 - flat @ flat) / (normal @ normal)) * normal
    ends = {'U0': u0, 'U1': u1, 'U2': u2, 'U3': u3}
    fixed = {'U0': {'fixed': True}, 'U3': {'fixed': True}}
    links = {'crank': '01', 'coupler': '12', 'rocker': '32'}
    between = {'pin': ('ground', 'crank'), 'knee': ('crank', 'coupler')}
    between |= {'wrist': ('coupler', 'rocker'), 'foot': ('ground', 'rocker')}
    return {
        'alf': 1,
        'space': 'spatial',
        'points': {n: {'at': list(map(float, u)), **fixed.get(n, {})} for n, u in ends.items()},
        'vectors': {
            n.lower(): {'along': list(map(float, u)), **fixed.get(n, {})} for n, u in ends.items()
        },
        'bodies': {
            name: {'points': [f'U{k}' for k in of], 'vectors': [f'u{k}' for k in of], **ROD}
            for name, of in links.items()
        },
        'joints': {
            name: {'type': 'revolute', 'between': list(pair), 'at': f'U{k}', 'axis': f'u{k}'}
            for k, (name, pair) in enumerate(between.items())
        },
    }


def test_a_spherical_four_bar_has_two_assemblies() -> None:
    """Coupler and rocker fold over at the plane of u1 and u3. Noise hardly ever leads there."""
    mechanism = spherical((0.79, 1.75, 1.63, 0.54), 3.96)
    for seed in range(10):
        found = assemblies(mechanism, {'pin': 0.1}, starts=150, seed=seed)
        assert len(found) == 2, (seed, found.statement)
    one, other = (each.points['U2'] for each in found.positions)
    normal = np.cross(found[0].points['U1'], mechanism['points']['U3']['at'])
    assert np.cross(one - other, normal) == pytest.approx(0.0, abs=1e-10)
