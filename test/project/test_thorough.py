"""Cases that are left to `make thorough`: of each value one case at least stays."""

from __future__ import annotations

import pytest

from support import thorough
from support.thorough import combined, thinned


def test_each_value_keeps_a_case(monkeypatch: pytest.MonkeyPatch) -> None:
    lists = 'abc', [1, 2], [(3, 4), pytest.param(5, 6, id='other')]
    monkeypatch.setattr(thorough, 'LONG', True)
    every = [case.values for case in combined(*lists)]
    assert len(every) == 12 == len(set(every))
    named = combined([pytest.param(1, id='one')], [pytest.param(2, id='two')])
    assert [case.id for case in named] == ['one-two']
    monkeypatch.setattr(thorough, 'LONG', False)
    stays = [case.values for case in combined(*lists)]
    assert stays == [('a', 1, 3, 4), ('b', 2, 5, 6), ('c', 1, 3, 4)]


def test_what_is_kept_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thorough, 'LONG', False)
    for cases in (
        thinned([1, 2, 3], keep=[1, 3]),
        thinned([1, 2, 3], keep=lambda number: number != 2),
    ):
        assert [case.values for case in cases] == [(1,), (3,)]
    assert [case.values for case in thinned([(1, 2), (2, 1)], keep=[(2, 1)])] == [(2, 1)]
    with pytest.raises(ValueError, match='no case stays'):
        thinned([1, 2], keep=[3])
    monkeypatch.setattr(thorough, 'LONG', True)
    assert [case.values for case in thinned([1, 2, 3], keep=[1])] == [(1,), (2,), (3,)]


def test_whole_tests_are_left_to_make_thorough(request: pytest.FixtureRequest) -> None:
    marked = [each for each in request.session.items if each.get_closest_marker('thorough')]
    assert thorough.LONG or not marked
