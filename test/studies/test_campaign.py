"""The adaptive campaign in its reduced form, and what it is measured against."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pytest

from alf_ros.kernel import step_length
from alf_ros.studies.exact import cost, one_freedom
from alf_ros.studies.exact.cost import Cost, evaluations_for
from alf_ros.studies.exact.starting_states import TIMES, starting_states
from alf_ros.studies.hard_cases import campaign
from alf_ros.studies.hard_cases.cases import CASES
from alf_ros.studies.hard_cases.trial import RunResult, execute

MECHANISMS = ('slider_crank', 'double_four_bar')


@pytest.fixture(scope='module')
def results() -> list[list[RunResult]]:
    return [[execute(run) for run in row.runs] for row in campaign.rows(quick=True)]


def test_no_run_fails_and_each_is_within_its_bound(results: list[list[RunResult]]) -> None:
    assert [r.verdict for row in results for r in row] == ['passed'] * sum(map(len, results))


def test_the_error_falls_with_the_tolerance(results: list[list[RunResult]]) -> None:
    medians = [statistics.median(r.position for r in row) for row in results]
    for name in (slice(0, 4), slice(4, 8)):
        assert all(b < 0.1 * a for a, b in zip(medians[name], medians[name][1:], strict=False))


def test_it_costs_what_the_one_freedom_costs(results: list[list[RunResult]]) -> None:
    rows = [*campaign.rows(quick=True)]
    for row, done in zip(rows, results, strict=True):
        if row.ratio is not None:  # below 1e-10 rounding decides what it costs
            assert statistics.median(r.ratio for r in done) <= row.ratio
    assert sum(row.ratio is not None for row in rows) == 6


@pytest.mark.parametrize('name', MECHANISMS)
def test_thirty_starts_of_every_kind(name: str) -> None:
    starts = starting_states(name)
    singular = math.pi / 2 if name == 'slider_crank' else 0.0
    beside = [abs(math.sin(start.theta - singular)) for start in starts]
    assert len({(start.theta, start.rate) for start in starts}) == 30
    assert (
        sum(b < 1e-15 and start.rate != 0.0 for b, start in zip(beside, starts, strict=True)) == 8
    )
    near = [b for b, start in zip(beside, starts, strict=True) if start.rate == 0.0 and b < 2e-3]
    assert len(near) == 8 and min(near) < 2e-5 and max(near) > 5e-4
    angles = np.sort([start.theta % (2.0 * math.pi) for start in starts])
    assert np.diff(angles).max() < 1.0
    assert sum(start.rate > 0.0 for start in starts) >= 8
    assert sum(start.rate < 0.0 for start in starts) >= 8


def test_the_full_campaign_has_every_promised_run() -> None:
    rows = list(campaign.rows(quick=False))
    assert [len(row.runs) for row in rows] == [90] * 20
    assert {run.penalty for row in rows for run in row.runs} == {1e7, 1e9, 1e11}
    assert min(run.tolerance for row in rows for run in row.runs) == pytest.approx(1e-12)
    assert 'campaign' in CASES


@pytest.mark.parametrize('alone', [one_freedom.slider_crank(), one_freedom.four_bars(2)])
def test_inertia_is_that_of_the_energy(alone: one_freedom.OneFreedom) -> None:
    """d/dt of ½ I θ̇² is the power of gravity, a function of θ only: θ̈ = (τ - ½ I' θ̇²) / I."""
    for theta in (0.3, 1.7, 4.0):
        inertia, slope = alone.inertia(theta)
        rate = 2.5
        torque = inertia * alone.acceleration(theta, 0.0)
        found = alone.acceleration(theta, rate)
        assert found == pytest.approx((torque - 0.5 * slope * rate**2) / inertia, rel=1e-12)


@pytest.mark.parametrize('name', MECHANISMS)
def test_the_one_freedom_alone_follows_its_tolerance(name: str) -> None:
    start = starting_states(name)[3]
    costs = start.costs
    # from 1e-3 and two decades apart: between neighbours rejected steps decide
    pairs = zip(costs[4:], costs[8:], strict=False)
    assert all(a.evaluations <= b.evaluations for a, b in pairs)
    assert costs[4].position < 1e-4 and costs[-1].position < 1e-11
    order = math.log(costs[4].position / costs[-3].position) / math.log(
        costs[-3].evaluations / costs[4].evaluations
    )
    assert order > 6.0  # evaluations^-8, and rounding at the end
    assert len(start.motion.exact()) == len(TIMES)


def test_the_share_of_a_step_is_that_of_the_kernel() -> None:
    assert cost.SHARE == step_length.SHARE


def test_evaluations_for_an_error_lie_between_those_measured() -> None:
    costs = [Cost(1e-4, 100), Cost(1e-2, 50), Cost(1e-3, 90), Cost(2e-3, 95), Cost(1e-8, 400)]
    assert evaluations_for(1e-6, costs) == pytest.approx(200.0)
    assert evaluations_for(1e-8, costs) == pytest.approx(400.0)
    assert evaluations_for(1.0, costs) == pytest.approx(50.0)
    assert evaluations_for(0.0, costs) == pytest.approx(400.0)
