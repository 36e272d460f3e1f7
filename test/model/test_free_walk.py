"""Walks along the way of a mechanism: singular positions that exact lengths meet, and that others
miss, by how much."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.model.free_walk import PENALTY, Walk, compiled
from alf_ros.model.ordinary_positions import ordinary
from alf_ros.model.smooth_branch import SmoothBranch
from alf_ros.studies.exact.crossed_bars import crossed_four_bars, crossed_mechanism
from alf_ros.studies.exact.one_freedom import GRAVITY
from support.thorough import LONG

# crank and coupler (m), whether each loop is crossed, and the angle of the first crank where the
# drawing stands: a way in coarse steps changed branches in their singular positions
CHANGED_BRANCHES = [
    (1.14, 1.38, [False, True], 1.61),
    (0.36, 0.64, [True, True, False], 2.46),
]
# cranks that are short beside the mechanism: the way went past their singular positions, or the
# branch through one, followed in coarse steps, ended beside it
SHORT_CRANKS = [
    (0.05, 1.0, [False], 1.0),
    (0.1, 3.0, [False, False], 1.0),
    (0.11287398752461529, 1.7958335535050902, [False, True], 0.646770307511618),
    (0.2, 1.0, [False] * 6, 1.0),
]


def chain(
    crank: float, coupler: float, crossed: list[bool], angle: float, longer: float = 0.0
) -> dict[str, Any]:
    """The file of a chain of four-bars at an angle of the first crank (rad). `longer` (m): by how
    much the last ground is longer than the coupler above it."""
    file = crossed_mechanism(crank, coupler, crossed)
    places = crossed_four_bars(crank, coupler, crossed).position(angle).reshape(-1, 2)
    if longer:
        pin = np.array([len(crossed) * coupler + longer, 0.0])
        file['points'][f'A{len(crossed)}']['at'] = pin.tolist()
        places[-1] = elbow(places[-2], coupler, pin, crank, places[-1])
    for k, place in enumerate(places):
        file['points'][f'B{k}']['at'] = place.tolist()
    return file


def elbow(one: Any, reach: float, two: Any, other: float, near: Any) -> Any:
    """The intersection of two circles next to a place."""
    across = two - one
    d = float(np.hypot(*across))
    along = (reach**2 - other**2 + d**2) / (2.0 * d)
    high = math.sqrt(reach**2 - along**2)
    found = [
        one + (along * across + s * high * np.array([-across[1], across[0]])) / d
        for s in (1.0, -1.0)
    ]
    return min(found, key=lambda place: float(np.hypot(*(place - near))))


def missed(file: dict[str, Any]) -> tuple[float, float]:
    """By how much a way misses singular positions, m, and the size of the mechanism, m."""
    model = compiled(load_scene({'mechanism': file}).mechanism)
    dependent_rows, _, sigma = ordinary(model, model.q)
    assert model.n - (len(model.row_names) - dependent_rows) == 1  # freedom
    model = model.accustomed(sigma, dependent_rows).with_penalty(PENALTY)
    walk = Walk(model, dependent_rows)
    return walk.missed(
        model.q, np.random.default_rng(0).standard_normal(model.n), False
    ), model.size


@pytest.mark.parametrize('drawing', CHANGED_BRANCHES + SHORT_CRANKS)
def test_exact_lengths_miss_nothing(drawing: tuple[float, float, list[bool], float]) -> None:
    assert missed(chain(*drawing))[0] == 0.0


@pytest.mark.parametrize('error', [1e-9, 1e-7, 2e-6])
@pytest.mark.parametrize('drawing', SHORT_CRANKS)
def test_short_cranks_miss_their_positions(
    drawing: tuple[float, float, list[bool], float], error: float
) -> None:
    found, _ = missed(chain(*drawing, error * drawing[0]))
    assert 0.1 * error * drawing[0] < found < 5.0 * error * drawing[0]


def test_a_start_in_a_position_that_many_loops_share() -> None:
    """There free directions lead off all branches, where nothing tells what lengths miss."""
    for way in (1.0, -1.0):
        cranks = {f'B{k}': [k + way, 0.0] for k in range(11)}
        scene = {'mechanism': 'n_four_bar', 'initial': {'positions': cranks}}
        assert Simulation(load_scene(scene)).missed == 0.0


def test_lengths_are_judged_at_random() -> None:
    random = np.random.default_rng(6)
    for _ in range(20 if LONG else 8):
        crossed = [bool(x) for x in random.integers(0, 2, random.integers(1, 4))]
        crank = round(float(random.uniform(0.1, 1.2)), 2)
        coupler = round(crank * float(random.uniform(1.2, 8.0)), 2)
        angle = float(random.choice([-1.0, 1.0]) * random.uniform(0.3, 2.8))
        alike = missed(chain(crank, coupler, crossed, angle))
        assert alike[0] < 1e-13 * alike[1], (crank, coupler, crossed, angle)
        error = float(10.0 ** random.uniform(-11.0, -9.0))
        found, _ = missed(chain(crank, coupler, crossed, angle, error))
        # bars in a line share the error among the rows of their loop
        assert 0.02 * error < found < 2.0 * error, (crank, coupler, crossed, angle, error)


def test_exact_lengths_are_not_blamed_for_a_long_step() -> None:
    """A stage that is some µm off its branch looks as if lengths missed the position, unless it is
    interpolated from the position and in the direction that are found."""
    crank, coupler, crossed = 0.44, 0.61, [False, True]
    alone = crossed_four_bars(crank, coupler, crossed)
    # back from the position, which a step of 5 ms meets
    angle, back = alone.course(0.0, -7.83, [0.1])[:, -1]
    scene = {
        'mechanism': chain(crank, coupler, crossed, angle),
        'effects': {'gravity': {'acceleration': [0.0, -GRAVITY]}},
        'initial': {'velocities': {'B0': (-back * alone.tangent(angle)[:2]).tolist()}},
    }
    sim = Simulation(load_scene(scene), integrator='rk4', step=5e-3)
    list(sim.run(0.4))
    assert 'lengths' not in sim.sample().diagnostics.trouble


def test_a_branch_that_ends_early_has_no_singular_position() -> None:
    """It has too few places for the polynomial between them, on either side of the position."""
    models = [
        compiled(load_scene({'mechanism': chain(0.8, 1.3, [True], angle)}).mechanism)
        for angle in (3.135, 3.235, 3.335)
    ]
    dependent_rows, _, sigma = ordinary(models[1], models[1].q)
    walk = Walk(models[1].accustomed(sigma, dependent_rows).with_penalty(PENALTY), dependent_rows)
    around = [each.q for each in models]
    assert walk._softest(around) is not None
    for count in range(1, 6):
        with patch.object(walk, '_closed', limited(walk._closed, count)):
            assert walk._softest(around) is None


def limited(closed: Callable[[Floats], Floats | None], count: int) -> Any:
    """`closed`, which closes so many positions."""
    left = iter(range(count))
    return lambda q: closed(q) if next(left, None) is not None else None


def test_a_branch_is_followed_through_a_crossing() -> None:
    """Of two lines that cross, the next place is the nearest on either; the branch stays on its
    line."""
    slopes = 0.3, -0.4

    def closed(place: Any) -> Any:
        x, y = place
        return np.array([x, min((k * x for k in slopes), key=lambda line: abs(line - y))])

    for slope in slopes:
        branch = SmoothBranch(np.array([-1.0, -slope]))
        unit = np.array([1.0, slope]) / math.hypot(1.0, slope)
        branch.follow(unit, 0.13, 2.5, closed)
        assert branch.s[-1] >= 2.5
        assert branch.places[-1][1] == pytest.approx(slope * branch.places[-1][0])
        value, along, bend, _ = branch.at(1.0)
        assert value == pytest.approx([-1.0, -slope] + unit)
        assert along == pytest.approx(unit)
        assert bend == pytest.approx([0.0, 0.0], abs=1e-12)
