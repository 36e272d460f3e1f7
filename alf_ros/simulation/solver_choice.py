"""The solver of a simulation: the section of its scene, changed by given values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from alf_ros.errors import InputError
from alf_ros.scene.scene import PICKED, Scene, Solver, joined


def chosen(scene: Scene, given: Mapping[str, Any]) -> tuple[Solver, bool]:
    """The scene's solver section with the given changes, or the section of `given`; and whether
    integrator and tolerance are still to be chosen for its accuracy. Raises InputError."""
    section = scene.solver if scene.says_solver or not given else Solver()
    settings = joined(vars(section), given)
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
