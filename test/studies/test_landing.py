"""Steps that end in a singular position, samples there, and kinked forces beside it."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Scene, Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.studies.exact import crossed_bars, motions, one_freedom
from alf_ros.studies.hard_cases import landing
from alf_ros.studies.hard_cases.trial import execute
from support.thorough import LONG, combined, thinned

CRANK = one_freedom.slider_crank()
ASIDE = (0.0, 1e-12, -1e-9, 1e-7, -1e-6, 1e-5)  # s


def by_point(values: Floats) -> dict[str, list[float]]:
    return dict(zip(('A', 'B'), values.reshape(-1, 2).tolist(), strict=True))


def crank_scene(theta: float, rate: float, effects: dict[str, object]) -> Scene:
    return load_scene(
        {
            'mechanism': 'slider_crank',
            'effects': effects,
            'initial': {
                'positions': by_point(CRANK.position(theta)),
                'velocities': by_point(CRANK.tangent(theta) * rate),
            },
        }
    )


def piston(rate: float, when: float, gravity: float) -> Simulation:
    """At its dead centre at the time `when` (s), by steps of 10 ms."""
    motion = landing._piston(rate).motion(when)
    scene = motion.scene()
    source = {
        'mechanism': 'slider_crank',
        'effects': {'gravity': {'acceleration': [0, -gravity]}},
        'drives': {'piston': {'point': 'B', 'at': [f'-2*cos({rate!r}*(t - {when!r}))', None]}},
        'initial': {'positions': scene.positions, 'velocities': scene.velocities},
    }
    return Simulation(load_scene(source), step=1e-2, integrator='rk4')


def crossed(crank: float, coupler: float, pattern: list[bool], rate: float) -> landing._Passage:
    """Four-bars that pass the position in which they lie flat; the first crank has the rate."""
    alone = crossed_bars.crossed_four_bars(crank, coupler, pattern)
    mechanism = crossed_bars.crossed_mechanism(crank, coupler, pattern)
    points = tuple(f'B{k}' for k in range(len(pattern) + 1))
    return landing._Passage('crossed', mechanism, (), alone, points, 0.0, rate)


@pytest.mark.parametrize('aside', ASIDE)
def test_effort_at_a_dead_centre_is_its_limit(aside: float) -> None:
    """Without gravity the piston of a crank that turns uniformly needs -ω² cos ωt."""
    rate, when = 2.0 * math.pi, 0.2 + aside
    sim = piston(rate, when, 0.0)
    sim.step(20)
    angle = rate * (sim.t - when)
    sample = sim.sample()
    expected = rate**2 * math.cos(angle)
    assert sample.drive_efforts['piston'][0] == pytest.approx(expected, rel=1e-7)
    qdd = rate**2 * np.array([math.cos(angle), math.sin(angle), 2.0 * math.cos(angle), 0.0])
    assert sample.qdd == pytest.approx(qdd, abs=1e-6)


def test_a_weight_that_a_dead_centre_cannot_hold_has_no_limit() -> None:
    sim = piston(2.0 * math.pi, 0.2, one_freedom.GRAVITY)
    sim.step(20)
    sample = sim.sample()
    assert math.isnan(sample.drive_efforts['piston'][0])
    assert sample.reactions['crank_pin'].indeterminate
    assert sample.reactions['crank_pin'].force[1] == pytest.approx(one_freedom.GRAVITY, abs=1e-6)
    assert np.isfinite(sample.qdd).all()
    later = piston(2.0 * math.pi, 0.2, one_freedom.GRAVITY)
    later.step(21)  # 10 ms behind it there is a force
    angle = 2.0 * math.pi * 0.01
    exactly = (2.0 * math.pi) ** 2 * math.cos(angle) - one_freedom.GRAVITY / (
        2.0 * math.tan(angle)
    )
    assert later.sample().drive_efforts['piston'][0] == pytest.approx(exactly, rel=1e-8)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'esdirk43'])
def test_a_sample_is_the_same_from_a_state_kept(integrator: str) -> None:
    """In the position and beside it: a log can be verified."""
    for aside in (0.0, 1e-9, 1e-5, 1e-4) if LONG else (0.0, 1e-5):
        rates = landing._passages([2.0])
        passage = dict(rates)['change_point'][0]
        scene = passage.motion(0.1 + aside).scene()
        sim = Simulation(scene, step=1e-3, integrator=integrator)
        sim.step(100)
        first = sim.sample()
        again = Simulation(scene, step=1e-3, integrator=integrator)
        again.restore(sim.state)
        second = again.sample()
        assert np.array_equal(first.qdd, second.qdd)
        assert np.array_equal(first.lam, second.lam, equal_nan=True)
        assert np.array_equal(first.reaction_forces, second.reaction_forces, equal_nan=True)
        sim.step(50)
        again.step(50)
        assert np.array_equal(sim.state.q, again.state.q)


@cache
def stopped(beyond: float) -> tuple[Scene, tuple[float, ...]]:
    """A crank with a stiff stop so far beyond the position, and its angles every 0.05 s."""
    stop, stiffness, theta, rate = math.pi / 2 + beyond, 1e7, 1.2, 3.0

    def rates(t: float, y: Floats) -> tuple[float, float]:
        push = stiffness * max(0.0, y[0] - stop) ** 1.5 / (2 / 3 + 2 * math.sin(y[0]) ** 2)
        return y[1], CRANK.acceleration(y[0], y[1]) - push

    times = np.array([0.05, 0.1, 0.15, 0.2, 0.25, 0.3])
    found = solve_ivp(
        rates, (0, 0.3), (theta, rate), 'DOP853', times, rtol=1e-11, atol=1e-13, max_step=5e-5
    )
    effects = {
        'gravity': {'acceleration': [0, -one_freedom.GRAVITY]},
        'joint_stop': {'joint': 'crank_pin', 'upper': stop, 'stiffness': stiffness},
    }
    return crank_scene(theta, rate, effects), tuple(found.y[0])


@pytest.mark.parametrize(
    ('integrator', 'tolerance', 'beyond'),
    combined(
        thinned(
            [
                ('dop853_adaptive', 1e-4),
                ('dop853_adaptive', 1e-6),
                ('esdirk43_adaptive', 1e-5),
                ('esdirk43_adaptive', 1e-7),
            ],
            keep=[('dop853_adaptive', 1e-6), ('esdirk43_adaptive', 1e-7)],
        ),
        [3e-3, 1e-3, -3e-3],
    ),
)
def test_a_stiff_stop_beside_the_position(
    beyond: float, integrator: str, tolerance: float
) -> None:
    """The error falls with the tolerance: nothing is interpolated across the stop."""
    scene, angles = stopped(beyond)
    sim = Simulation(scene, step=0.05, integrator=integrator, tolerance=tolerance)
    for angle in angles:
        sim.step()
        assert sim.sample().q == pytest.approx(CRANK.position(angle), abs=150 * tolerance)


def test_runs_of_the_case_land_where_they_say() -> None:
    """The exact motions of the driven runs follow from their drives."""
    for row in landing.rows(True):
        if 'driven' in row.setting and row.runs[0].integrator == 'dop853':
            for run in row.runs:
                assert execute(run).position < 1e-11


@pytest.mark.parametrize(
    ('step', 'rate'), [(1e-2, -6.049690027078819), (2e-3, -3.295916496819431)]
)
def test_a_step_that_begins_where_nothing_is_felt(step: float, rate: float) -> None:
    """Of 3,000 landings at random speeds these ended so well that the next step did not notice."""
    change = one_freedom.change_point_alone()
    passage = landing._Passage(
        'change_point', 'change_point', (), change, ('A', 'B'), 3.0 * math.pi, rate
    )
    motion = passage.motion(0.1)
    whole = Simulation(motion.scene(), integrator='dop853', step=step)
    whole.step(round(0.2 / step))
    assert whole.sample().q == pytest.approx(motion.exact()[2], abs=1e-11)
    # nor does it matter how the steps are asked for, or whether the state is put back
    parts = Simulation(motion.scene(), integrator='dop853', step=step)
    parts.step(round(0.1 / step))
    parts.restore(parts.state)
    for _ in range(round(0.1 / step)):
        parts.step()
    assert (parts.sample().q == whole.sample().q).all()


@pytest.mark.parametrize('integrator', ['esdirk43_adaptive', 'dop853_adaptive'])
def test_a_long_step_away_from_a_dead_centre(integrator: str) -> None:
    """A piston turns its crank by 0.84 rad in a step of the grid, from 8e-9 rad before it."""
    driven = landing._piston(-8.394194570562531)
    motion = driven.motion(0.100000001)
    simulation = Simulation(motion.scene(), integrator=integrator, step=0.1, tolerance=1e-3)
    for wanted in motion.exact()[1:]:
        simulation.step()
        assert simulation.sample().q == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize(
    ('offset', 'integrator'), combined([1e-9, -1e-8], ['rk4', 'dop853', 'esdirk43_adaptive'])
)
def test_at_rest_however_little_beside_it(integrator: str, offset: float) -> None:
    """It stays on the branch of its place, though no row feels which one that is."""
    motion = motions.start('slider_crank', offset, 0.0)
    simulation = Simulation(motion.scene(), integrator=integrator, step=1e-3)
    simulation.step(1000)
    wanted = motion.exact()[10]
    assert simulation.sample().q - [0.0, 1.0, 0.0, 0.0] == pytest.approx(
        wanted - [0.0, 1.0, 0.0, 0.0], rel=1e-4, abs=1e-15
    )


@pytest.mark.parametrize(
    ('crank', 'coupler', 'pattern', 'rate', 'aside'),
    [
        (1.12, 1.72, [True], 5.48, 1e-10),
        (0.76, 1.44, [True, True], 4.01, -1e-10),
        (0.93, 1.47, [False, True], 3.13, 0.0),
        (1.04, 1.64, [True, False], 4.74, 1e-8),
    ],
)
def test_coarse_steps_that_land_on_exact_lengths(
    crank: float, coupler: float, pattern: list[bool], rate: float, aside: float
) -> None:
    """The error of a long step is not taken for lengths that disagree."""
    motion = crossed(crank, coupler, pattern, rate).motion(0.1 + aside)
    sim = Simulation(motion.scene(), integrator='rk4', step=1e-2)
    for wanted in motion.exact()[1:]:
        sim.step(10)
        assert sim.sample().q == pytest.approx(wanted, abs=1e-3)
    assert sim.resolution.crossing == 0.0


def too_long(crank: float, coupler: float, rate: float, aside: float) -> Simulation:
    """The last crank turns by a radian and more in a step."""
    motion = crossed(crank, coupler, [True, True], rate).motion(0.1 + aside)
    return Simulation(motion.scene(), integrator='rk4', step=1e-2)


def test_steps_far_too_long_that_are_refused_are_not_blamed_on_lengths() -> None:
    with pytest.raises(StepError, match='take a smaller step') as refused:
        too_long(0.62, 1.06, -4.7, 1e-10).step(30)
    assert 'lengths' not in str(refused.value)


def test_steps_far_too_long_that_pass_are_not_blamed_on_lengths() -> None:
    simulation = too_long(0.6, 1.06, -7.37, 1e-8)
    simulation.step(30)
    said = simulation.sample().diagnostics.trouble
    assert 'too long' in said and 'lengths' not in said
