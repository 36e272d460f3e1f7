"""Cases that repeat what other cases of the same test prove. `make thorough` runs them, too.

`make test` has a limit of time. A test of many integrators, scenes and effects keeps one case at
least of each of them there, and all cases that are hard.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable
from typing import Any

import pytest
from _pytest.mark import ParameterSet


def thinned(
    values: Iterable[Any], keep: Collection[Any] | Callable[..., bool]
) -> list[ParameterSet]:
    """All values as cases of a test, all but some for `make thorough` only.

    `keep` has the values that stay, or tells of one whether it stays; tuples are the values of
    several arguments.
    """
    stays = keep if callable(keep) else lambda *case: (case[0] if len(case) == 1 else case) in keep
    cases = [_case(value) for value in values]
    found = [case if stays(*case.values) else _marked(case) for case in cases]
    if all(case.marks for case in found):
        raise ValueError(f'no case stays: {keep}')
    return found


def combined(*lists: Iterable[Any]) -> list[ParameterSet]:
    """Each value of a list with each of the others, as cases of a test with an argument for each
    list. One case at least of each value stays: those along the diagonal."""
    columns = [[_case(value) for value in values] for values in lists]
    longest = max(len(column) for column in columns)
    diagonal = {tuple(n % len(column) for column in columns) for n in range(longest)}
    found = []
    for places in itertools.product(*(range(len(column)) for column in columns)):
        parts = [column[n] for column, n in zip(columns, places, strict=True)]
        case = pytest.param(
            *(value for part in parts for value in part.values),
            marks=[mark for part in parts for mark in part.marks],
            id=_joined([part.id for part in parts]),
        )
        found.append(case if places in diagonal else _marked(case))
    return found


def _case(value: Any) -> ParameterSet:
    if isinstance(value, ParameterSet):
        return value
    return pytest.param(*value) if isinstance(value, tuple) else pytest.param(value)


def _marked(case: ParameterSet) -> ParameterSet:
    return pytest.param(*case.values, marks=[*case.marks, pytest.mark.thorough], id=case.id)


def _joined(names: list[Any]) -> str | None:
    return '-'.join(names) if all(isinstance(name, str) for name in names) else None
