"""The digest of a function of the user says what it would compute."""

from __future__ import annotations

import functools
import os
import pickle
import subprocess
import sys
import threading
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import pytest

import alf_ros
from alf_ros.errors import InputError
from alf_ros.studies.ensemble.kept_outputs import outputs
from alf_ros.studies.ensemble.user_function import UserFunction
from support.thorough import LONG

TOP = 1.0  # a global of `scaled`


def scaled(factor: Any, shift: Any = 0.0) -> UserFunction:
    """A function whose value depends on a closure, a default and a global."""

    def made(run: Any, by: Any = shift) -> float:
        return float(np.sum(factor)) * TOP + by if 'x' in {'x', 'y', 'z'} else 0.0

    return UserFunction.of(made)


def test_the_digest_of_a_function_covers_the_values_that_it_uses(monkeypatch: Any) -> None:
    kinds = [
        1.0,
        2.0,
        [1.0, {'a': 2.0}],
        [1.0, {'a': 3.0}],
        np.arange(3),
        np.arange(4),
        {'q', 'r'},
    ]
    functions = [scaled(factor) for factor in kinds] + [scaled(1.0, 2.0)]
    before = [each.digest for each in functions]
    assert len(set(before)) == len(functions)
    assert scaled(2.0).digest == before[1]
    monkeypatch.setitem(globals(), 'TOP', 2.0)
    assert scaled(1.0).digest not in before
    pair = [UserFunction.of(lambda run: 1.0), UserFunction.of(lambda run: 2.0)]
    assert pair[0].digest != pair[1].digest


def test_the_digest_of_a_function_changes_neither_in_calls_nor_in_another_process() -> None:
    calls: list[object] = []

    def counting(run: Any) -> float:
        calls.append(run)
        return len(calls)

    known = UserFunction.of(counting)
    assert (known.called(None), known.called(None)) == (1, 2)
    assert known.digest == UserFunction.of(counting).digest
    shared = scaled({'one', 'two', 'three'}, Direction((1.0, 0.0)))
    partial = UserFunction.of(functools.partial(counting))
    doubled = numba.njit(lambda x: 2.0 * x)
    compiled = UserFunction.of(lambda run: doubled(np.max(run['energy'])))
    functions = [known, shared, partial, compiled]
    assert not any(each.digest == digest_of_bytes(each) for each in functions)
    text = (
        'import pickle, sys; '
        'print([each.digest for each in pickle.loads(bytes.fromhex(sys.argv[1]))])'
    )
    for seed in ('1', '2') if LONG else ('1',):
        said = subprocess.run(
            [sys.executable, '-c', text, pickle.dumps(functions).hex()],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, 'PYTHONHASHSEED': seed},
        ).stdout
        assert said.strip() == str([each.digest for each in functions])


def digest_of_bytes(function: UserFunction) -> str:
    """The digest of a function whose values have no content."""
    return UserFunction(function.name, source=function.pickled).digest


@dataclass
class Direction:
    """A value of a class of the user's own."""

    along: tuple[float, float]
    label: str = 'way'


def test_a_store_refuses_a_function_with_another_value(tmp_path: Any) -> None:
    def run_with(factor: float) -> Any:
        return alf_ros.ensemble(
            'slider_crank',
            {'m': [1.0]},
            members=1,
            outputs={'f': {'function': lambda run: factor, 'reads': ['energy']}},
            duration=0.01,
            workers=0,
            store=tmp_path / 'one',
        )

    assert float(run_with(1.0).f[0]) == 1.0
    with pytest.raises(InputError, match='store.outputs: the store of another study'):
        run_with(2.0)


def test_a_function_that_cannot_travel_is_one_line() -> None:
    lock = threading.Lock()
    with pytest.raises(InputError, match='function: cannot be given to workers: cannot pickle'):
        outputs([lambda run: lock])
