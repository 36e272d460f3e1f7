"""Friction under the true reactions: against equations with them, and what locks must lock."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from alf_ros import Simulation, StepError, load_scene
from support.effect_scenes import rubbing_pendulum

Floats = NDArray[np.float64]
G = 9.81


def test_bearing_of_a_pendulum() -> None:
    """θ̈ m l²/3 = -m g l/2 cos θ - μ r N, N = |m (a + g)| with the acceleration it leads to."""
    mu_r = 0.4 * 0.15  # a bearing so large that it matters
    sim = rubbing_pendulum({'dynamic': 0.4, 'radius': 0.15, 'slip': 1e-5}, A=[None, -3.0])

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
    samples = list(sim.run(0.5))
    energies = np.array([sample.energy for sample in samples])
    powers = np.array([sum(list(sample.powers.values())[1:]) for sample in samples])
    assert np.diff(energies).max() < 1e-12
    assert powers.max() <= 0.0
    work = (powers[0] + 4 * powers[1:-1:2].sum() + 2 * powers[2:-1:2].sum() + powers[-1]) / 12e3
    assert energies[-1] - energies[0] == pytest.approx(work, rel=1e-6)
    assert energies[0] - energies[-1] > 0.5


def test_it_is_the_given_load_where_that_is_the_reaction() -> None:
    """A wheel whose pin carries its weight: both ways the same."""
    scene: dict[str, Any] = {
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
    assert given._run.applied.assembled.bearings.settle.size == 0


def test_without_coefficient_nothing_is_compiled_and_nothing_changes() -> None:
    plain = rubbing_pendulum({'viscous': 0.1})
    rubbing = rubbing_pendulum({'viscous': 0.1, 'dynamic': 0.0})
    plain.step(100)
    rubbing.step(100)
    assert np.array_equal(plain.state.q, rubbing.state.q)
    assert plain._run.applied.assembled.bearings.settle.size == 0


def test_a_run_repeats_bit_for_bit() -> None:
    sim = rubbing_pendulum({'dynamic': 0.4, 'radius': 0.15})
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


def test_a_guide_that_nothing_presses_on() -> None:
    """A spring along the guide: the reaction is zero but for rounding, and the motion harmonic."""
    along = np.array([np.cos(0.3), np.sin(0.3)])
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'points': {'S': {'at': [0, 0]}, 'T': {'at': along.tolist()}},
                'bodies': {'block': {'points': ['S', 'T'], 'mass': 2.0, 'inertia': 'rod'}},
                'joints': {
                    'guide': {
                        'type': 'prismatic',
                        'between': ['ground', 'block'],
                        'at': 'S',
                        'axis': along.tolist(),
                    }
                },
            },
            'effects': {
                'spring': {
                    'between': ['block', 'ground'],
                    'at': ['S', (2.0 * along).tolist()],
                    'stiffness': 18.0,
                },
                'joint_friction': {'joint': 'guide', 'dynamic': 0.3, 'slip': 0.1},
            },
            'initial': {'velocities': {'S': (0.6 * along).tolist()}},
        }
    )
    for integrator in ('rk4', 'esdirk43', 'dop853_adaptive'):
        sim = Simulation(scene, integrator=integrator, step=1e-3, tolerance=1e-10)
        for sample in sim.run(0.5, every=100):
            wanted = 0.2 * np.sin(3.0 * sample.t)
            assert sample.joints['guide'].position == pytest.approx(wanted, abs=1e-9)
            assert sample.reactions['guide'].force == pytest.approx(0.0, abs=1e-11)


def planetary() -> dict[str, Any]:
    """A sun, a ring and three planets with friction in their pins: a row too many for each pin
    but the first."""
    sun, planet = 0.15, 0.11
    ring, pins = sun + 2.0 * planet, range(3)
    wheels = {
        'sun': (['O', 'S'], 2.4, 0.24, [0.0, 0.0]),
        'ring': (['O', 'R'], 1.8, 0.14, [-0.17, -0.15]),
        'carrier': (['O', 'P0', 'P1', 'P2'], 1.8, 0.3, [0.22, 0.14]),
        'planet0': (['P0', 'M0'], 2.4, 0.33, [-0.19, 0.01]),
        'planet1': (['P1', 'M1'], 2.9, 0.15, [0.36, -0.04]),
        'planet2': (['P2', 'M2'], 2.5, 0.34, [0.29, -0.09]),
    }
    angle = [0.82 + 2.0 * np.pi * k / 3.0 for k in pins]
    way = [np.array([np.cos(a), np.sin(a)]) for a in angle]

    def turns(of: str) -> dict[str, Any]:
        return {'type': 'revolute', 'between': ['ground', of], 'at': 'O'}

    def mesh(of: str, k: int, radius: float, **more: Any) -> dict[str, Any]:
        centres = {'centres': ['O', f'P{k}'], 'radii': [radius, planet]}
        return {'type': 'gear', 'between': [of, f'planet{k}'], **centres, **more}

    return {
        'mechanism': {
            'alf': 1,
            'points': {
                'O': {'at': [0, 0], 'fixed': True},
                'S': {'at': [sun, 0]},
                'R': {'at': [0, ring]},
                **{f'P{k}': {'at': ((sun + planet) * way[k]).tolist()} for k in pins},
                **{f'M{k}': {'at': (ring * way[k]).tolist()} for k in pins},
            },
            'bodies': {
                name: {'points': points, 'mass': m, 'inertia': {'about_com': J}, 'com': com}
                for name, (points, m, J, com) in wheels.items()
            },
            'joints': {
                'shaft': turns('sun'),
                'rim': turns('ring'),
                'output': turns('carrier'),
                **{
                    f'pin{k}': {
                        'type': 'revolute',
                        'between': ['carrier', f'planet{k}'],
                        'at': f'P{k}',
                    }
                    for k in pins
                },
                **{f'mesh{k}': mesh('sun', k, sun) for k in pins},
                **{f'ring{k}': mesh('ring', k, ring, internal=True) for k in pins},
            },
        },
        'effects': {
            'joint_friction': {
                f'rub{k}': {'joint': f'pin{k}', 'dynamic': 0.2, 'radius': 0.05, 'slip': 0.3}
                for k in pins
            }
        },
        'initial': {'velocities': {'S': [None, -1.9], 'R': [1.3, None]}},
    }


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'dop853_adaptive', 'esdirk43'])
def test_rows_that_depend_on_others_jam_nothing(integrator: str) -> None:
    """Rounding adds to the shares of such rows with each solve: no end of a balance."""
    sim = Simulation(load_scene(planetary()), integrator=integrator, step=1e-3, ledger=True)
    begins, lost = sim.sample().kinetic_energy, []
    for sample in sim.run(0.2, every=50):
        lost.append(-sum(sample.works.values()))
        assert begins - sample.kinetic_energy == pytest.approx(lost[-1], abs=1e-6)
    assert (np.diff(lost) > 0.0).all()
