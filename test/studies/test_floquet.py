"""Floquet multipliers against elliptic integrals and variational equations of one freedom."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipe, ellipk

from alf_ros import InputError, Simulation, floquet, load_scene
from alf_ros.arrays import Floats
from alf_ros.commands.linearise import main
from alf_ros.scene.scene import Scene
from support.statics_scenes import GRAVITY

G = 9.81
BAR: dict[str, Any] = {'mass': 1.0, 'inertia': 'point', 'com': [1.0, 0.0]}


def shaken(amplitude: float, rate: float, drag: float = 0.0) -> Scene:
    """An upright pendulum (1 m, 1 kg) whose pivot is shaken along the vertical."""
    points = {'P': {'at': [0, amplitude]}, 'B': {'at': [0, amplitude + 1.0]}}
    bodies = {'bar': {'points': ['P', 'B'], **BAR}}
    drive = {'point': 'P', 'at': ['0', f'{amplitude}*cos({rate}*t)']}
    return load_scene(
        {
            'mechanism': {'alf': 1, 'points': points, 'bodies': bodies},
            'drives': {'shake': drive},
            'effects': {**GRAVITY, 'drag': {'on': 'bar', 'linear': drag}},
        }
    )


def swinging(angle: float) -> Scene:
    """A pendulum (1 m, 1 kg) let go at an angle from the vertical."""
    tip = [math.sin(angle), -math.cos(angle)]
    mechanism = {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'B': {'at': tip}},
        'bodies': {'bar': {'points': ['O', 'B'], **BAR}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
    }
    return load_scene({'mechanism': mechanism, 'effects': GRAVITY})


@pytest.mark.parametrize(
    ('rate', 'drag', 'verdict'),
    [(60.0, 0.0, 'neutral'), (30.0, 0.0, 'unstable'), (60.0, 0.5, 'stable')],
)
def test_a_shaken_pivot_holds_a_pendulum_upright(rate: float, drag: float, verdict: str) -> None:
    """Mathieu's equation, with the drag of the moving pivot: δ̈ + c δ̇ = (g + ÿ + c ẏ) δ."""
    period = 2.0 * math.pi / rate

    def rates(t: float, y: Floats) -> list[float]:
        phase = rate * t
        lift = G - 0.1 * rate**2 * math.cos(phase) - drag * 0.1 * rate * math.sin(phase)
        return [y[1], lift * y[0] - drag * y[1], y[3], lift * y[2] - drag * y[3]]

    solved = solve_ivp(rates, (0.0, period), [1, 0, 0, 1], 'DOP853', rtol=1e-13, atol=1e-14)
    expected = solved.y[:, -1].reshape(2, 2).T
    found = floquet(shaken(0.1, rate, drag), period=period)
    np.testing.assert_allclose(found.monodromy, expected, atol=1e-11)
    values = np.sort_complex(np.linalg.eigvals(expected).astype(complex))
    np.testing.assert_allclose(np.sort_complex(found.multipliers), values, atol=1e-11)
    assert found.verdict == verdict and not found.autonomous
    assert math.exp(-drag * period) == pytest.approx(np.linalg.det(found.monodromy), rel=1e-10)
    np.testing.assert_allclose(
        np.exp(found.exponents * period), found.multipliers, rtol=1e-12, atol=0.0
    )


def test_a_free_swing_shears_with_the_slope_of_its_period() -> None:
    """From rest at θ, T = 4 K(m) / √g, m = sin²(θ/2): the velocity changes by g sin θ dT/dθ."""
    angle = 2.0
    m = math.sin(angle / 2.0) ** 2
    K, E = ellipk(m), ellipe(m)
    period = 4.0 * K / math.sqrt(G)
    slope = (
        4.0 / math.sqrt(G) * (E - (1.0 - m) * K) / (2.0 * m * (1.0 - m)) * math.sin(angle) / 2.0
    )
    found = floquet(swinging(angle), period=period)
    shear = [[1.0, 0.0], [G * math.sin(angle) * slope, 1.0]]
    np.testing.assert_allclose(found.monodromy, shear, atol=1e-8)
    assert found.autonomous and found.verdict == 'neutral'
    assert max(found.miss) < 1e-10


@pytest.mark.parametrize('angle', [0.5, 2.0, 2.8])
@pytest.mark.parametrize('digit', [1e-9, -1e-9, 1e-8, -1e-8])
def test_last_digits_of_the_period_do_not_decide(angle: float, digit: float) -> None:
    """A free swing is neutral; its double multiplier 1 moves by the root of such an error."""
    period = 4.0 * ellipk(math.sin(angle / 2.0) ** 2) / math.sqrt(G)
    found = floquet(swinging(angle), period=period * (1.0 + digit))
    assert found.autonomous and found.verdict == 'neutral'


@pytest.mark.parametrize(
    ('speed', 'drag', 'verdict'), [(0.1, 0.0, 'unstable'), (8.0, 0.5, 'stable'), (8, 0, 'neutral')]
)
def test_short_periods_are_judged_as_long_ones(speed: float, drag: float, verdict: str) -> None:
    """Shaken with 40 kHz: the mean is δ̈ = (g - v²/2) δ - c δ̇, and v is the largest speed."""
    rate = 2.5e5
    found = floquet(shaken(speed / rate, rate, drag), period=2.0 * math.pi / rate)
    mean = np.roots([1.0, drag, speed**2 / 2.0 - G])
    np.testing.assert_allclose(
        np.sort_complex(found.exponents), np.sort_complex(mean), rtol=1e-3, atol=1e-6
    )
    assert found.verdict == verdict and not found.autonomous


def test_a_short_period_does_not_free_a_motion_from_time() -> None:
    """Shaken to the side with 16 kHz by x = a cos ωt, a bar stands upright at about -x / 1 m."""
    rate, aside = 1e5, 1e-6
    tip = [aside + math.sin(-aside), math.cos(aside)]
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'P': {'at': [aside, 0]}, 'B': {'at': tip}},
                'bodies': {'bar': {'points': ['P', 'B'], **BAR}},
            },
            'drives': {'shake': {'point': 'P', 'at': [f'{aside}*cos({rate}*t)', '0']}},
            'effects': GRAVITY,
        }
    )
    found = floquet(scene, period=2.0 * math.pi / rate)
    assert not found.autonomous and found.verdict == 'unstable'
    assert found.exponents[0] == pytest.approx(math.sqrt(G), rel=1e-3)


def test_a_loop_returns_after_its_period() -> None:
    """Without effects a four-bar turns for ever: dq̇ along the motion only changes its period."""
    crank = {'A': ['-3*a*sin(theta)', '3*a*cos(theta)']}
    scene = load_scene({'mechanism': 'four_bar', 'initial': {'velocities': crank}})
    simulation = Simulation(scene, integrator='dop853_adaptive', tolerance=1e-12, step=1e-3)
    start, after = simulation.sample(), []
    for sample in simulation.run(4.0, every=20):
        angle = sample.joints['crank_pin'].position - start.joints['crank_pin'].position
        after.append((sample.t, angle - 2.0 * math.pi))
    k = next(n for n, (_, left) in enumerate(after) if left > 0.0)
    times, left = np.array(after[k - 4 : k + 4]).T
    period = float(np.polynomial.Polynomial.fit(left, times, 7)(0.0))
    found = floquet(scene, period=period)
    # at speed v (1 + e) the period is T / (1 + e): after T the motion is e T q̇ further
    expected = found.flow / np.linalg.norm(found.flow)
    np.testing.assert_allclose(found.monodromy @ expected, expected, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(found.monodromy), 1.0, rtol=1e-7)
    faster = np.array([0.0, found.flow[0]])
    later = found.monodromy @ faster - faster
    np.testing.assert_allclose(later, period * found.flow, rtol=1e-5, atol=1e-6)


def test_none_is_said_in_one_line() -> None:
    with pytest.raises(
        InputError, match='not periodic: after 1 s it misses its start by'
    ) as error:
        floquet(swinging(2.0), period=1.0)
    assert '\n' not in str(error.value)
    crank = load_scene(
        {'mechanism': 'four_bar', 'drives': {'m': {'joint': 'crank_pin', 'angle': 't+1'}}}
    )
    with pytest.raises(InputError, match='nothing is free'):
        floquet(crank, period=2.0 * math.pi)
    with pytest.raises(InputError, match='period: not usable'):
        floquet(swinging(1.0), period=-1.0)
    with pytest.raises(InputError, match='no whole number of steps'):
        simulation = Simulation(swinging(1.0))
        simulation.step(3)
        floquet(simulation, period=1.0007)


def test_the_command_lists_multipliers(capsys: pytest.CaptureFixture[str], tmp_path: Any) -> None:
    file = tmp_path / 'shaken.yaml'
    file.write_text(shaken(0.1, 30.0).text, 'utf-8')
    assert main([str(file), '--period', repr(2.0 * math.pi / 30.0)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith('unstable, period 0.20944 s')
    assert lines[3].split()[:2] == ['1', '1.62940883']
    with pytest.raises(InputError, match='--period'):
        main([str(file), '--period', '1', '--inputs', 'x'])


def test_rotors_turn_on() -> None:
    """A bar turns with a drive, and a link swings on its end, both with rotors."""
    rate, damping, inertia = 2.0 * math.pi, 0.5, 0.3 / 3.0 + 0.1
    points = {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}, 'B': {'at': [2, 0]}}
    mechanism = {
        'alf': 1,
        'points': points,
        'bodies': {
            'bar': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'},
            'link': {'points': ['A', 'B'], 'mass': 0.3, 'inertia': 'rod'},
        },
        'joints': {
            'hip': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'},
            'knee': {'type': 'revolute', 'between': ['bar', 'link'], 'at': 'A'},
        },
    }
    motors = {
        f'm{n}': {'joint': joint, 'armature': 0.1} for n, joint in enumerate(('hip', 'knee'))
    }
    scene = {
        'mechanism': mechanism,
        'drives': {'turn': {'joint': 'hip', 'angle': f'{rate}*t'}},
        'initial': {'velocities': {'B': [0, 2.0 * rate]}},
        'effects': {
            'motor': motors,
            'torsion_spring': {'joint': 'knee', 'stiffness': 2.0, 'damping': damping},
        },
    }
    found = floquet(load_scene(scene), period=1.0)
    stiffness = 2.0 + 0.3 * rate**2 * 0.5  # and the centrifugal force
    expected = np.exp(np.roots([inertia, damping, stiffness]))
    np.testing.assert_allclose(
        np.sort_complex(found.multipliers), np.sort_complex(expected), rtol=1e-9
    )


@pytest.mark.parametrize('exponent', [1.0, 1.5])
def test_a_motion_that_stays_in_a_kink_is_refused(exponent: float) -> None:
    """A link turns on an arm, at the edge of its stop: free to one side, and held to the other.

    A stop that begins without a slope has no kink: the centrifugal stiffness alone holds the link.
    """
    mechanism = {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}, 'B': {'at': [2, 0]}},
        'bodies': {
            'arm': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'},
            'link': {'points': ['A', 'B'], 'mass': 1.0, 'inertia': 'rod'},
        },
        'joints': {
            'hip': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O'},
            'knee': {'type': 'revolute', 'between': ['arm', 'link'], 'at': 'A'},
        },
    }
    scene = {
        'mechanism': mechanism,
        'drives': {'turn': {'joint': 'hip', 'angle': '5*t'}},
        'initial': {'velocities': {'B': [0, 10.0]}},
        'effects': {
            'joint_stop': {'joint': 'knee', 'lower': 0, 'stiffness': 9.0, 'exponent': exponent}
        },
    }
    if exponent == 1.0:
        with pytest.raises(InputError, match='stays in a kink of a force'):
            floquet(load_scene(scene), period=2.0 * math.pi / 5.0)
    else:
        found = floquet(load_scene(scene), period=2.0 * math.pi / 5.0)
        turned = 2.0 * math.pi * math.sqrt(1.5)
        expected = np.exp([1j * turned, -1j * turned])
        # rounding of the motion is felt by the root of it in this slope
        multipliers = np.sort_complex(found.multipliers)
        np.testing.assert_allclose(multipliers, np.sort_complex(expected), rtol=1e-6)


def test_a_motion_through_a_kink_is_neutral() -> None:
    """A bob on a spring, which begins where a second one begins to act."""
    mechanism = {
        'alf': 1,
        'points': {'B': {'at': [0, 0]}},
        'bodies': {'bob': {'points': ['B'], 'mass': 1.0, 'inertia': 'point'}},
        'joints': {
            'rail': {
                'type': 'slider',
                'point': 'B',
                'on': {'through': [0, 0], 'direction': [1, 0]},
            }
        },
    }
    spring = {'between': ['bob', 'ground'], 'at': [None, [0, 0]], 'stiffness': 100.0}
    stop = {'joint': 'rail', 'lower': 0, 'stiffness': 400.0, 'exponent': 1}
    scene = {
        'mechanism': mechanism,
        'initial': {'velocities': {'B': [1.0, 0]}},
        'effects': {'spring': {'near': spring}, 'joint_stop': stop},
    }
    found = floquet(load_scene(scene), period=math.pi * (1.0 / 10.0 + 1.0 / math.sqrt(500.0)))
    assert found.verdict == 'neutral' and found.multipliers == pytest.approx([1.0, 1.0], abs=1e-3)
