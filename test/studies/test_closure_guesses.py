"""Motions that do not tell how they continue behind a dead point: right, or marked a guess."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros import Closure
from alf_ros.arrays import Floats

START = np.pi / 4  # rad, of the crank; its slider is at 2 cos(angle)
KINDS = ('twice', 'one twice', 'exchanged', 'an old one', 'a rest', 'a rest in it', 'slowly')


def calls(kind: str, random: np.random.Generator) -> Floats:
    """Crank angles through the dead point at 0, as the values arrive."""
    step = random.uniform(0.01, 0.08)
    angles = np.arange(START - random.uniform(0.0, 1.0) * step, -0.7, -step)
    dead = int(np.abs(angles).argmin())
    at, rest = dead + int(random.integers(-2, 3)), int(random.integers(3, 60))
    order = np.arange(angles.size)
    if kind == 'twice':
        return np.repeat(angles, 2)
    if kind == 'one twice':
        return np.insert(angles, at + 1, angles[at])
    if kind == 'exchanged':
        order[[at, at + 1]] = order[[at + 1, at]]
        return np.asarray(angles[order])
    if kind == 'an old one':
        return np.insert(angles, at + 1, angles[at - 3])
    if kind == 'a rest':
        return np.insert(angles, at, np.full(rest, angles[at]))
    if kind == 'a rest in it':
        return np.insert(angles, dead, np.zeros(rest))
    part = np.linspace(0.0, 1.0, 200)
    return np.concatenate([START * (1.0 - part) ** 3, -0.7 * part[1:] ** 3])


@pytest.mark.parametrize('noise', [0.0, 1e-6])
@pytest.mark.parametrize('kind', KINDS)
def test_a_motion_that_does_not_tell_the_branch_is_marked(kind: str, noise: float) -> None:
    """The crank continued on the other side, without a word."""
    closure, random = Closure('slider_crank', ['guide'], noise=noise), np.random.default_rng(0)
    said = 0
    for _ in range(40):
        closure.restart()
        angles = calls(kind, random)
        given = 2.0 * np.cos(angles) + noise * random.standard_normal(angles.size)
        values, _missed = closure.follow(given[:, None])
        crank = values[-1, closure.joint_names.index('crank_pin')]
        assert crank * angles[-1] > 0.0 or closure.ambiguous
        said += closure.ambiguous
    assert said > 0


@pytest.mark.parametrize('rest', [1, 2, 6])
def test_values_out_of_reach_that_no_motion_led_to(rest: int) -> None:
    """One call asked for too much. Its way to the dead point passed for a motion through it."""
    closure = Closure('slider_crank', ['guide'])
    closure.follow(2.0 * np.cos(np.arange(START, 0.3, -0.02))[:, None])
    closure.follow(np.full((rest, 1), 2.0 * np.cos(0.3)))
    assert closure.close({'guide': 2.5}).missed_by > 0.1
    back = closure.close({'guide': 2.0 * np.cos(0.3)})
    assert back.joints['crank_pin'] == pytest.approx(0.3, abs=1e-12)


def test_values_out_of_reach_beside_a_motion_through_the_dead_point() -> None:
    """The slider's places have an offset, so one of them is out of reach."""
    closure = Closure('slider_crank', ['guide'])
    angles = 0.05 * np.arange(12, -13, -1) + 0.002  # rad
    values, missed = closure.follow(2.0 * np.cos(angles)[:, None] + 2e-5)
    assert (missed > 1e-6).sum() == 1
    np.testing.assert_allclose(
        values[:, closure.joint_names.index('crank_pin')], angles, atol=3e-3
    )
    assert not closure.ambiguous


def test_a_branch_behind_a_stay_out_of_reach_is_a_guess() -> None:
    closure = Closure('slider_crank', ['guide'])
    closure.follow(2.0 * np.cos(np.arange(START, 0.1, -0.05))[:, None])
    closure.follow([[2.1]] * 3)
    assert closure.close({'guide': 2.0 * np.cos(0.1)}).ambiguous


def test_a_rest_away_from_a_dead_point_is_no_guess() -> None:
    closure = Closure('slider_crank', ['guide'])
    angles = np.concatenate(
        [np.arange(0.7, 0.2, -0.02), np.full(20, 0.2), np.arange(0.2, 0.7, 0.02)]
    )
    values, _ = closure.follow(2.0 * np.cos(angles)[:, None])
    np.testing.assert_allclose(
        values[:, closure.joint_names.index('crank_pin')], angles, atol=1e-12
    )
    assert not closure.ambiguous


def five_bar() -> Closure:
    """Cranks and rods 1 m, ground 1 m: the rods stretch where the cranks' ends are 2 m apart."""
    rod = {'mass': 1, 'inertia': 'rod'}
    points = {
        'O': {'at': [0, 0], 'fixed': True},
        'C': {'at': [1, 0], 'fixed': True},
        'A': {'at': [0, 1]},
        'B': {'at': [1, 1]},
        'P': {'at': [0.5, 1 + np.sqrt(0.75)]},
    }
    bodies = {'left': 'OA', 'right': 'CB', 'one': 'AP', 'two': 'BP'}
    joints = {'m1': 'O', 'm2': 'C', 'a': 'A', 'b': 'B', 'tip': 'P'}
    pairs = (('ground', 'left'), ('ground', 'right'), ('left', 'one'), ('right', 'two'))
    between = dict(zip(joints, (*pairs, ('one', 'two')), strict=True))
    return Closure(
        {
            'alf': 1,
            'points': points,
            'bodies': {name: {**rod, 'points': list(ends)} for name, ends in bodies.items()},
            'joints': {
                name: {'type': 'revolute', 'between': list(between[name]), 'at': at}
                for name, at in joints.items()
            },
        },
        ['m1', 'm2'],
    )


@pytest.mark.parametrize('close', [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize('spacing', [0.02, 0.05, 0.1])
def test_two_cranks_that_nearly_stretch_their_rods(close: float, spacing: float) -> None:
    """The cranks swing out and back, and the rods never stretch: the tip stays above them."""
    closure = five_bar()
    widest = np.arcsin(0.5 - 0.5 * close)  # the ends are 1 + 2 sin(widest) apart
    for phase in np.linspace(0.0, 1.0, 8, endpoint=False):
        closure.restart()
        swing = widest * np.cos(np.arange(-np.pi / 2, np.pi / 3, spacing) + phase * spacing)
        posture = None
        for out, turn in zip(swing, np.linspace(0.0, 0.2, swing.size), strict=True):
            given = {'m1': np.pi / 2 + out + turn, 'm2': np.pi / 2 - out + turn}
            posture = closure.close(given)
        assert posture is not None and posture.missed_by < 1e-12
        a, b, tip = (posture.points[name] for name in 'ABP')
        side = (b[0] - a[0]) * (tip[1] - a[1]) - (b[1] - a[1]) * (tip[0] - a[0])
        assert side > 0.0 or posture.ambiguous, (phase, side)
