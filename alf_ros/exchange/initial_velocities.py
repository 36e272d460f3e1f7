"""The `initial` section of an imported scene: velocities of bodies that the joints permit.

A file gives the velocity of each body, rounded, and perhaps not of all. The velocities of a scene
must fit the constraints to more digits. So q̇ = N y, with the free directions N of the mechanism
as drawn and the y for which the bodies move as in the file, in the sense of least squares. The
section has as many components of q̇ as determine y: more would contradict each other as soon as a
length is changed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import qr

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError
from alf_ros.exchange.robot import Robot
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.scene.scene import Scene
from alf_ros.scene.text.yaml_writer import entry, serialise
from alf_ros.simulation.simulation import Simulation

_ROUNDED = 1e-5  # of the largest: what the velocities of a file may differ from permitted ones
_SEEN = 1e-9  # of the largest singular value: directions that these velocities show
_EXAMINED = 1500  # coordinates of mechanisms, with dense matrices


def section(scene: Scene, robot: Robot) -> str | None:
    """The text of the section for a scene that `robot` became; empty if its joints do not permit
    the velocities of its bodies, None if it is too large to say."""
    try:
        simulation = Simulation(scene)
    except AlfError:
        return ''
    model = simulation.model
    if model.n > _EXAMINED:
        return None
    speeds = dict(_given(scene, robot))
    if not speeds:
        return ''
    free, layout = Linearised(model, simulation.state.q).free, model.layout
    rows = []
    for name in speeds:
        is_point = name in layout.of_point
        n = 3 * (layout.of_point[name] if is_point else layout.of_vector[name])
        # a mechanism computes with vectors of a length of its own
        rows.append(free[n : n + 3] / (1.0 if is_point else layout.length))
    wanted = np.concatenate(list(speeds.values()))
    directions = np.concatenate(rows)
    y, _, rank, _ = np.linalg.lstsq(directions, wanted, rcond=_SEEN)
    found = directions @ y
    if np.abs(found - wanted).max() > _ROUNDED * np.abs(wanted).max():
        return ''
    _, order = qr(directions.T, mode='r', pivoting=True)
    told = np.full(found.size, None, object)
    told[order[:rank]] = found[order[:rank]].tolist()
    named = zip(speeds, told.reshape(-1, 3).tolist(), strict=True)
    fitting = {name: parts for name, parts in named if parts != [None] * 3}
    return serialise(entry({'initial': {'velocities': fitting}}))


def _given(scene: Scene, robot: Robot) -> Iterator[tuple[str, Floats]]:
    """The points and vectors of bodies with a velocity, each with its own: (3,) m/s, or 1/s."""
    points = {each.name: each for each in scene.mechanism.points if not each.fixed}
    vectors = {each.name: each for each in scene.mechanism.vectors if not each.fixed}
    for part, body in zip(robot.parts, scene.mechanism.bodies, strict=True):
        motion = robot.velocities.get(part.name)
        if motion is None:
            continue
        for name in body.points:
            if name in points:
                yield name, motion.at(np.array(points[name].at))
        for name in body.vectors:
            if name in vectors:
                along = np.array(vectors[name].along)
                yield name, np.asarray(np.cross(motion.angular, along), dtype=float)
