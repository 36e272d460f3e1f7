"""Directions in which a mechanism yields wherever it goes: rows hold them to second order only.

A plate on four equal, parallel rods swings, and wherever it goes Φ_q also lets it turn about the
direction of the rods. Only the second-order condition nᵀ c = 0 rules that out, so no finite
reaction holds the plate against a force that turns it. As long as nothing does, it moves as an
ordinary mechanism does.
"""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model import branch_words
from alf_ros.model.singular_branches import CURVED, MANY, SMOOTH, Position


def yields(here: Position, dependent: int) -> bool:
    """Whether a position, which is not singular as `dependent` rows depend on others elsewhere
    too, has such directions."""
    return len(here.lost) <= dependent and here.kind not in (SMOOTH, CURVED, MANY)


def yielding(here: Position) -> tuple[int, str]:
    """How many they are at a position that `yields`, and what moves in them (names)."""
    model = here.model
    widest = max((branch.directions for branch in here.branches), key=len, default=here.free[:0])
    momenta = np.zeros((len(here.free), model.n))
    for direction, momentum in zip(here.free, momenta, strict=True):
        kernel.add_mass_times(model.unit, model.system.mass, 1.0, direction, momentum)
    along: Floats = momenta @ widest[:, : model.n].T
    beside = here.free - along @ widest
    return len(here.free) - len(widest), branch_words.some_moving(model, beside)
