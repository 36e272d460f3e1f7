"""Scenes of the library for tests that take seconds for each: one of every kind.

`make thorough ARGS=FILE` takes all of them.
"""

from __future__ import annotations

from support.paths import ROOT
from support.thorough import LONG

# loops in the plane and in space, singular positions, redundant rows, drives, wheels, gears,
# screws, couplings, free bodies
_KINDS = [
    'bricard',
    'change_point',
    'coin',
    'delta_robot',
    'differential_drive_cart',
    'double_four_bar',
    'governor',
    'planetary_gear',
    'scissor_lift',
    'screw_jack',
    'slider_crank',
    'wiper',
]
_ALL = sorted(path.stem for path in (ROOT / 'config' / 'scenes').glob('*.yaml'))
SOME_SCENES = _ALL if LONG else _KINDS
