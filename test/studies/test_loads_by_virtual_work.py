"""Efforts of a delta robot along a path from a file, against virtual work in closed form.

The angles of the arms for a place of the tool follow from triangles. Places of all bodies are
differentiated along the path, and with the place of the tool, by differences of sixth order.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from alf_ros import load_scene, loads
from alf_ros.arrays import Floats

BASE, ARM, ROD, PLATE = 0.20, 0.25, 0.45, 0.06  # m
ARM_MASS, ROD_MASS, PLATE_MASS, GRAVITY = 0.4, 0.1, 0.5, np.array([0.0, 0.0, -9.81])
REACH = BASE + ARM * math.cos(math.pi / 6) - PLATE
HIGH = -ARM / 2 - math.sqrt(ROD**2 - REACH**2)
INSTANTS = [0.0, 0.3, 0.55, 0.9, 1.2]
PLACES = np.array(
    [[0, 0, 0], [0.05, -0.03, 0.04], [0.08, 0.05, -0.03], [-0.04, 0.06, 0.02], [0.02, 0, 0]]
) + [0, 0, HIGH]
FIRST = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
SECOND = np.array([2, -27, 270, -490, 270, -27, 2]) / 180


def arms(tool: Floats) -> tuple[Floats, Floats]:
    """(7, 3) elbow and wrist of each arm, and the tool; (3,) angles below the horizontal."""
    places, angles = [], []
    for k in range(3):
        out = np.array([math.cos(2 * math.pi * k / 3), math.sin(2 * math.pi * k / 3), 0.0])
        gap = tool + (PLATE - BASE) * out
        across, along = float(gap @ np.cross([0, 0, 1], out)), float(gap @ out)
        far = math.hypot(along, gap[2])
        corner = math.acos((ARM**2 + far**2 - ROD**2 + across**2) / (2 * ARM * far))
        angles.append(math.atan2(-gap[2], along) - corner)
        turned = math.cos(angles[-1]) * out - [0, 0, math.sin(angles[-1])]
        places += [BASE * out + ARM * turned, tool + PLATE * out]
    return np.array([*places, tool]), np.array(angles)


def efforts(path: CubicSpline, t: float) -> Floats:
    """(3,) torques of the motors, N m."""
    h, e = 2e-3, 1e-4
    a = np.tensordot(SECOND, [arms(path(t + n * h))[0] for n in range(-3, 4)], 1) / h**2
    work, turns = np.zeros(3), np.zeros((3, 3))
    for axis, way in enumerate(np.eye(3)):
        near = [arms(path(t) + n * e * way) for n in range(-3, 4)]
        d = np.tensordot(FIRST, [places for places, _ in near], 1) / e
        turns[axis] = np.tensordot(FIRST, [angles for _, angles in near], 1) / e
        work[axis] = PLATE_MASS * (a[6] - GRAVITY) @ d[6]
        for elbow, wrist in ((0, 1), (2, 3), (4, 5)):
            # slender: an arm with a fixed end, and two rods between elbow and wrist
            work[axis] += ARM_MASS * (a[elbow] / 3 - GRAVITY / 2) @ d[elbow]
            work[axis] += 2 * ROD_MASS * (a[elbow] / 3 + a[wrist] / 6 - GRAVITY / 2) @ d[elbow]
            work[axis] += 2 * ROD_MASS * (a[wrist] / 3 + a[elbow] / 6 - GRAVITY / 2) @ d[wrist]
    return np.asarray(np.linalg.solve(turns, work))


def test_motors_of_a_delta_robot_along_a_path_from_a_file(tmp_path: Path) -> None:
    rows = [
        ', '.join(map(repr, map(float, (t, *x)))) for t, x in zip(INSTANTS, PLACES, strict=True)
    ]
    (tmp_path / 'path.csv').write_text('t, x, y, z\n' + '\n'.join(rows) + '\n', encoding='utf-8')
    (tmp_path / 'scene.yaml').write_text(
        'mechanism: delta_robot\n'
        'effects: {gravity: {acceleration: [0, 0, -9.81]}}\n'
        'drives: {tool: {point: C, at: {table: path.csv}}}\n',
        encoding='utf-8',
    )
    path = CubicSpline(INSTANTS, PLACES, bc_type='clamped')
    # differences stay within one piece of the spline
    times = [t for t in np.linspace(0.01, 1.19, 41) if min(abs(t - x) for x in INSTANTS) > 7e-3]
    found = loads(
        load_scene(tmp_path / 'scene.yaml'), [f'motor{k}' for k in range(3)], times=times
    )
    assert not found.notes
    wanted = np.array([efforts(path, float(t)) for t in times])
    assert len(times) > 30 and np.abs(wanted).max() > 2.0
    assert found.efforts == pytest.approx(wanted, abs=1e-9)
