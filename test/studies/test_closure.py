"""Closing loops around given joints, against closed forms of the mechanisms."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest

from alf_ros import Closure, InputError, Simulation, load_scene
from alf_ros.arrays import Floats
from support.thorough import LONG

R, L = 0.3, 0.8  # m, crank and coupler
SLIDER_CRANK: dict[str, Any] = {
    'alf': 1,
    'space': 'planar',
    'parameters': {'r': R, 'l': L, 'a': 0.7},
    'points': {
        'O': {'at': [0, 0], 'fixed': True},
        'A': {'at': ['r*cos(a)', 'r*sin(a)']},
        'B': {'at': ['r*cos(a) + sqrt(l**2 - (r*sin(a))**2)', 0]},
    },
    'bodies': {
        'crank': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
        'coupler': {'points': ['A', 'B'], 'mass': 1, 'inertia': 'rod'},
    },
    'joints': {
        'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
        'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
        'guide': {'type': 'slider', 'point': 'B', 'on': {'through': [0, 0], 'direction': [1, 0]}},
    },
}
BARS: dict[str, Any] = {'type': 'revolute'}
# a five-bar: two cranks of 0.2 m on the ground, 0.3 m apart, two rods of 0.35 m that meet in P
FIVE_BAR: dict[str, Any] = {
    'alf': 1,
    'space': 'planar',
    'parameters': {'a': 0.2, 'b': 0.35, 'd': 0.3, 'rise': 'sqrt(b**2 - (d/2)**2)'},
    'points': {
        'O': {'at': [0, 0], 'fixed': True},
        'C': {'at': ['d', 0], 'fixed': True},
        'A': {'at': [0, 'a']},
        'B': {'at': ['d', 'a']},
        'P': {'at': ['d/2', 'a + rise']},
    },
    'bodies': {
        'left': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
        'right': {'points': ['C', 'B'], 'mass': 1, 'inertia': 'rod'},
        'left_rod': {'points': ['A', 'P'], 'mass': 1, 'inertia': 'rod'},
        'right_rod': {'points': ['B', 'P'], 'mass': 1, 'inertia': 'rod'},
    },
    'joints': {
        'm1': {**BARS, 'between': ['ground', 'left'], 'at': 'O'},
        'm2': {**BARS, 'between': ['ground', 'right'], 'at': 'C'},
        'e1': {**BARS, 'between': ['left', 'left_rod'], 'at': 'A'},
        'e2': {**BARS, 'between': ['right', 'right_rod'], 'at': 'B'},
        'tip': {**BARS, 'between': ['left_rod', 'right_rod'], 'at': 'P'},
    },
}


def test_a_posture_and_its_joints_print_what_they_hold() -> None:
    found = Closure(SLIDER_CRANK, active=['pin']).close({'pin': 0.5})
    text = repr(found)
    assert text.startswith('<Posture of 3 joint coordinates, closed to ') and '0x' not in text
    assert repr(found.joints) == repr(dict(found.joints)) != '{}'


def stroke(angle: Any) -> Any:
    """The place of the slider (m) at a crank angle (rad)."""
    return R * np.cos(angle) + np.sqrt(L**2 - (R * np.sin(angle)) ** 2)


@pytest.fixture(scope='module')
def slider() -> Closure:
    return Closure(SLIDER_CRANK, ['guide'])


def test_slider_crank_in_closed_form_with_velocities() -> None:
    closure = Closure(SLIDER_CRANK, ['pin'])
    for angle in np.linspace(0.7, 20.0, 60):
        posture = closure.close({'pin': angle}, rates={'pin': 3.0})
        across = L * math.sqrt(1.0 - (R * math.sin(angle) / L) ** 2)
        slope = -R * math.sin(angle) - R**2 * math.sin(angle) * math.cos(angle) / across
        assert posture.joints['guide'] == pytest.approx(stroke(angle), abs=1e-14)
        assert posture.joints['pin'] == pytest.approx(angle, abs=1e-14)
        assert posture.joint_rates['guide'] == pytest.approx(3.0 * slope, abs=1e-12)
        assert posture.rates[2, 0] == pytest.approx(slope, abs=1e-12)
        assert posture.closed_to < 1e-14
        assert posture.missed_by < 1e-14


def test_the_slider_goes_through_both_dead_points(slider: Closure) -> None:
    """Crank angles that a slider alone does not tell, over three turns and back."""
    slider.restart()
    for angle in (*np.arange(0.7, 20.0, 0.07), *np.arange(20.0, -1.0, -0.05)):
        if angle == 20.0:  # the motion turns back here: away from dead points
            angle = 19.95
        posture = slider.close({'guide': float(stroke(angle))})
        assert posture.joints['pin'] == pytest.approx(angle, abs=2e-6)
        assert posture.closed_to < 1e-12


def test_a_slider_that_turns_back_before_the_dead_point_stays(slider: Closure) -> None:
    slider.restart()
    time = np.linspace(0.0, 2.0 * np.pi, 400)
    angles = 0.35 + 0.34 * np.cos(time)  # up to 0.01 rad before it
    values, missed = slider.follow(stroke(angles)[:, None])
    np.testing.assert_allclose(values[:, 0], angles, atol=1e-9)
    assert missed.max() < 1e-14


def test_the_branch_changes_in_a_dead_point(slider: Closure) -> None:
    slider.restart()
    signs = [
        slider.close({'guide': float(stroke(angle))}).branch
        for angle in np.arange(0.7, -0.7, -0.1)
    ]
    assert signs == [1] * 8 + [-1] * 7 or signs == [1] * 7 + [-1] * 7


def test_velocities_and_times_that_are_not_equal(slider: Closure) -> None:
    slider.restart()
    random, t = np.random.default_rng(4), 0.0
    while t < 3.0:
        t += random.uniform(0.005, 0.02)
        angle = 0.7 - 2.0 * t
        posture = slider.close({'guide': float(stroke(angle))}, t=t)
        assert posture.joints['pin'] == pytest.approx(angle, abs=1e-5)


def test_after_a_long_gap_the_motion_does_not_count(slider: Closure) -> None:
    """Behind a gap nobody knows on which side of the dead point it is: it stays."""
    for gap, side in ((0.01, -1.0), (0.2, 1.0)):
        slider.restart()
        for n in range(6):
            posture = slider.close({'guide': float(stroke(0.7 - 0.12 * n))}, t=0.01 * n)
        assert posture.joints['pin'] == pytest.approx(0.1, abs=1e-9)
        posture = slider.close({'guide': float(stroke(0.02))}, t=0.05 + gap)
        assert posture.joints['pin'] == pytest.approx(side * 0.02, abs=1e-9)


@pytest.mark.parametrize('noise', [0.0, 1e-5])
@pytest.mark.parametrize(
    ('stop', 'said'), [(0.0, True), (1e-5, True), (0.001, True), (0.4, False)]
)
def test_a_long_gap_beside_a_dead_point_leaves_the_branch_a_guess(
    noise: float, stop: float, said: bool
) -> None:
    closure, random = Closure(SLIDER_CRANK, ['guide'], noise=noise), np.random.default_rng(2)
    for _ in range(10):
        closure.restart()
        spacing, t = random.uniform(0.01, 0.08), 0.0
        angles = np.arange(stop + math.floor((0.7 - stop) / spacing) * spacing, -0.3, -spacing)
        before = True
        for angle in angles.tolist():
            at = float(stroke(angle)) + noise * float(random.standard_normal())
            gone = before and angle < stop - 1e-9
            before = before and not gone
            t += 1e6 if gone else 0.1
            posture = closure.close({'guide': at}, t=t)
            assert posture.ambiguous == (said and not before)
    closure.restart()
    assert not closure.ambiguous
    assert not closure.close(closure.start, t=0.0).ambiguous


@pytest.mark.parametrize('noise', [0.0, 1e-5, 1e-4])
def test_a_branch_that_the_motion_tells_is_no_guess(noise: float) -> None:
    """Many turns through both dead points."""
    closure, random = Closure(SLIDER_CRANK, ['guide'], noise=noise), np.random.default_rng(8)
    angles = 0.7 - np.cumsum(0.1 + 0.03 * np.sin(0.07 * np.arange(600.0)))
    values, _ = closure.follow((stroke(angles) + noise * random.standard_normal(600))[:, None])
    assert values[-1, closure.joint_names.index('pin')] == pytest.approx(angles[-1], abs=0.05)
    assert not closure.ambiguous


@pytest.mark.parametrize('far', [1e4, 1e6])
def test_a_mechanism_far_from_the_origin_moves(far: float) -> None:
    """Places are rounded to EPS of their distance (m): the loops close to this, and no better."""
    points = {
        name: {**point, 'at': [f'{far} + {point["at"][0]}', point['at'][1]]}
        for name, point in SLIDER_CRANK['points'].items()
    }
    closure = Closure({**SLIDER_CRANK, 'points': points}, ['pin'])
    angles = np.linspace(0.7, 7.7, 300)
    found, missed = closure.follow([[angle] for angle in angles.tolist()])
    rounding = 1e2 * np.finfo(float).eps * far
    assert missed.max() < rounding
    slider = R * np.cos(angles) + np.sqrt(L**2 - (R * np.sin(angles)) ** 2)
    guide = closure.joint_names.index('guide')
    assert np.abs(found[:, guide] - far - slider).max() < rounding


def test_out_of_reach_the_nearest_posture(slider: Closure) -> None:
    slider.restart()
    for angle in np.arange(0.7, 0.3, -0.02):
        slider.close({'guide': float(stroke(angle))})
    posture = slider.close({'guide': R + L + 0.01})
    assert posture.missed_by == pytest.approx(0.01, abs=1e-9)
    assert posture.joints['pin'] == pytest.approx(0.0, abs=1e-4)
    assert posture.closed_to < 1e-12


def test_no_velocity_is_told_where_none_exists(slider: Closure) -> None:
    """In a dead point the slider cannot continue; a milliradian before it the crank is fast."""
    slider.restart()
    for angle in (*np.arange(0.7, 0.0, -0.05), 1e-3):
        posture = slider.close({'guide': float(stroke(angle))}, rates={'guide': 0.5})
    angle = posture.joints['pin']
    across = math.sqrt(L**2 - (R * math.sin(angle)) ** 2)
    slope = -R * math.sin(angle) * (1.0 + R * math.cos(angle) / across)
    assert posture.joint_rates['pin'] == pytest.approx(0.5 / slope, rel=1e-6)
    assert posture.rates[[0, 2], 0].tolist() == pytest.approx([1 / slope, 1.0], rel=1e-6)
    posture = slider.close({'guide': R + L + 0.01}, rates={'guide': 0.5})
    assert np.isnan(posture.joint_velocities).all() and np.isnan(posture.rates).all()
    posture = slider.close({'guide': R + L + 0.02}, rates={'guide': 0.0})
    assert posture.joint_rates['guide'] == 0.0


def test_joints_that_come_to_rest_have_velocities() -> None:
    """With rates of zero behind a motion there were none: its rounding is more than nothing."""
    closure = Closure('delta_robot', ['motor0', 'motor1', 'motor2'])
    for n, rate in enumerate((0.1, 0.1, 0.0, 1e-12, 0.0)):
        angles = {'motor0': 0.05, 'motor1': 0.01 * (n % 3), 'motor2': 0.003 * n}
        posture = closure.close(angles, dict.fromkeys(angles, rate), 1e-3 * n)
        assert posture.joint_velocities == pytest.approx([rate] * 3, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize('noise', [0.0, 1e-5, 1e-4])
def test_values_that_come_back_from_out_of_reach_are_met(noise: float) -> None:
    """Beyond the dead point by little or much, in one call or more, then back."""
    closure, random = Closure(SLIDER_CRANK, ['guide'], noise=noise), np.random.default_rng(17)
    pin = closure.joint_names.index('pin')
    for _ in range(400 if LONG else 150):
        closure.restart()
        there = np.linspace(0.7, random.choice([0.0, 0.1]), random.integers(2, 20))
        excess = 10.0 ** random.uniform(-16, -2)
        back = np.linspace(random.uniform(0.001, 0.2), random.uniform(0.3, 1.0), 8)
        calls = random.integers(1, 4)
        given = np.concatenate([stroke(there), np.full(calls, R + L + excess), stroke(back)])
        values, missed = closure.follow(given[:, None])
        assert missed[-1] <= 1e-12 + noise
        assert abs(abs(values[-1, pin]) - back[-1]) <= 1e-12 + 100.0 * noise
        if calls > 1 and excess > 1e-9 and not noise:  # the crank has stopped in the dead point
            assert values[-1, pin] > 0.0


@pytest.mark.parametrize('noise', [1e-6, 1e-4])
def test_noise_does_not_turn_the_crank_back(noise: float) -> None:
    closure, random = Closure(SLIDER_CRANK, ['guide'], noise=noise), np.random.default_rng(7)
    angles = np.concatenate([np.arange(0.7, -0.7, -step) for step in (0.02, 0.01)])
    for angle in (0.7, 0.7):
        closure.close({'guide': float(stroke(angle))})
    half = angles.size // 3  # the first sweep, coarse
    given = stroke(angles[:70]) + noise * random.standard_normal(70)
    values, missed = closure.follow(given[:, None])
    far = np.abs(angles[:70]) > 6.0 * math.sqrt(noise)
    assert half > 60
    np.testing.assert_array_equal(np.sign(values[far, 0]), np.sign(angles[:70][far]))
    assert missed.max() < 6.0 * noise


@pytest.mark.parametrize('active', ['guide', 'rocker_pin'])
def test_noisy_values_out_of_reach_leave_the_loops_closed(active: str) -> None:
    """Beside a dead point the miss of the active joint counted as a gap of the loops."""
    noise, random, missed = 1e-3, np.random.default_rng(5), []
    closure = Closure(SLIDER_CRANK, ['guide'], noise=noise)
    given = stroke(np.arange(0.75, -0.8, -0.02))
    if active == 'rocker_pin':  # an angle
        crank = Closure('four_bar', ['crank_pin'])
        turns = crank.start['crank_pin'] + np.arange(0.0, 6.3, 0.05)
        given = np.array([crank.close({'crank_pin': float(x)}).joints[active] for x in turns])
        closure = Closure('four_bar', [active], noise=noise)
    for value in given + noise * random.standard_normal(given.size):
        posture = closure.close({active: float(value)})
        assert posture.closed_to < 1e-12
        assert posture.missed_by == pytest.approx(abs(posture.joints[active] - value), abs=1e-14)
        missed.append(posture.missed_by)
    assert max(missed) > 0.1 * noise  # some are out of reach


def test_travel_of_a_four_bar_against_triangles() -> None:
    """The rocker ends where crank and coupler lie on one line; the crank goes round (Grashof)."""
    a, b, c, d = 0.10, 0.30, 0.25, 0.30
    crank = Closure('four_bar', ['crank_pin']).close({'crank_pin': 1.0})
    assert crank.travel('crank_pin') == (-math.inf, math.inf)
    rocker = Closure('four_bar', ['rocker_pin']).close({'rocker_pin': 1.6})
    ends = [math.pi - math.acos((d * d + c * c - r * r) / (2 * d * c)) for r in (a + b, b - a)]
    assert rocker.travel('rocker_pin') == pytest.approx(ends, abs=1e-8)


def test_the_travel_of_a_posture_does_not_depend_on_other_postures() -> None:
    fields = {**FIVE_BAR, 'parameters': {**FIVE_BAR['parameters'], 'a': 0.3, 'd': 0.5}}
    closure = Closure(fields, ['m1', 'm2'])
    first, second = (closure.close({'m1': 1.4, 'm2': angle}) for angle in (1.3, 0.9))
    found = [first.travel('m1'), second.travel('m1'), second.travel('m2'), second.travel('m1')]
    assert found[1] == found[3]
    again = Closure(fields, ['m1', 'm2'])
    again.close({'m1': 1.4, 'm2': 1.3})
    assert again.close({'m1': 1.4, 'm2': 0.9}).travel('m1') == found[1]
    assert found[0] != found[1]


def test_travel_of_a_crank_that_does_not_go_round() -> None:
    """A triple rocker: no Grashof; ends where coupler and rocker lie on one line."""
    lengths = {'a': 0.25, 'b': 0.2, 'c': 0.2, 'd': 0.2}
    scene = load_scene({'mechanism': 'four_bar', 'parameters': lengths})
    low, high = Closure(scene, ['crank_pin']).close({'crank_pin': 1.0}).travel('crank_pin')
    a, b, c, d = lengths.values()
    end = math.acos((a * a + d * d - (b + c) ** 2) / (2 * a * d))
    assert high == pytest.approx(end, abs=1e-8)
    assert low == pytest.approx(-end, abs=1e-8)


def _bar(*points: str) -> dict[str, Any]:
    return {'points': list(points), 'mass': 1, 'inertia': {'about_com': 0.1}, 'com': [0, 0]}


def _pin(parent: str, child: str, at: str) -> dict[str, Any]:
    return {'type': 'revolute', 'between': [parent, child], 'at': at}


def _slide(parent: str, child: str, at: str, axis: list[float]) -> dict[str, Any]:
    return {'type': 'prismatic', 'between': [parent, child], 'at': at, 'axis': axis}


# two slides turn about O and C; out of them come bars that a hinge at H connects
SLIDES: dict[str, Any] = {
    'alf': 1,
    'points': {
        'O': {'at': [0.71, 0.06], 'fixed': True},
        'C': {'at': [-0.72, 0.26], 'fixed': True},
        'A': {'at': [0.14, 0.01]},
        'B': {'at': [-0.46, 0.1]},
        'H': {'at': [-0.36, 0.13]},
        'M': {'at': [1.11, -0.22]},
        'N': {'at': [-1.16, 0.66]},
    },
    'bodies': {
        'first': _bar('O', 'M'),
        'second': _bar('C', 'N'),
        'out': _bar('A', 'H'),
        'along': _bar('B', 'H'),
    },
    'joints': {
        'at_O': _pin('ground', 'first', 'O'),
        'reach': _slide('first', 'out', 'A', [0.9, -0.44]),
        'at_C': _pin('ground', 'second', 'C'),
        'boom': _slide('second', 'along', 'B', [-1.0, -0.07]),
        'hinge': _pin('along', 'out', 'H'),
    },
}


@pytest.mark.parametrize('turned', [-1.0, 0.25, 0.75])
def test_travel_to_dead_points_far_out(turned: float) -> None:
    """Seen from the bars C moves along one line, O along another one, and |OC| is constant: a dead
    point is where OC is perpendicular to the line of O. Long before it σ is small."""
    points = SLIDES['points']
    base, C, H = (np.array(points[name]['at']) for name in 'OCH')
    turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    along = np.array([-1.0, -0.07]) / np.hypot(1.0, 0.07)
    normal = turn @ np.array([0.44, 0.9]) / np.hypot(0.44, 0.9)
    away, apart = normal @ (C - H - turn @ (base - H)), np.linalg.norm(C - base)
    ends = sorted((away + sign * apart) / (normal @ along) for sign in (-1.0, 1.0))
    closure = Closure(SLIDES, ['boom', 'hinge'])
    start = closure.start
    posture = closure.close({'boom': start['boom'], 'hinge': start['hinge'] + turned})
    assert posture.travel('boom') == pytest.approx(tuple(ends), abs=1e-9)


# a plate on three legs; two of its angles rest, and it turns by the third
TRIPOD: dict[str, Any] = {
    'alf': 1,
    'points': {
        'A': {'at': [1.14, -0.12]},
        'B': {'at': [0.63, 0.28]},
        'C': {'at': [0.2, 0.22]},
        'D': {'at': [-0.78, 0.61], 'fixed': True},
        'E': {'at': [-0.18, 0.3]},
        'F': {'at': [-0.05, 0.53]},
        'G': {'at': [-0.72, -0.78], 'fixed': True},
        'H': {'at': [-0.33, 0.14]},
        'I': {'at': [-0.24, 0.23]},
        'K': {'at': [-0.34, 0.5]},
        'L': {'at': [-0.24, -0.64]},
    },
    'bodies': {
        'plate': _bar('C', 'F', 'I'),
        'slide': _bar('A', 'B'),
        'bar': _bar('B', 'C'),
        'second': _bar('D', 'K'),
        'second_rod': _bar('E', 'F'),
        'third': _bar('G', 'L'),
        'third_rod': _bar('H', 'I'),
    },
    'joints': {
        'guide': _slide('ground', 'slide', 'A', [0.78, 0.63]),
        'knee': _pin('slide', 'bar', 'B'),
        'first_hinge': _pin('bar', 'plate', 'C'),
        'second_pin': _pin('ground', 'second', 'D'),
        'second_length': _slide('second', 'second_rod', 'E', [0.39, 0.92]),
        'second_hinge': _pin('second_rod', 'plate', 'F'),
        'third_pin': _pin('ground', 'third', 'G'),
        'third_length': _slide('third', 'third_rod', 'H', [0.92, 0.39]),
        'third_hinge': _pin('third_rod', 'plate', 'I'),
    },
}
# rad: where the angle turns back, of a computation of its own (poses of rigid bodies as unknowns,
# followed by arc length)
TRIPOD_ENDS = -0.2029486788111, 8.8196255245594


def test_an_angle_whose_travel_is_more_than_a_turn() -> None:
    """A turn later the plate is elsewhere, so the next turn need not be possible."""
    closure = Closure(TRIPOD, ['first_hinge', 'second_hinge', 'third_pin'])
    posture = closure.close(closure.start)
    assert posture.travel('second_hinge') == pytest.approx(TRIPOD_ENDS, abs=1e-9)
    assert TRIPOD_ENDS[1] - TRIPOD_ENDS[0] > math.tau


def test_delta_robot_forward_and_inverse() -> None:
    """Forward: three spheres; inverse: the angles that lead back."""
    rb, a, rod, rp = 0.20, 0.25, 0.45, 0.06
    closure = Closure('delta_robot', ['motor0', 'motor1', 'motor2'])
    turns = 2.0 * np.pi * np.arange(3) / 3.0
    out = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(3)])
    time = np.linspace(0.0, 1.0, 80)
    for t in time:
        # angles are counted from the drawing, at 30 degrees
        given = 0.4 * np.sin(2.0 * np.pi * t + np.arange(3)) * t
        angle = math.radians(30.0) + given
        posture = closure.close({f'motor{k}': float(given[k]) for k in range(3)})
        centres = (rb - rp + a * np.cos(angle))[:, None] * out
        centres[:, 2] -= a * np.sin(angle)
        np.testing.assert_allclose(posture.points['C'], lowest(centres, rod), atol=1e-12)
        assert posture.closed_to < 1e-13


def lowest(centres: Floats, radius: float) -> Floats:
    """The lower one of two points at this distance from three."""
    x = centres[1] - centres[0]
    size = np.linalg.norm(x)
    x = x / size
    y = centres[2] - centres[0]
    i = x @ y
    y = y - i * x
    j = np.linalg.norm(y)
    y = y / j
    z = np.cross(x, y)
    u = size / 2.0
    v = (i * i + j * j - 2.0 * i * u) / (2.0 * j)
    w = math.sqrt(radius**2 - u * u - v * v)
    both = [centres[0] + u * x + v * y + sign * w * z for sign in (-1, 1)]
    return np.asarray(min(both, key=lambda place: float(place[2])))


def test_the_effort_map_is_the_work_of_finite_differences() -> None:
    closure = Closure(FIVE_BAR, ['m1', 'm2'])
    at = {'m1': 1.9, 'm2': 1.3}
    posture = closure.close(at)
    h = 1e-5
    for n, name in enumerate(closure.active):
        changed = [
            closure.close({**at, name: at[name] + sign * h}).joint_positions for sign in (1, -1)
        ]
        slopes = (changed[0] - changed[1]) / (2.0 * h)
        np.testing.assert_allclose(posture.effort_map[n], slopes, atol=1e-8)
        closure.close(at)


def test_the_effort_map_gives_the_efforts_of_the_simulators_drives() -> None:
    """A torque on the passive rocker of a four-bar at rest is held by the crank: -Gᵀ τ."""
    fields = {
        'mechanism': 'four_bar',
        'drives': {'hold': {'joint': 'crank_pin', 'angle': 'radians(60)'}},
        'effects': {},
    }
    simulation = Simulation(load_scene(fields))
    simulation.apply_effort('rocker_pin', 0.7)
    held = simulation.sample().drives[2][0]
    posture = Closure('four_bar', ['crank_pin']).close({'crank_pin': math.radians(60)})
    tau = np.array([0.7 if name == 'rocker_pin' else 0.0 for name in posture.joints])
    assert float(held) == pytest.approx(-float(posture.effort_map[0] @ tau), rel=1e-9)


def test_a_five_bar_of_type_two_loses_the_distance() -> None:
    """Where both rods lie on one line, the cranks do not determine the tip."""
    closure = Closure(FIVE_BAR, ['m1', 'm2'])
    distances = []
    for spread in np.linspace(0.0, 0.99, 34):
        # A and B apart by d + 2 a sin(turn): the rods stretch at 2 b
        turn = math.asin(spread * (2 * 0.35 - 0.3) / (2 * 0.2))
        posture = closure.close({'m1': math.pi / 2 + turn, 'm2': math.pi / 2 - turn})
        half = 0.15 + 0.2 * math.sin(turn)
        height = 0.2 * math.cos(turn) + math.sqrt(0.35**2 - half**2)
        np.testing.assert_allclose(posture.points['P'], [0.15, height], atol=1e-10)
        distances.append(posture.distance)
    assert all(a > b for a, b in zip(distances[25:], distances[26:], strict=False))
    assert distances[-1] < 0.3 * distances[0]


def test_a_restart_repeats_bit_for_bit(slider: Closure) -> None:
    table = stroke(np.arange(0.7, -2.0, -0.03))[:, None]
    slider.restart()
    first = slider.follow(table)[0]
    slider.restart()
    again = [slider.close({'guide': float(x)}).joint_positions for (x,) in table]
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize('span', [1.0, 0.001])
def test_instants_before_a_table_do_not_time_the_call_behind_it(
    slider: Closure, span: float
) -> None:
    """The first of them was taken for a tenth of a step, on the wrong side of the dead point."""
    slider.restart()
    for n in range(2):
        slider.close({'guide': float(stroke(0.75 - 0.01 * n))}, t=n * span)
    table = stroke(np.arange(0.73, 0.029, -0.05))[:, None]
    assert slider.follow(table)[0][-1, 0] == pytest.approx(0.03, abs=1e-9)
    for n, angle in enumerate(np.arange(-0.02, -0.3, -0.05).tolist()):
        posture = slider.close({'guide': float(stroke(angle))}, t=span + 0.05 * (n + 1))
        assert posture.joints['pin'] == pytest.approx(angle, abs=1e-7)
        assert not posture.ambiguous


def test_an_empty_table_changes_nothing() -> None:
    closure = Closure(SLIDER_CRANK, ['guide'])
    closure.close({'guide': 1.4}, t=1.0)
    values, missed = closure.follow(np.zeros((0, 1)))
    assert values.shape == (0, 3) and missed.shape == (0,)
    with pytest.raises(InputError):
        closure.close({'guide': 1.4}, t=1.0)


@pytest.mark.parametrize('table', [
    [],
    [1.4],
    [[1.4, 1.4]],
    [[1.4], [1.4, 1.4]],
    [[math.nan]],
    [['1.4']],
    [[True]],
    [[1.4], [True]],
    [[None]],
    [[10**400]],
    [[1.4 + 1.0j]],
    np.ma.masked_array([[1.4]], mask=[[True]]),
    'a',
    None,
    np.array(1.4),
])  # fmt: skip
def test_what_is_no_table_of_numbers_is_refused(slider: Closure, table: Any) -> None:
    """Masked numbers, the real parts of complex ones, and truth values among numbers were followed
    without a word."""
    with pytest.raises(InputError) as caught:
        slider.follow(table)
    assert str(caught.value) == 'table: not a table; expected rows of 1 finite numbers'


def test_numbers_of_any_kind_make_a_table(slider: Closure) -> None:
    tables: list[Any] = [
        [[1]],
        [[np.array(1)]],
        np.ones((1, 1), dtype=np.float32),
        np.ones((1, 1), dtype=object),
    ]
    assert [slider.follow(table)[0][0, 2] for table in tables] == pytest.approx([1.0] * 4)


def test_the_row_that_is_too_far_is_named(slider: Closure) -> None:
    """It named the value of the last row."""
    with pytest.raises(InputError) as caught:
        slider.follow([[1.4], [1e9], [1.3]])
    assert str(caught.value) == 'guide: too far away, got 1000000000.0'


@pytest.mark.parametrize('copied', [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_motion_has_no_copy(slider: Closure, copied: Any) -> None:
    """Calls of a copy moved the original as well."""
    with pytest.raises(TypeError, match='make another one of its scene'):
        copied(slider)


def test_a_negative_noise_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        Closure(SLIDER_CRANK, ['guide'], noise=-1.0)
    said = 'noise.guide: not usable, got -1.0; expected a finite number, 0 or more'
    assert str(caught.value) == said


REFUSED = {
    'unknown': (['giude'], "active: no such joint coordinate, got 'giude'; did you mean 'guide'?"),
    'none': ([], 'active: no joint is active; known: pin, knee, guide'),
    'twice': (['pin', 'pin'], "active: given twice, got 'pin'"),
    'text': ('pin', "active: not a list of joint coordinates, got 'pin'; expected ['name', …]"),
    'too many': (
        ['pin', 'guide'],
        '2 active joints, but together they have 1 freedom: the loops would not allow all values',
    ),
}


@pytest.mark.parametrize(('active', 'message'), REFUSED.values(), ids=list(REFUSED))
def test_wrong_active_joints_are_refused(active: Any, message: str) -> None:
    with pytest.raises(InputError) as caught:
        Closure(SLIDER_CRANK, active)
    assert message in str(caught.value)


def test_the_freedoms_that_are_left_are_named() -> None:
    with pytest.raises(InputError) as caught:
        Closure('delta_robot', ['motor0'])
    assert str(caught.value).startswith(
        'active: 2 freedoms are left: motor1, motor2 would still be free'
    )


def test_bodies_are_named_where_no_joint_is_left() -> None:
    """A plate floats beside a slider-crank, all of which the active crank holds."""
    beside = {
        **SLIDER_CRANK,
        'points': {**SLIDER_CRANK['points'], 'P': {'at': [2, 2]}, 'Q': {'at': [3, 2]}},
        'bodies': {
            **SLIDER_CRANK['bodies'],
            'plate': {'points': ['P', 'Q'], 'mass': 1, 'inertia': 'rod'},
        },
    }
    with pytest.raises(InputError) as caught:
        Closure(beside, ['pin'])
    assert 'active: 3 freedoms are left: body plate would still be free' in str(caught.value)


def test_a_joint_that_moves_in_the_dead_point_only_is_not_left_free() -> None:
    """The rod between two balls spins; the crank, which begins in the rocker's dead point, was
    named as free."""
    spinning = {
        'alf': 1,
        'space': 'spatial',
        'points': {
            'O': {'at': [0, 0, 0], 'fixed': True},
            'A': {'at': [0.1, 0, 0]},
            'B': {'at': [0.35, 0, 0.4]},
            'C': {'at': [0.35, 0, 0], 'fixed': True},
        },
        'bodies': {
            'arm': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
            'rod': {
                'points': ['A', 'B'],
                'mass': 1,
                'inertia': {'about_com': [0.01, 0.02, 0.02]},
                'com': [0.2, 0, 0],
            },
            'swing': {'points': ['C', 'B'], 'mass': 1, 'inertia': 'rod'},
        },
        'joints': {
            'crank': {
                'type': 'revolute',
                'between': ['ground', 'arm'],
                'at': 'O',
                'axis': [0, 0, 1],
            },
            'knee': {'type': 'spherical', 'between': ['arm', 'rod'], 'at': 'A'},
            'wrist': {'type': 'spherical', 'between': ['rod', 'swing'], 'at': 'B'},
            'rocker': {
                'type': 'revolute',
                'between': ['ground', 'swing'],
                'at': 'C',
                'axis': [0, -1, 0],
            },
        },
    }
    with pytest.raises(InputError) as caught:
        Closure(spinning, ['rocker'])
    assert str(caught.value).startswith('active: 1 freedom is left: body rod would still be free')


def test_coupled_joints_keep_their_phase_over_turns() -> None:
    """A finger whose second joint turns twice as far, back: no drift after many turns."""
    gripper = {
        'alf': 1,
        'space': 'planar',
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': [1, 0]},
            'B': {'at': [1.5, 0]},
        },
        'bodies': {
            'upper': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
            'lower': {'points': ['A', 'B'], 'mass': 1, 'inertia': 'rod'},
        },
        'joints': {
            'one': {'type': 'revolute', 'between': ['ground', 'upper'], 'at': 'O'},
            'two': {'type': 'revolute', 'between': ['upper', 'lower'], 'at': 'A'},
        },
        'couplings': {'mimic': {'joints': {'one': 2, 'two': 1}}},
    }
    closure = Closure(gripper, ['one'])
    for angle in (*np.arange(0.0, 50.0, 0.2), 3.0, -7.0):
        posture = closure.close({'one': angle}, rates={'one': 1.0})
        assert posture.joints['two'] == pytest.approx(-2.0 * angle, abs=1e-12)
        assert posture.joint_rates['two'] == pytest.approx(-2.0, abs=1e-12)
        place = np.array([math.cos(angle) + 0.5 * math.cos(angle), 0.5 * math.sin(angle)])
        np.testing.assert_allclose(posture.points['B'], place, atol=1e-12)


WRONG: list[tuple[dict[str, Any], str]] = [
    ({'positions': {}}, 'positions: without guide; expected a number for each'),
    ({'positions': {'guide': math.nan}}, 'positions.guide: not usable, got nan'),
    ({'positions': {'pin': 1.0}}, "positions: not an active joint, got 'pin'"),
    ({'positions': {'guide': 0.9}, 'rates': {}}, 'rates: without guide'),
    ({'positions': {'guide': 0.9}, 't': 'now'}, "t: not a time, got 'now'; expected s"),
    ({'positions': {'guide': 1e9}}, 'guide: too far away'),
    ({'positions': [0.9]}, 'positions: not numbers by name'),
]


@pytest.mark.parametrize(('arguments', 'message'), WRONG, ids=[m for _, m in WRONG])
def test_wrong_values_change_nothing(
    slider: Closure, arguments: dict[str, Any], message: str
) -> None:
    slider.restart()
    before = slider.close({'guide': 0.9})
    slider.restart()
    with pytest.raises(InputError) as caught:
        slider.close(**arguments)
    assert message in str(caught.value)
    np.testing.assert_array_equal(
        slider.close({'guide': 0.9}).joint_positions, before.joint_positions
    )
