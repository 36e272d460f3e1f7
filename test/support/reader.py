"""Where a reader of the documents types what stands there."""

import os

from support.paths import ROOT

# With a cold cache a program compiles for most of a minute.
START_LIMIT = 180.0


def environment() -> dict[str, str]:
    """This package in every folder, as `make setup` gives it; no variables of an outer `make`."""
    of_make = ('MAKEFLAGS', 'MAKEOVERRIDES', 'MAKELEVEL', 'MFLAGS', 'ARGS', 'SCENE', 'DURATION')
    rest = {key: value for key, value in os.environ.items() if key not in of_make}
    return {**rest, 'PYTHONPATH': str(ROOT)}
