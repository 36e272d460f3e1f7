"""The digest of a function of the user says what it would compute."""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

import alf_ros
from alf_ros.errors import InputError
from alf_ros.studies.ensemble.distributions import uniform
from alf_ros.studies.ensemble.function_values import digest

FACTOR = 2.0
ANOTHER_PROCESS = """
import sys
sys.path.insert(0, sys.argv[1])
from test_function_values import all_digests
print(*all_digests())
"""


def times(run: Any) -> float:
    return float(FACTOR * run['energy'].max())


def more(run: Any, by: float = 1.0, *, of: frozenset[str] = frozenset({'a', 'b', 'c'})) -> float:
    return times(run) + by + len(of)


def made(factor: Any) -> Callable[[Any], Any]:
    return lambda run: factor * run['energy'].max()


def recursive(run: Any) -> Any:
    return recursive if run is None else run['energy'].max()


@numba.njit
def compiled(x: float) -> float:
    return x + FACTOR


@functools.cache
def remembered(x: float) -> float:
    return x * FACTOR


def calling(run: Any) -> float:
    return float(compiled(run['energy'].max()) + remembered(2.0))


class Scaled:
    def __init__(self, by: float) -> None:
        self.by = by

    def read(self, run: Any) -> float:
        return float(self.by * run['energy'].max())


def all_digests() -> list[str]:
    values = [1.0, 2.0, np.arange(3.0), np.arange(4.0), {'x': 1, 'y': {'p', 'q', 'r'}}, [times]]
    functions: list[Callable[..., Any]] = [
        times,
        more,
        recursive,
        Scaled(1.0).read,
        functools.partial(more, by=2.0),
        calling,
    ]
    return [digest(each) for each in (*map(made, values), *functions)]


def test_other_values_have_other_digests(monkeypatch: pytest.MonkeyPatch) -> None:
    before = all_digests()
    assert len(set(before)) == len(before)
    assert before == all_digests()
    monkeypatch.setattr(sys.modules[__name__], 'FACTOR', 3.0)
    changed = {
        n for n, (old, new) in enumerate(zip(before, all_digests(), strict=True)) if old != new
    }
    assert changed == {5, 6, 7, 10, 11}  # all that use the number, or call `times`
    assert digest(Scaled(1.0).read) != digest(Scaled(2.0).read)


def test_another_process_has_the_same_digests() -> None:
    """Sets have another order there."""
    here = Path(__file__).parent
    code = [sys.executable, '-c', ANOTHER_PROCESS, str(here)]
    said = {
        subprocess.run(
            code,
            capture_output=True,
            text=True,
            check=True,
            cwd=here.parent,
            env={'PYTHONHASHSEED': seed, 'PYTHONPATH': str(here.parent.parent)},
        ).stdout
        for seed in ('1', '2')
    }
    assert len(said) == 1


def test_a_store_of_another_function_is_left(tmp_path: Path) -> None:
    settings: dict[str, Any] = {'members': 2, 'workers': 0, 'duration': 0.01}
    settings['store'] = tmp_path / 'functions.zarr'
    vary = {'m': uniform(0.9, 1.1)}
    first = alf_ros.ensemble('slider_crank', vary, outputs=[made(1.0)], **settings)
    again = alf_ros.ensemble('slider_crank', vary, outputs=[made(1.0)], **settings)
    assert first.equals(again)
    with pytest.raises(InputError, match='the store of another study'):
        alf_ros.ensemble('slider_crank', vary, outputs=[made(2.0)], **settings)
