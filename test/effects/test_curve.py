"""Curves against scipy's, and the motion of a joint under them against closed forms."""

import math

import numpy as np
import pytest
from scipy.interpolate import BPoly

from alf_ros import InputError, Simulation
from alf_ros.effects.contract.trajectory import Curve, through
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.saved_states import as_data, from_data, read_curve
from support.effect_scenes import ROTOR, simulate

J = 0.5
TIMES = [0.3, 0.8, 1.0, 2.5]
KNOTS = np.array([[0.1, -0.4, 2.0], [1.5, 0.3, -1.0], [1.2, 0.0, 0.5], [-0.7, 0.0, 0.0]])
PD = 'motor: {joint: pin, position: 0, position_gain: 40, velocity_gain: 9}'


@pytest.mark.parametrize('known', [1, 2, 3])
def test_pieces_have_what_the_knots_say(known):
    """Linear, cubic, quintic: as the interpolating polynomials of scipy, derivatives too."""
    curve = through(TIMES, KNOTS[:, :known].tolist())
    wanted = BPoly.from_derivatives(TIMES, KNOTS[:, :known])
    for t in np.linspace(TIMES[0], TIMES[-1], 50)[:-1]:
        found = curve.at(t)
        for order in range(3):
            assert found[order] == pytest.approx(wanted.derivative(order)(t), rel=1e-9, abs=1e-9)
    assert curve.at(0.0) == (0.1, 0.0, 0.0)
    assert curve.at(curve.end) == curve.at(1e9) == (-0.7, 0.0, 0.0)


def test_a_piece_is_as_smooth_as_the_poorer_of_its_knots():
    curve = through([0.0, 1.0, 2.0], [(0.0, 1.0, 0.0), (1.0,), (2.0, 0.0)])
    assert curve.at(0.25) == (0.25, 1.0, 0.0) and curve.at(1.5) == (1.5, 1.0, 0.0)


def test_a_new_curve_follows_the_old_one_up_to_its_start():
    old = through(TIMES, KNOTS.tolist())
    new = through([0.9, 1.9], [old.at(0.9), (5.0, 0.0, 0.0)], old)
    for t in np.linspace(0.0, 0.9, 20)[:-1]:
        assert new.at(t) == old.at(t)
    for order in range(3):
        assert new.at(0.9)[order] == pytest.approx(old.at(0.9)[order], rel=1e-12)
    assert new.at(1.9) == (5.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ('pieces', 'says'),
    [
        ((), 'pieces of 7'),
        (((0.0, 1.0),), 'pieces of 7'),
        (((0.0, math.nan, 0, 0, 0, 0, 0),), 'finite'),
        (((1.0, *[0.0] * 6), (1.0, *[0.0] * 6)), 'ascend'),
        (((0.0, 1.0, 2.0, 0, 0, 0, 0),), 'slope'),
    ],
)
def test_what_is_no_curve_is_told(pieces, says):
    with pytest.raises(ValueError, match=says):
        Curve(pieces)
    with pytest.raises(ValueError, match='ascend'):
        through([0.0, 0.0], [(1.0,), (2.0,)])


def test_effort_over_time_moves_a_rotor_as_its_integral():
    """J θ̈ = e(t), of the third power: θ is a polynomial of the fifth, which dop853 has exactly."""
    effort = through([0.0, 1.0], [(0.2, 1.0), (0.7, 0.0)])
    scene = scene_from_text(ROTOR + '\nsolver: {step: 0.05, integrator: dop853}')
    sim = Simulation(scene)
    sim.apply_effort('pin', effort)
    polynomial = np.polynomial.Polynomial(effort.pieces[0][1:]) / J
    for sample in sim.run(1.0, every=4):
        angle, rate = (polynomial.integ(k)(sample.t) for k in (2, 1))
        assert sample.joints['pin'].position == pytest.approx(angle, abs=1e-13)
        assert sample.joints['pin'].velocity == pytest.approx(rate, abs=1e-13)
        assert sample.joints['pin'].effort == effort.at(sample.t)[0]
    sim.step(20)
    assert sim.sample().joints['pin'].effort == 0.7


def test_a_target_is_followed_as_a_table_of_the_scene_is():
    """Bit for bit: the same controller, the same function of time."""
    table = PD.replace('position: 0', 'position: [[0.1, 0.0], [0.6, 2.0], [0.8, 1.5]]')
    scene, commanded = simulate(ROTOR, table), simulate(ROTOR, PD)
    commanded.apply_target('pin', through([0.1, 0.6, 0.8], [(0.0,), (2.0,), (1.5,)]))
    for sim in (scene, commanded):
        sim.step(1200)
    assert np.array_equal(scene.sample().q, commanded.sample().q)
    assert abs(scene.sample().joints['pin'].position - 1.5) < 0.3


def test_a_constant_target_and_a_speed():
    sim = simulate(ROTOR, PD)
    sim.apply_target('pin', 0.5)
    sim.step(4000)
    assert sim.sample().joints['pin'].position == pytest.approx(0.5, abs=1e-9)
    driven = simulate(ROTOR, 'motor: {joint: pin, velocity: 0, velocity_gain: 9}')
    driven.apply_target('pin', velocity=2.0)
    driven.step(4000)
    assert driven.sample().joints['pin'].velocity == pytest.approx(2.0, abs=1e-9)


def test_what_no_motor_follows_is_refused():
    sim = simulate(ROTOR, 'motor: {joint: pin, velocity: 0, velocity_gain: 9}')
    before = sim.state.inputs
    for arguments in (('pin', 1.0), ('pni', 1.0), ('pin', None, math.inf)):
        with pytest.raises(InputError):
            sim.apply_target(*arguments)
    assert sim.state.inputs == before


def test_a_state_keeps_curves_and_targets():
    sim = simulate(ROTOR, PD)
    sim.apply_target('pin', through([0.1, 0.9], [(0.0, 0.0, 0.0), (1 / 3, 0.0, 0.0)]))
    sim.apply_effort('pin', through([0.2, 0.3], [(0.0,), (0.7,)]))
    sim.step(250)
    state = from_data(as_data(sim.state), sim.state)
    assert state.inputs == sim.state.inputs
    sim.step(500)
    ahead = sim.sample().q
    sim.restore(state)
    sim.step(500)
    assert np.array_equal(sim.sample().q, ahead)
    assert read_curve(0.5) == 0.5 and read_curve(None) is None
