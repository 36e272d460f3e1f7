"""Steps across kinks: stops anywhere on the way, against a motion made of its pieces."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from alf_ros import Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.kernel.step_length import ACROSS
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import Scene
from alf_ros.studies.exact import one_freedom
from support.effect_scenes import MASS
from support.thorough import combined

CRANK = one_freedom.slider_crank()
ADAPTIVE = ['dop853_adaptive', 'esdirk43_adaptive']
TIMES = np.array([0.1, 0.2, 0.3])
LATER = np.array([0.3, 0.6])


def bouncing(
    theta: float,
    rate: float,
    stop: float,
    stiffness: float,
    exponent: float,
    times: Floats = TIMES,
) -> list[Floats]:
    """q of a slider-crank that bounces off a stop, piece by piece: no step goes across a kink."""

    def rates(inside: bool) -> Callable[[float, Floats], tuple[float, float]]:
        def found(t: float, y: Floats) -> tuple[float, float]:
            depth = max(0.0, y[0] - stop) if inside else 0.0
            push = stiffness * depth**exponent / CRANK.inertia(y[0])[0]
            return y[1], CRANK.acceleration(y[0], y[1]) - push

        return found

    def crosses(t: float, y: Floats) -> float:
        return y[0] - stop

    crosses.terminal = True  # type: ignore[attr-defined]
    t, y, inside, places = 0.0, np.array([theta, rate]), False, []
    while t < times[-1]:
        crosses.direction = -1 if inside else 1  # type: ignore[attr-defined]
        piece = solve_ivp(
            rates(inside),
            (t, times[-1]),
            y,
            'DOP853',
            rtol=3e-14,
            atol=1e-15,
            events=crosses,
            dense_output=True,
            max_step=2e-4 if inside else 2e-3,
        )
        places += [CRANK.position(piece.sol(a)[0]) for a in times if t < a <= piece.t[-1]]
        t, y, inside = piece.t[-1], np.array([stop, piece.y[1, -1]]), not inside
    return places


@pytest.mark.parametrize(
    ('theta', 'rate', 'stop', 'stiffness', 'exponent'),
    [
        (0.3, 6.0, 0.8, 1e3, 1.0),
        (0.3, 6.0, 0.8, 1e7, 1.0),
        (0.3, 6.0, 0.8, 1e7, 1.5),
        (1.2, 3.0, math.pi / 2 + 3e-3, 1e7, 1.5),  # beside a singular position
    ],
)
def test_the_error_falls_with_the_tolerance(
    theta: float, rate: float, stop: float, stiffness: float, exponent: float
) -> None:
    wanted = bouncing(theta, rate, stop, stiffness, exponent)
    scene = bounced(theta, rate, stop, stiffness, exponent)
    for step in (0.05, 1e-3):
        for tolerance in (1e-6, 1e-8, 1e-9, 1e-10, 1e-11):
            sim = Simulation(scene, step=step, integrator='dop853_adaptive', tolerance=tolerance)
            for q in wanted:
                sim.step(round(0.1 / step))
                assert sim.sample().q == pytest.approx(q, abs=100.0 * tolerance)


@pytest.mark.parametrize(
    ('theta', 'rate', 'stop', 'stiffness', 'exponent'),
    [
        (0.995, 7.126, 1.609, 3.91e4, 1.5),
        (0.995431, 7.12567, 1.608945, 3.90779e4, 1.5),
        (1.327, 7.437, 2.117, 2.34e4, 1.5),
        (2.4, 6.205, 2.483, 2.66e5, 1.5),
    ],
)
def test_a_kink_below_the_errors_of_the_smooth_motion_is_known(
    theta: float, rate: float, stop: float, stiffness: float, exponent: float
) -> None:
    """Long steps, whose embedded errors do not show that the stop is in them: the stop does."""
    wanted = bouncing(theta, rate, stop, stiffness, exponent, LATER)
    scene = bounced(theta, rate, stop, stiffness, exponent)
    for step in (0.3, 0.1, 0.06, 0.05, 0.02):
        for tolerance in (1e-8, 1e-9, 1e-10):
            sim = Simulation(scene, step=step, integrator='dop853_adaptive', tolerance=tolerance)
            for q in wanted:
                sim.step(round(0.3 / step))
                assert sim.sample().q == pytest.approx(q, abs=10.0 * tolerance)


def bounced(theta: float, rate: float, stop: float, stiffness: float, exponent: float) -> Scene:
    """The scene of `bouncing`."""
    points = dict(zip('AB', CRANK.position(theta).reshape(-1, 2).tolist(), strict=True))
    speeds = dict(zip('AB', (rate * CRANK.tangent(theta)).reshape(-1, 2).tolist(), strict=True))
    return load_scene(
        {
            'mechanism': 'slider_crank',
            'effects': {
                'gravity': {'acceleration': [0, -one_freedom.GRAVITY]},
                'joint_stop': {
                    'joint': 'crank_pin',
                    'upper': stop,
                    'stiffness': stiffness,
                    'exponent': exponent,
                },
            },
            'initial': {'positions': points, 'velocities': speeds},
        }
    )


def swinging(theta: float, rate: float, times: tuple[float, float], **events: Any) -> Any:
    """The crank without a stop, between two times."""
    return solve_ivp(
        lambda t, y: (y[1], CRANK.acceleration(y[0], y[1])),
        times,
        (theta, rate),
        'DOP853',
        rtol=3e-14,
        atol=1e-15,
        dense_output=True,
        max_step=5e-3,
        **events,
    )


def grazing(
    theta: float, rate: float, depth: float, stiffness: float, exponent: float
) -> tuple[float, list[Floats]]:
    """The stop that a slider-crank would pass by `depth` (rad) where its swing turns, and its q
    after 0.3, 0.6 and 0.9 s. It turns at 0.1 to 0.7 s."""

    def turns(t: float, y: Floats) -> float:
        return float(y[1])

    turns.terminal, turns.direction = True, -1  # type: ignore[attr-defined]
    up = swinging(theta, rate, (0.0, 2.0), events=turns)
    stop = up.y[0, -1] - depth
    meets = brentq(lambda t: up.sol(t)[0] - stop, 0.0, up.t[-1], xtol=1e-16, rtol=1e-15)

    def leaves(t: float, y: Floats) -> float:
        return float(y[0] - stop)

    leaves.terminal, leaves.direction = True, -1  # type: ignore[attr-defined]

    def rates(t: float, y: Floats) -> tuple[float, float]:
        push = stiffness * max(0.0, y[0] - stop) ** exponent / CRANK.inertia(y[0])[0]
        return y[1], CRANK.acceleration(y[0], y[1]) - push

    inside = solve_ivp(
        rates,
        (meets, 2.0),
        (stop, up.sol(meets)[1]),
        'DOP853',
        rtol=3e-14,
        atol=1e-15,
        events=leaves,
        first_step=1e-7,
        max_step=1e-4,
    )
    down = swinging(stop, inside.y[1, -1], (inside.t[-1], 1.0))
    pieces = [up if t <= meets else down for t in (0.3, 0.6, 0.9)]
    places = [piece.sol(t)[0] for piece, t in zip(pieces, (0.3, 0.6, 0.9), strict=True)]
    return stop, [CRANK.position(place) for place in places]


@pytest.mark.parametrize(
    ('theta', 'rate', 'depth', 'stiffness', 'exponent', 'integrator'),
    combined(
        [
            (0.356, 3.281, 3.8e-6, 7.0e6, 1.0),
            (0.228, 1.176, 1.1e-5, 1.9e6, 1.0),
            (0.175, 3.316, 4.0e-5, 7.7e4, 1.5),
            (0.513, 1.148, 2.4e-6, 7.8e6, 1.5),
            (0.202, 1.681, 1.8e-4, 8.7e4, 1.0),
            (0.41, 1.95, 1.0e-3, 1.0e7, 1.5),
            (0.3, 2.4, 1.0e-2, 1.0e4, 1.0),
        ],
        ADAPTIVE,
    ),
)
def test_a_stop_that_is_only_grazed_is_seen(
    integrator: str, theta: float, rate: float, depth: float, stiffness: float, exponent: float
) -> None:
    """Contacts of 1 to 60 ms, of which no stage of a long step need be a part."""
    stop, wanted = grazing(theta, rate, depth, stiffness, exponent)
    scene = bounced(theta, rate, stop, stiffness, exponent)
    for step in (0.3, 0.1, 0.03, 0.01, 1e-3):
        for tolerance in (1e-4, 1e-6, 1e-8, 1e-9):
            sim = Simulation(scene, step=step, integrator=integrator, tolerance=tolerance)
            for q in wanted:
                sim.step(round(0.3 / step))
                assert sim.sample().q == pytest.approx(q, abs=100.0 * tolerance)


def thrown(depth: float, stiffness: float, times: Floats) -> Floats:
    """Heights of 2 kg thrown up by 1 m, which is `depth` more than a springy ceiling allows."""
    g, rate = one_freedom.GRAVITY, math.sqrt(0.5 * stiffness)
    ceiling, first = 1.0 - depth, math.sqrt(2.0 * g)
    speed = math.sqrt(2.0 * g * depth)
    meets, lasts = (first - speed) / g, 2.0 * math.atan2(speed * rate, g) / rate
    found = []
    for t in times:
        tau, past = t - meets, t - meets - lasts
        if tau < 0.0:
            found.append(first * t - 0.5 * g * t * t)
        elif past < 0.0:
            swing = g / rate**2 * (math.cos(rate * tau) - 1.0)
            found.append(ceiling + swing + speed / rate * math.sin(rate * tau))
        else:
            found.append(ceiling - speed * past - 0.5 * g * past * past)
    return np.array(found)


def under(effects: dict[str, Any]) -> Scene:
    """The mass, thrown up."""
    up = math.sqrt(2.0 * one_freedom.GRAVITY)
    gravity = {'acceleration': [0, -one_freedom.GRAVITY]}
    return load_scene(
        {
            **yaml.safe_load(MASS),
            'effects': {'gravity': gravity, **effects},
            'initial': {'positions': {'P': [0, 0]}, 'velocities': {'P': [0, up]}},
        }
    )


@pytest.mark.parametrize('integrator', ADAPTIVE)
@pytest.mark.parametrize('kind', ['ground_contact', 'spring'])
def test_a_throw_that_just_reaches_the_ceiling(kind: str, integrator: str) -> None:
    """Any step follows the parabola: only the contact, or the rope that gets taut, limits it."""
    for depth in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2):
        for stiffness in (1e4, 1e7):
            at = 1.0 - depth
            ceiling = {'on': 'P', 'normal': [0, -1], 'through': [0, at], 'exponent': 1}
            rope = [[0.0, 0.0], [1.0 + at, 0.0], [2.0 + at, stiffness]]
            tied = {'between': ['P', 'ground'], 'at': [None, [0, -1]], 'free_length': 0}
            effect = {
                'ground_contact': {**ceiling, 'stiffness': stiffness},
                'spring': {**tied, 'table': rope},
            }[kind]
            scene = under({kind: effect})
            for step, tolerance in ((0.6, 1e-8), (0.3, 1e-5), (0.05, 1e-7), (2e-3, 1e-6)):
                times = np.array([step * n for n in range(1, round(0.6 / step) + 1)])
                sim = Simulation(scene, step=step, integrator=integrator, tolerance=tolerance)
                heights = [sample.points['P'][1] for sample in sim.run(0.6)][1:]
                assert np.array(heights) == pytest.approx(
                    thrown(depth, stiffness, times), abs=100.0 * tolerance
                )


@pytest.mark.parametrize(
    'integrator, silent', [('rk4', 2e-3), ('dop853', 2e-3), ('esdirk43', 2e-2)]
)
def test_a_fixed_step_sees_the_ceiling_or_is_too_long(integrator: str, silent: float) -> None:
    """No stage need meet it, and the parabola has no error that would tell."""
    for depth in (1e-4, 1e-3, 1e-2):
        for stiffness in (1e3, 1e5, 1e7):
            ceiling = {'on': 'P', 'normal': [0, -1], 'through': [0, 1.0 - depth], 'exponent': 1}
            scene = under({'ground_contact': {**ceiling, 'stiffness': stiffness}})
            for step in (0.3, 0.1, 0.03):
                times = np.array([step * n for n in range(1, round(0.6 / step) + 1)])
                sim = Simulation(scene, step=step, integrator=integrator)
                heights = []
                try:
                    heights = [sample.points['P'][1] for sample in sim.run(0.6)][1:]
                except StepError:
                    assert sim.resolution.too_long
                if not sim.resolution.too_long:
                    wanted = thrown(depth, stiffness, times)
                    assert np.array(heights) == pytest.approx(wanted, abs=silent)


@pytest.mark.parametrize('integrator', ADAPTIVE)
def test_a_stop_out_of_reach_changes_no_bit(integrator: str) -> None:
    theta, rate = 0.3, 2.4
    free, stopped = (
        Simulation(
            bounced(theta, rate, stop, 1e6, 1.5), step=0.1, integrator=integrator, tolerance=1e-8
        )
        for stop in (3.0, 1.5)
    )
    for sim in (free, stopped):
        sim.step(20)
    assert np.array_equal(free.state.q, stopped.state.q)
    assert free.evaluations == stopped.evaluations


@pytest.mark.parametrize('power', [0, 1, 2])
def test_what_counts_across_a_kink_is_about_a_tenth_of_the_error(power: int) -> None:
    """A force that jumps, bends or bends in its slope at any part τ of a step: its impulse."""
    tableau = TABLEAUX['dop853_adaptive']
    stages = tableau.b.size
    embedded = np.reshape(tableau.embedded, (2, stages))
    for tau in np.linspace(1e-3, 0.999, 997):
        force = np.where(tableau.c > tau, (tableau.c - tau) ** power, 0.0)
        exact = (1.0 - tau) ** (power + 1) / (power + 1)
        fine, coarse = np.abs(embedded @ force)
        assert abs(exact - tableau.b @ force) < 10.5 * max(fine, ACROSS * coarse)
