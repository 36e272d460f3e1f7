"""Constraints that depend on time: drives against inverse dynamics by hand, and reduced models."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from alf_ros import InputError, Simulation, load_scene
from alf_ros.scene.scene import scene_from_text
from support.driven_mechanisms import ARM, BELT, GRAVITY, START, TWO, G, pendulum

OTHERS = ['alf1', 'canonical', 'alf2_as_printed', 'baumgarte', 'lagrange_canonical']
METHODS = [('rk4', 1e-3), ('dop853', 1e-2), ('dop853_adaptive', 0.05)]


@pytest.fixture(params=METHODS, ids=lambda p: p[0])
def method(request: pytest.FixtureRequest) -> dict[str, Any]:
    integrator, step = request.param
    return {'integrator': integrator, 'step': step, 'tolerance': 1e-11}


# --------------------------------------------------------------------- inverse dynamics by hand


def test_torque_that_drives_a_pendulum(method: dict[str, Any]) -> None:
    """τ = m l²/3 θ̈ + m g l/2 cos θ, and the pin carries the rest."""
    drives = {'motor': {'joint': 'pin', 'angle': '0.5*sin(3*t) + 2*t**2'}}
    sim = Simulation(load_scene(pendulum(drives=drives)), **method)
    for sample in sim.run(2.0, at=[0.0, 0.31, 1.0, 1.777, 2.0]):
        t = sample.t
        angle, rate = 0.5 * np.sin(3 * t) + 2 * t**2, 1.5 * np.cos(3 * t) + 4 * t
        acceleration = 4 - 4.5 * np.sin(3 * t)
        assert sample.joints['pin'].position == pytest.approx(angle, abs=1e-12)
        assert sample.joints['pin'].velocity == pytest.approx(rate, abs=1e-12)
        torque = 2.0 / 3.0 * acceleration + 2.0 * G * 0.5 * np.cos(angle)
        assert sample.drive_efforts['motor'] == pytest.approx([torque], abs=1e-10)
        assert sample.joints['pin'].effort == pytest.approx(torque, abs=1e-10)
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([-along[1], along[0]])
        com = 0.5 * (acceleration * across - rate**2 * along)
        force = 2.0 * (com + [0.0, G])
        assert sample.reactions['pin'].force == pytest.approx(force, abs=1e-9)


def along(angle: float) -> Any:
    return np.array([np.cos(angle), np.sin(angle)])


def accelerated(angle: float, rate: float, acceleration: float) -> Any:
    """Of the end of a rod of 1 m."""
    return acceleration * along(angle + np.pi / 2) - rate**2 * along(angle)


def arm_angles(t: float) -> tuple[Any, Any]:
    """Angle of each rod, its rate and acceleration."""
    upper = np.sin(t), np.cos(t), -np.sin(t)
    return upper, (upper[0] + START - 3 * t, upper[1] - 3, upper[2])


def arm_reaction(t: float) -> tuple[Any, Any]:
    """Forces of upper on lower rod, and of the ground on the upper one."""
    upper, lower = arm_angles(t)
    weight = np.array([0.0, G])
    force = 1.5 * (accelerated(*upper) + 0.5 * accelerated(*lower) + weight)
    return force, force + 2.0 * (0.5 * accelerated(*upper) + weight)


def arm_efforts(t: float) -> tuple[float, float]:
    """Efforts at shoulder and elbow, by the balance of moments of each rod."""
    (a, _, add), (b, _, bdd) = arm_angles(t)

    def cross(r: Any, f: Any) -> float:
        return float(r[0] * f[1] - r[1] * f[0])

    force, _ = arm_reaction(t)
    elbow = 1.5 / 12 * bdd + cross(0.5 * along(b), force)
    weight = np.array([0.0, 2.0 * G])
    shoulder = 2.0 / 3.0 * add + cross(0.5 * along(a), weight) + cross(along(a), force)
    return shoulder + elbow, elbow


def test_angle_between_two_moving_bodies(method: dict[str, Any]) -> None:
    """The elbow turns twice around while the shoulder swings."""
    sim = Simulation(load_scene({'mechanism': ARM, 'effects': GRAVITY}), **method)
    for sample in sim.run(4.0, at=[0.0, 0.5, 2.2, 4.0]):
        wanted = arm_efforts(sample.t)
        got = sample.drive_efforts
        assert sample.joints['elbow'].position == pytest.approx(START - 3 * sample.t, abs=1e-11)
        assert (got['first'][0], got['second'][0]) == pytest.approx(wanted, abs=1e-9)
        assert sample.diagnostics.position_violation < 1e-13
        force, elbow = arm_reaction(sample.t)
        assert sample.reactions['elbow'].force == pytest.approx(force, abs=1e-8)
        assert sample.reactions['shoulder'].force == pytest.approx(elbow, abs=1e-8)


def test_forward_dynamics_with_the_efforts_of_the_drives_agree() -> None:
    """The same state, the efforts applied instead of prescribed: the same accelerations."""
    driven = Simulation(load_scene({'mechanism': ARM, 'effects': GRAVITY}))
    for steps in (1, 400, 700):
        driven.step(steps)
        sample = driven.sample()
        names = ('A', 'B')
        free = Simulation(
            load_scene(
                {
                    'mechanism': TWO,
                    'effects': GRAVITY,
                    'initial': {
                        'positions': {n: sample.points[n] for n in names},
                        'velocities': {n: sample.velocities[n] for n in names},
                    },
                }
            )
        )
        free.apply_effort('shoulder', sample.drive_efforts['first'][0])
        free.apply_effort('elbow', sample.drive_efforts['second'][0])
        assert free.sample().qdd == pytest.approx(sample.qdd[:4], abs=1e-9)


def test_slider_crank_driven_through_its_singular_position(method: dict[str, Any]) -> None:
    """Where all links lie on one line its rank drops; the driven motion goes straight through."""
    scene = load_scene('slider_crank')
    mechanism = scene.text[scene.text.index('mechanism:') : scene.text.index('effects:')]
    text = mechanism + (
        '  drives:\n    motor: {joint: crank_pin, angle: pi/4 + 2*t}\n'
        'effects: {gravity: {acceleration: [0, -9.81]}}\n'
    )
    sim = Simulation(scene_from_text(text), **method)
    energies, work = [], 0.0
    for sample in sim.run(3.0, at=np.linspace(0.0, 3.0, 301).tolist()):
        angle = np.pi / 4 + 2 * sample.t
        assert sample.points['B'] == pytest.approx([2 * np.cos(angle), 0.0], abs=1e-11)
        # two rods of 1 m and 1 kg: 2 T = (1/3 + 1/12 + 1/4 + 2 sin²) ω², V = g sin
        power = 4 * np.sin(angle) * np.cos(angle) * 2**2
        torque = 0.5 * power + G * np.cos(angle)
        assert sample.energy == pytest.approx(
            0.5 * 4 * (2.0 / 3.0 + 2 * np.sin(angle) ** 2) + G * np.sin(angle), abs=1e-9
        )
        if abs(np.cos(angle)) > 1e-2:
            assert sample.drive_efforts['motor'][0] == pytest.approx(torque, abs=1e-6)
        energies.append(sample.energy)
        work += torque
    assert np.ptp(energies) > 1.0


def test_work_of_a_drive_is_the_change_of_energy() -> None:
    """A driven four-bar: by Simpson's rule over the power of its motor."""
    scene = load_scene('four_bar')
    cut = scene.text.index('mechanism:'), scene.text.index('effects:')
    text = scene.text[cut[0] : cut[1]] + (
        '  drives:\n    motor: {joint: DRIVEN, angle: START + t - sin(t)}\n'
        'effects: {gravity: {acceleration: [0, -9.81]}}\n'
    )
    joint = scene.mechanism.joints[0].name
    start = Simulation(scene).sample().joints[joint].position
    text = text.replace('DRIVEN', joint).replace('START', repr(start))
    sim = Simulation(scene_from_text(text), step=1e-3)
    samples = list(sim.run(2.0))
    powers = [s.drive_efforts['motor'][0] * s.joints[joint].velocity for s in samples]
    work = (powers[0] + 4 * sum(powers[1:-1:2]) + 2 * sum(powers[2:-1:2]) + powers[-1]) / 3e3
    assert work == pytest.approx(samples[-1].energy - samples[0].energy, rel=1e-9)


# ------------------------------------------------------------------- some of the motion is free


def test_pendulum_on_a_moving_pivot(method: dict[str, Any]) -> None:
    """(2/3) l θ̈ = -cos θ (g + ÿ) + sin θ ẍ, for a rod, the angle from the x axis."""
    scene = pendulum()
    scene['mechanism']['points']['O'] = {'at': [0, 0]}
    scene['mechanism']['joints'] = {}
    scene['mechanism']['drives'] = {
        'pivot': {'point': 'O', 'at': ['0.1*sin(2*t)', '0.05*sin(11*t)']}
    }
    sim = Simulation(load_scene(scene), **method)

    def rates(t: float, y: Any) -> Any:
        x, up = -0.4 * np.sin(2 * t), -6.05 * np.sin(11 * t)
        return [y[1], 1.5 * (np.sin(y[0]) * x - np.cos(y[0]) * (G + up))]

    start = sim.sample()
    spin = start.velocities['A'][1] - start.velocities['O'][1]
    wanted = solve_ivp(
        rates, (0, 3), [0.0, spin], 'DOP853', rtol=1e-13, atol=1e-13, dense_output=True
    )
    for sample in sim.run(3.0, at=[0.5, 1.5, 3.0]):
        t, angle = sample.t, wanted.sol(sample.t)[0]
        pivot = np.array([0.1 * np.sin(2 * t), 0.05 * np.sin(11 * t)])
        assert sample.points['O'] == pytest.approx(pivot, abs=1e-13)
        tip = pivot + [np.cos(angle), np.sin(angle)]
        assert sample.points['A'] == pytest.approx(tip, abs=2e-8)
        # what holds the pivot up: the mass times the acceleration of its centre
        rate, acceleration = wanted.sol(t)[1], rates(t, wanted.sol(t))[1]
        com = 0.5 * np.array(
            [
                -acceleration * np.sin(angle) - rate**2 * np.cos(angle),
                acceleration * np.cos(angle) - rate**2 * np.sin(angle),
            ]
        )
        com += [-0.4 * np.sin(2 * t), -6.05 * np.sin(11 * t)]
        assert sample.drive_efforts['pivot'] == pytest.approx(2.0 * (com + [0, G]), abs=1e-6)


def test_mass_on_a_string_that_is_pulled_in(method: dict[str, Any]) -> None:
    """l θ̈ + 2 l̇ θ̇ + g sin θ = 0, and the string pulls with m (l θ̇² + g cos θ - l̈)."""
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [0.6, -0.8]}},
            'bodies': {'bob': {'points': ['A'], 'mass': 0.5, 'inertia': 'point'}},
            'drives': {'winch': {'points': ['O', 'A'], 'length': '1 - 0.1*t + 0.05*sin(2*t)'}},
        },
        'effects': GRAVITY,
    }
    sim = Simulation(load_scene(scene), **method)

    def length(t: float) -> tuple[float, float, float]:
        s, c = np.sin(2 * t), np.cos(2 * t)
        return 1 - 0.1 * t + 0.05 * s, -0.1 + 0.1 * c, -0.2 * s

    def rates(t: float, y: Any) -> Any:
        r, rd, _ = length(t)
        return [y[1], -(2 * rd * y[1] + G * np.sin(y[0])) / r]

    y0 = [np.arcsin(0.6), 0.0]
    wanted = solve_ivp(rates, (0, 4), y0, 'DOP853', rtol=1e-13, atol=1e-13, dense_output=True)
    for sample in sim.run(4.0, at=[1.0, 2.5, 4.0]):
        (angle, rate), (r, _, rdd) = wanted.sol(sample.t), length(sample.t)
        tip = [r * np.sin(angle), -r * np.cos(angle)]
        assert sample.points['A'] == pytest.approx(tip, abs=1e-9)
        pull = 0.5 * (r * rate**2 + G * np.cos(angle) - rdd)
        assert sample.drive_efforts['winch'][0] == pytest.approx(-pull, abs=1e-7)


@pytest.mark.parametrize('formulation', OTHERS)
def test_other_formulations_know_the_time(formulation: str) -> None:
    """Φ_t in all of them, away from singular positions."""
    scene = pendulum()
    scene['mechanism']['points']['O'] = {'at': [0, 0]}
    scene['mechanism']['joints'] = {}
    scene['mechanism']['drives'] = {'pivot': {'point': 'O', 'at': ['0.1*sin(2*t)', '0.1*t**2']}}
    ours, other = (
        Simulation(load_scene(scene), formulation=name, step=1e-3, penalty=1e6)
        for name in ('alf2', formulation)
    )
    ours.step(1000)
    other.step(1000)
    assert other.sample().q == pytest.approx(ours.sample().q, abs=2e-5)
    assert other.sample().qd == pytest.approx(ours.sample().qd, abs=2e-4)


def test_independent_coordinates_refuse_the_time() -> None:
    drives = {'motor': {'joint': 'pin', 'angle': 't'}}
    for scene in (pendulum(drives=drives), BELT):
        with pytest.raises(InputError, match='do not depend on time'):
            Simulation(load_scene(scene), formulation='independent')


# ----------------------------------------------------- rows N(q, t) q̇ + B(q, t) = 0 that know t


def test_blade_that_is_steered(method: dict[str, Any]) -> None:
    """N(q, t): it goes at constant speed where the blade points, angle of the body plus t²/2."""
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {'A': {'at': [0, 0]}, 'B': {'at': [1, 0]}},
            'bodies': {
                'skate': {
                    'points': ['A', 'B'],
                    'mass': 2.0,
                    'inertia': {'about_com': 0.3},
                    'com': [0, 0],
                }
            },
            'joints': {
                'edge': {
                    'type': 'blade',
                    'between': ['ground', 'skate'],
                    'at': 'A',
                    'axis': [1, 0],
                    'angle': 't**2/2',
                }
            },
        },
        'initial': {'velocities': {'A': [0.7, 0], 'B': [0.7, 1.3]}},
    }
    sim = Simulation(load_scene(scene), **method)

    def way(f: Any, t: float) -> float:
        course = quad(lambda s: 0.7 * f(1.3 * s + s * s / 2), 0, t, epsabs=1e-13, epsrel=1e-13)
        return float(course[0])

    for sample in sim.run(3.0, at=[0.4, 1.7, 3.0]):
        wanted = way(np.cos, sample.t), way(np.sin, sample.t)
        assert sample.points['A'] == pytest.approx(wanted, abs=1e-9)
        assert sample.body_poses[0, 2] == pytest.approx(1.3 * sample.t, abs=1e-9)
        assert np.linalg.norm(sample.velocities['A']) == pytest.approx(0.7, abs=1e-10)


def test_ball_on_a_turntable(method: dict[str, Any]) -> None:
    """B(q, t): v̇ = (2/7) d/dt(Ω z × r). Started right it goes around at 2/7 of the turntable."""
    R, m = 0.1, 0.5
    scene = {
        'mechanism': {
            'alf': 1,
            'space': 'spatial',
            'points': {'C': {'at': [1, 0, R]}},
            'vectors': {
                'u': {'along': [1, 0, 0]},
                'v': {'along': [0, 1, 0]},
                'w': {'along': [0, 0, 1]},
            },
            'bodies': {
                'ball': {
                    'points': ['C'],
                    'vectors': ['u', 'v', 'w'],
                    'mass': m,
                    'inertia': {'about_com': [0.4 * m * R**2] * 3},
                }
            },
            'joints': {
                'rim': {
                    'type': 'no_slip',
                    'between': ['ground', 'ball'],
                    'at': 'C',
                    'radius': R,
                    'on': {
                        'through': [0, 0, 0],
                        'normal': [0, 0, 1],
                        'spin': '3 + sin(2*t)',
                    },
                }
            },
        },
        'effects': {'gravity': {'acceleration': [0, 0, -G]}},
        'initial': {'velocities': {'C': [0, 6 / 7, 0]}},
    }
    sim = Simulation(load_scene(scene), **{**method, 'step': method['step'] / 2})
    for sample in sim.run(4.0, at=[0.7, 2.0, 4.0]):
        angle = 2 / 7 * (3 * sample.t + 0.5 - 0.5 * np.cos(2 * sample.t))
        wanted = [np.cos(angle), np.sin(angle), R]
        assert sample.points['C'] == pytest.approx(wanted, abs=1e-9)


def on_the_belt(sample: Any, error: float) -> None:
    """A solid disk takes a third of the belt's speed."""
    t = sample.t
    way = t * t / 2 + np.cos(t) - 1
    assert sample.points['C'] == pytest.approx([way / 3, 0.5], abs=error)
    spin = (t - np.sin(t)) * (1 - 1 / 3) / 0.5
    assert sample._spins[0] == pytest.approx(spin, abs=error)


def test_wheel_on_a_belt_that_speeds_up(method: dict[str, Any]) -> None:
    for sample in Simulation(load_scene(BELT), **method).run(3.0, at=[1.1, 3.0]):
        on_the_belt(sample, 1e-10)


@pytest.mark.parametrize('formulation', OTHERS)
def test_other_formulations_know_the_belt(formulation: str) -> None:
    sim = Simulation(load_scene(BELT), formulation=formulation, step=1e-3)
    sim.step(1000)
    on_the_belt(sim.sample(), 1e-5)
