"""Passes through singular positions as events, and the distance to them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from alf_ros import InputError, Simulation, load_scene
from support.paths import DATA

EXACT = {
    'slider_crank': 'slider_crank_6_2.json',
    'double_four_bar': 'n_fourbar_N2.json',
}


def times(name: str) -> list[float]:
    exact = json.loads((DATA / EXACT[name]).read_text())
    return [each['t'] for each in exact['singular_passages']]


@pytest.mark.parametrize('name', EXACT)
@pytest.mark.parametrize(
    ('integrator', 'step', 'within'),
    [('rk4', 1e-3, 1e-5), ('dop853', 4e-3, 1e-5), ('dop853_adaptive', 1e-2, 1e-4)],
)
def test_every_pass_is_an_event(name: str, integrator: str, step: float, within: float) -> None:
    sim = Simulation(load_scene(name), integrator=integrator, step=step, watch=True)
    sim.step(round(10.0 / step))
    assert [event.t for event in sim.passes] == pytest.approx(times(name), abs=within)
    for event in sim.passes:
        assert event.distance < 0.05
        assert event.energy_after == pytest.approx(event.energy_before, abs=1e-6)
        assert set(event.joints) == set(sim.model.joint_names)


def test_events_do_not_depend_on_how_it_is_stepped_and_change_nothing() -> None:
    whole = Simulation(load_scene('slider_crank'), watch=True)
    whole.step(3300)
    parts = Simulation(load_scene('slider_crank'), watch=True)
    for n in (1, 390, 1, 1, 1, 906, 2000):
        parts.step(n)
    assert parts.passes == whole.passes and len(whole.passes) == 4
    alone = Simulation(load_scene('slider_crank'))
    alone.step(3300)
    assert alone.state.q.tobytes() == whole.state.q.tobytes()
    whole.reset()
    assert not whole.passes


def test_what_turns_back_is_no_pass() -> None:
    """A slider-crank let go at rest a little before the position swings away from it."""
    for offset in (0.05, 0.01):
        angle = 0.5 * np.pi + offset
        A = [float(np.cos(angle)), float(np.sin(angle))]
        source = {
            'mechanism': 'slider_crank',
            'effects': {'gravity': {'acceleration': [0, 9.81]}},  # upwards: the position is below
            'initial': {'positions': {'A': A, 'B': [2.0 * A[0], 0.0]}},
        }
        sim = Simulation(load_scene(source), step=1e-3, watch=True)
        period = 2.0 * np.pi * np.sqrt((2.0 / 3.0 + 2.0) / 9.81)  # of small swings
        sim.step(round(1.5 * period / 1e-3))
        assert len(sim.passes) == 3  # it swings through the position, up and down
    source['effects'] = {'gravity': {'acceleration': [0, -9.81]}}
    sim = Simulation(load_scene(source), step=1e-3, watch=True)
    sim.step(300)  # it falls away from it
    assert sim.passes == ()


def test_a_mechanism_without_such_positions_has_no_pass() -> None:
    sim = Simulation(load_scene('four_bar'), watch=True)
    sim.step(5000)
    assert sim.passes == ()
    assert sim.sample().diagnostics.distance > 0.1


def test_distance_is_the_least_singular_value() -> None:
    """The slider-crank's is √(48/7) |cos θ| near the position, in α M^-½ scaled rows."""
    sim = Simulation(load_scene('slider_crank'))
    found = []
    for sample in sim.run(0.45, every=1):
        found.append((np.cos(sample.body_poses[0, 2]), sample.diagnostics.distance))
    near = [(cos, distance) for cos, distance in found if 0.003 < abs(cos) < 0.05]
    ratios = [distance / abs(cos) for cos, distance in near]
    assert len(ratios) > 10
    assert np.ptp(ratios) < 0.02 * np.mean(ratios)


def test_who_does_not_watch_has_no_events() -> None:
    with pytest.raises(InputError, match='nobody watches'):
        _ = Simulation(load_scene('slider_crank')).passes
    with pytest.raises(InputError, match='only alf2 watches'):
        Simulation(load_scene('slider_crank'), formulation='alf1', watch=True)
