"""The solver of runs with gradients, and with tangents that pass singular positions: both take
explicit integrators."""

from __future__ import annotations

from dataclasses import replace

from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import Solver
from alf_ros.simulation.accuracy import pick
from alf_ros.simulation.simulation import Simulation


def explicit_solver(simulation: Simulation) -> Solver:
    """The solver of a simulation; where its accuracy has picked an implicit integrator, the best
    explicit one."""
    solver, accuracy = simulation.solver, simulation.accuracy
    if accuracy is None or not TABLEAUX[solver.integrator].implicit:
        return solver
    asked = replace(solver, accuracy=accuracy.asked)
    return pick(asked, simulation._with, explicit=True).solver
