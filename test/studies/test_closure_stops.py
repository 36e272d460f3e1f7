"""The travel of active joints within the stops of a scene, against triangles."""

from __future__ import annotations

import math

import pytest

from alf_ros import Closure, InputError, Scene, load_scene

A, B, C, D = 0.10, 0.30, 0.25, 0.30  # m, crank, coupler, rocker and ground of the four-bar
HIGHEST = math.pi - math.acos((D * D + C * C - (B - A) ** 2) / (2.0 * D * C))  # rad, of the rocker

SCREWED = {
    'alf': 1,
    'space': 'spatial',
    'points': {'O': {'at': [0, 0, 0], 'fixed': True}, 'A': {'at': [0.3, 0, 0]}},
    'bodies': {
        'arm': {'points': ['O'], 'mass': 1, 'inertia': {'about_com': [1, 1, 1, 0, 0, 0]}},
        'slide': {'points': ['A'], 'mass': 1, 'inertia': {'about_com': [1, 1, 1, 0, 0, 0]}},
    },
    'joints': {
        'pin': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O', 'axis': [0, 1, 0]},
        'guide': {'type': 'prismatic', 'between': ['arm', 'slide'], 'at': 'A', 'axis': [0, 1, 0]},
    },
    'couplings': {'screw': {'joints': {'guide': 1.0, 'pin': -0.05}}},
}
SLIDE_STOP = {'joint': 'guide', 'lower': -0.25, 'upper': 1.0, 'stiffness': 1e4}


def stopped(**stops: dict[str, float]) -> Scene:
    """The four-bar with stops at its joints."""
    effects = {
        f'at_{joint}': {'joint': joint, 'stiffness': 1e4, **ends} for joint, ends in stops.items()
    }
    return load_scene({'mechanism': 'four_bar', 'effects': {'joint_stop': effects}})


def cranks(rocker: float) -> list[float]:
    """Angles of the crank (rad) in one turn with the rocker at an angle."""
    x, y = D + C * math.cos(rocker), C * math.sin(rocker)
    reach = math.hypot(x, y)
    apart = math.acos((A * A + reach * reach - B * B) / (2.0 * A * reach))
    return [math.atan2(y, x) + sign * apart for sign in (-1.0, 1.0)]


def around(angle: float, places: list[float]) -> tuple[float, float]:
    """Of angles that repeat in each turn, the nearest ones below and above."""
    every = [place + turn * math.tau for place in places for turn in (-2, -1, 0, 1, 2)]
    return max(x for x in every if x < angle), min(x for x in every if x > angle)


def travel(scene: Scene, crank: float = 1.0, stops: bool = True) -> tuple[float, float]:
    return Closure(scene, ['crank_pin']).close({'crank_pin': crank}).travel('crank_pin', stops)


@pytest.mark.parametrize('rocker', [1.7, 2.0, 2.3])
def test_a_passive_joint_stops_the_crank(rocker: float) -> None:
    scene = stopped(rocker_pin={'upper': rocker})
    assert travel(scene) == pytest.approx(around(1.0, cranks(rocker)), abs=1e-11)
    assert travel(scene, stops=False) == (-math.inf, math.inf)


@pytest.mark.parametrize('below', [1e-3, 1e-5, 1e-8])
def test_a_stop_that_a_joint_only_touches(below: float) -> None:
    """Near the highest angle of the rocker, which it reaches once in a turn, and just above."""
    expected = around(1.0, cranks(HIGHEST - below))
    found = travel(stopped(rocker_pin={'upper': HIGHEST - below}))
    assert found == pytest.approx(expected, abs=1e-12 / math.sqrt(below))
    above = travel(stopped(rocker_pin={'upper': HIGHEST + below}))
    assert above == (-math.inf, math.inf)


@pytest.mark.thorough
def test_a_stop_of_the_active_joint_after_a_turn() -> None:
    scene = stopped(crank_pin={'lower': -9.0, 'upper': 7.5})
    assert travel(scene) == pytest.approx((-9.0, 7.5), abs=1e-12)
    # the coupler turns back and forth; the angle between crank and coupler counts turns
    knee = Closure('four_bar', ['crank_pin']).close({'crank_pin': 1.0}).joints['knee']
    low, high = travel(stopped(knee={'lower': knee - 4.0 * math.pi}))
    assert low == -math.inf
    assert high == pytest.approx(1.0 + 4.0 * math.pi, abs=1e-10)


def test_an_angle_coupled_to_a_length() -> None:
    """The length has no dead point, and is never the same again; it is followed to its stop."""
    scene = load_scene({'mechanism': SCREWED, 'effects': {'joint_stop': SLIDE_STOP}})
    posture = Closure(scene, ['pin']).close({'pin': 0.1})
    assert posture.travel('pin') == pytest.approx((-5.0, 20.0), abs=1e-9)
    assert posture.travel('pin', stops=False) == (-math.inf, math.inf)


def test_the_nearest_of_stops_and_dead_points() -> None:
    scene = stopped(crank_pin={'upper': 2.0}, rocker_pin={'upper': 2.0, 'lower': 1.0})
    closure = Closure(scene, ['rocker_pin'])
    low, high = closure.close({'rocker_pin': 1.6}).travel('rocker_pin')
    alone = closure.close({'rocker_pin': 1.6}).travel('rocker_pin', stops=False)
    assert low == alone[0] > 1.5  # a dead point
    assert high <= 2.0 < alone[1]


def test_beyond_a_stop_there_is_no_way_on() -> None:
    scene = stopped(rocker_pin={'upper': 1.5})
    posture = Closure(scene, ['crank_pin']).close({'crank_pin': 1.0})
    assert posture.joints['rocker_pin'] > 1.5
    assert posture.travel('crank_pin') == (1.0, 1.0)


def test_what_is_refused() -> None:
    posture = Closure(stopped(rocker_pin={'upper': 2.0}), ['crank_pin']).close({'crank_pin': 1.0})
    with pytest.raises(InputError, match='stops: '):
        posture.travel('crank_pin', stops='yes')  # type: ignore[arg-type]
