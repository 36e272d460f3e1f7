"""Simulations in lanes have the bits of simulations alone, whatever their neighbours do."""

from __future__ import annotations

import copy
import signal
from typing import Any

import numpy as np
import pytest

from alf_ros import BusyError, InputError, Simulation, StepError, load_scene
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.scene.scene import Scene
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.side_by_side import SideBySide, no_place
from support.side_by_side_members import check, member
from support.singular_starts import GRAVITY, scene
from support.thorough import thinned

pytestmark = pytest.mark.skipif(PLAIN, reason='code that is not compiled has no lanes')

DOWN, BELOW = 'gravity.acceleration.1', 'gravity.acceleration.2'
# what differs from member to member, step (s), steps: the plane and space, singular positions,
# redundant rows, rolling, stops, drives, angles that are counted
LIBRARY: dict[str, tuple[dict[str, Any], float, int]] = {
    'slider_crank': ({'coupler.mass': '{1+k/50}', DOWN: '{-9-k/8}'}, 5e-3, 400),
    'change_point': ({'m': '{1+k/40}', DOWN: '{-9-k/8}'}, 5e-3, 300),
    'double_four_bar': ({DOWN: '{-9-k/8}'}, 2e-3, 200),
    'double_pendulum': ({DOWN: '{-9-k/8}'}, 5e-3, 200),
    'bricard': ({BELOW: '{-9-k/8}'}, 5e-3, 40),
    'delta_robot_controlled': ({BELOW: '{-9-k/8}'}, 5e-3, 60),
    'coin': ({BELOW: '{-9-k/8}'}, 5e-3, 100),
    'differential_drive_cart': ({}, 5e-3, 60),
    'wiper': ({DOWN: '{-9-k/8}'}, 5e-3, 100),
    'scissor_lift': ({DOWN: '{-9-k/8}'}, 5e-3, 60),
}


@pytest.mark.parametrize('name', LIBRARY)
def test_members_have_the_bits_of_their_single_runs(name):
    changes, h, steps = LIBRARY[name]
    made = [member(name, changes, k, step=h, integrator='rk4') for k in range(5)]
    alone = [copy.copy(each) for each in made]
    together = SideBySide(made, 8)
    for n in (1, steps - 8, 7):
        assert together.step(n) == {}
        for each in alone:
            each.step(n)
        check(made, alone)


@pytest.mark.parametrize(
    ('integrator', 'lanes'),
    thinned(
        [('rk4', 2 * width()), ('dop853', 2 * width()), ('rk4', width()), ('dop853', width())],
        # others are compiled for this test alone, and rk4 is in the tests beside it
        lambda integrator, lanes: lanes == width() and integrator != 'rk4',
    ),
)
def test_registers_of_other_widths_and_every_integrator_of_fixed_steps(lanes, integrator):
    made = [
        member('change_point', {DOWN: '{-9-k/8}'}, k, step=1e-2, integrator=integrator)
        for k in range(2 * lanes + 1)
    ]
    alone = [copy.copy(each) for each in made]
    SideBySide(made, lanes).step(90)
    for each in alone:
        each.step(90)
    check(made, alone)


def test_different_mechanisms_share_a_call():
    names = ['slider_crank', 'double_pendulum', 'slider_crank', 'bricard', 'double_pendulum']
    made = [Simulation(load_scene(name), step=4e-3, integrator='rk4') for name in names]
    alone = [copy.copy(each) for each in made]
    together = SideBySide(made)
    assert together.patterns == 3
    together.step(50)
    for each in alone:
        each.step(50)
    check(made, alone)


def test_members_with_other_settings_of_solves():
    made = [
        Simulation(load_scene('bricard'), step=4e-3, iterations=n, penalty=p, integrator='rk4')
        for n, p in ((10, 1e7), (2, 1e7), (10, 1e9), (1, 1e7))
    ]
    alone = [copy.copy(each) for each in made]
    together = SideBySide(made)
    assert together.patterns == 3
    together.step(30)
    for each in alone:
        each.step(30)
    check(made, alone)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
@pytest.mark.parametrize('crank', [0.0, 3.0])
def test_starts_in_singular_positions(crank, integrator):
    """Upright, with and without a speed, and beside members that start elsewhere."""
    starts: list[Scene] = [
        scene(effects=GRAVITY, A=[-crank, 0.0], B=[-2.0 * crank, 0.0]),
        load_scene('slider_crank'),
        scene(effects=GRAVITY, A=[-2.0 * crank, 0.0], B=[-4.0 * crank, 0.0]),
    ]
    made = [Simulation(each, step=5e-3, integrator=integrator) for each in starts]
    alone = [copy.copy(each) for each in made]
    SideBySide(made).step(60)
    for each in alone:
        each.step(60)
    check(made, alone)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_a_member_that_fails_does_not_touch_the_others(integrator):
    """A drive that asks for a place beyond reach ends its own run, with the error of its run."""

    def driven(reach: float) -> Simulation:
        drives = {'push': {'joint': 'guide', 'length': f'1.2 + {reach}*t'}}
        return Simulation(
            scene(positions={'A': [0.6, 0.8], 'B': [1.2, 0]}, drives=drives, effects={}),
            step=1e-2,
            integrator=integrator,
        )

    made = [driven(reach) for reach in (0.1, 5.0, 0.2)]
    alone = [copy.copy(each) for each in made]
    failed = SideBySide(made).step(40)
    assert list(failed) == [1]
    with pytest.raises(StepError) as error:
        alone[1].step(40)
    assert str(failed[1]) == str(error.value)
    for each in (alone[0], alone[2]):
        each.step(40)
    check(made, alone)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
@pytest.mark.parametrize(
    'angle',
    [
        '0.7854 + 2*sin({k}*t)',
        '0.7854 + {k}*t**2*exp(-t)/hypot(1, t)',
        'max(0.7854, {k}*t*t)',  # the members leave the first branch one after another
        'table',
        '0.7854 + {k}*t',  # in one member the program is another one: no number is 0.7854 twice
    ],
)
def test_members_with_drives(angle, integrator):
    def motion(k: float) -> Any:
        if angle == 'table':
            return {'table': [[0, 0.7854], [0.11, k], [0.3, 2]]}
        return angle.format(k=k)

    made = [
        Simulation(
            load_scene(
                {
                    'mechanism': 'slider_crank',
                    'drives': {'turn': {'joint': 'crank_pin', 'angle': motion(k)}},
                }
            ),
            step=5e-3,
            integrator=integrator,
        )
        for k in (1.0, 0.7854, 1.3)
    ]
    alone = [copy.copy(each) for each in made]
    SideBySide(made).step(200)
    for each in alone:
        each.step(200)
    check(made, alone)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_between_two_calls_a_member_is_a_simulation(integrator):
    made = [member('slider_crank', {'m': '{1+k/9}'}, k, integrator=integrator) for k in range(3)]
    alone = [copy.copy(each) for each in made]
    together = SideBySide(made)
    together.step(40)
    for each in alone:
        each.step(40)
    begin = made[1].state
    for run in (made, alone):
        run[0].apply_effort('crank_pin', 3.0)
        run[1].restore(begin)
        run[2].step(5)
    together.step(30, without=[2])
    for each in alone[:2]:
        each.step(30)
    check(made, alone)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_samples_of_a_run(integrator):
    made = [member('slider_crank', {'m': '{1+k/9}'}, k, integrator=integrator) for k in range(2)]
    alone = [copy.copy(each) for each in made]
    times = [0.0, 0.01, 0.0234567, 0.05]
    found: list[list[tuple[float, bytes]]] = [[] for _ in made]

    def look(k: int, sample: Sample) -> None:
        found[k].append((sample.t, sample.state.q.tobytes()))

    assert SideBySide(made).run(0.06, times, look) == {}
    for samples, each in zip(found, alone, strict=True):
        assert samples == [(s.t, s.state.q.tobytes()) for s in each.run(0.06, at=times)]
    check(made, alone)


class _Ring(Exception):
    pass


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_an_interrupted_call_leaves_whole_steps(integrator):
    made = [member('slider_crank', {'m': '{1+k/9}'}, k, integrator=integrator) for k in range(3)]
    alone = [copy.copy(each) for each in made]
    together = SideBySide(made)
    together.step(1)

    def ring(*_: object) -> None:
        raise _Ring

    before = signal.signal(signal.SIGVTALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.2)
        with pytest.raises(_Ring):
            together.step(10**9)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    together.step(10)
    for one, other in zip(made, alone, strict=True):
        assert one.step_index > 11
        other.step(one.step_index)
        assert one.state.q.tobytes() == other.state.q.tobytes()
        assert one.state.qd.tobytes() == other.state.qd.tobytes()


def test_one_thread_at_a_time():
    made = [Simulation(load_scene('slider_crank'), integrator='rk4') for _ in range(2)]
    together = SideBySide(made)
    with made[1]._lock, pytest.raises(BusyError):
        together.step(1)
    together.step(1)
    assert [each.step_index for each in made] == [1, 1]


@pytest.mark.parametrize(
    ('settings', 'said'),
    [
        ({'integrator': 'esdirk43'}, 'explicit'),
        ({'formulation': 'alf1'}, 'alf2'),
        ({'watch': True}, 'watched'),
        ({'ledger': True}, 'works'),
    ],
)
def test_what_has_no_lanes_is_refused(settings, said):
    simulation = Simulation(load_scene('slider_crank'), **settings)
    assert said in no_place(simulation)
    with pytest.raises(InputError, match=said):
        SideBySide([simulation])


def test_other_refusals():
    one, other = (Simulation(load_scene('slider_crank'), step=h) for h in (1e-3, 2e-3))
    with pytest.raises(InputError, match='one step'):
        SideBySide([one, other])
    with pytest.raises(InputError, match='twice'):
        SideBySide([one, one])
    with pytest.raises(InputError, match='not a simulation'):
        SideBySide([one, 'slider_crank'])  # type: ignore[list-item]
    assert SideBySide([]).step(3) == {} and SideBySide([]).run(0.1, [0.0], print) == {}
    with pytest.raises(InputError, match='2, 4, 8 or 16'):
        SideBySide([one], lanes=3)
    with pytest.raises(InputError, match='n: '):
        SideBySide([one]).step(-1)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_turns_are_counted_for_each_member(integrator):
    made = [
        member('pendulum', {DOWN: '{-0.01-k/1e3}'}, k, step=1e-2, integrator=integrator)
        for k in range(4)
    ]
    for k, each in enumerate(made):
        each.apply_effort(each.model.coordinate_names[0], 3.0 * (-1) ** k)
    alone = [copy.copy(each) for each in made]
    SideBySide(made).step(400)
    for each in alone:
        each.step(400)
    check(made, alone)
    assert len({np.sign(each.state.turns.sum()) for each in made}) > 1
