"""The place in which a reader of the documents types what they show."""

import os
import re
from pathlib import Path

from support.forked import ended
from support.paths import ROOT

# With a cold cache a program compiles for most of a minute.
START_LIMIT = 180.0


def environment() -> dict[str, str]:
    """This package in every folder, as `make setup` gives it; no variables of an outer `make`."""
    of_make = ('MAKEFLAGS', 'MAKEOVERRIDES', 'MAKELEVEL', 'MFLAGS', 'ARGS', 'SCENE', 'DURATION')
    rest = {key: value for key, value in os.environ.items() if key not in of_make}
    return {**rest, 'PYTHONPATH': str(ROOT)}


def programs(text: str) -> list[tuple[str, str, str]]:
    """(program, its file name, what the page says that it prints) of a page, by its text."""
    block = r'^```python\n(# (\w+\.py)\n.*?)^```\n\n^```text\n(.*?)^```$'
    return re.findall(block, text, re.M | re.S)


def shown_by(arguments: list[str], folder: Path, **variables: str) -> tuple[str, str]:
    """The output and the errors of Python with these arguments, in a folder: of a forked process.
    Tests of the commands themselves start new ones (test/commands)."""
    done = ended(arguments, folder, {**environment(), **variables}, START_LIMIT)
    return done.stdout, done.stderr
