"""Cases that the campaigns of fuzz/ found are tried in every run, with some hundred new cases.

The campaigns are `make fuzz ARGS="--minutes 60"`; a case that went wrong is kept as a file below
test/data/fuzz, in the folder of its harness.
"""

from __future__ import annotations

import sys

import pytest

from support.paths import DATA, ROOT

sys.path.insert(0, str(ROOT / 'fuzz'))

from campaign import campaign
from worker import HARNESSES, harness

from support.thorough import LONG, thinned

CORPUS = {name: sorted((DATA / 'fuzz' / name).glob('*')) for name in HARNESSES}
CASES = {'expressions': 3000, 'tables': 500, 'states': 100, 'robots': 20, 'scenes': 10}
CASES |= {'logs': 5, 'commands': 10, 'services': 10}
if not LONG:
    CASES = {name: count if count < 20 else count // 3 for name, count in CASES.items()}


@pytest.mark.parametrize('name', [name for name in HARNESSES if CORPUS[name]])
def test_what_was_found_once_is_found_no_more(name):
    tried = harness(name)
    vars(tried)['every'] = True  # use of a log
    try:
        for path in CORPUS[name]:
            assert tried.check(path.read_bytes()) in ('ran', 'refused'), path
    finally:
        getattr(tried, 'close', lambda: None)()


@pytest.mark.parametrize('name', thinned(HARNESSES, lambda name: name != 'services'))
def test_a_few_new_cases(name):
    """In a process of their own; such as nobody has tried yet, the same at every run."""
    tally = campaign(name, 1_000_000_000, count=CASES[name])
    assert tally.found == [] and tally.cases == CASES[name]
    assert tally.ran + tally.refused == tally.cases
    assert tally.refused > 0


def test_what_goes_wrong_is_found_and_blamed():
    """Each fault is found with the number of its case, and the campaign continues after it.

    The faults: a hang in compiled code, a crash, memory without end, an exit, a traceback, a wrong
    number.
    """
    tally = campaign('support.misbehaving', 0, count=30)
    kinds = {found.number: found.kind for found in tally.found}
    assert kinds == {
        3: 'hang',
        7: 'crash',
        11: 'traceback',
        13: 'traceback',
        17: 'traceback',
        19: 'silent',
        23: 'hang',
    }
    assert tally.cases == 30 and tally.ran == 30 - len(kinds)
    assert [found.case for found in tally.found] == [b'%d' % n for n in kinds]
