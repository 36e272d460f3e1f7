"""A clock that is set, forward or back, changes no run: nothing but names and dates reads it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from support.paths import ROOT
from support.syntax import parsed

PACKAGE = ROOT / 'alf_ros'
# in the text of each file with such a call
MENTIONS = re.compile(r'\b(time|datetime|date|clock)\s*\.|get_clock|create_timer')
READ = {'time', 'time_ns', 'now', 'today', 'utcnow', 'localtime', 'gmtime', 'strftime'}
# whether a source has just changed: its digest is computed again; the name of the folder of a log;
# the date of a stored result; the age of a port; the date in the name of a process
ALLOWED = {
    ('kernel/numba_ext/cache_sources.py', 'time_ns'),
    ('ros/recording/recorder.py', 'now'),
    ('logs/provenance.py', 'strftime'),
    ('ros/unborn_ports.py', 'time'),
    ('ros/namesake.py', 'now'),
}


def calls() -> Iterator[tuple[str, str, ast.Call]]:
    """Calls of attributes in files that may read a clock: file, name and call."""
    for path in sorted(PACKAGE.rglob('*.py')):
        if not MENTIONS.search(path.read_text('utf-8')):
            continue
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                yield path.relative_to(PACKAGE).as_posix(), node.func.attr, node


def test_only_names_and_dates_come_from_the_wall_clock() -> None:
    """A simulation and a log have a `time` too: what counts is whose it is."""
    found = set()
    for file, name, call in calls():
        whose = ast.unparse(call.func).split('.')[0]
        if name in READ and whose in ('time', 'datetime', 'date', 'clock'):
            found.add((file, name))
        assert name != 'get_clock', file
    assert found == ALLOWED


def test_timers_of_the_nodes_run_on_the_steady_clock() -> None:
    timers = [(file, call) for file, name, call in calls() if name == 'create_timer']
    assert timers
    for file, call in timers:
        given = {keyword.arg: ast.unparse(keyword.value) for keyword in call.keywords}
        assert 'steady' in given.get('clock', ''), file
