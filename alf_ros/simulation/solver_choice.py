"""Which solver a simulation takes: what its scene says, and what is given with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from alf_ros.errors import InputError
from alf_ros.scene.scene import PICKED, Scene, Solver, joined


def chosen(scene: Scene, given: Mapping[str, Any]) -> tuple[Solver, bool]:
    """The scene's solver section with what was given, without a section that of `given`; and
    whether its accuracy has integrator and tolerance still to pick. Raises InputError."""
    section = scene.solver if scene.says_solver or not given else Solver()
    settings = joined(asdict(section), given)
    solver = Solver(**settings)
    picked = [key for key in PICKED if key in settings]
    if solver.accuracy is None or len(picked) == len(PICKED):  # both: as a log says
        return solver, False
    if picked or solver.formulation != 'alf2':
        key = picked[0] if picked else 'formulation'
        raise InputError(
            'an accuracy picks integrator and tolerance, of alf2',
            key=key,
            value=settings[key],
            expected='one or the other',
        )
    return solver, True
