"""Efforts and reactions of given motions against closed forms, and fed back into forward runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from alf_ros import (
    Closure,
    InputError,
    Simulation,
    equilibrium,
    fastest,
    load_scene,
    loads,
)
from alf_ros.arrays import Floats
from alf_ros.scene.scene import Scene
from alf_ros.studies.loads import inverse_dynamics
from support.thorough import LONG

G = 9.81
GRAVITY = {'gravity': {'acceleration': [0, -G]}}


def crank(angle: str = 'pi/4 + 0.6*sin(2*t)', **more: Any) -> Scene:
    """The slider-crank of two equal rods (1 m, 1 kg), its crank driven."""
    drives = {'motor': {'joint': 'crank_pin', 'angle': angle}}
    effects = {**GRAVITY, **more}
    return load_scene({'mechanism': 'slider_crank', 'effects': effects, 'drives': drives})


def crank_torque(theta: Floats, speed: Floats, acceleration: Floats) -> Floats:
    """Closed form: T = ½ J θ̇² with J = 2/3 + 2 sin² θ, V = g sin θ."""
    J, slope = 2.0 / 3.0 + 2.0 * np.sin(theta) ** 2, 4.0 * np.sin(theta) * np.cos(theta)
    return J * acceleration + 0.5 * slope * speed**2 + G * np.cos(theta)


def evenly(first: float, last: float, count: int) -> Floats:
    """Instants, s."""
    return np.array(np.linspace(first, last, count), dtype=float)


TIMES = evenly(0.0, 1.0, 41)


def swing(t: Floats) -> tuple[Floats, Floats, Floats]:
    """The angle of `crank`, its rate, and its acceleration."""
    return np.pi / 4 + 0.6 * np.sin(2 * t), 1.2 * np.cos(2 * t), -2.4 * np.sin(2 * t)


def test_one_actuator_against_the_closed_form() -> None:
    found = loads(crank(), times=TIMES)
    assert found.names == ('crank_pin',)
    assert found['crank_pin'] == pytest.approx(crank_torque(*swing(TIMES)), abs=1e-11)
    assert found.is_possible and not found.notes
    samples = list(Simulation(crank()).run(1.0, at=TIMES.tolist()))
    force = np.array([sample.reactions['knee'].force for sample in samples])
    assert found.run['reactions.knee.force'] == pytest.approx(force, abs=1e-9)
    assert found.run['joints.crank_pin.effort'] == pytest.approx(found['crank_pin'])
    peak = found.peaks['crank_pin']
    assert abs(peak.largest) == np.abs(found['crank_pin']).max() and peak.t in TIMES


def test_other_actuators_of_the_same_motion() -> None:
    """By virtual work: the knee turns by -2 θ, B moves by -2 sin θ dθ."""
    theta = swing(TIMES)[0]
    torque = crank_torque(*swing(TIMES))
    knee = loads(crank(), ['knee'], times=TIMES)
    assert knee['knee'] == pytest.approx(torque / -2.0, abs=1e-11)
    push = loads(crank(), ['wrenches.B.force.x'], times=TIMES)
    assert push.efforts[:, 0] == pytest.approx(torque / (-2.0 * np.sin(theta)), abs=1e-10)


def test_too_many_actuators_share_by_least_norm() -> None:
    found = loads(crank(), ['crank_pin', 'knee'], times=TIMES, weights={'knee': 3.0})
    torque = crank_torque(*swing(TIMES))
    # least u² + 3 v² with u - 2 v = torque
    assert found['crank_pin'] == pytest.approx(torque * 3.0 / 7.0, abs=1e-11)
    assert found['knee'] == pytest.approx(-torque * 2.0 / 7.0, abs=1e-11)
    assert '2 actuators move 1 freedoms' in found.notes[0] and found.is_possible


def test_singular_instants_have_limits() -> None:
    """The crank passes 90°, where the slider-crank of equal rods is singular."""
    at = np.pi / 4
    times = at + np.array([-0.7, -0.3, -1e-3, -1e-5, -1e-9, 0.0, 1e-7, 1e-4, 1e-2, 0.5])
    found = loads(crank('pi/4 + t'), times=times)
    one = np.ones_like(times)
    exact = crank_torque(np.pi / 4 + times, one, 0.0 * one)
    assert found['crank_pin'] == pytest.approx(exact, abs=1e-6)
    assert found.run.t == pytest.approx(times[[0, 1, 9]])
    alone = loads(crank('pi/4 + t'), times=[at])  # nothing around it is known
    assert np.isnan(alone['crank_pin']).all() and 'not determined' in alone.notes[0]
    with pytest.raises(InputError, match='all instants lie in singular positions'):
        print(alone.peaks)
    rubbing: Any = {'joint_friction': {'joint': 'knee', 'dynamic': 0.2, 'radius': 0.05}}
    alone = loads(crank('pi/4 + t', **rubbing), times=[at])
    assert np.isnan(alone['crank_pin']).all()


def test_an_actuator_of_an_angle_that_rows_hold_has_no_effort() -> None:
    """A heavy block that hardly resists turning, on two parallel rails. The torque about one rail
    was -1 N m, which the other rail holds alone."""
    mechanism = {
        'alf': 1,
        'space': 'spatial',
        'points': {'O': {'at': [0, 0, 0]}, 'A': {'at': [0, 1, 0]}},
        'bodies': {
            'block': {
                'points': ['O', 'A'],
                'mass': 10.0,
                'com': [0, 0, 0],
                'inertia': {'about_com': [1e-4, 1e-4, 1e-4]},
            }
        },
    }
    mechanism['joints'] = {
        name: {'type': kind, 'between': ['ground', 'block'], 'at': at, 'axis': [1, 0, 0]}
        for name, kind, at in (('rail', 'cylindrical', 'O'), ('guide', 'prismatic', 'A'))
    }
    scene = {
        'mechanism': mechanism,
        'drives': {'path': {'joint': 'guide', 'length': '0.3*sin(2*t)'}},
        'effects': {'constant_wrench': {'on': 'block', 'force': [0, 0, 0], 'torque': [1, 0, 0]}},
    }
    found = loads(scene, ['rail_angle', 'rail_length'], times=TIMES)
    assert np.abs(found['rail_angle']).max() < 1e-12
    assert found['rail_length'] == pytest.approx(-12.0 * np.sin(2.0 * TIMES), abs=1e-11)
    assert '2 actuators move 1 freedoms' in found.notes[0]


DOUBLE: dict[str, Any] = {'mechanism': 'double_pendulum', 'effects': GRAVITY}


def test_too_few_actuators() -> None:
    """The shoulder alone, for a motion of both joints: least squares in the metric of mass."""
    drives = {
        'one': {'joint': 'shoulder', 'angle': '0.3*sin(3*t)'},
        'two': {'joint': 'elbow', 'angle': 'pi/2 + 0.4*cos(2*t) - 0.4'},
    }
    times = evenly(0.1, 0.9, 9)
    whole = loads(load_scene({**DOUBLE, 'drives': drives}), times=times)
    found = loads(load_scene({**DOUBLE, 'drives': drives}), ['shoulder'], times=times)
    a, b = 1.0, 0.8
    elbow = np.pi / 2 + 0.4 * np.cos(2 * times) - 0.4
    for k, angle in enumerate(elbow):
        # joint-space mass matrix of two rods of 1 kg
        coupling = 0.5 * a * b * np.cos(angle)
        M22 = b**2 / 3.0
        M = np.array([[a**2 / 3 + a**2 + M22 + 2 * coupling, M22 + coupling], [0.0, M22]])
        M[1, 0] = M[0, 1]
        inverse, need = np.linalg.inv(M), whole.efforts[k]
        least = (inverse @ need)[0] / inverse[0, 0]
        assert found['shoulder'][k] == pytest.approx(least, rel=1e-10)
        left = inverse @ (need - [least, 0.0])
        assert found.missing[k] == pytest.approx(left, abs=1e-9)
    assert not found.is_possible
    assert 'cannot make this motion: elbow misses' in found.notes[-1]


def test_a_motion_of_its_own_needs_nothing() -> None:
    simulation = Simulation(load_scene({**DOUBLE}), step=1e-3, integrator='dop853')
    found = loads(simulation, ['shoulder'], times=[0.0, 0.1, 0.25, 0.5])
    assert np.abs(found.efforts).max() < 1e-10 and found.is_possible
    assert simulation.t == 0.0  # the caller's own is left alone


def platform(n: int) -> list[str]:
    """The place of P<n> as the platform heaves, sways and turns."""
    angle = float(np.radians(120 * (n // 2) + 100 * (n % 2) - 50))
    turn = f'{angle!r} + 0.3*sin(3*t)'
    return [f'0.6*cos({turn}) + 0.05*sin(2*t)', f'0.6*sin({turn})', '1.2 + 0.1*sin(4*t)']


def test_stewart_efforts_repeat_the_motion() -> None:
    """Six legs for a given motion of the platform, fed back into a forward run."""
    scene = {'mechanism': 'stewart_platform', 'effects': {'gravity': {'acceleration': [0, 0, -G]}}}
    drives = {f'd{n}': {'point': f'P{n}', 'at': platform(n)} for n in (0, 2, 4)}
    driven = load_scene({**scene, 'drives': drives})
    legs = [f'leg{n}' for n in range(6)]
    times = evenly(0.0, 0.3, 121)
    found = loads(driven, legs, times=times)
    assert found.short.max() < 1e-12
    ends = list(Simulation(driven, step=1e-3, integrator='rk4').run(0.3, at=[0.0, 0.3]))
    velocities = {f'P{n}': ends[0].velocities[f'P{n}'].tolist() for n in (0, 2, 4)}
    free = load_scene({**scene, 'initial': {'velocities': velocities}})
    simulation = Simulation(free, step=2.5e-3, integrator='dop853')
    found.apply_to(simulation)
    simulation.step(120)
    now, then = simulation.sample().points, ends[1].points
    assert max(np.abs(now[name] - then[name]).max() for name in then) < 1e-9


def test_friction_that_depends_on_reactions() -> None:
    friction: Any = {'joint_friction': {'joint': 'knee', 'dynamic': 0.2, 'radius': 0.05}}
    found = loads(crank(**friction), times=evenly(0.0, 0.4, 201))
    free = load_scene(
        {
            'mechanism': 'slider_crank',
            'effects': {**GRAVITY, **friction},
            'initial': {'velocities': {'A': [-1.2 * np.sin(np.pi / 4), 1.2 * np.cos(np.pi / 4)]}},
        }
    )
    simulation = Simulation(free, step=2e-3, integrator='dop853')
    found.apply_to(simulation)
    simulation.step(200)
    angle = simulation.sample().joints['crank_pin'].position
    assert angle == pytest.approx(swing(np.array(0.4))[0], abs=1e-8)
    assert not np.allclose(found['crank_pin'], loads(crank(), times=found.t)['crank_pin'])


def test_held_inputs_and_effects_left_out() -> None:
    simulation = Simulation(crank(), step=1e-3, integrator='rk4')
    simulation.apply_wrench('B', force=[3.0, 0.0])
    found = loads(simulation, times=[0.0, 0.2])
    angle = swing(found.t)
    assert found['crank_pin'] == pytest.approx(
        crank_torque(*angle) + 3.0 * 2.0 * np.sin(angle[0]), abs=1e-10
    )
    bare = loads(crank(), times=[0.0, 0.2], without=['gravity'])
    weight = G * np.cos(angle[0])
    assert bare['crank_pin'] == pytest.approx(crank_torque(*angle) - weight, abs=1e-10)


def test_a_table_of_all_numbers(tmp_path: Path) -> None:
    found = loads(crank(), times=TIMES[:3])
    lines = found.csv(tmp_path / 'loads.csv').read_text().splitlines()
    head = lines[0].split(',')
    assert head[:3] == ['t', 'crank_pin.effort', 'short'] and 'reactions.knee.force.x' in head
    assert float(lines[3].split(',')[1]) == found['crank_pin'][2]


# -------------------------------------------------------------------------------- the fastest run


def guided(length: str = 't', **effects: Any) -> Scene:
    """A mass of 2 kg on a straight guide."""
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': {'A': {'at': [0, 0]}},
        'bodies': {'mass': {'points': ['A'], 'mass': 2.0, 'inertia': 'point'}},
        'joints': {
            'guide': {
                'type': 'slider',
                'point': 'A',
                'on': {'through': [0, 0], 'direction': [1, 0]},
            }
        },
    }
    drives = {'path': {'joint': 'guide', 'length': length}}
    return load_scene({'mechanism': mechanism, 'drives': drives, 'effects': effects})


def test_fastest_straight_run() -> None:
    run = fastest(guided(), {'guide': 3.0}, length=0.8, pieces=100)
    assert run.duration == pytest.approx(2.0 * np.sqrt(2.0 * 0.8 / 3.0), rel=1e-13)
    assert run.limited_by['guide'] == pytest.approx(1.0)
    # brakes harder than it accelerates: t = v/a + v/b with v² (1/a + 1/b) = 2 d
    run = fastest(guided(), {'guide': [-6.0, 2.0]}, length=0.8, pieces=400)
    a, b = 1.0, 3.0
    speed = np.sqrt(2.0 * 0.8 / (1.0 / a + 1.0 / b))
    assert run.duration == pytest.approx(speed / a + speed / b, rel=1e-13)


def swung(limit: float, length: float) -> float:
    """Time of the fastest turn of the crank backwards from 45°, by integration in time from both
    ends up to the common angle and speed."""

    def motion(torque: float) -> Any:
        def rate(_t: float, y: Floats) -> list[float]:
            theta, speed = y
            J = 2.0 / 3.0 + 2.0 * np.sin(theta) ** 2
            rest = 2.0 * np.sin(theta) * np.cos(theta) * speed**2 + G * np.cos(theta)
            return [speed, (torque - rest) / J]

        return rate

    def past(_t: float, y: Floats) -> float:
        return float(y[0] - (np.pi / 4 - length))

    past.terminal = True  # type: ignore[attr-defined]

    def run(switch: float) -> Any:
        """Pushed downwards for `switch`, then upwards, until it stops."""
        first = solve_ivp(motion(-limit), (0, switch), [np.pi / 4, 0.0], rtol=1e-11, atol=1e-12)

        def still(_t: float, y: Floats) -> float:
            return float(y[1])

        still.terminal = True  # type: ignore[attr-defined]
        still.direction = 1.0  # type: ignore[attr-defined]
        return solve_ivp(
            motion(limit), (switch, 5.0), first.y[:, -1], rtol=1e-11, atol=1e-12, events=still
        )

    switch = brentq(lambda s: run(s).y[0, -1] - (np.pi / 4 - length), 0.05, 0.6, xtol=1e-13)
    return float(run(switch).t[-1])


def test_fastest_turn_of_a_crank() -> None:
    exact = swung(12.0, 0.7)
    errors = []
    for pieces in (100, 400, 1600):
        run = fastest(crank('pi/4 - 0.7*t'), {'crank_pin': 12.0}, length=1.0, pieces=pieces)
        assert np.abs(run.loads.efforts).max() <= 12.0 + 1e-9
        errors.append(abs(run.duration - exact))
    assert errors[2] < 5e-6 and errors[0] / errors[2] > 16.0**1.3 / 2.0


def arm() -> Scene:
    """Two rods (1 m, 1 kg) on level ground, both joints driven."""
    rod = {'mass': 1.0, 'inertia': 'rod'}
    mechanism = {
        'alf': 1,
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': [1, 0]},
            'B': {'at': [1 + np.cos(1), np.sin(1)]},
        },
        'bodies': {'upper': {'points': ['O', 'A'], **rod}, 'lower': {'points': ['A', 'B'], **rod}},
        'joints': {
            'shoulder': {'type': 'revolute', 'between': ['ground', 'upper'], 'at': 'O'},
            'elbow': {'type': 'revolute', 'between': ['upper', 'lower'], 'at': 'A'},
        },
        'drives': {
            'first': {'joint': 'shoulder', 'angle': 'sin(2*t)'},
            'second': {'joint': 'elbow', 'angle': 'cos(2*t)'},
        },
    }
    return load_scene({'mechanism': mechanism})


def test_fastest_run_past_a_zero_of_the_inertia() -> None:
    """Where the shoulder's effort for a unit of s̈ changes its sign, nothing but the speed keeps
    its limit. The speed alternated there, down to zero, and so did all other efforts."""
    runs = [
        fastest(arm(), {'shoulder': 10.0, 'elbow': 10.0}, length=1.0, pieces=pieces)
        for pieces in (100, 800)
    ]
    for run in runs:
        square = run.rate**2
        assert np.abs(np.diff(square)).max() < 12.0 * square.max() / square.size
        assert run.loads.peaks['elbow'].largest == pytest.approx(4.0, abs=0.05)
    assert runs[0].duration == pytest.approx(runs[1].duration, rel=1e-3)


def test_fastest_run_with_a_damper() -> None:
    damper = {'damper': {'between': ['O', 'B'], 'damping': 1.5}}
    scene = crank('pi/4 - 0.7*t', **damper)
    run = fastest(scene, {'crank_pin': [-12.0, 12.0]}, length=1.0, pieces=300)
    assert np.abs(run.loads.efforts).max() <= 12.0 + 1e-6
    assert run.limited_by['crank_pin'] > 0.98
    free = fastest(crank('pi/4 - 0.7*t'), {'crank_pin': 12.0}, length=1.0, pieces=300)
    assert abs(run.duration - free.duration) > 1e-3


@pytest.mark.thorough
def test_fastest_run_where_drag_limits_the_speed() -> None:
    """Most of the way has the speed at which drag takes the whole effort. This was refused:
    without drag the speed is so high that the effort could not hold it."""
    m, u, d, way = 2.0, 3.0, 20.0, 0.8
    scene = guided(joint_friction={'joint': 'guide', 'viscous': d})
    run = fastest(scene, {'guide': u}, length=way)
    top, k = u / d, d / m

    def braking(speed: float) -> tuple[float, float]:
        t = np.log1p(speed / top) / k
        return t, (speed + top) * -np.expm1(-k * t) / k - top * t

    def ahead(t: float) -> float:
        part = -np.expm1(-k * t)
        return top * (t - part / k) + braking(top * part)[1] - way

    t = brentq(ahead, 1.0, 10.0)
    expected = t + braking(top * -np.expm1(-k * t))[0]
    assert run.duration == pytest.approx(expected, rel=2e-4)
    assert run.limited_by['guide'] > 0.99
    # half a thousandth of the time is lost where it begins and ends
    quadratic = fastest(guided(drag={'on': 'A', 'quadratic': 300.0}), {'guide': u}, length=way)
    assert way / 0.1 < quadratic.duration < 1.01 * way / 0.1


def test_viscous_friction_costs_half_a_power() -> None:
    """Accelerates with 2 N, brakes with 6 N: at both ends friction goes as the root of the way."""
    m, d, way = 2.0, 5.0, 0.8
    k = d / m

    def braking(speed: float) -> tuple[float, float]:
        t = np.log1p(speed * d / 6.0) / k
        return t, (speed + 6.0 / d) * -np.expm1(-k * t) / k - 6.0 / d * t

    def ahead(t: float) -> float:
        part = -np.expm1(-k * t)
        return 2.0 / d * (t - part / k) + braking(2.0 / d * part)[1] - way

    t = brentq(ahead, 0.1, 10.0)
    expected = t + braking(2.0 / d * -np.expm1(-k * t))[0]
    scene = guided(joint_friction={'joint': 'guide', 'viscous': d})
    few, many = (500, 8000) if LONG else (125, 2000)
    runs = [fastest(scene, {'guide': [-6.0, 2.0]}, length=way, pieces=n) for n in (few, many)]
    errors = [abs(run.duration - expected) for run in runs]
    assert errors[1] < 0.8 / many and 12.0 < errors[0] / errors[1] < 40.0


def rolled(speed: str) -> Scene:
    """A wheel on a belt, its centre driven."""
    belt = {'through': [0, 0], 'direction': [1, 0], 'speed': speed}
    of = {'between': ['ground', 'wheel'], 'at': 'C', 'radius': 0.2}
    wheel = {'points': ['C', 'M'], 'mass': 1.0, 'com': [0, 0], 'inertia': {'about_com': 0.02}}
    mechanism = {
        'alf': 1,
        'points': {'C': {'at': [0, 0.2]}, 'M': {'at': [0.2, 0.2]}},
        'bodies': {'wheel': wheel},
        'joints': {'roll': {'type': 'no_slip', **of, 'on': belt}},
        'drives': {'path': {'point': 'C', 'at': ['t', None]}},
    }
    return load_scene({'mechanism': mechanism})


@pytest.mark.parametrize(
    ('call', 'words'),
    [
        (lambda: loads(load_scene('four_bar'), times=[0.0]), 'the scene has no drives'),
        (lambda: loads('crank', times=[0.0]), 'no scene of this name'),
        (lambda: loads(1, times=[0.0]), 'not a scene'),  # type: ignore[arg-type]
        (lambda: loads(crank(), [], times=[0.0]), 'no actuators'),
        (lambda: loads(crank(), ['kne'], times=[0.0]), "got 'kne'"),
        (lambda: loads(crank(), ['knee', 'knee'], times=[0.0]), 'given twice'),
        (lambda: loads(crank(), times=[]), 'no instants'),
        (lambda: loads(crank(), times=[1.0, 0.5]), 'times: lies in the past, got 0.5'),
        (lambda: loads(crank(), times=[0.2, 0.1]), 'lies in the past'),
        (lambda: loads(crank(), times=[0.0], weights={'a': 1.0}), 'no such actuator'),
        (lambda: loads(crank(), times=[0.0], weights={'crank_pin': 0.0}), 'not usable'),
        (lambda: loads(crank(), times=[0.0], without=['wind']), 'no such effect'),
        (lambda: loads(crank(), times=[0.0])['knee'], 'no such actuator'),
        (lambda: loads(crank(), times=[0.0]).curve('crank_pin'), 'too few instants'),
        (lambda: fastest(crank(), {}, length=1.0), 'no limits'),
        (lambda: fastest(crank(), {'crank_pin': [2.0, 1.0]}, length=1.0), 'an empty range'),
        (lambda: fastest(crank(), {'crank_pin': [1.0]}, length=1.0), 'not a limit'),
        (lambda: fastest(crank(), {'crank_pin': 12.0}, length=0.0), 'not usable'),
        (lambda: fastest(crank(), {'crank_pin': 1.0}, length=0.3), 'cannot hold the path'),
    ],
)
def test_refusals(call: Any, words: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    assert words in str(caught.value)


def test_forces_over_time_and_of_reactions_have_no_fastest_run() -> None:
    friction: Any = {'joint_friction': {'joint': 'knee', 'dynamic': 0.2, 'radius': 0.05}}
    with pytest.raises(InputError, match='depends on reactions'):
        fastest(crank(**friction), {'crank_pin': 12.0}, length=0.2)
    # the run takes longer than the path has parameters: the table acts on its way
    late: Any = {'user_table': {'joint': 'guide', 'table': [[0, 0], [3, 0], [3.1, -0.5]]}}
    with pytest.raises(InputError, match="depend on time have no fastest run, got 'user_table'"):
        fastest(guided(**late), {'guide': 1.0}, length=1.0)
    with pytest.raises(InputError, match="depend on time have no fastest run, got 'roll'"):
        fastest(rolled('0.5'), {'wrenches.wheel.torque': 1.0}, length=1.0)


@pytest.mark.parametrize(('length', 'where'), [('0*t', '0.005'), ('max(t - 0.5, 0)**3', '0.005')])
def test_a_path_that_stands_still_has_no_fastest_run(length: str, where: str) -> None:
    with pytest.raises(InputError, match=f'path: it stands still at s = {where}'):
        fastest(guided(length), {'guide': 1.0}, length=1.0, pieces=100)


def test_efforts_are_applied_to_simulations_only() -> None:
    with pytest.raises(InputError, match='simulation: not a simulation'):
        loads(crank(), times=[0.0, 0.1]).apply_to('crank')  # type: ignore[arg-type]


def test_actuators_that_lose_a_direction() -> None:
    """A push on B along the guide cannot hold the crank where B turns back (θ = 0)."""
    times = [0.1, np.pi / 4, 1.0]
    found = loads(crank('pi/4 - t'), ['wrenches.B.force.x'], times=times)
    assert np.isnan(found.efforts[1, 0]) and not np.isnan(found.efforts[[0, 2]]).any()
    assert 'not determined' in found.notes[0]


def test_efforts_beside_a_dead_centre() -> None:
    """The push moves B by -2 sin θ dθ, and all around a heavy flywheel on the crank."""
    flywheel = {'motor': {'joint': 'crank_pin', 'armature': 100.0}}
    angle = 10.0 ** evenly(-1.0, -6.0, 11)
    scene = crank('pi/4 - t', **flywheel)
    found = loads(scene, ['wrenches.B.force.x'], times=np.pi / 4 - angle)
    torque = crank_torque(angle, -np.ones(11), np.zeros(11))
    assert found.efforts[:, 0] == pytest.approx(torque / (-2.0 * np.sin(angle)), rel=2e-9)
    assert found.is_possible and not found.notes


def test_too_many_actuators_beside_a_dead_centre_of_one() -> None:
    """The push on B alone moves the crank less and less; together they always share."""
    angle = evenly(0.2, 0.005, 118)
    flywheel = {'motor': {'joint': 'crank_pin', 'armature': 5.0}}
    scene = crank('pi/4 - t', **flywheel)
    found = loads(scene, ['wrenches.B.force.x', 'crank_pin'], times=np.pi / 4 - angle)
    ways = np.array([-2.0 * np.sin(angle), np.ones_like(angle)])
    torque = crank_torque(angle, -np.ones_like(angle), np.zeros_like(angle))
    assert found.efforts.T == pytest.approx(ways * torque / (ways**2).sum(axis=0), abs=1e-9)


@pytest.mark.parametrize('bearings', [{}, {'stiffness': {'translation': 1e6}}])
def test_shares_of_redundant_joints_are_noted(bearings: dict[str, Any]) -> None:
    """Three parallel cranks: rigid bodies leave their shares open, and bearings decide."""
    points, bodies, joints = dict[str, Any](), dict[str, Any](), dict[str, Any]()
    for k in range(3):
        points |= {f'O{k}': {'at': [k, 0], 'fixed': True}, f'A{k}': {'at': [k + 0.5, 0.8]}}
        bodies[f'crank{k}'] = {'points': [f'O{k}', f'A{k}'], 'mass': 1.0, 'inertia': 'rod'}
        for name, between, at in (
            (f'foot{k}', ['ground', f'crank{k}'], f'O{k}'),
            (f'head{k}', [f'crank{k}', 'plate'], f'A{k}'),
        ):
            joints[name] = {'type': 'revolute', 'between': between, 'at': at, **bearings}
    plate = {'points': ['A0', 'A1', 'A2'], 'mass': 3.0, 'inertia': {'about_com': 0.2}}
    bodies['plate'] = {**plate, 'com': [1.0, 0.0]}
    scene = {
        'mechanism': {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints},
        'effects': {'gravity': {'acceleration': [0, -9.81]}},
        'drives': {'turn': {'joint': 'foot0', 'angle': '1.0 + 0.2*t'}},
    }
    found = loads(load_scene(scene), times=[0.0, 0.5])
    if bearings:
        assert not found.notes
    else:
        assert 'shares of the load in foot0, head0, ' in found.notes[0]
        assert found.is_possible


def test_parts_of_a_motion_have_the_bits_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many instants are computed in several calls, so that an interruption is heard between."""
    whole = loads(crank('pi/4 + t'), ['crank_pin', 'knee'], times=TIMES)
    monkeypatch.setattr(inverse_dynamics, '_LABOUR', 1)
    parts = loads(crank('pi/4 + t'), ['crank_pin', 'knee'], times=TIMES)
    for name in ('efforts', 'short', 'missing'):
        assert getattr(parts, name).tobytes() == getattr(whole, name).tobytes()


def test_the_branch_of_a_start_does_not_matter_at_rest() -> None:
    """A scene that names the branch of its velocities has equilibria, loads and closed loops."""
    singular = {
        'positions': {'A': [0, 1], 'B': [0, 0]},
        'velocities': {'B': [-4.0, None]},
        'branch': 1,
    }
    scene = load_scene({'mechanism': 'slider_crank', 'effects': GRAVITY, 'initial': singular})
    simulation = Simulation(scene, step=1e-3, integrator='dop853')
    found = loads(simulation, ['crank_pin'], times=[0.1, 0.2])
    assert np.abs(found.efforts).max() < 1e-8  # gravity makes the motion
    assert equilibrium(scene).stability == 'undecided'  # it rests where it starts, upright
    posture = Closure(scene, ['crank_pin']).close({'crank_pin': np.pi / 2 + 0.1})
    assert posture.missed_by < 1e-12
