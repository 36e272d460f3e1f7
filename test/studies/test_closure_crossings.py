"""Closures through flat positions, where the branches of four-bars cross, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from alf_ros.arrays import Floats
from support.flat_four_bars import Bars, closure_of, crossed, kite, parallel, random_motion
from support.thorough import LONG, combined

AT, AWAY = 1e-9, 1e-12  # m: in a flat position, and further than NEAR (rad) from it
NEAR = 0.02


def assert_held(bars: Bars, a: float, b: float, angles: Floats) -> None:
    """The postures at these angles, which begin within half a turn of 0, are on their branch."""
    closure = closure_of(bars, a, b, float(angles[0]))
    for angle in angles[1:].tolist():
        posture = closure.close({'pin': angle})
        found = np.concatenate([posture.points['A'], posture.points['B']])
        off = float(np.abs(found - bars(a, b, angle)).max())
        assert off <= (AWAY if abs(angle) > NEAR else AT), (a, b, angle, off)
        assert posture.missed_by <= 1e-12
        assert posture.closed_to <= 1e-12


def calls(spacing: float, beside: float) -> Floats:
    """Angles from below 0 to above, at this spacing, one of them so far from 0."""
    count = max(4, round(0.5 / spacing))
    return np.arange(-count, count + 1, dtype=np.float64) * spacing + beside


SPACINGS = (0.005, 0.02, 0.05, 0.1, 0.2)  # rad


@pytest.mark.parametrize(('a', 'spacing'), combined([0.3, 0.5, 0.7, 0.85, 0.95, 0.97], SPACINGS))
def test_a_crossed_four_bar_stays_crossed(a: float, spacing: float) -> None:
    for beside in (0.0, 1e-12, 1e-9, 1e-5, -1e-3, spacing / 3, spacing / 2):
        assert_held(crossed, a, 1.0, calls(spacing, beside))


@pytest.mark.parametrize(
    ('bars', 'a', 'b', 'spacing'),
    combined(
        [(kite, 0.4, 1.1), (kite, 0.8, 1.0), (parallel, 0.4, 1.0), (parallel, 1.2, 0.9)], SPACINGS
    ),
)
def test_kites_and_parallelograms_keep_their_branch(
    bars: Bars, a: float, b: float, spacing: float
) -> None:
    for beside in (0.0, 1e-9, -1e-5, spacing / 3, spacing / 2):
        assert_held(bars, a, b, calls(-spacing, beside))


@pytest.mark.parametrize('beside', [0.0, 1e-9, 1e-4, 0.01])
@pytest.mark.parametrize('a', [0.3, 0.6, 0.85, 0.95])
def test_a_crank_that_turns_back_at_the_flat_position(a: float, beside: float) -> None:
    """In the position itself, and behind it."""
    angles = calls(0.03, beside)
    for last in (angles.size // 2, angles.size // 2 + 1):
        there = angles[: last + 1]
        assert_held(crossed, a, 1.0, np.concatenate([there, there[-2::-1]]))


def test_random_motions_through_flat_positions() -> None:
    random = np.random.default_rng(11)
    for _ in range(150 if LONG else 60):
        assert_held(*random_motion(random))


def test_a_doubt_in_the_call_before_the_flat_position_leaves_its_line() -> None:
    """One of many motions, in which another branch is looked for just before the crossing."""
    random = np.random.default_rng(0)
    *_, motion = (random_motion(random) for _ in range(72))
    assert_held(*motion)


def test_calls_that_are_far_apart_go_through_the_flat_position() -> None:
    """In one call; several branches of a dead point are not in its way."""
    for a in (0.5, 0.9):
        assert_held(crossed, a, 1.0, np.array([-1.0, 0.7, -0.6, 1.1]))


def test_the_crank_of_a_crossed_four_bar_goes_round() -> None:
    posture = closure_of(crossed, 0.6, 1.0, 0.5).close({'pin': 0.5})
    assert posture.travel('pin') == (-math.inf, math.inf)
