"""The paper's examples against their exact solutions, through all singular positions."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from support.paths import DATA


def exact(name: str) -> Any:
    return json.loads((DATA / f'{name}.json').read_text())


def four_bar_points(theta: float) -> list[float]:
    return [np.cos(theta), np.sin(theta)]


def test_slider_crank() -> None:
    """6.2: 10 s, 11 passages; position, velocity, energy, multipliers."""
    reference = exact('slider_crank_6_2')
    sim = Simulation(load_scene('slider_crank'))
    passed = 0
    for sample, wanted in zip(sim.run(10.0, every=100), reference['samples'], strict=True):
        assert sample.t == pytest.approx(wanted['t'], abs=1e-12)
        q = [*sample.points['A'], sample.points['B'][0]]
        qd = [*sample.velocities['A'], sample.velocities['B'][0]]
        assert q == pytest.approx(wanted['q'], abs=1e-6)
        assert qd == pytest.approx(wanted['qd'], abs=1e-5)
        assert sample.energy == pytest.approx(reference['energy'], rel=1e-7)
        assert sample.diagnostics.position_violation < 1e-14
        assert sample.diagnostics.velocity_violation < 1e-12
        if abs(np.cos(wanted['theta'])) > 0.1:
            lam = [sample.multipliers['crank_length'], sample.multipliers['coupler_length']]
            assert lam == pytest.approx(wanted['lambda'], abs=1e-5)
            passed += 1
    assert passed > 80


@pytest.mark.parametrize(
    ('scene', 'parameters', 'name'),
    [('double_four_bar', None, 'n_fourbar_N2'), ('n_four_bar', {'N': 10}, 'n_fourbar_N10')],
)
def test_four_bars(scene: str, parameters: dict[str, float] | None, name: str) -> None:
    """6.3 and the N-four-bar: one freedom more at each of 10 passages, where λ has poles."""
    reference = exact(name)
    sim = Simulation(load_scene(scene, parameters=parameters))
    last = reference['parameters']['N']
    for sample, wanted in zip(sim.run(10.0, every=100), reference['samples'], strict=True):
        for k in (0, last):
            expected = four_bar_points(wanted['theta'])
            assert sample.points[f'B{k}'] - [k, 0] == pytest.approx(expected, abs=1e-6)
        assert sample.velocities['B0'] == pytest.approx(wanted['B0d'], abs=1e-5)
        assert sample.energy == pytest.approx(reference['energy'], rel=1e-7)
        assert sample.diagnostics.position_violation < 1e-14


def test_singular_instants_are_found_by_the_rank() -> None:
    """At the passage itself one row more depends on the others; a little later none does."""
    reference = exact('slider_crank_6_2')
    sim = Simulation(load_scene('slider_crank'))
    passage = reference['singular_passages'][3]['t']
    before, at, after = sim.run(passage + 0.1, at=[passage - 0.1, passage, passage + 0.1])
    assert (before.diagnostics.rank, before.diagnostics.singular) == (3, False)
    assert (at.diagnostics.rank, at.diagnostics.redundant, at.diagnostics.singular) == (2, 1, True)
    assert (after.diagnostics.rank, after.diagnostics.singular) == (3, False)
