"""Scenes and mechanisms: whole ones with values, keys and references changed, and steps taken.

The test of mutants makes the same changes; here they come by the ten thousand, and with the output
that a person at a terminal would see.
"""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))


class Harness:
    SUFFIX = '.yaml'

    def __init__(self) -> None:
        from support.mutants import SOURCES
        from support.verdict import verdict

        self._sources, self._verdict = SOURCES, verdict

    def make(self, random: Random) -> bytes:
        """A scene."""
        from alf_ros.scene.text import yaml_document
        from support.mutants import change, damaged, disturb, taken_apart, written

        tree = taken_apart(yaml_document.parse(random.choice(self._sources), None))
        for _ in range(random.choice((1, 1, 2, 3))):
            (disturb if random.randrange(3) else change)(tree, random)
        text = written(tree)
        if random.randrange(6) == 0:
            text = damaged(text, random)
        return text.encode('utf-8', 'surrogatepass')

    def check(self, case: bytes) -> str:
        """It runs with finite numbers, or there is one line."""
        text = case.decode('utf-8', 'surrogatepass')
        outcome, details = self._verdict(text)
        assert outcome in ('ran', 'refused', 'stopped'), _blamed(outcome, details)
        return 'ran' if outcome == 'ran' else 'refused'


def _blamed(outcome: str, details: str) -> str:
    silent = 'silent: ' if outcome == 'not finite' else ''
    return f'{silent}{outcome}: {" ".join(details.split())[-200:]}'
