"""Ten thousand scene files with mistakes: each runs with finite numbers or is refused in one line.

Here a hundred of them; the whole campaign (minutes) is

    .venv/bin/python -m pytest test/scene/test_mutants.py --mutants 10000

Each file goes to a process of its own kind, so that one that hangs or crashes is found as well.
"""

from __future__ import annotations

import multiprocessing
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

import jsonschema
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings

from alf_ros import effects
from alf_ros.scene import json_schema
from alf_ros.scene.scene import FORMULATIONS
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.expression import ExpressionError, evaluate
from support.mutants import PLANE, SOURCES, SPACE, mutants
from support.thorough import LONG
from support.verdict import RAN, REFUSED, STOPPED, serve
from support.yaml_core import data

SCHEMA = json_schema.scene_schema(effects.own())
PATIENCE = 120.0  # s; the longest take a few on an idle machine


class Judge:
    """A process that gives verdicts; it is started again after a crash."""

    def __init__(self) -> None:
        self.found: Counter[str] = Counter()
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context('spawn')
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self._connection.recv()

    def __call__(self, text: str, patience: float = PATIENCE) -> tuple[str, str]:
        try:
            self._connection.send(text)
            if self._connection.poll(patience):
                outcome, details = self._connection.recv()
                self.found[outcome] += 1
                return outcome, details
            lost = 'hangs'
        except (EOFError, OSError):
            lost = 'crashes'
        self.close()
        self._start()
        return lost, ''

    def close(self) -> None:
        self._process.kill()
        self._process.join()
        self._connection.close()


@pytest.fixture(scope='module')
def judge() -> Iterator[Judge]:
    one = Judge()
    for text in SOURCES:  # compiles what they need, and below what mutants may choose
        assert one(text, patience=600.0) == (RAN, '')
    for text in (PLANE, SPACE) if LONG else (PLANE,):
        for kind in FORMULATIONS:
            chosen = re.sub('integrator: .*}', f'integrator: rk4, formulation: {kind}}}', text)
            assert one(chosen, patience=600.0)[0] in (RAN, REFUSED, STOPPED)
    one.found.clear()
    yield one
    one.close()


def _read(document: Any) -> Any:
    """The part of a document that the loader reads: entries that are repeated from a larger number
    to a smaller one stand for nothing."""
    if isinstance(document, list):
        return [_read(item) for item in document]
    if not isinstance(document, dict):
        return document
    return {key: _read(value) for key, value in document.items() if not _is_nothing(value)}


def _is_nothing(value: Any) -> bool:
    ranges = value.get('for') if isinstance(value, dict) else None
    if not isinstance(ranges, dict):
        return False
    try:
        bounds = [[evaluate(str(bound), {}) for bound in each] for each in ranges.values()]
        return any(first > last for first, last in bounds)
    except (TypeError, ValueError, ExpressionError):  # of parameters
        return False


def test_every_mutant_runs_or_ends_in_one_line(judge: Judge, request) -> None:
    count = request.config.getoption('--mutants')

    @seed(4)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(mutants())
    def campaign(text: str) -> None:
        outcome, details = judge(text)
        assert outcome in (RAN, REFUSED, STOPPED), f'{outcome}: {details}\n{text}'
        if outcome == RAN:  # what the loader accepts, an editor must not underline
            jsonschema.validate(_read(data(yaml_document.parse(text, None))), SCHEMA)

    campaign()
    print(dict(judge.found))
    # all three ends are reached, and the loader is not all that is tried
    assert judge.found[RAN] > count / 10
    assert judge.found[REFUSED] > count / 10
    assert sum(judge.found.values()) >= 0.9 * count


def test_a_hang_and_a_crash_are_noticed(judge: Judge) -> None:
    assert judge(SOURCES[0], patience=0.0) == ('hangs', '')
    assert judge(SOURCES[0]) == (RAN, '')
    judge._process.kill()
    judge._process.join()
    assert judge(SOURCES[0]) == ('crashes', '')
    assert judge(SOURCES[0]) == (RAN, '')
