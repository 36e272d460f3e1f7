"""The instants at which functions of time have kinks: the ones of drives, effects and inputs."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.simulation.drive_branches import DriveBranches
from alf_ros.simulation.simulation import Simulation


def time_kinks(simulation: Simulation, start: float, n: int, h: float) -> Floats:
    """Of a simulation with its inputs: the rows of tables and the pieces of curves (s), and in n
    steps of h (s) from `start` (s) on the corners of drives; ascending."""
    branches = DriveBranches.of(simulation.model)
    found = branches.instants(start, n, h) if branches is not None else []
    return np.union1d(simulation._run.applied.instants, np.array(found))
