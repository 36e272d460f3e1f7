"""Cases that repeat what other cases of the same test prove: `make thorough` runs them, too.

`make test` has a limit of time. A test of many integrators, scenes and effects keeps one case at
least of each of them there. A test with the marker `thorough` is left to `make thorough` as a
whole: it is long, and another one proves its statement for less.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Collection, Iterable
from typing import Any

import pytest
from _pytest.mark import ParameterSet

LONG = bool(os.environ.get('ALF_ROS_LONG'))  # all cases: `make thorough`


def thinned(
    values: Iterable[Any], keep: Collection[Any] | Callable[..., bool]
) -> list[ParameterSet]:
    """The values as cases of a test: all of them, or the ones that stay in `make test`.

    `keep` has the values that stay, or tells of one whether it stays; tuples are the values of
    several arguments.
    """
    stays = keep if callable(keep) else lambda *case: (case[0] if len(case) == 1 else case) in keep
    found = [case for case in map(_case, values) if LONG or stays(*case.values)]
    if not found:
        raise ValueError(f'no case stays: {keep}')
    return found


def combined(*lists: Iterable[Any]) -> list[ParameterSet]:
    """Each value of a list with each of the others, as cases of a test with an argument for each
    list. In `make test` one case at least of each value stays: those along the diagonal."""
    columns = [[_case(value) for value in values] for values in lists]
    longest = max(len(column) for column in columns)
    diagonal = {tuple(n % len(column) for column in columns) for n in range(longest)}
    every = itertools.product(*(range(len(column)) for column in columns))
    found = []
    for places in (each for each in every if LONG or each in diagonal):
        parts = [column[n] for column, n in zip(columns, places, strict=True)]
        case = pytest.param(
            *(value for part in parts for value in part.values),
            marks=[mark for part in parts for mark in part.marks],
            id=_joined([part.id for part in parts]),
        )
        found.append(case)
    return found


def _case(value: Any) -> ParameterSet:
    if isinstance(value, ParameterSet):
        return value
    return pytest.param(*value) if isinstance(value, tuple) else pytest.param(value)


def _joined(names: list[Any]) -> str | None:
    return '-'.join(names) if all(isinstance(name, str) for name in names) else None
