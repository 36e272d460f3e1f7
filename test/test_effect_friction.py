"""Friction under the true reactions: against equations with them, and what locks must lock."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from alf_ros import Simulation, StepError, load_scene
from alf_ros.simulation import state_vector
from alf_ros.simulation.saved_states import as_data, from_data

Floats = NDArray[np.float64]
G = 9.81


def rod(friction: dict[str, Any], **velocities: Any) -> Simulation:
    """A pendulum of 1 m and 2 kg, drawn along x, with friction in its pin."""
    return Simulation(
        load_scene(
            {
                'mechanism': {
                    'alf': 1,
                    'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
                    'bodies': {'rod': {'points': ['O', 'A'], 'mass': 2.0, 'inertia': 'rod'}},
                    'joints': {
                        'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}
                    },
                },
                'effects': {
                    'gravity': {'acceleration': [0, -G]},
                    'joint_friction': {'joint': 'pin', **friction},
                },
                'initial': {'velocities': velocities},
                'solver': {'step': 1e-3, 'integrator': 'dop853'},
            }
        )
    )


def test_bearing_of_a_pendulum() -> None:
    """θ̈ m l²/3 = -m g l/2 cos θ - μ r N, N = |m (a + g)| with the acceleration it leads to."""
    mu_r = 0.4 * 0.15  # a bearing so large that it matters
    sim = rod({'dynamic': 0.4, 'radius': 0.15, 'slip': 1e-5}, A=[None, -3.0])

    def reaction(angle: float, rate: float, acceleration: float) -> Any:
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([-along[1], along[0]])
        return 2.0 * (0.5 * (acceleration * across - rate**2 * along) + [0.0, G])

    def acceleration(angle: float, rate: float) -> float:
        def gap(a: float) -> float:
            torque = -mu_r * np.sign(rate) * np.linalg.norm(reaction(angle, rate, a))
            return float(2.0 / 3.0 * a + G * np.cos(angle) - torque)

        return float(brentq(gap, -1e3, 1e3, xtol=1e-14, rtol=1e-15))

    wanted = solve_ivp(
        lambda t, y: [y[1], acceleration(*y)],
        (0, 0.3),
        [0.0, -3.0],
        'DOP853',
        rtol=1e-12,
        atol=1e-12,
        dense_output=True,
    )
    for sample in sim.run(0.3, at=[0.1, 0.2, 0.3]):
        angle, rate = wanted.sol(sample.t)
        joint, force = sample.joints['pin'], reaction(angle, rate, acceleration(angle, rate))
        assert (joint.position, joint.velocity) == pytest.approx((angle, rate), abs=1e-9)
        assert sample.reactions['pin'].force == pytest.approx(force, abs=1e-7)
        assert sample.reactions['pin'].torque == pytest.approx(0.0, abs=1e-9)
        assert joint.effort == pytest.approx(mu_r * np.linalg.norm(force), abs=1e-8)
        assert sample.powers['joint_friction'] == pytest.approx(joint.effort * rate, abs=1e-7)


def wedge(angle: float, mu: float, slip: float) -> dict[str, Any]:
    """A block (1 kg) in a vertical guide presses on a wedge (2 kg) that slides on the ground."""
    up = [float(np.cos(angle)), float(np.sin(angle))]
    return {
        'mechanism': {
            'alf': 1,
            'points': {
                'A': {'at': [0, 0]},
                'B': {'at': [1, 0]},
                'C': {'at': [0.5, 0.3]},
                'D': {'at': [0.5, 0.8]},
            },
            'bodies': {
                'wedge': {
                    'points': ['A', 'B'],
                    'mass': 2.0,
                    'inertia': {'about_com': 0.1},
                    'com': [0.4, 0.1],
                },
                'block': {'points': ['C', 'D'], 'mass': 1.0, 'inertia': 'rod'},
            },
            'joints': {
                'floor': {
                    'type': 'prismatic',
                    'between': ['ground', 'wedge'],
                    'at': 'A',
                    'axis': [1, 0],
                },
                'incline': {
                    'type': 'prismatic',
                    'between': ['wedge', 'block'],
                    'at': 'C',
                    'axis': up,
                },
                'guide': {
                    'type': 'slider',
                    'point': 'C',
                    'between': ['ground', 'block'],
                    'on': {'through': [0.5, 0], 'direction': [0, 1]},
                },
            },
        },
        'effects': {
            'gravity': {'acceleration': [0, -G]},
            'joint_friction': {
                'below': {'joint': 'floor', 'dynamic': mu, 'slip': slip},
                'above': {'joint': 'incline', 'dynamic': mu, 'slip': slip},
            },
            'constant_wrench': {'on': 'block', 'force': [0, -100.0]},
        },
        'solver': {'step': 1e-5},
    }


def test_a_steep_wedge_slides() -> None:
    """By the balance of both bodies with Coulomb's friction at two contacts."""
    angle, mu = 0.6, 0.2
    sim = Simulation(load_scene(wedge(angle, mu, 1e-4)))
    sim.step(4000)
    sample = sim.sample()
    s, c = np.sin(angle), np.cos(angle)
    # wedge to +x with a; the block falls with a tan; N on the incline, R on the floor
    # block: m a tan = W - N (c + mu s), wedge: M a = N (s - mu c) - mu R, R = M g + N (c + mu s)
    load = 100.0 + G
    matrix = np.array(
        [[np.tan(angle), c + mu * s, 0.0], [2.0, -(s - mu * c), mu], [0.0, -(c + mu * s), 1.0]]
    )
    a, normal, below = np.linalg.solve(matrix, [load, 0.0, 2.0 * G])
    acceleration = sample.qdd.reshape(-1, 2)[0]
    assert acceleration == pytest.approx([a, 0.0], rel=1e-6, abs=1e-6)
    assert np.linalg.norm(sample.reactions['floor'].force) == pytest.approx(below, rel=1e-6)
    assert np.linalg.norm(sample.reactions['incline'].force) == pytest.approx(normal, rel=1e-6)


def test_a_flat_wedge_locks_itself() -> None:
    """Below twice the angle of friction no load moves it: it creeps, as slowly as `slip` says.

    At rest both contacts need the coefficient tan(angle / 2), and μ v / √(v² + ε²) is as much.
    """
    angle, mu, slip = 0.3, 0.2, 1e-3
    assert angle < 2 * np.arctan(mu)
    speeds = []
    for load in (100.0, 1000.0):
        scene = wedge(angle, mu, slip)
        scene['effects']['constant_wrench']['force'] = [0, -load]
        sim = Simulation(load_scene(scene))
        sim.step(3000)
        sample = sim.sample()
        assert np.abs(sample.qdd).max() < 1e-6 * load
        speeds += [abs(sample.joints['floor'].velocity), abs(sample.joints['incline'].velocity)]
    assert max(speeds) < 2.0 * slip
    needed = np.tan(angle / 2) / mu
    mean = slip * needed / np.sqrt(1 - needed**2)
    assert speeds == pytest.approx([mean] * 4, rel=0.25)  # the wedge has a weight too


def test_friction_in_all_joints_only_takes_energy() -> None:
    """A four-bar that slows down; the energy falls by what friction takes."""
    bearings = {'dynamic': 0.3, 'radius': 0.02, 'slip': 1.0}
    text = {
        'mechanism': 'four_bar',
        'effects': {
            'gravity': {'acceleration': [0, -G]},
            'joint_friction': {
                joint.name: {'joint': joint.name, **bearings}
                for joint in load_scene('four_bar').mechanism.joints
            },
        },
        'initial': {'velocities': {'A': ['-30*a*sin(theta)', '30*a*cos(theta)']}},
        'solver': {'step': 2.5e-4},
    }
    sim = Simulation(load_scene(text))
    samples = list(sim.run(1.0))
    energies = np.array([sample.energy for sample in samples])
    powers = np.array([sum(list(sample.powers.values())[1:]) for sample in samples])
    assert np.diff(energies).max() < 1e-12
    assert powers.max() <= 0.0
    work = (powers[0] + 4 * powers[1:-1:2].sum() + 2 * powers[2:-1:2].sum() + powers[-1]) / 12e3
    assert energies[-1] - energies[0] == pytest.approx(work, rel=1e-6)
    assert energies[0] - energies[-1] > 0.5


def test_it_is_the_given_load_where_that_is_the_reaction() -> None:
    """A wheel whose pin carries its weight: both ways the same."""
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
            'bodies': {
                'wheel': {
                    'points': ['O', 'A'],
                    'mass': 2.0,
                    'inertia': {'about_com': 0.5},
                    'com': [0, 0],
                }
            },
            'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'wheel'], 'at': 'O'}},
        },
        'effects': {
            'gravity': {'acceleration': [0, -G]},
            'joint_friction': {'joint': 'pin', 'dynamic': 0.3, 'static': 0.5, 'radius': 0.1},
        },
        'initial': {'velocities': {'A': [0, 3.0]}},
    }
    true = Simulation(load_scene(scene))
    scene['effects']['joint_friction']['load'] = 2.0 * G
    given = Simulation(load_scene(scene))
    true.step(500)
    given.step(500)
    assert true.sample().q == pytest.approx(given.sample().q, abs=1e-13)
    assert given._applied.assembled.bearings.settle.size == 0


def test_without_coefficient_nothing_is_compiled_and_nothing_changes() -> None:
    plain = rod({'viscous': 0.1})
    rubbing = rod({'viscous': 0.1, 'dynamic': 0.0})
    plain.step(100)
    rubbing.step(100)
    assert np.array_equal(plain.state.q, rubbing.state.q)
    assert plain._applied.assembled.bearings.settle.size == 0


def test_a_run_repeats_bit_for_bit() -> None:
    sim = rod({'dynamic': 0.4, 'radius': 0.15})
    sim.step(50)
    state = sim.state
    sim.step(60)
    end = sim.state
    sim.restore(state)
    sim.sample().reactions['pin']
    sim.step(25)
    sim.sample().reactions['pin']
    sim.step(35)
    assert np.array_equal(sim.state.q, end.q) and np.array_equal(sim.state.qd, end.qd)


def test_in_space() -> None:
    """An arm on a bearing with a vertical axis: the load has a part along the axis too."""
    scene = {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {'O': {'at': [0, 0, 0], 'fixed': True}, 'A': {'at': [0.5, 0, 0]}},
            'vectors': {'z': {'along': [0, 0, 1], 'fixed': True}},
            'bodies': {
                'arm': {
                    'points': ['O', 'A'],
                    'vectors': ['z'],
                    'mass': 2.0,
                    'inertia': {'about_com': [0.01, 0.05, 0.05]},
                    'com': [0.25, 0, 0],
                }
            },
            'joints': {
                'pin': {
                    'type': 'revolute',
                    'between': ['ground', 'arm'],
                    'at': 'O',
                    'axis': 'z',
                }
            },
        },
        'effects': {
            'gravity': {'acceleration': [0, 0, -G]},
            'joint_friction': {'joint': 'pin', 'dynamic': 0.3, 'radius': 0.1, 'slip': 1e-6},
        },
        'initial': {'velocities': {'A': [0, 2.0, 0]}},
    }
    sim = Simulation(load_scene(scene), integrator='dop853')

    def rate_of(rate: float) -> float:
        inertia, mu_r = 0.05 + 2.0 * 0.25**2, 0.03

        def gap(a: float) -> float:
            force = 2.0 * np.array([-(rate**2) * 0.25, a * 0.25, G])
            return float(inertia * a + mu_r * np.linalg.norm(force))

        return float(brentq(gap, -1e3, 1e3, xtol=1e-14, rtol=1e-15))

    end = solve_ivp(lambda t, y: [rate_of(y[0])], (0, 0.5), [4.0], 'DOP853', rtol=1e-12).y[0, -1]
    sim.step(500)
    assert sim.sample().joints['pin'].velocity == pytest.approx(end, abs=1e-8)


def test_a_paradox_is_told() -> None:
    """Painlevé's rod: pushed one way, no normal force agrees with the friction it leads to."""
    angle = np.radians(70.0)
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {
                'A': {'at': [0, 0]},
                'B': {'at': [float(np.cos(angle)), float(np.sin(angle))]},
            },
            'bodies': {'rod': {'points': ['A', 'B'], 'mass': 1.0, 'inertia': 'rod'}},
            'joints': {
                'ground_line': {
                    'type': 'slider',
                    'point': 'A',
                    'on': {'through': [0, 0], 'direction': [1, 0]},
                }
            },
        },
        'effects': {
            'gravity': {'acceleration': [0, -G]},
            'joint_friction': {'joint': 'ground_line', 'dynamic': 2.0, 'slip': 1e-3},
        },
    }
    P, Q = 1 + 3 * np.cos(angle) ** 2, 3 * np.sin(angle) * np.cos(angle)
    assert 2.0 * Q > P
    told = []
    for speed in (2.0, -2.0):
        scene['initial'] = {'velocities': {'A': [speed, 0], 'B': [speed, 0]}}
        sim = Simulation(load_scene(scene))
        try:
            sim.step(10)
        except StepError as error:
            told.append(error.reason)
            assert sim.step_index == 0
    assert len(told) == 1 and 'Painlevé' in told[0] and 'at t = 0 s' in told[0]


# ---------------------------------------------------------------- beside a singular position
#
# The slider-crank with two rods of 1 m and 1 kg, c = cos θ. With friction in the guide alone the
# equations of Newton and Euler come down to c N + b |N| = c N₀ beside c = 0: one balance beyond
# |c| = |b|, and within it two on one side of the position and none on the other.

EPS = 1e-2  # slip speed
RUBBING: dict[str, dict[str, float]] = {
    # the guide alone: its reaction falls to zero at c = 0, where two balances meet and end
    'guide': {'guide': 0.01},
    # with the pin the balance goes on through c = 0, and ends after it
    'guide and pin': {'guide': 0.2, 'crank_pin': 0.03},
    'knee': {'knee': 0.005},
}


def slider_crank(friction: dict[str, float], **keywords: Any) -> Simulation:
    """friction: the coefficient, times a radius (m) of an angle, of each joint."""
    rubbing = {
        joint: {'joint': joint, 'dynamic': mu, 'slip': EPS}
        | ({} if joint == 'guide' else {'dynamic': 10 * mu, 'radius': 0.1})
        for joint, mu in friction.items()
    }
    scene = {
        'mechanism': 'slider_crank',
        'effects': {'gravity': {'acceleration': [0, -G]}, 'joint_friction': rubbing},
        'initial': {'velocities': {'B': [-4.0, 0]}},
    }
    return Simulation(load_scene(scene), **keywords)


def newton_euler(
    angle: float, rate: float, friction: dict[str, float]
) -> tuple[Floats, Floats, Floats]:
    """K x = r + F loads for x = (θ̈, force on the crank in O, on the coupler in A, in B along y);
    loads: magnitudes in the order guide, crank_pin, knee."""
    s, c = np.sin(angle), np.cos(angle)
    K, r, F = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 3))
    K[0], r[0] = [-0.5 * s, -1, 0, 1, 0, 0], 0.5 * rate**2 * c
    K[1], r[1] = [0.5 * c, 0, -1, 0, 1, 0], 0.5 * rate**2 * s - G
    K[2], r[2] = [1 / 3, 0, 0, -s, c, 0], -0.5 * G * c  # about O
    K[3], r[3] = [-1.5 * s, 0, 0, -1, 0, 0], 1.5 * rate**2 * c
    K[4], r[4] = [0.5 * c, 0, 0, 0, -1, -1], 0.5 * rate**2 * s - G
    K[5] = [-1 / 12, 0, 0, 0.5 * s, 0.5 * c, -0.5 * c]  # about the centre of the coupler

    def effort(joint: str, speed: float) -> float:
        return -friction.get(joint, 0.0) * speed / float(np.hypot(speed, EPS))

    guide, knee = effort('guide', -2 * s * rate), effort('knee', -2 * rate)
    F[3, 0], F[5, 0] = guide, 0.5 * s * guide
    F[2, 1] = effort('crank_pin', rate)
    F[2, 2], F[5, 2] = -knee, knee
    return K, r, F


def balances(angle: float, rate: float, friction: dict[str, float]) -> list[Floats]:
    """All x that agree with the magnitudes in them, of guides up to some kN.

    All but one of the equations are solved for all but the guide's reaction, where both pins are a
    contraction; the last one, a function of that reaction alone, is searched for all its zeros.
    """
    K, r, F = newton_euler(angle, rate, friction)
    inverse = np.linalg.inv(K[:5, :5])

    def rest(N: float) -> Floats:
        loads, x = np.array([abs(N), 1.0, 1.0]), np.zeros(6)
        for _ in range(500):
            x = np.append(inverse @ ((r + F @ loads)[:5] - K[:5, 5] * N), N)
            new = np.array([abs(N), np.hypot(x[1], x[2]), np.hypot(x[3], x[4])])
            if np.abs(new - loads).max() <= 1e-14 * new.max():
                break
            loads = new
        return x

    def gap(u: float) -> float:
        x = rest(np.sinh(u))
        loads = np.array([abs(x[5]), np.hypot(x[1], x[2]), np.hypot(x[3], x[4])])
        return float((K @ x - r - F @ loads)[5] / (1.0 + abs(x[5])))

    grid = np.linspace(-9.0, 9.0, 601)
    values = [gap(u) for u in grid]
    return [
        rest(np.sinh(brentq(gap, grid[k], grid[k + 1], xtol=1e-15)))
        for k in range(grid.size - 1)
        if values[k] * values[k + 1] < 0.0
    ]


def crank(sim: Simulation) -> tuple[float, float]:
    joint = sim.sample().joints['crank_pin']
    return joint.position, joint.velocity


@pytest.mark.parametrize('which', RUBBING)
@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive', 'esdirk43'])
def test_the_balance_of_the_motion_is_kept_to_its_end(which: str, integrator: str) -> None:
    """Beside the position, step by step the balance next to the last one, of all there are."""
    friction = RUBBING[which]
    sim = slider_crank(friction, integrator=integrator, step=1e-3)
    while np.cos(crank(sim)[0]) > 0.06:
        sim.step()
    last, several = balances(*crank(sim), {})[0], 0
    with pytest.raises(StepError, match='Painlevé.*at t = '):
        while True:
            angle, rate = crank(sim)
            found = balances(angle, rate, friction)
            assert found
            several += len(found) > 1
            last = min(found, key=lambda x: float(np.abs(x - last).max()))
            sample = sim.sample()
            forces = [sample.reactions[name].force for name in ('crank_pin', 'knee', 'guide')]
            wanted = [last[1:3], last[3:5], [0.0, last[5]]]
            assert np.array(forces) == pytest.approx(np.array(wanted), abs=1e-6)
            sim.step()
    # where it stopped, what is next has no balance that the last one leads to
    angle, rate = crank(sim)
    ahead = [balances(angle + rate * k * 5e-4, rate, friction) for k in range(1, 5)]
    assert any(not found for found in ahead)
    assert several or which == 'knee'


@pytest.mark.parametrize('which', RUBBING)
def test_coarse_steps_do_not_leap_over_a_paradox(which: str) -> None:
    """On either side of it there is one balance."""
    friction = RUBBING[which]
    ends = []
    for integrator, step, tolerance in (
        ('dop853_adaptive', 1e-3, 1e-9),
        ('dop853_adaptive', 0.5, 1e-3),
        ('dop853_adaptive', 0.05, 1e-6),
        ('esdirk43_adaptive', 0.1, 1e-5),
        ('esdirk43', 1e-2, 1e-6),
    ):
        sim = slider_crank(friction, integrator=integrator, step=step, tolerance=tolerance)
        with pytest.raises(StepError, match='Painlevé') as told:
            sim.step(int(2.0 / step))
        ends.append(float(told.value.reason.split('at t = ')[1].split()[0]))
    assert ends == pytest.approx([ends[0]] * len(ends), abs=2e-4)
    for side in (-0.3, 0.3):
        assert len(balances(np.arccos(side), crank(sim)[1], friction)) == 1
    for integrator in ('rk4', 'dop853'):
        with pytest.raises(StepError, match='Painlevé'):
            slider_crank(friction, integrator=integrator, step=0.02).step(50)


def test_of_several_balances_a_run_begins_with_that_of_growing_friction() -> None:
    """Drawn where there are two: that to which the one without friction leads."""
    c, rate, friction = 0.002, 3.0, {'guide': 0.01}
    s = float(np.sqrt(1.0 - c * c))
    rods = {'crank': ['O', 'A'], 'coupler': ['A', 'B']}
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {
                'O': {'at': [0, 0], 'fixed': True},
                'A': {'at': [c, s]},
                'B': {'at': [2 * c, 0]},
            },
            'bodies': {
                name: {'points': points, 'mass': 1.0, 'inertia': 'rod'}
                for name, points in rods.items()
            },
            'joints': {
                'crank_pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
                'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
                'guide': {
                    'type': 'slider',
                    'point': 'B',
                    'on': {'through': [0, 0], 'direction': [1, 0]},
                },
            },
        },
        'effects': {
            'gravity': {'acceleration': [0, -G]},
            'joint_friction': {'joint': 'guide', 'dynamic': 0.01, 'slip': EPS},
        },
        'initial': {'velocities': {'A': [-s * rate, c * rate]}},
    }
    sim = Simulation(load_scene(scene))
    reaction = balances(np.arccos(c), 3.0, {})[0][5]
    for part in np.linspace(0.0, 1.0, 41):
        found = balances(np.arccos(c), rate, {'guide': part * friction['guide']})
        reaction = min((x[5] for x in found), key=lambda N: abs(N - reaction))
    assert len(found) == 2
    assert sim.sample().reactions['guide'].force == pytest.approx([0.0, reaction], rel=1e-7)


def test_a_position_that_friction_does_not_feel_is_passed() -> None:
    """A pendulum beside the slider-crank, on a pin that rubs."""
    mechanism = {
        'alf': 1,
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': [0.5**0.5, 0.5**0.5]},
            'B': {'at': [2**0.5, 0]},
            'P': {'at': [3, 0], 'fixed': True},
            'Q': {'at': [4, 0]},
        },
        'bodies': {
            'crank': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'},
            'coupler': {'points': ['A', 'B'], 'mass': 1.0, 'inertia': 'rod'},
            'rod': {'points': ['P', 'Q'], 'mass': 2.0, 'inertia': 'rod'},
        },
        'joints': {
            'crank_pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
            'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
            'guide': {
                'type': 'slider',
                'point': 'B',
                'on': {'through': [0, 0], 'direction': [1, 0]},
            },
            'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'P'},
        },
    }
    friction = {'joint': 'pin', 'dynamic': 0.4, 'radius': 0.15, 'slip': 1e-2}
    scene = {
        'mechanism': mechanism,
        'effects': {'gravity': {'acceleration': [0, -G]}, 'joint_friction': friction},
        'initial': {'velocities': {'B': [-4.0, 0], 'Q': [0, -3.0]}},
    }
    for keywords in (
        {'integrator': 'dop853', 'step': 2e-3},
        {'integrator': 'dop853_adaptive', 'step': 0.1, 'tolerance': 1e-6},
        {'integrator': 'rk4', 'step': 1e-3},
    ):
        sim = Simulation(load_scene(scene), **keywords)
        alone = rod({**friction}, A=[None, -3.0])
        sim.step(round(1.0 / sim.h))
        alone.step(1000)
        here, there = sim.sample().joints['pin'], alone.sample().joints['pin']
        assert np.cos(crank(sim)[0]) < -0.5
        assert here.position == pytest.approx(there.position, abs=1e-4)


def test_a_run_repeats_beside_a_position_too() -> None:
    """Its balance is a part of the state, also of one that was written and read."""
    sim = slider_crank(RUBBING['guide and pin'], step=1e-3)
    sim.step(435)
    state = sim.state
    assert np.abs(state.loads).max() > 0.0
    sim.step(20)
    end = sim.state
    again = slider_crank(RUBBING['guide and pin'], step=1e-3)
    again.restore(from_data(json.loads(json.dumps(as_data(state))), again.state))
    again.sample().reactions['guide']
    again.step(11)
    again.sample().reactions['guide']
    again.step(9)
    assert np.cos(crank(again)[0]) < 0.0
    assert np.array_equal(again.state.q, end.q) and np.array_equal(again.state.qd, end.qd)
    assert np.array_equal(again.state.loads, end.loads)
    old = as_data(state)
    del old['loads']
    assert not from_data(old, again.state).loads.any()
    numbers, rates = state_vector.values(sim.model, end)
    read = state_vector.state(sim.model, state, numbers, rates, end.inputs)
    assert np.array_equal(read.loads, end.loads) and read.step == end.step
    numbers = np.append(numbers[: -1 - end.loads.size], numbers[-1])
    read = state_vector.state(sim.model, state, numbers, rates, end.inputs)
    assert not read.loads.any() and read.step == end.step
