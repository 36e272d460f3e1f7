"""Exudyn: redundant coordinates (x, y, φ of each rod), implicit generalised-α, its own C++ loop.

Settings: index 3, spectral radius 0.9, full Newton to 1e-8, dense solver. Tighter is no more
accurate, modified Newton slower, a radius of 1 does not end, of 0.6 errs more. Index 2 needs
Newmark's method. The sparse solver errs as the dense one does; its time is half as long for ten
four-bars, and a third longer for two.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import exudyn as exu
import exudyn.itemInterface as items
import numpy as np
from common import perform, timed

DENSE = 30  # coordinates: with more of them the solver is sparse


class Mechanism:
    """Rods of 1 m and 1 kg in a system of their own."""

    def __init__(self) -> None:
        self.container = exu.SystemContainer()
        self.system = self.container.AddSystem()
        self.ground = self.system.AddObject(items.ObjectGround())
        self.sensors: list[Any] = []
        self.energy = 0.0  # J, at the start

    def rod(self, foot: Any, angle: float, velocity: Any, rate: float) -> Any:
        """From `foot` (m) at `angle`, its foot moving at `velocity`; returns the body."""
        along = np.array([math.cos(angle), math.sin(angle)])
        across = np.array([-along[1], along[0]])
        centre = np.asarray(foot) + 0.5 * along
        speed = np.asarray(velocity) + 0.5 * rate * across
        node = self.system.AddNode(
            items.NodeRigidBody2D(
                referenceCoordinates=[*centre, angle], initialVelocities=[*speed, rate]
            )
        )
        body = self.system.AddObject(
            items.ObjectRigidBody2D(nodeNumber=node, mass=1.0, inertia=1.0 / 12.0)
        )
        self.energy += 0.5 * float(speed @ speed) + rate * rate / 24.0 + 9.81 * centre[1]
        mass = self.system.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        self.system.AddLoad(
            items.LoadMassProportional(markerNumber=mass, loadVector=[0, -9.81, 0])
        )
        return body

    def marker(self, body: Any, x: float) -> Any:
        """At x (m) along a rod from its foot."""
        return self.system.AddMarker(
            items.MarkerBodyRigid(bodyNumber=body, localPosition=[x - 0.5, 0, 0])
        )

    def on_ground(self, x: float) -> Any:
        """A place (x, 0) of the ground."""
        return self.system.AddMarker(
            items.MarkerBodyRigid(bodyNumber=self.ground, localPosition=[x, 0, 0])
        )

    def slider(self, x: float, speed: float) -> Any:
        """A massless point at x (m) that stays on the x axis."""
        node = self.system.AddNode(
            items.NodePoint2D(referenceCoordinates=[x, 0], initialVelocities=[speed, 0])
        )
        point = self.system.AddObject(items.ObjectMassPoint2D(nodeNumber=node, mass=0.0))
        height = self.system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=1))
        still = self.system.AddNode(items.NodePointGround())
        zero = self.system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=still, coordinate=0))
        self.system.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[zero, height]))
        return self.system.AddMarker(items.MarkerBodyPosition(bodyNumber=point))

    def pin(self, one: Any, other: Any) -> None:
        """A revolute joint of two markers."""
        self.system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[one, other]))

    def watch(self, body: Any) -> None:
        """Record where the far end of a rod is."""
        self.sensors.append(
            self.system.AddSensor(
                items.SensorBody(
                    bodyNumber=body,
                    localPosition=[0.5, 0, 0],
                    storeInternal=True,
                    writeToFile=False,
                    outputVariableType=exu.OutputVariableType.Position,
                )
            )
        )

    def runner(self) -> Any:
        """The function that runs the mechanism."""
        self.system.Assemble()
        dense = self.system.systemData.ODE2Size() <= DENSE
        solver = exu.LinearSolverType.EigenDense if dense else exu.LinearSolverType.EigenSparse

        def run(n: int, h: float, instants: int = 100) -> tuple[Any, float]:
            settings = exu.SimulationSettings()
            settings.solution.file.write = False
            settings.solution.sensors.writePeriod = n * h
            settings.show.statistics = settings.show.computationTime = False
            settings.linearSolver.solverType = solver
            integration = settings.timeIntegration
            integration.verboseMode = 0
            integration.adaptiveStep = False
            integration.generalizedAlpha.spectralRadius = 0.9
            integration.generalizedAlpha.useIndex2Constraints = False
            integration.newton.useModifiedNewton = False
            integration.newton.relativeTolerance = 1e-8
            integration.newton.absoluteTolerance = 1e-10

            def over(steps: int) -> float:
                integration.endTime, integration.numberOfSteps = steps * h, steps
                good, spent = timed(lambda: self.system.SolveDynamic(settings, showHints=False))
                if good is False:
                    raise RuntimeError('the solver gave up')
                return spent

            before = over(1)  # what a call costs besides its steps
            spent = over(n * instants) - before
            found = [self.system.GetSensorStoredData(sensor)[:, 1:3] for sensor in self.sensors]
            return np.concatenate(found, axis=1), max(spent, 0.0)

        return run, self.energy


def slider_crank(case: dict[str, Any]) -> Any:
    """Crank from the origin, coupler from its tip; B stays on the x axis."""
    theta, rate = case['theta'], case['rate']
    made = Mechanism()
    tip = np.array([math.cos(theta), math.sin(theta)])
    crank = made.rod([0, 0], theta, [0, 0], rate)
    coupler = made.rod(tip, -theta, rate * np.array([-tip[1], tip[0]]), -rate)
    made.pin(made.on_ground(0.0), made.marker(crank, 0.0))
    made.pin(made.marker(crank, 1.0), made.marker(coupler, 0.0))
    made.pin(made.marker(coupler, 1.0), made.slider(2 * tip[0], -2 * tip[1] * rate))
    made.watch(crank)
    made.watch(coupler)
    return made.runner()


def four_bars(n: int, case: dict[str, Any]) -> Any:
    """`n` four-bars side by side: n + 1 cranks, n couplers."""
    theta, rate = case['theta'], case['rate']
    made = Mechanism()
    tip = np.array([math.cos(theta), math.sin(theta)])
    speed = rate * np.array([-tip[1], tip[0]])
    cranks = [made.rod([k, 0], theta, [0, 0], rate) for k in range(n + 1)]
    for k, crank in enumerate(cranks):
        made.pin(made.on_ground(k), made.marker(crank, 0.0))
        made.watch(crank)
    for k in range(n):
        coupler = made.rod([k, 0] + tip, 0.0, speed, 0.0)
        made.pin(made.marker(cranks[k], 1.0), made.marker(coupler, 0.0))
        made.pin(made.marker(cranks[k + 1], 1.0), made.marker(coupler, 1.0))
    return made.runner()


if __name__ == '__main__':
    perform(
        'exudyn',
        f'exudyn {exu.config.Version()}, generalised-α, index 3, spectral radius 0.9',
        {
            'slider_crank': slider_crank,
            'double_four_bar': partial(four_bars, 2),
            'n_four_bar': partial(four_bars, 10),
        },
    )
