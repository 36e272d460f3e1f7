"""Closures of four-bars whose branches nearly cross, against triangles: never on the other one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from alf_ros import Closure
from alf_ros.arrays import Floats

START = 0.9  # rad
BARS = (1.0, 1.0, 2.0)  # m, crank, rocker and ground


def b_of(coupler: float, angle: float, bars: tuple[float, float, float] = BARS) -> Floats:
    """The place of B, left of the line from A to C."""
    crank, rocker, ground = bars
    a = crank * np.array([math.cos(angle), math.sin(angle)])
    x, y = np.array([ground, 0.0]) - a
    across = math.hypot(x, y)
    half = math.acos((coupler**2 + across**2 - rocker**2) / (2.0 * coupler * across))
    turned = math.atan2(y, x) + half
    return np.asarray(a + coupler * np.array([math.cos(turned), math.sin(turned)]))


def closure_of(
    coupler: float, noise: float = 0.0, bars: tuple[float, float, float] = BARS
) -> Closure:
    rod = {'mass': 1, 'inertia': 'rod'}
    return Closure(
        {
            'alf': 1,
            'points': {
                'O': {'at': [0, 0], 'fixed': True},
                'C': {'at': [bars[2], 0], 'fixed': True},
                'A': {'at': [bars[0] * math.cos(START), bars[0] * math.sin(START)]},
                'B': {'at': b_of(coupler, START, bars).tolist()},
            },
            'bodies': {
                'crank': {**rod, 'points': ['O', 'A']},
                'coupler': {**rod, 'points': ['A', 'B']},
                'rocker': {**rod, 'points': ['C', 'B']},
            },
            'joints': {
                'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
                'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
                'wrist': {'type': 'revolute', 'between': ['coupler', 'rocker'], 'at': 'B'},
                'hip': {'type': 'revolute', 'between': ['ground', 'rocker'], 'at': 'C'},
            },
        },
        ['pin'],
        noise=noise,
    )


@pytest.mark.parametrize('short', [1e-2, 1e-3, 1e-4, 1e-6, 1e-8])
def test_branches_that_nearly_cross_are_not_confused(short: float) -> None:
    """The branches pass each other at about √short rad, far less than a call moves the crank."""
    closure, random = closure_of(2.0 - short), np.random.default_rng(5)
    for n in range(40):
        closure.restart()
        spacing = random.uniform(0.02, 0.3)
        angles = np.arange(START, -2.0, -spacing)
        if n % 3 == 0:  # calls that are much closer together for once
            near = math.sqrt(short) * np.array([0.5, 0.0, -0.3])
            angles = np.concatenate([angles[angles > 0.01], near, angles[angles < -0.01]])
        for angle in angles.tolist():
            posture = closure.close({'pin': angle})
            off = np.abs(posture.points['B'] - b_of(2.0 - short, angle)).max()
            assert off < (1e-8 if abs(angle) < 1e-3 else 1e-11), (spacing, angle, off)
            assert posture.missed_by < 1e-12


@pytest.mark.parametrize('apart', [1e-3, 1.5e-4, 1e-5])
def test_one_call_within_the_bend_does_not_leave_the_branch(apart: float) -> None:
    """Equally spaced calls over the flat position at π, one of them where the branch bends."""
    bars, coupler = (0.9, 0.86, 0.68), 0.9 + 0.68 - 0.86 + apart
    closure = closure_of(coupler, 0.0, bars)
    for spacing in (0.1, 0.126, 0.2):
        for beside in math.sqrt(apart) * np.linspace(-2.0, 2.0, 25):
            closure.restart()
            for angle in (math.pi + beside + spacing * np.arange(-8, 4)).tolist():
                posture = closure.close({'pin': angle})
            off = np.abs(posture.points['B'] - b_of(coupler, angle, bars)).max()
            assert off < 1e-11, (spacing, beside, off)
            assert not posture.ambiguous


@pytest.mark.parametrize('long', [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize('spacing', [0.03, 0.1, 0.25])
def test_a_gap_is_not_jumped(long: float, spacing: float) -> None:
    """Coupler and rocker do not reach over a small range of the crank, which ends before it."""
    closure = closure_of(2.0 + long)
    across = 1.0 + long  # of A and C, where coupler and rocker lie on one line
    end = math.acos((5.0 - across**2) / 4.0)
    for angle in np.arange(START, -0.5, -spacing).tolist():
        posture = closure.close({'pin': angle})
        if angle > end:
            assert posture.missed_by < 1e-12
    assert posture.joints['pin'] == pytest.approx(end, abs=1e-6)
    assert posture.missed_by == pytest.approx(end - angle, abs=1e-6)


@pytest.mark.parametrize(
    ('short', 'noise', 'hidden'),
    [
        (1e-2, 1e-6, False),
        (1e-2, 1e-3, False),
        (1e-4, 1e-6, False),
        (1e-4, 1e-4, False),
        (1e-6, 1e-3, True),
        (1e-8, 1e-3, True),
    ],
)
def test_noise_does_not_take_the_posture_to_the_other_branch(
    short: float, noise: float, hidden: bool
) -> None:
    """The motion leads to the other branch. Only a bend narrower than the noise is marked."""
    closure, random = closure_of(2.0 - short, noise), np.random.default_rng(1)
    said = 0
    for _ in range(20):
        closure.restart()
        assert not closure.ambiguous
        angles = np.arange(START, -1.0, -random.uniform(0.02, 0.06))
        given = angles[:-1] + noise * random.standard_normal(angles.size - 1)
        closure.follow(given[:, None])
        posture = closure.close({'pin': float(angles[-1])})
        np.testing.assert_allclose(
            posture.points['B'], b_of(2.0 - short, float(angles[-1])), atol=1e-9
        )
        assert posture.branch == 1
        assert posture.ambiguous == closure.ambiguous
        said += posture.ambiguous
    assert said >= 18 if hidden else said == 0


@pytest.mark.parametrize('long', [1e-4, 1e-6])
@pytest.mark.parametrize('noise', [1e-6, 1e-3])
def test_a_gap_is_not_passed_with_noise_without_a_word(long: float, noise: float) -> None:
    closure, random = closure_of(2.0 + long, noise), np.random.default_rng(1)
    for _ in range(20):
        closure.restart()
        angles = np.arange(START, -2.0, -random.uniform(0.02, 0.06))
        closure.follow((angles + noise * random.standard_normal(angles.size))[:, None])
        posture = closure.close({'pin': float(angles[-1])})
        assert posture.ambiguous or posture.missed_by > 1.0
