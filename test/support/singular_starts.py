"""Scenes that start at or near singular positions, and the answers of the commands to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from alf_ros import AssemblyError, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.inspection.soundness import examine
from alf_ros.scene.scene import Scene
from alf_ros.studies.exact import one_freedom

Array = np.ndarray[Any, np.dtype[Any]]  # also of complex numbers
GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}
UPRIGHT = {'A': [0, 1], 'B': [0, 0]}  # the slider lies on the pin of the crank
FLAT = {f'B{k}': [k + 1, 0] for k in range(3)}
IN_LINE = {'A': [-1, 0], 'B': [1, 0]}


def scene(
    mechanism: object = 'slider_crank',
    positions: Mapping[str, Any] = UPRIGHT,
    effects: Mapping[str, Any] = GRAVITY,
    drives: Mapping[str, Any] | None = None,
    solver: Mapping[str, Any] | None = None,
    **velocities: Any,
) -> Scene:
    source: dict[str, Any] = {
        'mechanism': mechanism,
        'effects': dict(effects),
        'initial': {'positions': dict(positions), 'velocities': velocities},
        'solver': dict(solver or {}),
    }
    return load_scene(source | ({'drives': dict(drives)} if drives else {}))


def velocities(simulation: Simulation) -> dict[str, list[float]]:
    sample = simulation.sample()
    return {name: sample.velocities[name].tolist() for name in sample.velocities}


def refused(scene: Scene) -> str:
    with pytest.raises(AssemblyError) as error:
        Simulation(scene)
    assert '\n' not in str(error.value)
    return str(error.value)


def answers(scene: Scene) -> dict[str, tuple[str, str]]:
    return {each.question: (each.verdict, each.answer) for each in examine(scene).answers}


def motor(angle: str) -> dict[str, Any]:
    return {'motor': {'joint': 'crank_pin', 'angle': angle}}


def change_point(sign: float) -> Callable[[complex], Array]:
    """A and B of `change_point` as functions of the angle of its crank, on one of the branches
    through π: by the law of cosines, as in `exact.change_point`."""

    def points(phi: complex) -> Array:
        f = np.sqrt(17.0 - 8.0 * np.cos(phi))
        x = (f * f - 5.0) / (2.0 * f)
        y = sign * np.cos(phi / 2.0) * np.sqrt(4.0 * (f + 1.0) * (f - 1.0)) / f
        A = np.array([np.cos(phi), np.sin(phi)])
        along = (np.array([4.0, 0.0]) - A) / f
        return np.concatenate([A, A + x * along + y * np.array([-along[1], along[0]])])

    return points


def slope(points: Callable[[complex], Array], phi: float) -> tuple[Floats, Floats]:
    whole = points(phi + 1e-30j)
    return whole.real, whole.imag * 1e30


def change_point_rates(
    points: Callable[[complex], Array],
) -> Callable[[float, Floats], list[float]]:
    """φ̇, φ̈ of the one freedom: I φ̈ = -V' - ½ I' φ̇²."""

    def inertia(phi: float) -> float:
        _, d = slope(points, phi)
        a, b = d[:2], d[2:]
        return float(a @ a + (a @ a + a @ b + b @ b) + 2.0 * b @ b) / 3.0

    def rates(t: float, y: Floats) -> list[float]:
        phi, rate = y
        _, d = slope(points, phi)
        push = -0.5 * one_freedom.GRAVITY * (d[1] + (d[1] + d[3]) + 2.0 * d[3])
        h = 1e-4
        bend = (inertia(phi - 2 * h) - 8 * inertia(phi - h) + 8 * inertia(phi + h)) / (12 * h)
        bend -= inertia(phi + 2 * h) / (12 * h)
        return [rate, (push - 0.5 * bend * rate * rate) / inertia(phi)]

    return rates
