"""Cases that are left to `make thorough`: of each value one case at least stays."""

from __future__ import annotations

import pytest

from support.thorough import combined, thinned


def test_each_value_keeps_a_case() -> None:
    cases = combined('abc', [1, 2], [(3, 4), pytest.param(5, 6, id='other')])
    assert len(cases) == 12 == len({case.values for case in cases})
    stays = [case.values for case in cases if not case.marks]
    assert stays == [('a', 1, 3, 4), ('b', 2, 5, 6), ('c', 1, 3, 4)]
    named = combined([pytest.param(1, id='one')], [pytest.param(2, id='two')])
    assert [case.id for case in named] == ['one-two']


def test_what_is_kept_is_told() -> None:
    for cases in (
        thinned([1, 2, 3], keep=[1, 3]),
        thinned([1, 2, 3], keep=lambda number: number != 2),
    ):
        assert [case.values for case in cases if not case.marks] == [(1,), (3,)]
        assert [mark.name for case in cases for mark in case.marks] == ['thorough']
    pairs = thinned([(1, 2), (2, 1)], keep=[(2, 1)])
    assert [case.values for case in pairs if not case.marks] == [(2, 1)]
    with pytest.raises(ValueError, match='no case stays'):
        thinned([1, 2], keep=[3])
