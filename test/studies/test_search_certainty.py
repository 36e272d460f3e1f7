"""The bound on what a search may have missed holds with the confidence that it states."""

from __future__ import annotations

import math

import numpy as np
import pytest

from alf_ros import assemblies, atlas
from alf_ros.studies.atlas.search_certainty import CONFIDENCE, in_words, most_missing


def wrong(parts: list[float], patience: int) -> float:
    """The exact probability that a search ends where more than the bound is left.

    parts: of the starts that find something new, after 1, 2, ... finds. A search ends after that
    many in vain.
    """
    reached, found = 1.0, 0.0
    for run, part in enumerate(parts, 1):
        ends = (1.0 - part) ** patience
        found += reached * ends * (part > most_missing(patience, run))
        reached *= 1.0 - ends
    return found


@pytest.mark.parametrize('patience', [4, 20, 100, 300])
def test_the_bound_holds_with_its_confidence(patience: int) -> None:
    """Also where each part lies just above its bound, which is the worst that can be."""
    worst = [most_missing(patience, run) * (1.0 + 1e-9) for run in range(1, 200)]
    assert 0.04 < wrong(worst, patience) <= 1.0 - CONFIDENCE
    random = np.random.default_rng(3)
    for _ in range(200):
        parts = np.sort(random.uniform(0.0, 1.0, 40) ** random.integers(1, 8))[::-1]
        assert wrong(parts.tolist(), patience) <= 1.0 - CONFIDENCE


def test_several_searches_share_the_confidence() -> None:
    one = (1.0 - most_missing(40, 3, 25)) ** 40
    assert one == pytest.approx((1.0 - CONFIDENCE) / 25 / 12, rel=1e-12)


def test_starts_that_are_no_round_say_nothing() -> None:
    assert [most_missing(n, 1) for n in range(4)] == [1.0] * 4
    assert most_missing(7, 1) == most_missing(4, 1) < 1.0


def test_the_part_is_rounded_up() -> None:
    assert in_words(0.2101).startswith('at most 22 % of')
    assert in_words(0.0183).startswith('at most 1.9 % of')
    assert in_words(0.00401).startswith('at most 0.41 % of')


def test_few_starts_do_not_claim_to_have_found_all() -> None:
    """The RSSR four-bar has two assemblies. Some searches with 20 starts find one of them."""
    counts = set()
    for seed in range(8):
        found = assemblies('spatial_four_bar', {'crank_pin': 0.7}, starts=20, seed=seed)
        counts.add(len(found))
        run = len(found) + 1
        assert found.missing == pytest.approx(
            1.0 - (0.05 / (run * (run - 1))) ** (1 / 20), rel=1e-12
        )
        assert f'at most {math.ceil(100 * found.missing)} % of further starts' in found.statement
    assert counts == {1, 2}


def test_an_atlas_states_what_it_may_have_missed() -> None:
    few = atlas('four_bar', 'crank_pin', starts=8)
    (sheet,) = few.sheets
    assert sheet.vain == 8 and sheet.finds in (0, 1)
    bound = 1.0 - (0.05 / ((sheet.finds + 1) * (sheet.finds + 2))) ** (1 / 8)
    assert f'at most {math.ceil(100 * bound)} % of further starts would find more' in (
        few.statement
    )


def test_an_atlas_names_the_stops_that_do_not_end_its_curves() -> None:
    scene = {
        'mechanism': 'four_bar',
        'effects': {'joint_stop': {'joint': 'rocker_pin', 'upper': 2.0, 'stiffness': 1e4}},
    }
    found = atlas(scene, 'rocker_pin', starts=20)
    assert found.statement.endswith('; stops do not end a curve: those of rocker_pin')
    assert found.limits() == atlas('four_bar', 'rocker_pin', starts=20).limits()
