"""Adaptive steps across kinks: stops anywhere on the way, against a motion made of its pieces."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.kernel.step_length import ACROSS
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import Scene
from alf_ros.studies.exact import one_freedom

CRANK = one_freedom.slider_crank()
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
